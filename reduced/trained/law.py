"""The trained law of a rod's sections: free strains, stiffness and enthalpy of cells, learned from finite
elements.

`RodLaw` knows both kinds of segment; `RodLaw.of(segment)` is the law of one of them in mm and MPa, with what
a rod asks: free_strains(P), psi(q, P), force(q, P), stiffness(q, P). Everything else is without dimension
(base.files.dataset). Trained by `pneunet train` (reduced.training.train); numpy and scipy alone.
"""

from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.archive import read_archive, write_archive
from pneunet.base.materials.laws import NeoHookean
from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import TWISTING
from pneunet.geometry.shape_numbers import SHAPE, normal_pitch, shape_numbers, shapes_of
from pneunet.reduced.model import SegmentLaw, checked_pressure
from pneunet.reduced.trained.closing import Closing
from pneunet.reduced.trained.coordinates import LENGTHS, Coordinates, cosine
from pneunet.reduced.trained.enthalpy import (
    Anharmonic,
    anharmonic_gradient,
    anharmonic_hessian,
    anharmonic_value,
    whitening,
)
from pneunet.reduced.trained.free_path import FreePath
from pneunet.reduced.trained.free_stiffness import FreeStiffness
from pneunet.reduced.trained.gaussian import GaussianProcess
from pneunet.reduced.trained.side_by_side import SideBySide

SCHEMA = "pneunet-law-7"
#: a length that the sample ties to another may differ from it by so much of itself before the law says so
TIE_TOLERANCE = 0.02
#: `make bench ONLY=silicones`, docs/rod-law.md
SILICONES = "strains of fitted silicones differed by up to 1.2 % at P/mu = 0.1 and 7.3 % at 0.2"
#: of an input's range, by which dimensions may leave it that `pneunet design` has put on its edge and rounded
ROUNDED = 1e-3
#: lowest P/mu, whose logarithm is taken
LOWEST = 1e-9


@dataclass(frozen=True)
class KindLaw:
    """The law of one kind. path, stiffness: of the free states; anharmonic: of the enthalpy around them;
    quantile (6,): what a standard deviation of each strain is multiplied by for a 90 % interval; low, high
    (r,): range of Coordinates.ranged; doubt: largest deviation of the free states' pressure that counts as
    known; level: the mesh that is predicted, by its place among those trained on, the finest last."""

    kind: str
    path: FreePath
    stiffness: FreeStiffness
    anharmonic: Anharmonic
    quantile: np.ndarray
    low: np.ndarray
    high: np.ndarray
    doubt: float
    level: int = 0

    @cached_property
    def coordinates(self):
        return Coordinates(self.kind)

    def _ranged(self, shape, pressure):
        return self.coordinates.ranged(shape, pressure, self.level)

    def free_strains(self, shape, pressure):
        """(n, 6) free strains of shape numbers (n, 13) at P/mu (n,); beyond the end of their path, as at a
        limit load, those there."""
        return self.path.strains(shape, np.maximum(pressure, LOWEST), self.level)

    def free_strains_and_slopes(self, shape, pressure):
        """(strains (n, 6), slopes (n, 6, 14)): derivatives by the 13 shape numbers (the angle in degrees) and
        P/mu."""
        return self.path.strains_and_slopes(shape, np.maximum(pressure, LOWEST), self.level)

    def free_stiffness(self, shape, pressure):
        """(n, 6, 6) tangent stiffness of the free states."""
        strains = self.free_strains(shape, pressure)
        return self.stiffness_at(shape, strains, self.closed(shape, pressure, strains))

    def stiffness_at(self, shape, strains, closed):
        """(n, 6, 6) the same, of free states with these strains (n, 6) whose walls have closed so much of
        their gap (n,)."""
        return self.stiffness.at(shape, strains, closed, self.level)

    def closed(self, shape, pressure, strains):
        """(n,) part of the gap that walls have closed in free states with these strains (n, 6), as if they
        could go on: from 1 on they touch."""
        return self.path.closing.closed(shape, pressure, strains)

    def anharmonic_at(self, shape, strains, closed):
        """What reduced.trained.enthalpy's anharmonic forms are made of around free states with these strains
        (n, 6)."""
        return self.anharmonic.at(self.coordinates.around_inputs(shape, strains, closed), cosine(shape))

    def half_width(self, shape, pressure):
        """(n, 6) half of the 90 % interval of each free strain."""
        return self.quantile * self.path.spread(shape, np.maximum(pressure, LOWEST), self.level)

    def excess(self, shape, pressure):
        """(n, r + 2) how far a design lies outside what the law was taught: of each of Coordinates.ranged in
        widths of its range, of the free states' deviation in units of the largest that counts as known, and
        of log P beyond the end of their path; 0 inside."""
        pressure = np.maximum(pressure, LOWEST)
        x = self._ranged(shape, pressure)
        width = np.maximum(self.high - self.low, 1.0)  # a level's may be 0
        box = np.maximum(np.maximum(self.low - x, x - self.high) - 1e-9, 0) / width
        _, beyond, there = self.path.at(shape, pressure, self.level)
        return np.column_stack([box, np.maximum(self.path.deviation(there) / self.doubt - 1, 0), beyond])


