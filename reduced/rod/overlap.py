"""Does a predicted body run through itself? A rod's centreline knows nothing of that."""

import numpy as np
from scipy.spatial import cKDTree

from pneunet.geometry.parameters import Manipulator
from pneunet.geometry.sections import whole_section
from pneunet.reduced.rod.centreline import Centreline


def overlap_doubts(manipulator: Manipulator, line: Centreline) -> tuple[str, ...]:
    """One line of text where parts of the body that are far apart along it share the same space, none
    otherwise.

    Far apart means by more than the diagonal of the largest section. Two such sections overlap where their
    centres are nearer than both reach towards each other, each as a rectangle in its own frame.
    """
    segments = manipulator.segments
    extents = np.array([whole_section(s) for s in segments])
    owner = np.clip(np.searchsorted(manipulator.starts, line.s, side="right") - 1, 0, len(segments) - 1)
    diagonal = 2 * np.linalg.norm(abs(extents).max(axis=2), axis=1).max()
    pairs = cKDTree(line.points).query_pairs(diagonal, output_type="ndarray")
    pairs = pairs[abs(np.diff(line.s[pairs], axis=1)[:, 0]) > diagonal]
    between = line.points[pairs[:, 1]] - line.points[pairs[:, 0]]
    distance = np.linalg.norm(between, axis=1)
    room = distance**2
    for end, sign in ((0, 1), (1, -1)):
        at = pairs[:, end]
        towards = sign * np.einsum("nij,ni->nj", line.poses[at, :3, 1:3], between)
        low, high = np.moveaxis(extents[owner[at]], 2, 0)
        room -= (np.where(towards > 0, high, low) * towards).sum(axis=1)
    if not (room < 0).any():
        return ()
    nearest = np.flatnonzero(room < 0)[np.argmin(distance[room < 0])]
    low, high = sorted(line.s[pairs[nearest]])
    return (
        f"the body runs through itself: its parts at {low:.0f} and {high:.0f} mm along it come within"
        f" {distance[nearest]:.1f} mm, nearer than it is thick",
    )
