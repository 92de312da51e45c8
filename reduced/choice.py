"""Which law predicts: the trained one that comes along, the analytic models, or a trained law in a file."""

from functools import lru_cache
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.reduced.model import AnalyticModel
from pneunet.reduced.trained.law import read_law

DATA = Path(__file__).resolve().parent / "data"
#: how both are made: docs/rod-law.md
DATA_SET, SHIPPED = DATA / "cells-v1.npz", DATA / "rod-law-v1.npz"
TRAINED, ANALYTIC = "trained", "analytic"


@lru_cache
def shipped_law():
    """The trained RodLaw that comes along."""
    return read_law(SHIPPED, TRAINED)


def choose_law(name=TRAINED):
    """The SegmentLaw called 'trained' or 'analytic', or the RodLaw in the file `name` (.npz); a law's own
    `name` gives it again."""
    if name == TRAINED:
        return shipped_law()
    if name == ANALYTIC:
        return AnalyticModel()
    if Path(name).suffix != ".npz":
        raise InputError(f"--law {name}: write 'trained', 'analytic' or the .npz file of a trained law")
    return read_law(name)