@dataclass(frozen=True, eq=False)
class RodLaw(SegmentLaw):
    """kinds: {kind: KindLaw}; about: how it was trained."""

    kinds: dict
    about: dict
    name: str = "trained"

    def _kind(self, segment):
        if segment.kind not in self.kinds:
            known = " and ".join(self.kinds)
            raise InputError(
                f"kind = '{segment.kind}': the law '{self.name}' knows {known} segments only: take --law"
                " analytic"
            )
        return self.kinds[segment.kind]

    def of(self, segment):
        """The SectionLaw of a Segment; InputError for a kind that it was not taught."""
        return SectionLaw(
            self._kind(segment),
            shape_numbers(segment),
            normal_pitch(segment),
            segment.material.mu,
            _ties(segment),
        )

    def strains(self, segment, pressure):
        """RodStrains with e, k of shape pressure.shape + (3,); pressure in MPa, a number or an array."""
        q = self.of(segment).free_strains(checked_pressure(pressure))
        return RodStrains(q[..., :3], q[..., 3:])

    def table(self, segments, pressures):
        """RodStrains (n, m, 3) of n segments at pressures (m,) in MPa, all at once."""
        pressures = checked_pressure(pressures)
        (shape, pitch), m, alike = shapes_of(segments), len(pressures), {}
        P = pressures / np.array([s.material.mu for s in segments])[:, None]
        q = np.empty((len(segments), m, 6))
        for i, segment in enumerate(segments):
            alike.setdefault(segment.kind, []).append(i)
        for rows in alike.values():
            law = self._kind(segments[rows[0]])
            q[rows] = law.free_strains(shape[rows].repeat(m, axis=0), P[rows].ravel()).reshape(-1, m, 6)
        return RodStrains(q[..., :3], q[..., 3:] / pitch[:, None, None])

    def each(self, segments, pressure):
        """RodStrains (n, 3) of n segments at one pressure in MPa, all at once."""
        found = self.table(segments, [pressure])
        return RodStrains(found.e[:, 0], found.k[:, 0])

    def excess(self, segment, pressure):
        """(r + 2,) how far a segment at a pressure (MPa) lies outside what the law was taught;
        KindLaw.excess."""
        return self._kind(segment).excess(
            shape_numbers(segment)[None], np.array([pressure / segment.material.mu])
        )[0]

    def doubts(self, segment, pressure):
        """Reasons, as text, not to trust the law for a segment at a pressure (MPa) or several; () when there
        are none."""
        return self.of(segment).doubts(pressure)


