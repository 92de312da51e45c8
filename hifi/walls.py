"""Smallest distance between the walls that face each other across the gaps of a segment."""

import numpy as np
from scipy.spatial import cKDTree

from geometry import cad
from hifi import surface

_TOLERANCE = 1e-6
_NEIGHBOURS = 8


class WallDistances:
    """Signed distances between facing chamber walls; evaluated on rank 0 from gathered wall nodes.

    Negative = overlap: a point of one wall lies behind the other wall's surface.
    """

    def __init__(self, problem, manipulator):
        self.problem, self.comm = problem, problem.mesh.comm
        facets = surface.facet_nodes(problem, cad.OUTER)
        corners = problem.nodes[facets[:, :3]]
        self._local, wall_of_facet, self.gaps = [], [], []
        wall = 0
        for i, (segment, start) in enumerate(zip(manipulator.segments, manipulator.starts)):
            half = segment.chamber_thickness / segment.sin / 2
            centres = start + segment.chamber_positions
            for side in segment.sides:
                along = corners[:, :, 0] - side * segment.cot * corners[:, :, 1]
                above = (side * corners[:, :, 2]).min(axis=1) > segment.core_top - _TOLERANCE
                for gap, (x0, x1) in enumerate(zip(centres[:-1] + half, centres[1:] - half), start=1):
                    for x in (x0, x1):
                        chosen = np.flatnonzero(above & (np.abs(along - x) < _TOLERANCE).all(axis=1))
                        self._local.append(facets[chosen])
                        wall_of_facet += [wall] * len(chosen)
                        wall += 1
                    self.gaps.append((i + 1, "top" if side > 0 else "bottom", gap, segment.gap))
        self._local = np.concatenate(self._local) if self._local else np.zeros((0, 6), int)
        gathered = self.comm.gather(np.array(wall_of_facet, int), root=0)
        self._wall = np.concatenate(gathered) if self.comm.rank == 0 else None
        self.reference = self._gather(problem.nodes)

    def _gather(self, positions):
        """(facets of all ranks, 6, 3) on rank 0, None elsewhere."""
        parts = self.comm.gather(positions[self._local], root=0)
        return np.concatenate(parts) if self.comm.rank == 0 else None

    def distances(self, array=None):
        """(gaps,) signed smallest distances in mm, on rank 0 (None elsewhere); inf where a gap has no walls."""
        positions = self._gather(self.problem.nodes + self.problem.displacement(array))
        if self.comm.rank != 0:
            return None
        out = np.full(len(self.gaps), np.inf)
        order = np.argsort(self._wall, kind="stable")
        bounds = np.searchsorted(self._wall[order], np.arange(2 * len(self.gaps) + 1))
        for g in range(len(self.gaps)):
            a, b = (positions[order[bounds[w] : bounds[w + 1]]] for w in (2 * g, 2 * g + 1))
            if len(a) and len(b):
                out[g] = min(wall_distance(a, b), wall_distance(b, a))
        return out


def wall_distance(points, wall):
    """Smallest signed distance (mm) of the nodes of quadratic facets `points` (n, 6, 3) from the wall (m, 6, 3)."""
    triangles = wall.reshape(-1, 3)[surface.split(np.arange(6 * len(wall)).reshape(-1, 6))]
    points = np.unique(points.reshape(-1, 3), axis=0)
    count = min(_NEIGHBOURS, len(triangles))
    near = cKDTree(triangles.mean(axis=1)).query(points, k=count)[1].reshape(len(points), count)
    candidates = triangles[near]
    closest = closest_point(points[:, None], candidates)
    offset = points[:, None] - closest
    distance = np.linalg.norm(offset, axis=-1)
    best = distance.argmin(axis=1)
    rows = np.arange(len(points))
    distance, offset, triangle = distance[rows, best], offset[rows, best], candidates[rows, best]
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    # behind the wall only when the wall's interior is what is closest; past its rim the sign has no meaning
    behind = np.einsum("ni,ni->n", offset, normal) < -0.9 * distance
    return float(np.where(behind, -distance, distance).min())


def closest_point(point, triangle):
    """Points (..., 3) of triangles (..., 3, 3) closest to points (..., 3); Ericson, Real-Time Collision Detection, 5.1.5."""
    a, b, c = triangle[..., 0, :], triangle[..., 1, :], triangle[..., 2, :]
    ab, ac = b - a, c - a
    d1, d2 = _dot(ab, point - a), _dot(ac, point - a)
    d3, d4 = _dot(ab, point - b), _dot(ac, point - b)
    d5, d6 = _dot(ab, point - c), _dot(ac, point - c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    with np.errstate(divide="ignore", invalid="ignore"):
        total = va + vb + vc
        v, w = vb / total, vc / total
        on_ab, on_ac = d1 / (d1 - d3), d2 / (d2 - d6)
        on_bc = (d4 - d3) / ((d4 - d3) + (d5 - d6))
    regions = [
        ((d1 <= 0) & (d2 <= 0), 0.0, 0.0),
        ((d3 >= 0) & (d4 <= d3), 1.0, 0.0),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), on_ab, 0.0),
        ((d6 >= 0) & (d5 <= d6), 0.0, 1.0),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), 0.0, on_ac),
        ((va <= 0) & (d4 >= d3) & (d5 >= d6), 1 - on_bc, on_bc),
    ]
    v = np.select([r[0] for r in regions], [np.broadcast_to(r[1], v.shape) for r in regions], v)
    w = np.select([r[0] for r in regions], [np.broadcast_to(r[2], w.shape) for r in regions], w)
    return a + v[..., None] * ab + w[..., None] * ac


def _dot(a, b):
    return np.einsum("...i,...i->...", a, b)
