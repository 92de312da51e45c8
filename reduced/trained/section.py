"""The section law of one segment by a trained law, in mm, N and MPa, and what is doubtful of it."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.materials.stiffening import stiffening
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.parameters import TWISTING, Segment
from pneunet.reduced.trained.enthalpy import (
    anharmonic_gradient,
    anharmonic_hessian,
    anharmonic_value,
    whitening,
)
from pneunet.reduced.trained.kind_law import KindLaw

#: a length that the sample ties to another may differ from it by so much of itself before the law says so
TIE_TOLERANCE = 0.02
#: of the stresses of a law, by which Yeoh's with the ratios that the law is told may miss them
LARGEST_MISFIT = 0.02
#: measured once; docs/decisions.md
SILICONES = "strains of fitted silicones differed by up to 1.2 % at P/mu = 0.1 and 7.3 % at 0.2"
#: of an input's range, by which dimensions may leave it that `pneunet design` has put on its edge and rounded
ROUNDED = 1e-3


@dataclass(frozen=True, eq=False)
class TrainedSection:
    """The SectionLaw of one Segment in mm, N and MPa; q (..., 6) = (e, k), P a number or (...,).

    length: the normal pitch, mm; remarks: `remarks_on` the segment.
    """

    law: KindLaw
    numbers: np.ndarray
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
        numbers, p = self._rows(pressures)
        free = self.law.free_strains(numbers, p)
        closed = self.law.closed(numbers, p, free)
        white = whitening(self.law.kind, self.law.stiffness_at(numbers, free, closed))
        return free, *white, *self.law.anharmonic_at(numbers, free, closed)

    def _rows(self, P):
        p = np.atleast_1d(np.asarray(P, float)).ravel() / self.mu
        return np.broadcast_to(self.numbers, (len(p), len(self.numbers))), p

    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) minimiser of psi."""
        return (self.law.free_strains(*self._rows(P)) / self._scale).reshape(*np.shape(P), 6)

    def half_width(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) half of the 90 % interval of each free strain."""
        return (self.law.half_width(*self._rows(P)) / self._scale).reshape(*np.shape(P), 6)

    def doubts(self, P: float | ArrayLike) -> tuple[str, ...]:
        """Reasons, as text, not to trust the law at this pressure; () when there are none."""
        numbers, p = self._rows(P)
        law, co = self.law, self.law.coordinates
        excess = law.excess(numbers, p)
        if not excess.any():
            return self.remarks
        told = co.told(law.ranged(numbers, p)[excess.max(axis=1).argmax()])
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


def remarks_on(segment: Segment, stiffens: bool) -> tuple[str, ...]:
    """Reasons, as text, to doubt the law of a segment at any pressure: what the sample ties together and this
    segment does not, a bottom layer, a material that stiffens in another way than the law has learned, or at
    all where it does not know what `stiffens`."""
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
    *ratios, misfit = stiffening(s.material)
    if not stiffens and (any(ratios) or misfit > LARGEST_MISFIT):
        remarks.append(
            f"the law was trained on neo-Hookean material, not {s.material.law}: its initial modulus is taken"
            f" ({SILICONES})"
        )
    elif misfit > LARGEST_MISFIT:
        remarks.append(
            f"the law was trained on Yeoh's material, whose stresses miss those of {s.material.law} by"
            f" {misfit:.1%} (root mean square): fit Yeoh's law"
        )
    return tuple(remarks)