@dataclass(frozen=True, eq=False)
class SectionLaw:
    """The law of one Segment's section in mm, N and MPa; q (..., 6) = (e, k), P a number or (...,)."""

    law: KindLaw
    shape: np.ndarray
    length: float
    mu: float
    remarks: tuple = ()

    def __post_init__(self):
        object.__setattr__(self, "_scale", np.array([1, 1, 1, self.length, self.length, self.length]))
        object.__setattr__(self, "_known", lru_cache(maxsize=64)(self._free_state))

    def _free_state(self, *pressures):
        """(free strains (n, 6), M (n, 6, 6), D1 (n,), cubic (n, 6, 36), quartic (n, 36, 36)) without
        dimension at pressures in MPa."""
        shape, p = self._rows(pressures)
        free = self.law.free_strains(shape, p)
        closed = self.law.closed(shape, p, free)
        return (
            free,
            *whitening(self.law.kind, self.law.stiffness_at(shape, free, closed)),
            *self.law.anharmonic_at(shape, free, closed),
        )

    def _rows(self, P):
        p = np.atleast_1d(np.asarray(P, float)).ravel() / self.mu
        return np.broadcast_to(self.shape, (len(p), len(self.shape))), p

    def free_strains(self, P):
        """(..., 6) minimiser of psi."""
        return (self.law.free_strains(*self._rows(P)) / self._scale).reshape(*np.shape(P), 6)

    def half_width(self, P):
        """(..., 6) half of the 90 % interval of each free strain."""
        return (self.law.half_width(*self._rows(P)) / self._scale).reshape(*np.shape(P), 6)

    def doubts(self, P):
        """Reasons, as text, not to trust the law at this pressure; () when there are none."""
        shape, p = self._rows(P)
        law, co = self.law, self.law.coordinates
        excess = law.excess(shape, p)
        told = co.told(law._ranged(shape, p)[excess.max(axis=1).argmax()])
        known = np.sort([co.told(law.low), co.told(law.high)], axis=0).T
        reasons = [
            f"{name} = {value:.3g} is outside the trained law's {low:.3g} to {high:.3g}"
            for name, value, (low, high), out in zip(co.names, told, known, excess.max(axis=0))
            if out > ROUNDED
        ]
        if excess[:, -2].max() > 0 and not reasons:
            reasons = ["the trained law knows no design near this one"]
        if excess[:, -1].max() > 0:
            limit = self.mu * (p * np.exp(-excess[:, -1]))[excess[:, -1] > 0].min()
            reasons.append(
                f"the trained law sees a limit load, or no further, at {1e3 * limit:.3g} kPa: strains are"
                " those there"
            )
        return self.remarks + tuple(reasons)

    def _state(self, q, P):
        """(shape of the answer, v (n, 6), M (n, 6, 6), D1 (n,), anharmonic tensors)."""
        lead = np.broadcast_shapes(np.shape(q)[:-1], np.shape(P))
        q = np.broadcast_to(q, (*lead, 6)).reshape(-1, 6)
        if np.ndim(P):
            pressures, back = np.unique(np.asarray(P, float), return_inverse=True)
            i = np.broadcast_to(back.reshape(np.shape(P)), lead).ravel()
            free, M, D1, *tensors = (a[i] for a in self._free_state(*pressures))
        else:
            free, M, D1, *tensors = self._known(float(P))
        v = (M @ (q * self._scale - free)[:, :, None])[:, :, 0]
        return lead, v, M, D1, tensors

    def psi(self, q, P):
        """(...,) enthalpy per undeformed length, N; 0 at the free state."""
        lead, v, _, D1, tensors = self._state(q, P)
        return (
            self.mu * self.length**2 * D1 * ((v**2).sum(axis=1) / 2 + anharmonic_value(v, tensors))
        ).reshape(lead)

    def force(self, q, P):
        """(..., 6) gradient of psi: force (N) and moment (N mm) in the section frame."""
        lead, v, M, D1, tensors = self._state(q, P)
        by_v = D1[:, None] * (v + anharmonic_gradient(v, tensors))
        force = (by_v[:, None, :] @ M)[:, 0]
        return (self.mu * self.length**2 * force * self._scale).reshape(*lead, 6)

    def stiffness(self, q, P):
        """(..., 6, 6) Hessian of psi, N, N mm and N mm2."""
        lead, v, M, D1, tensors = self._state(q, P)
        by_v = D1[:, None, None] * (np.eye(6) + anharmonic_hessian(v, tensors))
        K = np.swapaxes(M, 1, 2) @ by_v @ M
        return (self.mu * self.length**2 * K * np.outer(self._scale, self._scale)).reshape(*lead, 6, 6)


