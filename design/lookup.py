"""Lookup table for the first guess (the paper's Fig. 8f): what each kind of segment does over angle, height, pressure.

All segments share one pressure, so the table is read pressure by pressure: at each, every piece takes the angle and
chamber height whose deformed active length turns most nearly as the piece asks, in rad.
"""

from dataclasses import dataclass, replace

import numpy as np

from base.errors import ConvergenceError
from geometry.parameters import TWISTING as TWISTING_KIND

HEIGHT_WEIGHT = 0.1  # rad per mm away from the start height: decides only between equals


@dataclass(frozen=True)
class Guess:
    """One entry read from the table for every piece: `segments` (chambers 1), real-valued `counts`, pressure in MPa."""

    pressure: float
    segments: tuple
    counts: tuple
    misfit: float


def responses(segment, pressures, law):
    """Stretch, curvature (1/mm) and twist (rad/mm) per deformed length, (3, m), at pressures (m,) in MPa; nan beyond a
    limit load."""
    out = np.full((3, len(pressures)), np.nan)
    for j, pressure in enumerate(pressures):
        try:
            strains = law.strains(segment, float(pressure))
        except ConvergenceError:
            break
        out[:, j] = strains.stretch, strains.frenet_curvature, _twist(segment, strains)
    return out


def _twist(segment, strains):
    return strains.twist_per_deformed_length if segment.kind == TWISTING_KIND else strains.frenet_torsion


def active_length(segment, count):
    """Undeformed active length, mm, of a real number of chambers: `Segment.active_length` between whole ones."""
    return count * segment.pitch - segment.gap / segment.sin


def count_for(segment, stretch, deformed_length):
    """Real number of chambers (>= 1) that makes a segment as long as asked when its active part is stretched."""
    active = (deformed_length - 2 * segment.end_length) / stretch
    return max(1.0, (active + segment.gap / segment.sin) / segment.pitch)


def first_guesses(pieces, prototypes, angles, heights, pressures, law):
    """`Guess`es, best first, one for every pressure at which each piece has an entry.

    pieces: `Extracted`; prototypes: a Segment for each with its start dimensions; angles (deg) and heights (mm): the
    grid of each piece; pressures: increasing, MPa.
    """
    options = [_options(piece, prototype, a, h, pressures, law) for piece, prototype, a, h in zip(pieces, prototypes, angles, heights)]
    guesses = []
    for j, pressure in enumerate(pressures):
        best = [min(entries[j], key=lambda entry: entry[0], default=None) for entries in options]
        if None not in best:
            misfit = sum(entry[0] for entry in best)
            guesses.append(Guess(float(pressure), tuple(b[1] for b in best), tuple(b[2] for b in best), misfit))
    return sorted(guesses, key=lambda guess: guess.misfit)


def _options(piece, prototype, angles, heights, pressures, law):
    """For every pressure the list of (misfit, segment, count) of one piece."""
    entries = [[] for _ in pressures]
    for angle in angles:
        for height in heights:
            segment = replace(prototype, angle=float(angle), chamber_height=float(height))
            for j, (stretch, curvature, twist) in enumerate(responses(segment, pressures, law).T):
                if not np.isfinite(stretch):
                    continue
                count = count_for(segment, stretch, piece.length)
                active = stretch * active_length(segment, count)
                turned = active * np.array([curvature, twist])
                asked = piece.length * np.array([piece.curvature, piece.twist])
                misfit = np.sum((turned - asked) ** 2) + (HEIGHT_WEIGHT * (height - prototype.chamber_height)) ** 2
                entries[j].append((misfit, segment, count))
    return entries
