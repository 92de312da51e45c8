"""From the strains of cells to the free pieces of a body: bare core, cells, bare core of each segment, in the
body's axes.

Every chamber counts with its whole pitch, half a gap at the ends included, and the ends of slanted one-sided
segments turn about z (docs/theory-reduced.md). A law answers in a segment's own axes; this is where its roll
turns strains. A passive segment is three thirds of bare core.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import ONE_SIDED, PASSIVE, Segment
from pneunet.geometry.sections import rotation
from pneunet.reduced.rod.laws import SegmentLaw


def cell_strains(
    law: SegmentLaw | Sequence[SegmentLaw], segments: Sequence[Segment], pressures: ArrayLike
) -> RodStrains:
    """Free RodStrains (n, 3) of n segments in their own axes, at a pressure (MPa) for all or (n,); law: one
    for all or one for each. Passive segments are at rest at any."""
    n = len(segments)
    laws = list(law) if isinstance(law, Sequence) else [law] * n
    pressures, q = np.broadcast_to(np.asarray(pressures, float), n), np.tile(np.eye(6)[0], (n, 1))
    for each in dict.fromkeys(laws):  # all at once
        rows = [i for i in range(n) if laws[i] is each and segments[i].kind != PASSIVE]
        if rows:
            q[rows] = each.each([segments[i] for i in rows], pressures[rows]).vector
    return RodStrains.of_vector(q)


def free_pieces(
    segments: Sequence[Segment],
    free: RodStrains,
    counts: Sequence[float] | np.ndarray | None = None,
    end_effects: bool = True,
) -> tuple[np.ndarray, RodStrains]:
    """(lengths (3 n,) in mm, RodStrains (3 n, 3) in the body's axes) of n segments in a row: the three pieces
    of each, at its cells' free RodStrains (n, 3) in its own axes.

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
    lengths[[s.kind == PASSIVE for s in segments]] = np.array(
        [s.plain_length / 3 for s in segments if s.kind == PASSIVE]
    ).reshape(-1, 1)
    turn = np.array([rotation(s) for s in segments])[:, None]
    e, k = ((turn @ part[..., None]).reshape(-1, 3) for part in (e, k))
    return lengths.ravel(), RodStrains(e, k)


def _end_turn(segment: Segment, free: list[float]) -> float:
    """Turn (rad) about z of the section frame from the bare base end to the cells with free strains (6,); at
    the tip end back.

    A line at height z of the section runs at the slope e2 - k1 z to the frame's x axis. The bottom of a
    one-sided core carries no chambers, and slanted ones do not shear it: the line along it goes on straight
    from the bare end. (Measured, not derived.)
    """
    return free[3] * segment.core_bottom - free[1] if segment.kind == ONE_SIDED else 0.0
