"""Distance between the walls that face each other across the gaps of a segment, or of the unit cell, where
one wall of a gap is the screw-periodic image of the other chamber's.

Signed, between the deformed surfaces: negative = overlap, a point of one wall lies behind the other wall's
surface.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pneunet.base import se3
from pneunet.geometry import tags
from pneunet.geometry.parameters import Manipulator
from pneunet.geometry.sections import rotation
from pneunet.hifi.fem import surface
from pneunet.hifi.fem.agreement import gathered
from pneunet.hifi.fem.facets import kind_of, subdivided
from pneunet.hifi.fem.mixed_field import MixedField

_TOLERANCE = 1e-6
_NEIGHBOURS = 8
#: flat triangles along a facet's edge; the sagitta of a wall's curvature between them is microns
_DIVISIONS = 4


#: walls are in contact where they push at each other with more than this part of the air's pressure
IN_CONTACT = 0.1


@dataclass(frozen=True)
class Wall:
    """A wall of a cell's gap. facets (n, k) of nodes; number (n,): of the rotation that takes each from its
    own place to the cell's, shift (n,): by how much it is moved along X1 then, mm."""

    problem: MixedField
    facets: np.ndarray
    number: np.ndarray
    shift: np.ndarray

    @property
    def images(self) -> np.ndarray:
        """(n, k) rotation and node in one number."""
        return self.number[:, None] * len(self.problem.nodes) + self.facets

    @property
    def turn(self) -> np.ndarray:
        """(n, 1, 3) diagonals of the rotations."""
        return self.problem.turns[self.number][:, None]

    @property
    def along(self) -> np.ndarray:
        """(n, k) of the nodes along X1 at rest, mm."""
        return self.problem.nodes[self.facets][..., 0] * self.turn[..., 0] + self.shift[:, None]

    def local(self, array: np.ndarray | None = None) -> np.ndarray:
        """(n, k, 3) of the nodes in the section frames at their X1, mm."""
        u = self.problem.displacement(array)[self.facets]
        return (self.problem.nodes[self.facets] * [0, 1, 1] + u) * self.turn


@dataclass(frozen=True)
class WallContact:
    """force: resultant (N) on a wall; area: undeformed, in contact (mm2); nearest, farthest: distances (mm)
    met there.

    gamma: stiffness of the medium that transmits it, over the body's; nan without one.
    """

    force: float = 0.0
    area: float = 0.0
    nearest: float = np.nan
    farthest: float = np.nan
    gamma: float = np.nan


class WallDistances:
    """Smallest distance in each gap of a manipulator; evaluated on rank 0 from gathered wall nodes."""

    def __init__(self, problem: MixedField, manipulator: Manipulator):
        self.problem, self.comm = problem, problem.mesh.comm
        facets = surface.facet_nodes(problem, tags.OUTER)
        self.facets, wall_of_facet, self.gaps = [], [], []
        wall = 0
        for i, (segment, start) in enumerate(zip(manipulator.segments, manipulator.starts)):
            corners = problem.nodes[facets[:, : kind_of(facets).corners]] @ rotation(
                segment
            )  # in its own axes
            half = segment.chamber_thickness / segment.sin / 2
            centres = start + segment.chamber_positions
            for side in segment.sides:
                along = corners[:, :, 0] - side * segment.cot * corners[:, :, 1]
                above = (side * corners[:, :, 2]).min(axis=1) > segment.core_top - _TOLERANCE
                for gap, (x0, x1) in enumerate(zip(centres[:-1] + half, centres[1:] - half), start=1):
                    for x in (x0, x1):
                        chosen = np.flatnonzero(above & (np.abs(along - x) < _TOLERANCE).all(axis=1))
                        self.facets.append(facets[chosen])
                        wall_of_facet += [wall] * len(chosen)
                        wall += 1
                    self.gaps.append((i + 1, "top" if side > 0 else "bottom", gap, segment.gap))
        self.facets = np.concatenate([facets[:0], *self.facets])
        #: (facets,) of this rank: walls 2 g and 2 g + 1 face each other across gap g
        self.wall_of_facet = np.array(wall_of_facet, int)
        self._wall = gathered(self.comm, self.wall_of_facet)

    def distances(self, array: np.ndarray | None = None) -> np.ndarray | None:
        """(gaps,) signed smallest distances in mm, on rank 0 (None elsewhere); inf where a gap has no
        walls."""
        each = self.at_nodes(array)
        if each is None:
            return None
        out = np.full(2 * len(self.gaps), np.inf)
        np.fmin.at(out, self._wall, each.min(axis=1, initial=np.inf))
        return out.reshape(-1, 2).min(axis=1)

    def at_nodes(self, array: np.ndarray | None = None) -> np.ndarray | None:
        """(facets of all walls, k) signed distances (mm) of their nodes from the wall that they face, on rank
        0 (None elsewhere)."""
        moved = self.problem.nodes + self.problem.displacement(array)
        positions = gathered(self.comm, moved[self.facets])
        if self.comm.rank != 0:
            return None
        out = np.full(positions.shape[:2], np.inf)
        order = np.argsort(self._wall, kind="stable")
        walls = np.split(order, np.searchsorted(self._wall[order], np.arange(1, 2 * len(self.gaps))))
        for wall in range(2 * len(self.gaps)):
            a, b = walls[wall], walls[wall ^ 1]
            if len(a) and len(b):
                points, inverse = np.unique(positions[a].reshape(-1, 3), axis=0, return_inverse=True)
                out[a] = distances_from(positions[b], points)[inverse.ravel()].reshape(len(a), -1)
        return out

    def node_numbers(self, numbers: np.ndarray) -> np.ndarray | None:
        """(facets of all walls, k) on rank 0 (None elsewhere) of `numbers` (all local nodes,), as `at_nodes`
        has them."""
        return gathered(self.comm, numbers[self.facets])


