"""The file of a trained law (.npz)."""

from collections.abc import Collection
from dataclasses import fields
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.archive import Member, read_archive, write_archive
from pneunet.geometry.shape_numbers import NUMBERS
from pneunet.reduced.trained.closing import Closing
from pneunet.reduced.trained.coordinates import IN_SUMS, LENGTHS, Coordinates
from pneunet.reduced.trained.enthalpy import Anharmonic, monomials
from pneunet.reduced.trained.free_path import FreePath
from pneunet.reduced.trained.free_stiffness import FreeStiffness
from pneunet.reduced.trained.gaussian import GaussianProcess
from pneunet.reduced.trained.kind_law import KindLaw
from pneunet.reduced.trained.law import TrainedLaw
from pneunet.reduced.trained.mesh import MeshDifference
from pneunet.reduced.trained.recorded import Recorded
from pneunet.reduced.trained.side_by_side import SideBySide

SCHEMA = "pneunet-law-10"
KEYS = {"kinds": list, "numbers": list, "lengths": dict}
#: fields of the Gaussian processes side by side that are the same in all of them
COMMON = ("shift", "width", "inducing", "observed", "group", "at", "ways")
#: a variance, or what is divided by
POSITIVE = 1e-30
#: what only deviations need, most of the file, in as few digits as they take (measured: ways in half
#: precision change them by 2e-7)
SHORT = {"observed": "f4", "ways": "f2", "trust": "f4", "group": "i4", "at": "i4"}
PROCESSES = ("closing", "path", "start", "stiffness", "contact", "recorded", "mesh", "mesh stiffness")
#: processes that a kind is without where too few designs were seen to touch, are on finer grids, or whose
#: stretch is not known
OPTIONAL = ("closing", "contact", "recorded", "mesh", "mesh stiffness")
#: those whose deviations or covariances are asked for
DEVIATING = ("path", "contact")
ANHARMONIC = ("coefficients", "centre", "width")
NOISES = ("noise", "common_noise", "slope_noise")
OF_MESH = ("left", "stiffness_left", "uncertainty", "uncertainty_at_lead")


def write_law(path: Path, law: TrainedLaw) -> None:
    """Write a law (.npz)."""
    arrays: dict[str, np.ndarray] = {}
    for kind, k in law.kinds.items():
        known = (
            k.path.closing.process,
            k.path.learned,
            k.path.start,
            k.stiffness.smooth,
            k.stiffness.contact,
        )
        besides = k.recorded.process if k.recorded else None, k.mesh.strains, k.mesh.stiffness
        for name, found in zip(PROCESSES, (*known, *besides)):
            for number, process in enumerate(found.processes if found else ()):
                for f in fields(GaussianProcess):
                    value = np.asarray(getattr(process, f.name), SHORT.get(f.name))
                    if f.name in SHORT and name not in DEVIATING:
                        value = value[:0]
                    arrays[_key(kind, name, number, f.name)] = value
        arrays[f"{kind}/furthest"] = np.asarray(k.path.furthest)
        arrays[f"{kind}/remainder"] = k.path.remainder
        arrays[f"{kind}/landmarks"] = k.path.landmarks.astype("u2")
        for name in ("quantile", "low", "high", "doubt"):
            arrays[f"{kind}/{name}"] = np.asarray(getattr(k, name))
        for name in OF_MESH:
            arrays[f"{kind}/{name}"] = np.asarray(getattr(k.mesh, name))
        for name in ANHARMONIC:
            arrays[f"{kind}/anharmonic/{name}"] = np.asarray(getattr(k.anharmonic, name))
    lengths = {kind: list(names) for kind, names in LENGTHS.items()}
    about = {"kinds": list(law.kinds), "numbers": list(NUMBERS), "lengths": lengths}
    write_archive(path, SCHEMA, about | law.about, arrays, compress=True)


def _key(kind, name, number, field):
    return f"{kind}/{name}/{field}" if field in COMMON else f"{kind}/{name}/{number}/{field}"


def read_law(path: str | Path, name: str | None = None) -> TrainedLaw:
    """The law in a file, by default named like it; InputError when it is none or of another version."""
    fix = "make it again with pneunet train"
    about, stored = read_archive(path, SCHEMA, "a trained law", fix, KEYS, _members)
    kinds = {kind: _read_kind(stored, kind) for kind in about["kinds"]}
    return TrainedLaw(kinds, about, name or str(path))


