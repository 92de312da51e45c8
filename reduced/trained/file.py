"""The file of a trained law (.npz)."""

from dataclasses import fields
from pathlib import Path

import numpy as np

from pneunet.base.files.archive import read_archive, write_archive
from pneunet.geometry.shape_numbers import SHAPE
from pneunet.reduced.trained.closing import Closing
from pneunet.reduced.trained.coordinates import LENGTHS
from pneunet.reduced.trained.enthalpy import Anharmonic
from pneunet.reduced.trained.free_path import FreePath
from pneunet.reduced.trained.free_stiffness import FreeStiffness
from pneunet.reduced.trained.gaussian import GaussianProcess
from pneunet.reduced.trained.law import KindLaw, TrainedLaw
from pneunet.reduced.trained.side_by_side import SideBySide

SCHEMA = "pneunet-law-7"
#: fields of the Gaussian processes side by side that are the same in all of them
COMMON = ("shift", "width", "inducing", "observed", "group", "at", "ways")
#: what only deviations need, most of the file, in as few digits as they take (measured: ways in half
#: precision change them by 2e-7)
SHORT = {"observed": "f4", "ways": "f2", "trust": "f4", "group": "i4", "at": "i4"}
PROCESSES = ("closing", "path", "start", "stiffness", "contact")
ANHARMONIC = ("coefficients", "centre", "width", "reach")
NUMBERS = ("noise", "common_noise", "slope_noise")


def write_law(path: Path, law: TrainedLaw) -> None:
    """Write a law (.npz)."""
    arrays: dict[str, np.ndarray] = {}
    for kind, k in law.kinds.items():
        known = k.path.closing.process, k.path.learned, k.path.start, k.stiffness.smooth, k.stiffness.contact
        for name, found in zip(PROCESSES, known):
            for number, process in enumerate(found.processes if found else ()):
                for f in fields(GaussianProcess):
                    value = np.asarray(getattr(process, f.name), SHORT.get(f.name))
                    arrays[_key(kind, name, number, f.name)] = value
        arrays[f"{kind}/furthest"] = np.asarray(k.path.furthest)
        for name in ("quantile", "low", "high", "doubt", "level"):
            arrays[f"{kind}/{name}"] = np.asarray(getattr(k, name))
        for name in ANHARMONIC:
            arrays[f"{kind}/anharmonic/{name}"] = np.asarray(getattr(k.anharmonic, name))
    lengths = {kind: list(names) for kind, names in LENGTHS.items()}
    about = {"kinds": list(law.kinds), "shape": list(SHAPE), "lengths": lengths}
    write_archive(path, SCHEMA, about | law.about, arrays, compress=True)


def _key(kind, name, number, field):
    return f"{kind}/{name}/{field}" if field in COMMON else f"{kind}/{name}/{number}/{field}"


def read_law(path: str | Path, name: str | None = None) -> TrainedLaw:
    """The law in a file, by default named like it; InputError when it is none or of another version."""
    with read_archive(path, SCHEMA, "a trained law", "pneunet train") as (about, archive):
        stored = dict(archive)  # what processes have in common is inflated once
        kinds = {kind: _read_kind(stored, kind) for kind in about["kinds"]}
        return TrainedLaw(kinds, about, name or str(path))


def _read_kind(stored, kind):
    def processes(name):
        found, number = [], 0
        while f"{kind}/{name}/{number}/noise" in stored:
            values = {f.name: stored[_key(kind, name, number, f.name)] for f in fields(GaussianProcess)}
            values |= {field: float(values[field]) for field in NUMBERS}
            found.append(GaussianProcess(**values))
            number += 1
        return SideBySide(tuple(found))

    closing, learned, start, smooth, contact = map(processes, PROCESSES)
    closes = Closing(kind, closing if closing.processes else None)
    path = FreePath(kind, closes, learned, start, float(stored[f"{kind}/furthest"]))
    stiffness = FreeStiffness(kind, smooth, contact if contact.processes else None)
    plain = {name: stored[f"{kind}/{name}"] for name in ("quantile", "low", "high")}
    anharmonic = Anharmonic(kind, *(stored[f"{kind}/anharmonic/{name}"] for name in ANHARMONIC))
    doubt, level = float(stored[f"{kind}/doubt"]), int(stored[f"{kind}/level"])
    return KindLaw(kind, path, stiffness, anharmonic, **plain, doubt=doubt, level=level)
