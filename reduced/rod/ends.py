"""Where a segment's cells end: its free pieces, bare core, cells, bare core.

Every chamber counts with its whole pitch, half a gap at the ends included, and the ends of slanted one-sided
segments turn about z (docs/theory-reduced.md).
"""

from collections.abc import Sequence

import numpy as np

from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import ONE_SIDED, Segment


def free_pieces(
    segments: Sequence[Segment],
    free: RodStrains,
    counts: Sequence[float] | np.ndarray | None = None,
    end_effects: bool = True,
) -> tuple[np.ndarray, RodStrains]:
    """(lengths (3 n,) in mm, RodStrains (3 n, 3)) of n segments in a row: the three pieces of each, at its
    cells' free RodStrains (n, 3).

    counts (n,): of chambers, real numbers, by default the segments' own. end_effects: False for cells from
    outermost wall to outermost wall, between straight ends.
    """
    n, counts = len(segments), [s.chambers for s in segments] if counts is None else counts
    gaps = np.array([0.0 if end_effects else s.gap / s.sin for s in segments])
    lengths, e, k = np.empty((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    lengths[:, 0] = lengths[:, 2] = [s.end_wall for s in segments] + gaps / 2
    lengths[:, 1] = [count * s.pitch for s, count in zip(segments, counts)] - gaps
    e[:, :, 0], e[:, 1], k[:, 1] = 1.0, free.e, free.k
    if end_effects:
        k[:, 0, 2] = [_end_turn(*both) for both in zip(segments, free.vector.tolist())] / lengths[:, 0]
        k[:, 2, 2] = -k[:, 0, 2]
    return lengths.ravel(), RodStrains(e.reshape(-1, 3), k.reshape(-1, 3))


def _end_turn(segment: Segment, free: list[float]) -> float:
    """Turn (rad) about z of the section frame from the bare base end to the cells with free strains (6,); at
    the tip end back.

    A line at height z of the section runs at the slope e2 - k1 z to the frame's x axis. The bottom of a
    one-sided core carries no chambers, and slanted ones do not shear it: the line along it goes on straight
    from the bare end. (Measured, not derived.)
    """
    return free[3] * segment.core_bottom - free[1] if segment.kind == ONE_SIDED else 0.0