class CellWalls:
    """The walls of a cell's gaps, put together from the pieces that its cuts leave.

    gaps: a pair of walls for each side of the body, the second facing the first across the gap. Where the
    mesh is a part of the cell, half turns make the rest, and of gaps that they take to each other there is
    one.
    """

    def __init__(self, problem: MixedField):
        self.problem, s = problem, problem.segment
        facets = surface.facet_nodes(problem, tags.OUTER)
        self.gaps: list[tuple[Wall, Wall]] = []
        pieces = []
        for turn in problem.turns:
            corners = problem.nodes[facets[:, : kind_of(facets).corners]] * turn
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            pieces.append((corners, normal[:, 0] / np.linalg.norm(normal, axis=1)))
        for side in s.sides if len(problem.turns) < 4 else s.sides[:1]:
            found: list[list[np.ndarray]] = [[], []]
            for number, (corners, slope) in enumerate(pieces):
                above = (side * corners[:, :, 2]).min(axis=1) > s.core_top - _TOLERANCE
                along = (corners[:, :, 0] - side * s.cot * corners[:, :, 1]).mean(axis=1)
                for rows, sign in zip(found, (1, -1)):
                    for f in np.flatnonzero(above & (sign * slope > 0.1)):
                        rows.append(np.array([number, f, along[f]]))
            first, second = (np.array(rows) for rows in found)
            plane = first[0, 2]
            walls = []
            for rows, x in ((first, plane), (second, plane + s.gap / s.sin)):
                number, f = rows[:, :2].astype(int).T
                shift = s.pitch * np.round((x - rows[:, 2]) / s.pitch)
                walls.append(Wall(problem, facets[f], number, shift))
            self.gaps.append((walls[0], walls[1]))

    def positions(self, wall: Wall, array: np.ndarray | None = None) -> np.ndarray:
        """(n, k, 3) deformed positions of a wall's nodes, in the section frame at X1 = 0."""
        e, k = np.split(self.problem.strains.value, 2)
        screw = se3.exp_pose(np.concatenate([k, e]) * wall.along[..., None])
        return np.einsum("...ij,...j->...i", screw[..., :3, :3], wall.local(array)) + screw[..., :3, 3]

    def distance(self) -> float:
        """Smallest signed distance in mm; inf without chambers."""
        pairs = [[self.positions(wall) for wall in gap] for gap in self.gaps]
        return min((min(wall_distance(a, b), wall_distance(b, a)) for a, b in pairs), default=np.inf)

    def contact(self, pressure: float) -> WallContact:
        """WallContact of the gap with the largest force, `pressure` (MPa) being that of the air."""
        return max((self._contact(gap, pressure) for gap in self.gaps), key=lambda c: c.force)

    def _contact(self, gap, pressure):
        (wall, other), kind = gap, kind_of(gap[0].facets)
        e, k = np.split(self.problem.strains.value, 2)
        s = wall.along[..., None]
        rotation = se3.exp_pose(np.concatenate([k, e]) * s)[..., :3, :3]
        forces = self.problem.medium_forces()[wall.facets] * wall.turn
        forces = np.einsum("...ij,...j->...i", rotation, forces).reshape(-1, 3)
        # a node of a cut is there in several images, with a share of the force in each
        _, first, inverse = np.unique(
            np.round(np.c_[wall.images.ravel(), s.ravel()], 6), axis=0, return_index=True, return_inverse=True
        )
        forces, x = forces[first], self.positions(wall).reshape(-1, 3)[first]
        shares = surface.reference_areas(self.problem, wall.facets) @ kind.shape(kind.gauss)
        areas = np.bincount(inverse.ravel(), shares.ravel())
        total = np.linalg.norm(forces.sum(axis=0))
        touching = (areas > _TOLERANCE) & (
            forces @ forces.sum(axis=0) > max(total, 1e-300) * IN_CONTACT * pressure * areas
        )
        distances = distances_from(self.positions(other), x)[touching]
        nearest, farthest = (distances.min(), distances.max()) if len(distances) else (np.nan, np.nan)
        return WallContact(
            float(total),
            float(areas[touching].sum()),
            float(nearest),
            float(farthest),
            self.problem.medium.gamma,
        )


def wall_distance(points: np.ndarray, wall: np.ndarray) -> float:
    """Smallest signed distance (mm) of the nodes of facets `points` (n, k, 3) from the wall (m, k, 3)."""
    return float(distances_from(wall, np.unique(points.reshape(-1, 3), axis=0)).min())


def distances_from(wall: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) signed distances (mm) of points (n, 3) from a wall of quadratic facets (m, k, 3)."""
    triangles = subdivided(wall, _DIVISIONS)
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
    return np.where(behind, -distance, distance)


def closest_point(point: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Points (..., 3) of triangles (..., 3, 3) closest to points (..., 3); Ericson, Real-Time Collision
    Detection, 5.1.5."""
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