def _ties(segment):
    """What the sample ties together and this segment does not."""
    s, shell = segment, segment.top_wall
    ties = [("side_wall", s.side_wall, shell)]
    if s.kind != TWISTING:
        ties += [("roof", s.roof, shell), ("cavity_floor", s.cavity_floor, s.channel_height / 2)]
    remarks = [
        f"{name}_mm = {value:g} where the law was trained on {tied:g} (tied to other dimensions)"
        for name, value, tied in ties
        if abs(value - tied) > TIE_TOLERANCE * abs(tied)
    ]
    if s.layer_thickness:
        remarks.append("the law was trained without a bottom layer")
    if not isinstance(s.material, NeoHookean):
        remarks.append(
            f"the law was trained on neo-Hookean material, not {s.material.law}: its initial modulus is taken"
            f" ({SILICONES})"
        )
    return tuple(remarks)


# ---- files


#: fields of the Gaussian processes side by side that are the same in all of them
COMMON = ("shift", "width", "inducing", "observed", "group", "at", "ways")
#: what only deviations need, most of the file, in as few digits as they take (measured: ways in half
#: precision change them by 2e-7)
SHORT = {"observed": "f4", "ways": "f2", "trust": "f4", "group": "i4", "at": "i4"}
PROCESSES = ("closing", "path", "start", "stiffness", "contact")
ANHARMONIC = ("coefficients", "centre", "width", "reach")
NUMBERS = {"noise": float, "common_noise": float, "slope_noise": float}


def write_law(path, law):
    """Write a RodLaw (.npz)."""
    arrays = {}
    for kind, k in law.kinds.items():
        known = k.path.closing.process, k.path.learned, k.path.start, k.stiffness.smooth, k.stiffness.contact
        for name, found in zip(PROCESSES, known):
            for number, process in enumerate(found.processes if found else ()):
                for f in fields(GaussianProcess):
                    arrays[_key(kind, name, number, f.name)] = np.asarray(
                        getattr(process, f.name), SHORT.get(f.name)
                    )
        arrays[f"{kind}/furthest"] = np.asarray(k.path.furthest)
        arrays |= {
            f"{kind}/{name}": np.asarray(getattr(k, name))
            for name in ("quantile", "low", "high", "doubt", "level")
        }
        arrays |= {
            f"{kind}/anharmonic/{name}": np.asarray(getattr(k.anharmonic, name)) for name in ANHARMONIC
        }
    about = {
        "kinds": list(law.kinds),
        "shape": list(SHAPE),
        "lengths": {k: list(v) for k, v in LENGTHS.items()},
        **law.about,
    }
    write_archive(path, SCHEMA, about, arrays, compress=True)


def _key(kind, name, number, field):
    return f"{kind}/{name}/{field}" if field in COMMON else f"{kind}/{name}/{number}/{field}"


def read_law(path, name=None):
    """The RodLaw in a file, by default named like it; InputError when it is none or of another version."""
    with read_archive(path, SCHEMA, "a trained law", "pneunet train") as (about, archive):
        # what processes have in common is inflated once
        stored = {key: archive[key] for key in archive.files}
        return RodLaw({kind: _read_kind(stored, kind) for kind in about["kinds"]}, about, name or str(path))


def _read_kind(stored, kind):
    processes = {}
    for name in PROCESSES:
        processes[name], number = [], 0
        while f"{kind}/{name}/{number}/noise" in stored:
            values = {f.name: stored[_key(kind, name, number, f.name)] for f in fields(GaussianProcess)}
            values |= {field: number_type(values[field]) for field, number_type in NUMBERS.items()}
            processes[name].append(GaussianProcess(**values))
            number += 1
    closing, learned, start, *of_stiffness = (
        SideBySide(tuple(found)) if found else None for found in processes.values()
    )
    path = FreePath(kind, Closing(kind, closing), learned, start, float(stored[f"{kind}/furthest"]))
    stiffness = FreeStiffness(kind, *of_stiffness)
    plain = {name: stored[f"{kind}/{name}"] for name in ("quantile", "low", "high")}
    anharmonic = Anharmonic(kind, *(stored[f"{kind}/anharmonic/{name}"] for name in ANHARMONIC))
    doubt, level = float(stored[f"{kind}/doubt"]), int(stored[f"{kind}/level"])
    return KindLaw(kind, path, stiffness, anharmonic, **plain, doubt=doubt, level=level)
