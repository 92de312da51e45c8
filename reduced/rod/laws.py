"""What a law is: of a section, as a rod asks for it, and of every segment, as a prediction does.

A section's law is an enthalpy psi (N: energy per undeformed length, the gas's work included) of the section
frame's strains q = (e1, e2, e3, k1, k2, k3), 1/mm for k, at a pressure P in MPa. Its minimiser is the free
state, its gradient is (force, moment) in the section frame.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.strains import RodStrains
from pneunet.base.units import LARGEST_PRESSURE_KPA, MPA_PER_KPA
from pneunet.geometry.parameters import Segment
from pneunet.geometry.shape_numbers import SHAPE
from pneunet.reduced.rod.clearance import wall_bulge, wall_stretch
from pneunet.reduced.rod.states import VARIABLES, StatesWithSlopes

#: degrees and mm, and of the pressure: of laws without slopes of their own
DIFFERENCE = 1e-4


@runtime_checkable
class SectionLaw(Protocol):
    """What a rod asks of a section; q (..., 6), P in MPa, a number or (...,)."""

    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) minimiser of psi."""

    def psi(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(...,) enthalpy per undeformed length, N."""

    def force(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) gradient of psi: force (N) and moment (N mm) in the section frame."""

    def stiffness(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(..., 6, 6) Hessian of psi, N, N mm and N mm2; symmetric."""


class FreeSection(ABC):
    """A SectionLaw that knows the free strains alone: a rod of it has a free shape, and under load an
    InputError. law: the name of the law that it belongs to."""

    def __init__(self, law: str) -> None:
        self._refusal = (
            f"the law '{law}' knows free shapes alone, no forces and no stiffness: for a rod under load, or"
            " [loads] of a design, take the trained law, or a QuadraticLaw of a unit cell's states"
        )

    @abstractmethod
    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) at P in MPa, a number or (...,)."""

    def psi(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """InputError, as for the two others."""
        raise InputError(self._refusal)

    force = stiffness = psi


@dataclass(frozen=True)
class TurnedSection:
    """`law` in axes that `rotation` (3, 3) takes its own to: what a roll makes of a section."""

    law: SectionLaw
    rotation: np.ndarray

    def _turned(self, q: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        q = np.asarray(q, float)
        return (q.reshape(*q.shape[:-1], 2, 3) @ rotation.T).reshape(q.shape)

    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) minimiser of psi."""
        return self._turned(self.law.free_strains(P), self.rotation)

    def psi(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(...,) enthalpy per undeformed length, N."""
        return self.law.psi(self._turned(q, self.rotation.T), P)

    def force(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) force (N) and moment (N mm)."""
        return self._turned(self.law.force(self._turned(q, self.rotation.T), P), self.rotation)

    def stiffness(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(..., 6, 6) in N, N mm and N mm2."""
        both = np.kron(np.eye(2), self.rotation)
        return both @ self.law.stiffness(self._turned(q, self.rotation.T), P) @ both.T


class SegmentLaw(ABC):
    """What predicts the free strains of the middle of a long segment with chambers, in the segment's own axes
    whatever its roll (reduced.rod.ends turns them); `name`: what --law calls it."""

    name: str

    @abstractmethod
    def of(self, segment: Segment) -> SectionLaw:
        """The law of a segment's section; InputError for a segment that it does not know."""

    def strains(self, segment: Segment, pressure: float | ArrayLike) -> RodStrains:
        """RodStrains with e, k of shape pressure.shape + (3,); pressure in MPa, a number or an array.

        InputError for a pressure that is negative or not finite; ConvergenceError, with the pressure reached,
        where the law has no stable equilibrium.
        """
        return RodStrains.of_vector(self.of(segment).free_strains(checked_pressure(pressure)))

    def each(self, segments: Sequence[Segment], pressure: float | ArrayLike) -> RodStrains:
        """RodStrains (n, 3) of n segments at a pressure in MPa, one for all or (n,)."""
        pressures = np.broadcast_to(np.asarray(pressure, float), len(segments)).tolist()
        return RodStrains.of_vector([self.strains(s, P).vector for s, P in zip(segments, pressures)])

    def table(self, segments: Sequence[Segment], pressures: ArrayLike) -> RodStrains:
        """RodStrains (n, m, 3) of n segments at increasing pressures (m,) in MPa; nan from where there is no
        equilibrium."""
        pressures = checked_pressure(pressures)
        q = np.full((len(segments), len(pressures), 6), np.nan)
        for row, segment in zip(q, segments):
            for j, pressure in enumerate(pressures):
                try:
                    row[j] = self.strains(segment, pressure).vector
                except ConvergenceError:
                    break
        return RodStrains.of_vector(q)

    def each_with_slopes(
        self, segments: Sequence[Segment], pressure: float | ArrayLike, names: Collection[str] = SHAPE
    ) -> StatesWithSlopes:
        """StatesWithSlopes of n segments at a pressure in MPa, one for all or (n,), walls as plates; by
        central differences, and only by those of SHAPE that are among `names`, the others 0."""
        pressures = np.broadcast_to(np.asarray(pressure, float), len(segments))
        slopes = np.zeros((len(segments), 6, len(VARIABLES)))
        for by, segment, P in zip(slopes, segments, pressures):
            for j, name in enumerate(SHAPE):
                if name in names:
                    by[:, j] = self._slope(segment, P, name)
            step = DIFFERENCE * max(P, DIFFERENCE)
            low, high = (self.strains(segment, P + d).vector for d in (-step, step))
            by[:, -2] = (high - low) / (2 * step)
            by[:, -1] = -P / segment.material.mu * by[:, -2]
        return StatesWithSlopes.of_strains(self.each(segments, pressures).vector, slopes, segments, pressures)

    def _slope(self, segment, pressure, name):
        """(6,) derivative by one of SHAPE; 0 where the segment cannot be changed in it, one-sided where only
        that can be."""
        value, found = getattr(segment, name), []
        for step in (-DIFFERENCE, DIFFERENCE):
            try:
                found.append((step, self.strains(replace(segment, **{name: value + step}), pressure).vector))
            except (InputError, ConvergenceError):
                found.append((0.0, self.strains(segment, pressure).vector))
        (low, before), (high, after) = found
        return (after - before) / (high - low) if high > low else np.zeros(6)

    @property
    def of_walls(self) -> str:
        """Where it knows `walls` from, in words."""
        return "estimate by plates, which is early by a quarter"

    def walls(self, segment: Segment, pressure: float) -> tuple[float, float]:
        """(part of the gap that facing walls of a segment have closed at a pressure in MPa, they touch from 1
        on; how far the silicone is stretched)."""
        return 2 * wall_bulge(segment, pressure) / segment.gap, wall_stretch(segment, pressure)

    def excess(self, segment: Segment, pressure: float) -> np.ndarray:
        """How far (0: not at all) the segment lies outside what the law knows, (d,) in widths of that."""
        return np.zeros(1)

    def half_width(self, segment: Segment, pressure: float) -> np.ndarray | None:
        """(6,) half of the 90 % interval of each free strain at a pressure in MPa, or None where the law does
        not know how wrong it is."""
        return None

    def doubts(self, segment: Segment, pressure: float | ArrayLike) -> tuple[str, ...]:
        """Reasons, as text, not to trust the law for a segment at a pressure or several; () when there are
        none."""
        return ()


def checked_pressure(pressure: ArrayLike) -> np.ndarray:
    """Pressure in MPa as an array; InputError where it is negative, not finite, or in kPa by its size."""
    pressure = np.asarray(pressure, float)
    if not ((pressure >= 0) & (pressure < np.inf)).all():
        raise InputError("pressure_kPa: give finite values >= 0")
    largest = LARGEST_PRESSURE_KPA * MPA_PER_KPA
    if pressure.max(initial=0) > largest:
        told = f"pressure = {pressure.max():g} MPa is more than {largest:g}"
        raise InputError(f"{told}: laws take pressures in MPa; is it in kPa?")
    return pressure
