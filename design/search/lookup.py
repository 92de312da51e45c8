"""Lookup table for the first guess (the paper's Fig. 8f): what each kind of segment does over angle, height,
pressure.

Segments share pressures, so the table is read pressure by pressure: at each, every piece takes the angle and
chamber height whose deformed active length turns most nearly as the piece asks, in rad.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneunet.base.strains import RodStrains
from pneunet.design.target.extraction import Extracted
from pneunet.geometry.parameters import PASSIVE, TWISTING, Segment
from pneunet.reduced.rod.laws import SegmentLaw

HEIGHT_WEIGHT = 0.1  # rad per mm away from the start height: decides only between equals


@dataclass(frozen=True)
class Guess:
    """One entry read from the table for every piece: `segments` (chambers 1), real-valued `counts`, pressures
    in MPa of each."""

    pressures: tuple[float, ...]
    segments: tuple[Segment, ...]
    counts: tuple[float, ...]
    misfit: float

    @property
    def pressure(self) -> float:
        """The largest, MPa."""
        return max(self.pressures)


def responses(strains: RodStrains, twisting: bool) -> np.ndarray:
    """Stretch, curvature (1/mm) and twist (rad/mm) per deformed length, (3, ...), of RodStrains (..., 3)."""
    twist = strains.twist_per_deformed_length if twisting else strains.frenet_torsion
    return np.stack([strains.stretch, strains.frenet_curvature, twist])


def count_for(segment: Segment, stretch: float | np.ndarray, deformed_length: float) -> np.ndarray:
    """Real number of chambers (>= 1) that makes a segment as long as asked when its active part is
    stretched."""
    return np.maximum(1.0, (deformed_length - 2 * segment.end_wall) / stretch / segment.pitch)


def first_guesses(
    pieces: Sequence[Extracted],
    prototypes: Sequence[Segment],
    angles: Sequence[np.ndarray],
    heights: Sequence[np.ndarray],
    pressures: np.ndarray,
    law: SegmentLaw,
) -> list[Guess]:
    """`Guess`es, best first, one for every row of pressures at which each piece has an entry.

    prototypes: a Segment for each with its start dimensions; angles (deg) and heights (mm): the grid of each
    piece; pressures (m, pieces): increasing in m, MPa.
    """
    tables: dict[tuple, tuple[list[Segment], np.ndarray]] = {}
    best = []
    for piece, prototype, a, h, own in zip(pieces, prototypes, angles, heights, pressures.T):
        if prototype.kind == PASSIVE:
            best.append([(0.0, prototype, 0.0)] * len(pressures))
            continue
        key = prototype, tuple(a), tuple(h), tuple(own)
        if key not in tables:
            segments = [replace(prototype, angle=float(x), chamber_height=float(y)) for x in a for y in h]
            tables[key] = segments, responses(law.table(segments, own), prototype.kind == TWISTING)
        best.append(_nearest(piece, prototype, *tables[key]))
    guesses = []
    for j, row in enumerate(pressures.tolist()):
        misfits, chosen, counts = zip(*(entries[j] for entries in best))
        if np.isfinite(sum(misfits)):
            guesses.append(Guess(tuple(row), chosen, counts, float(sum(misfits))))
    return sorted(guesses, key=lambda guess: guess.misfit)


def _nearest(piece, prototype, segments, found):
    """[(misfit, segment, count)] of the best entry at every pressure; misfit inf where there is none."""
    stretch, *rates = found
    counts = np.array([count_for(s, row, piece.length) for s, row in zip(segments, stretch)])
    reach = stretch * counts * np.array([s.pitch for s in segments])[:, None]
    asked = piece.length * np.array([piece.curvature, piece.twist])
    away = HEIGHT_WEIGHT * np.array([s.chamber_height - prototype.chamber_height for s in segments])
    misfit = (reach * rates[0] - asked[0]) ** 2 + (reach * rates[1] - asked[1]) ** 2 + away[:, None] ** 2
    misfit = np.where(np.isfinite(misfit), misfit, np.inf)
    rows = misfit.argmin(axis=0)
    return [(misfit[i, j], segments[i], float(counts[i, j])) for j, i in enumerate(rows)]
