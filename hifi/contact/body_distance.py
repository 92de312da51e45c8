"""Distance between parts of a body that are far apart along it: do its coils, or its segments, run into each
other?

Far apart means, along the undeformed axis, by more than the larger of a pitch and the diameter of the body:
such parts can meet only where the body comes back to itself. Between them a node's distance is that from the
deformed quadratic surface of the others; it is negative when the node lies inside their solid, by the winding
number of their surface. As long as they are further apart than half the diameter, the distance of nodes from
nodes is taken.

The body is cut into slabs across its axis, so that a pair of them is far apart or not as a whole, and pairs
are looked at in order of the distance of their bounding boxes: a straight body costs little more than its
node trees.
"""

import numpy as np
from scipy.spatial import cKDTree

from pneunet.geometry import tags
from pneunet.geometry.parameters import Manipulator
from pneunet.hifi.contact.walls import distances_from
from pneunet.hifi.fem import surface
from pneunet.hifi.fem.agreement import gathered
from pneunet.hifi.fem.facets import kind_of, subdivided
from pneunet.hifi.fem.mixed_field import MixedField

#: slabs in the length that counts as far apart
_SLABS = 8
#: points whose winding number is computed at once; the deepest come first and the first that is inside ends
#: the search
_AT_ONCE = 32
#: mm and slabs; planes of nodes stand where slabs begin, and must not change sides with the rounding of
#: another number of ranks
_ROUNDING = 1e-6


class BodyDistance:
    """Smallest distance between far parts of a manipulator; evaluated on rank 0 from gathered outer-surface
    nodes.

    apart: mm along the undeformed axis from which on two points count as far apart (a quarter more at most).
    """

    def __init__(self, problem: MixedField, manipulator: Manipulator):
        self.problem, self.comm = problem, problem.mesh.comm
        self.diameter = max(
            float(np.hypot(s.width, s.chamber_top - s.chamber_bottom)) for s in manipulator.segments
        )
        self.apart = max(self.diameter, *(s.pitch for s in manipulator.segments if s.chambers))
        self._local = surface.facet_nodes(problem, tags.OUTER, tags.TIP, tags.BASE)
        X = gathered(self.comm, problem.nodes[self._local])
        if self.comm.rank == 0:
            self._arrange(X)

    def _arrange(self, X):
        """Nodes of the gathered facets, each once, and their slabs."""
        _, self._first, self._facets = np.unique(
            np.round(X.reshape(-1, 3), 6), axis=0, return_index=True, return_inverse=True
        )
        self._facets = self._facets.reshape(X.shape[:2])
        x = X.reshape(-1, 3)[self._first, 0]
        number = np.floor(_SLABS * x / self.apart + _ROUNDING)
        self._slabs = [np.flatnonzero(number == n) for n in np.unique(number)]
        self._low, self._high = (np.array([f(x[slab]) for slab in self._slabs]) for f in (np.min, np.max))
        self._facet_low, self._facet_high = x[self._facets].min(axis=1), x[self._facets].max(axis=1)
        self._pairs = np.argwhere(self._low[None, :] - self._high[:, None] >= self.apart - _ROUNDING)

    def smallest(self, array: np.ndarray | None = None) -> float | None:
        """Signed distance in mm, on rank 0 (None elsewhere); inf for a body too short to have far parts."""
        moved = self.problem.nodes + self.problem.displacement(array)
        positions = gathered(self.comm, moved[self._local])
        return None if self.comm.rank else self._smallest(positions.reshape(-1, 3)[self._first])

    def _smallest(self, x):
        if not len(self._pairs):
            return np.inf
        trees = [cKDTree(x[slab]) for slab in self._slabs]
        low, high = (np.array([f(x[slab], axis=0) for slab in self._slabs]) for f in (np.min, np.max))
        i, j = self._pairs.T
        between = np.linalg.norm(np.maximum(0, np.maximum(low[j] - high[i], low[i] - high[j])), axis=1)
        order = np.argsort(between, kind="stable")
        nodes = np.inf
        for n in order:
            if between[n] > nodes:
                break
            nodes = min(nodes, trees[i[n]].query(x[self._slabs[j[n]]])[0].min())
        if nodes > self.diameter / 2:
            return float(nodes)
        # no point of a facet is further than half its longest edge from one of its nodes
        facets = x[self._facets]
        corners = kind_of(facets).corners
        ring, middles = facets[:, :corners], facets[:, corners : 2 * corners]
        reach = max(np.linalg.norm(end - middles, axis=-1).max() for end in (ring, np.roll(ring, -1, axis=1)))
        open_ = nodes > 2 * reach
        within = nodes + reach if open_ else max(self.diameter / 2, 3 * reach)
        near = [[] for _ in self._slabs]
        for n in order[between[order] <= within]:
            near[i[n]].append(j[n])
            near[j[n]].append(i[n])
        best = np.inf
        for a, others in enumerate(near):
            if others:
                best = min(
                    best,
                    self._from(
                        a, np.concatenate([self._slabs[b] for b in others]), x, within, reach, open_, best
                    ),
                )
        return float(best)

    def _from(self, a, others, x, within, reach, open_, best):
        """Smallest distance of nodes of slab a, of those that matter, from the surface of the far parts that
        holds the nodes `others`; of depths only those that beat `best` matter."""
        points = self._slabs[a]
        points = points[cKDTree(x[others]).query(x[points], distance_upper_bound=within)[0] <= within]
        if not len(points):
            return np.inf
        others = others[
            cKDTree(x[points]).query(x[others], distance_upper_bound=within + 2 * reach)[0]
            <= within + 2 * reach
        ]
        far = (self._facet_low - self._high[a] >= self.apart - _ROUNDING) | (
            self._low[a] - self._facet_high >= self.apart - _ROUNDING
        )
        wall = far & np.isin(self._facets, others).any(axis=1)
        if not wall.any():
            return np.inf
        distances = distances_from(x[self._facets[wall]], x[points])
        clear = np.abs(distances)
        if not open_:
            behind = np.flatnonzero((distances < min(best, 0)) & (clear < self.diameter / 2))
            behind = behind[np.argsort(distances[behind], kind="stable")]
            solid = np.concatenate(
                [subdivided(x[self._facets[wall]], 4), subdivided(x[self._facets[far & ~wall]], 1)]
            )
            for chunk in np.split(behind, range(_AT_ONCE, len(behind), _AT_ONCE)):
                inside = chunk[np.abs(winding_numbers(x[points[chunk]], solid)) > 0.5]
                if len(inside):
                    return distances[inside].min()
        return clear.min()


def winding_numbers(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) of points (n, 3) by oriented triangles (m, 3, 3): 1 inside a closed surface, 0 outside, between
    them near a hole.

    Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983): solid angles; Jacobson et al., ACM Trans.
    Graph. 32 (2013): over 4 pi they tell inside from outside even where the surface is open, as that of the
    far parts is at its cuts.
    """
    a, b, c = np.moveaxis(triangles[None] - points[:, None, None], 2, 0)
    ab, bc, ca, aa, bb, cc = (
        np.einsum("pti,pti->pt", *two) for two in ((a, b), (b, c), (c, a), (a, a), (b, b), (c, c))
    )
    la, lb, lc = np.sqrt(aa), np.sqrt(bb), np.sqrt(cc)
    volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
    return np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1) / (2 * np.pi)
