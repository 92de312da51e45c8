"""Lookup table for the first guess (the paper's Fig. 8f): what each kind of segment does over angle, height,
pressure.

All segments share one pressure, so the table is read pressure by pressure: at each, every piece takes the
angle and chamber height whose deformed active length turns most nearly as the piece asks, in rad.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneunet.base.strains import RodStrains
from pneunet.design.target.extraction import Extracted
from pneunet.geometry.parameters import TWISTING, Segment
from pneunet.reduced.rod.laws import SegmentLaw

HEIGHT_WEIGHT = 0.1  # rad per mm away from the start height: decides only between equals
OUTSIDE = 1.0  # rad per width of what the law knows that an entry lies outside of it


@dataclass(frozen=True)
class Guess:
    """One entry read from the table for every piece: `segments` (chambers 1), real-valued `counts`, pressure
    in MPa."""

    pressure: float
    segments: tuple[Segment, ...]
    counts: tuple[float, ...]
    misfit: float


def responses(strains: RodStrains, twisting: bool) -> np.ndarray:
    """Stretch, curvature (1/mm) and twist (rad/mm) per deformed length, (3, ...), of RodStrains (..., 3)."""
    twist = strains.twist_per_deformed_length if twisting else strains.frenet_torsion
    return np.stack([strains.stretch, strains.frenet_curvature, twist])


def count_for(segment: Segment, stretch: float, deformed_length: float) -> float:
    """Real number of chambers (>= 1) that makes a segment as long as asked when its active part is
    stretched."""
    return max(1.0, (deformed_length - 2 * segment.end_wall) / stretch / segment.pitch)


def first_guesses(
    pieces: Sequence[Extracted],
    prototypes: Sequence[Segment],
    angles: Sequence[np.ndarray],
    heights: Sequence[np.ndarray],
    pressures: np.ndarray,
    law: SegmentLaw,
) -> list[Guess]:
    """`Guess`es, best first, one for every pressure at which each piece has an entry.

    prototypes: a Segment for each with its start dimensions; angles (deg) and heights
    (mm): the grid of each piece; pressures: increasing, MPa.
    """
    options = [
        _options(piece, prototype, a, h, pressures, law)
        for piece, prototype, a, h in zip(pieces, prototypes, angles, heights)
    ]
    guesses = []
    for j, pressure in enumerate(pressures):
        if all(entries[j] for entries in options):
            best = [min(entries[j], key=lambda entry: entry[0]) for entries in options]
            misfits, segments, counts = zip(*best)
            guesses.append(Guess(float(pressure), segments, counts, sum(misfits)))
    return sorted(guesses, key=lambda guess: guess.misfit)


def _options(piece, prototype, angles, heights, pressures, law):
    """For every pressure the list of (misfit, segment, count) of one piece."""
    segments = [replace(prototype, angle=float(a), chamber_height=float(h)) for a in angles for h in heights]
    found = responses(law.table(segments, pressures), prototype.kind == TWISTING)
    entries: list[list[tuple[float, Segment, float]]] = [[] for _ in pressures]
    asked = piece.length * np.array([piece.curvature, piece.twist])
    for segment, rows in zip(segments, np.moveaxis(found, 0, -1)):
        away = (HEIGHT_WEIGHT * (segment.chamber_height - prototype.chamber_height)) ** 2
        for pressure, options, (stretch, *rates) in zip(pressures, entries, rows):
            if not np.isfinite(stretch):
                continue
            count = count_for(segment, stretch, piece.length)
            turned = stretch * count * segment.pitch * np.array(rates)
            outside = np.sum((OUTSIDE * law.excess(segment, pressure)) ** 2)
            options.append((np.sum((turned - asked) ** 2) + away + outside, segment, count))
    return entries
