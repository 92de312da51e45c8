"""Where a segment's cells end: its free pieces, bare core, cells, bare core.

Every chamber counts with its whole pitch, half a gap at the ends included, and the ends of slanted one-sided
segments turn about z (docs/theory-reduced.md).
"""

import numpy as np

from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import ONE_SIDED


def end_turn(segment, free):
    """Turn (rad) about z of the section frame from the bare base end to the active part with free strains
    (6,); at the tip end back.

    A line at height z of the section runs at the slope e2 - k1 z to the frame's x axis. The bottom of a
    one-sided core carries no chambers, and slanted ones do not shear it: the line along it goes on straight
    from the bare end. (Measured, not derived.)
    """
    return float(free[3] * segment.core_bottom - free[1]) if segment.kind == ONE_SIDED else 0.0


def free_manipulator(segments, strains, counts):
    """(lengths (3 n,) in mm, RodStrains (3 n, 3)) of n segments in a row: the pieces of each, at its cells'
    free RodStrains (n, 3); counts: of chambers, real numbers."""
    n, bare = len(segments), [s.end_wall for s in segments]
    lengths, e, k = np.empty((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    lengths[:, 0] = lengths[:, 2] = bare
    lengths[:, 1] = [count * s.pitch for s, count in zip(segments, counts)]
    e[:, :, 0], e[:, 1], k[:, 1] = 1.0, strains.e, strains.k
    free = np.hstack([strains.e, strains.k]).tolist()
    k[:, 0, 2] = [end_turn(*each) / length for *each, length in zip(segments, free, bare)]
    k[:, 2, 2] = -k[:, 0, 2]
    return lengths.ravel(), RodStrains(e.reshape(-1, 3), k.reshape(-1, 3))
