"""Which law predicts: the trained one that comes along, the analytic models, or a trained law in a file."""

import copyreg
from functools import lru_cache
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.reduced.analytic.law import AnalyticLaw
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.trained.file import read_law
from pneunet.reduced.trained.law import TrainedLaw

DATA = Path(__file__).resolve().parent / "data"
#: how both are made: docs/rod-law.md
DATA_SET, SHIPPED = DATA / "cells-v2.npz", DATA / "rod-law-v2.npz"
TRAINED, ANALYTIC = "trained", "analytic"


@lru_cache
def shipped_law() -> TrainedLaw:
    """The trained law that comes along."""
    return read_law(SHIPPED, TRAINED)


def _packed(law):
    """Another process reads the law that comes along by itself: once used it is a hundred megabytes."""
    return (choose_law, (TRAINED,)) if law.name == TRAINED else object.__reduce_ex__(law, 2)


copyreg.pickle(TrainedLaw, _packed)


def choose_law(name: str = TRAINED) -> SegmentLaw:
    """The law called 'trained' or 'analytic', or the trained one in the file `name` (.npz); a law's own
    `name` gives it again. InputError for any other name, or where the file holds no law."""
    if name == TRAINED:
        return shipped_law()
    if name == ANALYTIC:
        return AnalyticLaw()
    if Path(name).suffix != ".npz":
        raise InputError(f"--law {name}: write 'trained', 'analytic' or the .npz file of a trained law")
    return read_law(name)
