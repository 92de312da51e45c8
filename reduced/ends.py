"""Where a segment's cells end: its free pieces, bare core, cells, bare core.

Every chamber counts with its whole pitch, half a gap at the ends included, and the ends of slanted one-sided segments turn about z
(docs/theory-reduced.md).
"""

import numpy as np

from base.strains import RodStrains
from geometry.parameters import ONE_SIDED


def end_turn(segment, free):
    """Turn (rad) about z of the section frame from the bare base end to the active part with free strains (6,); at the tip end back.

    A line at height z of the section runs at the slope e2 - k1 z to the frame's x axis. The bottom of a one-sided core carries no
    chambers, and slanted ones do not shear it: the line along it goes on straight from the bare end. (Measured, not derived.)
    """
    return float(free[3] * segment.core_bottom - free[1]) if segment.kind == ONE_SIDED else 0.0


def free_pieces(segment, strains, count=None):
    """(lengths (3,) in mm, e (3, 3), k (3, 3)) of a segment's pieces at its cells' free RodStrains; count: chambers, a real number."""
    count = segment.chambers if count is None else count
    lengths = [segment.end_wall, count * segment.pitch, segment.end_wall]
    bent = end_turn(segment, np.concatenate([strains.e, strains.k])) / segment.end_wall
    rest = RodStrains.unstrained()
    return lengths, [rest.e, strains.e, rest.e], [[0.0, 0.0, bent], strains.k, [0.0, 0.0, -bent]]


def free_manipulator(segments, strains, counts):
    """(lengths (3 n,), RodStrains (3 n, 3)) of n segments in a row."""
    lengths, e, k = (sum(parts, []) for parts in zip(*(free_pieces(*one) for one in zip(segments, strains, counts))))
    return lengths, RodStrains(e, k)
