"""The trained law of a rod's sections: free strains, stiffness and enthalpy of cells, learned from finite
elements.

A section is in mm and MPa; everything else is without dimension (base.files.dataset). Trained by `pneunet
train` (reduced.training.train), stored by reduced.trained.file.
"""

import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import Segment
from pneunet.geometry.shape_numbers import SHAPE, numbers_of
from pneunet.reduced.rod.laws import SegmentLaw, checked_pressure
from pneunet.reduced.rod.states import StatesWithSlopes
from pneunet.reduced.trained.kind_law import LOWEST, KindLaw
from pneunet.reduced.trained.section import TrainedSection, remarks_on

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class TrainedLaw(SegmentLaw):
    """kinds: {kind: KindLaw}; about: how it was trained; name: as of SegmentLaw, which gives it again."""

    kinds: dict[str, KindLaw]
    about: dict
    name: str

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
        law, (numbers, pitch) = self._kind(segment), self._numbers([segment])
        remarks = remarks_on(segment, law.stiffens)
        return TrainedSection(law, numbers[0], float(pitch[0]), segment.material.mu, remarks)

    def strains(self, segment: Segment, pressure: float | ArrayLike) -> RodStrains:
        """As SegmentLaw.strains; that a pressure lies beyond the end of the law's path is logged."""
        section, P = self.of(segment), checked_pressure(pressure)
        numbers, p = section._rows(P)
        found, beyond = section.law.path.strains_and_end(numbers, np.maximum(p, LOWEST))
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
        strains, how far each lies outside what the law knows, how far its walls have closed, and how far they
        are stretched, with exact derivatives by dimensions, pressure and modulus.

        Strains are those of `each` but for the last 1e-5 of them, which are computed as well here: values
        and derivatives belong together. Next to a limit load, where strains over the pressure turn vertical,
        derivatives are bounded; beyond it the leading strain counts as constant."""
        pressures, (numbers, pitch) = checked_pressure(pressure), self._numbers(segments)
        mu = np.array([s.material.mu for s in segments])
        P = np.broadcast_to(pressures, len(segments))
        found = [
            (rows, law.with_slopes(numbers[rows], P[rows] / mu[rows]))
            for rows, law in self._by_kind(segments)
        ]
        states = StatesWithSlopes.of(found, numbers[:, : len(SHAPE)], pitch, P, mu)
        return states.with_plates(segments, P)

    def _numbers(self, segments):
        """As numbers_of; without stiffening for a kind whose law has not learned what that does."""
        numbers, pitch = numbers_of(segments)
        for row, segment in zip(numbers, segments):
            if not self._kind(segment).stiffens:
                row[len(SHAPE) :] = 0
        return numbers, pitch

    def _by_kind(self, segments):
        """[(places of the segments of a kind, its KindLaw)]."""
        alike: dict[str, list[int]] = {}
        for i, segment in enumerate(segments):
            alike.setdefault(segment.kind, []).append(i)
        return [(rows, self._kind(segments[rows[0]])) for rows in alike.values()]

    def _at(self, segments: Sequence[Segment], pressures: np.ndarray) -> RodStrains:
        """RodStrains (n, m, 3) at pressures (n, m)."""
        (numbers, pitch), m = self._numbers(segments), pressures.shape[1]
        P = pressures / np.array([s.material.mu for s in segments])[:, None]
        q = np.empty((*P.shape, 6))
        for rows, law in self._by_kind(segments):
            q[rows] = law.free_strains(numbers[rows].repeat(m, axis=0), P[rows].ravel()).reshape(-1, m, 6)
        return RodStrains(q[..., :3], q[..., 3:] / pitch[:, None, None])

    def excess(self, segment: Segment, pressure: float) -> np.ndarray:
        """(r + 2,) how far a segment at a pressure (MPa) lies outside what the law was taught;
        KindLaw.excess."""
        numbers, _ = self._numbers([segment])
        return self._kind(segment).excess(numbers, np.array([pressure / segment.material.mu]))[0]

    @property
    def of_walls(self) -> str:
        """As of SegmentLaw."""
        return "the law's" if all(law.recorded for law in self.kinds.values()) else super().of_walls

    def walls(self, segment: Segment, pressure: float) -> tuple[float, float]:
        """As SegmentLaw.walls."""
        (numbers, _), p = self._numbers([segment]), np.array([pressure / segment.material.mu])
        law = self._kind(segment)
        if law.recorded is None:
            return super().walls(segment, pressure)
        return float(law.closed_on_the_way(numbers, p)[0]), float(law.recorded_at(numbers, p)[0][0])

    def half_width(self, segment: Segment, pressure: float) -> np.ndarray:
        """As SegmentLaw.half_width."""
        return self.of(segment).half_width(pressure)

    def doubts(self, segment: Segment, pressure: float | ArrayLike) -> tuple[str, ...]:
        """Reasons, as text, not to trust the law for a segment at a pressure (MPa) or several; () when there
        are none."""
        return self.of(segment).doubts(pressure)