def _processes(kind, names):
    """{name of processes side by side: (number of inputs, of outputs of each)}, the optional ones as the file
    has them."""
    coordinates = Coordinates(kind)
    inputs = coordinates.of_cell + 1
    strains, stiffness = len(coordinates.strain_parity), len(coordinates.stiffness_parity)
    outputs: list[tuple[int, ...]] = [(1,), (1, strains - 1), (1,), (stiffness,), (1, stiffness - 1), (1, 1)]
    outputs += [(1, strains - 1), (1, stiffness - 1)]
    return {
        name: (inputs + more, of_each)
        for name, more, of_each in zip(PROCESSES, (0, 1, 0, 0, 1, 1, 0, 0), outputs)
        if name not in OPTIONAL or any(each.startswith(f"{kind}/{name}/") for each in names)
    }


def _members(about: dict, names: Collection[str]) -> dict[str, Member]:
    """What a law's file holds."""
    out: dict[str, Member] = {}
    for kind in about["kinds"]:
        if kind not in LENGTHS:
            raise InputError(f"member 'about': kind {kind!r} is not known")
        for name, (d, outputs) in _processes(kind, names).items():
            m, n, r = (f"{kind} {name} {letter}" for letter in "mnr")
            for number, p in enumerate(outputs):
                noise = Member("f", low=0.0)
                forms = {
                    "shift": Member("f", (d,)),
                    "width": Member("f", (d,), POSITIVE),
                    "inducing": Member("f", (m, d)),
                    "observed": Member("f", (n, d)),
                    "group": Member("iu", (n,), 0),
                    "trust": Member("f", (n,)),
                    "at": Member("iu", (r,), 0, n),
                    "ways": Member("f", (r, d)),
                    "metric": Member("f", (d, f"{m} {number}")),
                    "weights": Member("f", (f"{m} + 1 + {d}", p)),
                    "variance": Member("f", (p,), POSITIVE),
                    "noise": Member("f", (), POSITIVE),
                    "common_noise": noise,
                    "slope_noise": noise,
                }
                out |= {_key(kind, name, number, field): form for field, form in forms.items()}
        co = Coordinates(kind)
        d = co.of_cell + 1
        ranged = Member("f", (d + len(IN_SUMS[kind]),))
        own = {
            "furthest": Member("f", (), POSITIVE),
            "remainder": Member("f", (2, 2), 0.0),
            "landmarks": Member("iu", (f"{kind} landmarks",), 0, f"{kind} path m"),
            "quantile": Member("f", (6,), 0.0),
            "low": ranged,
            "high": ranged,
            "doubt": Member("f", (), POSITIVE),
            "left": Member("f", ()),
            "stiffness_left": Member("f", ()),
            "uncertainty": Member("f", (), 0.0),
            "uncertainty_at_lead": Member("f", (), 0.0),
            "anharmonic/coefficients": Member("f", (len(monomials(kind)), d + 3)),
            "anharmonic/centre": Member("f", (d + 2,)),
            "anharmonic/width": Member("f", (d + 2,), POSITIVE),
        }
        out |= {f"{kind}/{name}": form for name, form in own.items()}
    return out


def _read_kind(stored, kind):
    def process(name, number):
        values = {f.name: stored[_key(kind, name, number, f.name)] for f in fields(GaussianProcess)}
        return GaussianProcess(**values | {field: float(values[field]) for field in NOISES})

    there = _processes(kind, stored)
    beside = {
        name: SideBySide(tuple(process(name, number) for number in range(len(outputs))))
        for name, (_, outputs) in there.items()
    }
    closing, learned, start, smooth, contact, recorded, mesh, mesh_stiffness = PROCESSES
    # of how walls close and touch, and of finer grids, there may be none
    known = Closing(kind, beside.get(closing)), beside[learned], beside[start]
    cheap = (stored[f"{kind}/{name}"] for name in ("remainder", "landmarks"))
    of_mesh = (float(stored[f"{kind}/{name}"]) for name in OF_MESH)
    difference = MeshDifference(kind, beside.get(mesh), beside.get(mesh_stiffness), *of_mesh)
    return KindLaw(
        kind,
        FreePath(kind, *known, float(stored[f"{kind}/furthest"]), *cheap),
        FreeStiffness(kind, beside[smooth], beside.get(contact)),
        Anharmonic(kind, *(stored[f"{kind}/anharmonic/{name}"] for name in ANHARMONIC)),
        Recorded(beside[recorded]) if recorded in beside else None,
        difference,
        **{name: stored[f"{kind}/{name}"] for name in ("quantile", "low", "high")},
        doubt=float(stored[f"{kind}/doubt"]),
    )
