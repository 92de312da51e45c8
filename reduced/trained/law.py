"""The trained law of a rod's sections: free strains, stiffness and enthalpy of cells, learned from finite
elements.

A section is in mm and MPa; everything else is without dimension (base.files.dataset). Trained by `pneunet
train` (reduced.training.train), stored by reduced.trained.file.
"""

import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.parameters import TWISTING, Segment
from pneunet.geometry.shape_numbers import SHAPE, normal_pitch, shape_numbers, shapes_of
from pneunet.reduced.rod.laws import SegmentLaw, checked_pressure
from pneunet.reduced.rod.states import Slopes, StatesWithSlopes
from pneunet.reduced.trained.coordinates import Coordinates, cosine
from pneunet.reduced.trained.enthalpy import (
    Anharmonic,
    Tensors,
    anharmonic_gradient,
    anharmonic_hessian,
    anharmonic_value,
    whitening,
)
from pneunet.reduced.trained.free_path import NEARER, FreePath
from pneunet.reduced.trained.free_stiffness import FreeStiffness

#: a length that the sample ties to another may differ from it by so much of itself before the law says so
TIE_TOLERANCE = 0.02
#: `make bench ONLY=silicones`, docs/rod-law.md
SILICONES = "strains of fitted silicones differed by up to 1.2 % at P/mu = 0.1 and 7.3 % at 0.2"
#: of an input's range, by which dimensions may leave it that `pneunet design` has put on its edge and rounded
ROUNDED = 1e-3
#: far from all that was learned the deviation that inducing points give may be too small, so it counts times
#: this when it comes to doubts
FAR = 1.04
#: lowest P/mu, whose logarithm is taken
LOWEST = 1e-9
log = logging.getLogger(__name__)


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
    def coordinates(self) -> Coordinates:
        return Coordinates(self.kind)

    def ranged(self, shape: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, r) what the ranges are of."""
        return self.coordinates.ranged(shape, pressure, self.level)

    def free_strains(self, shape: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, 6) free strains of shape numbers (n, 13) at P/mu (n,); beyond the end of their path, as at a
        limit load, those there."""
        return self.path.strains(shape, np.maximum(pressure, LOWEST), self.level)

    def free_strains_and_slopes(
        self, shape: np.ndarray, pressure: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(strains (n, 6), slopes (n, 6, 14)): derivatives by the 13 shape numbers (the angle in degrees) and
        P/mu."""
        return self.path.strains_and_slopes(shape, np.maximum(pressure, LOWEST), self.level)

    def free_stiffness(self, shape: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, 6, 6) tangent stiffness of the free states."""
        strains = self.free_strains(shape, pressure)
        return self.stiffness_at(shape, strains, self.closed(shape, pressure, strains))

    def stiffness_at(self, shape: np.ndarray, strains: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """(n, 6, 6) the same, of free states with these strains (n, 6) whose walls have closed so much of
        their gap (n,)."""
        return self.stiffness.at(shape, strains, closed, self.level)

    def closed(self, shape: np.ndarray, pressure: np.ndarray, strains: np.ndarray) -> np.ndarray:
        """(n,) part of the gap that walls have closed in free states with these strains (n, 6), as if they
        could go on: from 1 on they touch."""
        return self.path.closing.closed(shape, pressure, strains)

    def anharmonic_at(self, shape: np.ndarray, strains: np.ndarray, closed: np.ndarray) -> Tensors:
        """What reduced.trained.enthalpy's anharmonic forms are made of around free states with these strains
        (n, 6)."""
        return self.anharmonic.at(self.coordinates.around_inputs(shape, strains, closed), cosine(shape))

    def half_width(self, shape: np.ndarray, pressure: np.ndarray, exact: bool = False) -> np.ndarray:
        """(n, 6) half of the 90 % interval of each free strain; exact: as for FreePath.spread."""
        return self.quantile * self.path.spread(shape, np.maximum(pressure, LOWEST), self.level, exact)

    def excess(self, shape: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, r + 2) how far a design lies outside what the law was taught: of each of Coordinates.ranged in
        widths of its range, of the free states' deviation in units of the largest that counts as known, and
        of log P beyond the end of their path; 0 inside."""
        pressure = np.maximum(pressure, LOWEST)
        _, beyond, there = self.path.at(shape, pressure, self.level)
        return self.excess_there(shape, pressure, there, beyond)

    def excess_there(
        self, shape: np.ndarray, pressure: np.ndarray, there: np.ndarray, beyond: np.ndarray
    ) -> np.ndarray:
        """The same of free states whose path_inputs (n, d) and log P beyond the path's end (n,) are known."""
        return self._excess(self.ranged(shape, pressure), self.path.deviation(there, self.known), beyond)

    @property
    def known(self) -> float:
        """Largest deviation, from inducing points, that counts as known."""
        return self.doubt / FAR

    def _excess(self, ranged, deviation, beyond):
        outside = np.maximum(np.maximum(self.low - ranged, ranged - self.high) - 1e-9, 0) / self._width
        unknown = np.maximum(deviation / self.known - 1, 0)
        return np.concatenate([outside, unknown[:, None], beyond[:, None]], axis=1)

    @cached_property
    def _width(self):
        return np.maximum(self.high - self.low, 1.0)  # a level's may be 0

    def with_slopes(self, shape: np.ndarray, pressure: np.ndarray) -> tuple[Slopes, Slopes, Slopes]:
        """(`free_strains` (n, 6), `excess` (n, r + 2), `closed` (n,)), each with its derivatives (..., 14) by
        the 13 shape numbers (the angle in degrees) and P/mu: everything from one search."""
        pressure = np.maximum(pressure, LOWEST)
        state = self.path.state_and_slopes(shape, pressure, self.level, NEARER)
        x = self.ranged(shape, pressure)
        deviation, by_inputs = self.path.deviation_and_slopes(state.inputs, self.known)
        excess = self._excess(x, deviation, state.beyond)
        by = np.zeros((*excess.shape, shape.shape[1] + 1))
        if excess.any():  # mostly there is none
            side = np.sign(2 * x - self.low - self.high) * (excess[:, :-2] > 0) / self._width
            by[:, :-2] = side[:, :, None] * self.coordinates.ranged_slopes(shape, pressure)
            by[:, -2], by[:, -1] = state.of_inputs(by_inputs) / self.known, state.beyond_by
        return state.strains_and_slopes(), (excess, by), state.closed_and_slopes()


@dataclass(frozen=True, eq=False)
class TrainedLaw(SegmentLaw):
    """kinds: {kind: KindLaw}; about: how it was trained."""

    kinds: dict[str, KindLaw]
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

    def of(self, segment: Segment) -> "TrainedSection":
        """InputError for a kind that it was not taught."""
        law, shape, pitch = self._kind(segment), shape_numbers(segment), normal_pitch(segment)
        return TrainedSection(law, shape, pitch, segment.material.mu, _ties(segment))

    def strains(self, segment: Segment, pressure: float | ArrayLike) -> RodStrains:
        """As SegmentLaw.strains; that a pressure lies beyond the end of the law's path is logged."""
        section, P = self.of(segment), checked_pressure(pressure)
        shape, p = section._rows(P)
        found, beyond = self._kind(segment).path.strains_and_end(
            shape, np.maximum(p, LOWEST), section.law.level
        )
        if beyond.any():
            log.warning(f"warning: {section.told_end(p, beyond)}")
        return RodStrains.of_vector((found / section._scale).reshape(*P.shape, 6))

    def table(self, segments: Sequence[Segment], pressures: ArrayLike) -> RodStrains:
        """RodStrains (n, m, 3) of n segments at pressures (m,) in MPa, all at once."""
        pressures = checked_pressure(pressures)
        return self._at(segments, np.broadcast_to(pressures, (len(segments), len(pressures))))

    def each(self, segments: Sequence[Segment], pressure: float | ArrayLike) -> RodStrains:
        """RodStrains (n, 3) of n segments at a pressure in MPa, one for all or (n,), all at once."""
        found = self._at(segments, np.broadcast_to(checked_pressure(pressure), len(segments))[:, None])
        return RodStrains(found.e[:, 0], found.k[:, 0])

    def each_with_slopes(
        self, segments: Sequence[Segment], pressure: float | ArrayLike, names: Collection[str] = SHAPE
    ) -> StatesWithSlopes:
        """StatesWithSlopes of n segments at a pressure in MPa, one for all or (n,), all at once: free
        strains, how far each lies outside what the law knows, and how far its walls have closed, with exact
        derivatives by dimensions, pressure and modulus.

        Strains are those of `each` but for the last 1e-5 of them, which are computed as well here: values
        and derivatives belong together. Next to a limit load, where strains over the pressure turn vertical,
        derivatives are bounded; beyond it the leading strain counts as constant."""
        pressures, (shape, pitch) = checked_pressure(pressure), shapes_of(segments)
        mu = np.array([s.material.mu for s in segments])
        P = np.broadcast_to(pressures, len(segments))
        found = [
            (rows, law.with_slopes(shape[rows], P[rows] / mu[rows])) for rows, law in self._by_kind(segments)
        ]
        return StatesWithSlopes.of(found, shape, pitch, P, mu)

    def _by_kind(self, segments):
        """[(places of the segments of a kind, its KindLaw)]."""
        alike: dict[str, list[int]] = {}
        for i, segment in enumerate(segments):
            alike.setdefault(segment.kind, []).append(i)
        return [(rows, self._kind(segments[rows[0]])) for rows in alike.values()]

    def _at(self, segments: Sequence[Segment], pressures: np.ndarray) -> RodStrains:
        """RodStrains (n, m, 3) at pressures (n, m)."""
        (shape, pitch), m = shapes_of(segments), pressures.shape[1]
        P = pressures / np.array([s.material.mu for s in segments])[:, None]
        q = np.empty((*P.shape, 6))
        for rows, law in self._by_kind(segments):
            q[rows] = law.free_strains(shape[rows].repeat(m, axis=0), P[rows].ravel()).reshape(-1, m, 6)
        return RodStrains(q[..., :3], q[..., 3:] / pitch[:, None, None])

    def excess(self, segment: Segment, pressure: float) -> np.ndarray:
        """(r + 2,) how far a segment at a pressure (MPa) lies outside what the law was taught;
        KindLaw.excess."""
        return self._kind(segment).excess(
            shape_numbers(segment)[None], np.array([pressure / segment.material.mu])
        )[0]

    def half_width(self, segment: Segment, pressure: float) -> np.ndarray:
        """As SegmentLaw.half_width."""
        return self.of(segment).half_width(pressure)

    def doubts(self, segment: Segment, pressure: float | ArrayLike) -> tuple[str, ...]:
        """Reasons, as text, not to trust the law for a segment at a pressure (MPa) or several; () when there
        are none."""
        return self.of(segment).doubts(pressure)


@dataclass(frozen=True, eq=False)
class TrainedSection:
    """The SectionLaw of one Segment in mm, N and MPa; q (..., 6) = (e, k), P a number or (...,).

    length: the normal pitch, mm; remarks: reasons to doubt it at any pressure.
    """

    law: KindLaw
    shape: np.ndarray
    length: float
    mu: float
    remarks: tuple[str, ...] = ()

    @cached_property
    def _scale(self):
        return np.array([1, 1, 1, self.length, self.length, self.length])

    @cached_property
    def _known(self):
        return lru_cache(maxsize=64)(self._free_state)

    def _free_state(self, *pressures):
        """(free strains (n, 6), M (n, 6, 6), D1 (n,), cubic (n, 6, 36), quartic (n, 36, 36)) without
        dimension at pressures in MPa."""
        shape, p = self._rows(pressures)
        free = self.law.free_strains(shape, p)
        closed = self.law.closed(shape, p, free)
        white = whitening(self.law.kind, self.law.stiffness_at(shape, free, closed))
        return free, *white, *self.law.anharmonic_at(shape, free, closed)

    def _rows(self, P):
        p = np.atleast_1d(np.asarray(P, float)).ravel() / self.mu
        return np.broadcast_to(self.shape, (len(p), len(self.shape))), p

    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) minimiser of psi."""
        return (self.law.free_strains(*self._rows(P)) / self._scale).reshape(*np.shape(P), 6)

    def half_width(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) half of the 90 % interval of each free strain."""
        return (self.law.half_width(*self._rows(P)) / self._scale).reshape(*np.shape(P), 6)

    def doubts(self, P: float | ArrayLike) -> tuple[str, ...]:
        """Reasons, as text, not to trust the law at this pressure; () when there are none."""
        shape, p = self._rows(P)
        law, co = self.law, self.law.coordinates
        excess = law.excess(shape, p)
        if not excess.any():
            return self.remarks
        told = co.told(law.ranged(shape, p)[excess.max(axis=1).argmax()])
        known = np.sort([co.told(law.low), co.told(law.high)], axis=0).T
        reasons = [
            f"{name} = {value:.3g} is outside the trained law's {low:.3g} to {high:.3g}"
            for name, value, (low, high), out in zip(co.names, told, known, excess.max(axis=0))
            if out > ROUNDED
        ]
        if excess[:, -2].max() > 0 and not reasons:
            reasons = ["the trained law knows no design near this one"]
        if excess[:, -1].max() > 0:
            reasons.append(self.told_end(p, excess[:, -1]))
        return self.remarks + tuple(reasons)

    def told_end(self, p: np.ndarray, beyond: np.ndarray) -> str:
        """Where the path ends, for P/mu (n,) that are in part `beyond` it by log P (n,)."""
        limit = KPA_PER_MPA * self.mu * (p * np.exp(-beyond))[beyond > 0].min()
        return (
            f"the trained law sees a limit load, or no further, at {limit:.3g} kPa: strains are those there"
        )

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

    def psi(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(...,) enthalpy per undeformed length, N; 0 at the free state."""
        lead, v, _, D1, tensors = self._state(q, P)
        return (
            self.mu * self.length**2 * D1 * ((v**2).sum(axis=1) / 2 + anharmonic_value(v, tensors))
        ).reshape(lead)

    def force(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) gradient of psi: force (N) and moment (N mm) in the section frame."""
        lead, v, M, D1, tensors = self._state(q, P)
        by_v = D1[:, None] * (v + anharmonic_gradient(v, tensors))
        force = (by_v[:, None, :] @ M)[:, 0]
        return (self.mu * self.length**2 * force * self._scale).reshape(*lead, 6)

    def stiffness(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
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
