"""Facets of a body's surface as quadratic triangles: the samples every geometric measure is made of."""

import numpy as np

from pneunet.hifi.fem.mixed_field import MixedField

#: edges of dolfinx's reference tetrahedron, in the order of its P2 edge nodes 4..9
EDGES = [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]
#: local P2 nodes of the facet opposite each vertex: three corners, then the mid-edges (01, 12, 20)
FACETS = []
for _opposite in range(4):
    _corners = [v for v in range(4) if v != _opposite]
    _edges = [tuple(sorted((_corners[i], _corners[(i + 1) % 3]))) for i in range(3)]
    FACETS.append(_corners + [4 + EDGES.index(e) for e in _edges])


def facet_nodes(problem: MixedField, *tags: int) -> np.ndarray:
    """(facets, 6) displacement nodes of the tagged facets on this rank, corners ordered so that normals point
    out.

    A facet between two cells is seen from that with the lower tag: the body's. It is reported by the rank
    that owns its cell, so that sums over ranks count it once.
    """
    topology = problem.mesh.topology
    topology.create_connectivity(2, 3)
    topology.create_connectivity(3, 2)
    to_cell, to_facet = topology.connectivity(2, 3), topology.connectivity(3, 2)
    owned_cells = topology.index_map(3).size_local
    dofmap = problem.displacement_space.dofmap
    tags_of_cells = np.zeros(owned_cells + topology.index_map(3).num_ghosts, int)
    tags_of_cells[problem.cell_tags.indices] = problem.cell_tags.values
    rows = []
    for tag in tags:
        for facet in problem.facet_tags.find(tag):
            cell = min(to_cell.links(facet), key=tags_of_cells.__getitem__)
            if cell >= owned_cells:
                continue
            local = int(np.flatnonzero(to_facet.links(cell) == facet)[0])
            nodes = dofmap.cell_dofs(cell)
            row = nodes[FACETS[local]]
            a, b, c = problem.nodes[row[:3]]
            inside = problem.nodes[nodes[local]]
            if np.dot(np.cross(b - a, c - a), inside - a) > 0:
                row = row[[0, 2, 1, 5, 4, 3]]
            rows.append(row)
    return np.array(rows, dtype=int).reshape(-1, 6)


def reference_areas(problem: MixedField, facets: np.ndarray) -> np.ndarray:
    """(facets,) undeformed areas in mm^2."""
    a, b, c = (problem.nodes[facets[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


# degree-4 rule on the triangle (Dunavant 1985): exact for P2 shape functions times linear coordinates
_A4, _B4 = 0.445948490915965, 0.091576213509771
_BARYCENTRIC = np.array(
    [[1 - 2 * a if i == j else a for i in range(3)] for a in (_A4, _B4) for j in range(3)]
)
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


def p2_shape(barycentric: np.ndarray) -> np.ndarray:
    """(..., 6) quadratic shape functions at barycentric coordinates (..., 3); corners, then mid-edges 01, 12,
    20."""
    a, b, c = np.moveaxis(barycentric, -1, 0)
    return np.stack(
        [a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a], axis=-1
    )


def subdivision(divisions: int) -> np.ndarray:
    """(divisions^2, 3, 6) quadratic shape functions at the corners of a facet's flat parts, of its own
    orientation."""
    n = divisions
    up = [[(i, j), (i + 1, j), (i, j + 1)] for i in range(n) for j in range(n - i)]
    down = [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i in range(n) for j in range(n - i - 1)]
    corners = np.array(up + down) / n
    return p2_shape(np.concatenate([1 - corners.sum(axis=-1, keepdims=True), corners], axis=-1))


def subdivided(facets: np.ndarray, divisions: int) -> np.ndarray:
    """(facets divisions^2, 3, 3) flat triangles between points of quadratic facets (facets, 6, 3), same
    orientation."""
    return np.einsum("tcn,fni->ftci", subdivision(divisions), facets).reshape(-1, 3, 3)


def _clip(polygon, values, keep_below):
    """The part of a barycentric polygon (n, 3) where corner `values` (3,), taken linearly, are <= 0 (or >=
    0)."""
    sign = 1.0 if keep_below else -1.0
    out = []
    for p, q in zip(polygon, np.roll(polygon, -1, axis=0)):
        fp, fq = sign * p @ values, sign * q @ values
        if fp <= 0:
            out.append(p)
        if fp * fq < 0:
            out.append(p + fp / (fp - fq) * (q - p))
    return np.array(out).reshape(-1, 3)


class SlabIntegral:
    """Exact integrals over the part of a surface with low <= X1 <= high, as weights on its nodes.

    area (mm2); centre (3,) = int X dA; nodes (n,); weights (n,) = int N dA; first (n, 3) = int X N dA.
    """

    def __init__(self, problem: MixedField, facets: np.ndarray, low: float = -np.inf, high: float = np.inf):
        X1 = problem.nodes[facets[:, :3], 0]
        facets = facets[(X1.max(axis=1) > low) & (X1.min(axis=1) < high)]
        corners = problem.nodes[facets[:, :3]]
        areas = reference_areas(problem, facets)
        nodes, inverse = np.unique(facets, return_inverse=True)
        inverse = inverse.reshape(facets.shape)
        self.nodes, self.area, self.centre = nodes, 0.0, np.zeros(3)
        self.weights, self.first = np.zeros(len(nodes)), np.zeros((len(nodes), 3))
        for row, triangle, area in zip(inverse, corners, areas):
            polygon = np.eye(3)
            if triangle[:, 0].min() < low:
                polygon = _clip(polygon, triangle[:, 0] - low, keep_below=False)
            if triangle[:, 0].max() > high:
                polygon = _clip(polygon, triangle[:, 0] - high, keep_below=True)
            for i in range(1, len(polygon) - 1):
                part = polygon[[0, i, i + 1]]
                points = _BARYCENTRIC @ part
                w = _WEIGHTS * area * abs(np.linalg.det(part))
                X, N = points @ triangle, p2_shape(points)
                self.area += w.sum()
                self.centre += w @ X
                np.add.at(self.weights, row, w @ N)
                np.add.at(self.first, row, np.einsum("q,qi,qn->ni", w, X, N))

    def moments(self, positions: np.ndarray) -> np.ndarray:
        """(16,) moments of the rigid fit from the undeformed surface to nodal `positions` (all local nodes,
        3)."""
        x = positions[self.nodes]
        return np.concatenate([[self.area], self.centre, self.weights @ x, (self.first.T @ x).ravel()])


class FaceQuadrature:
    """Integrals over a tagged face of quantities that depend on the deformed position; weights are reference
    areas."""

    def __init__(self, problem: MixedField, tag: int):
        self.comm = problem.mesh.comm
        self._facets = facet_nodes(problem, tag)
        self._weights = np.outer(reference_areas(problem, self._facets), _WEIGHTS)
        self._shape = p2_shape(_BARYCENTRIC)

    def moments(self, positions: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """(area, centre (3,), central second moment (3, 3) in mm^4) of the face at nodal `positions` (all
        local nodes, 3)."""
        x = np.einsum("qn,fni->fqi", self._shape, positions[self._facets])
        w = self._weights
        sums = np.concatenate(
            [[w.sum()], np.einsum("fq,fqi->i", w, x), np.einsum("fq,fqi,fqj->ij", w, x, x).ravel()]
        )
        sums = self.comm.allreduce(sums)
        area, centre = sums[0], sums[1:4] / sums[0]
        return area, centre, sums[4:].reshape(3, 3) - area * np.outer(centre, centre)

    def traction(
        self, positions: np.ndarray, force: np.ndarray, moment: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(spread, spin, centre), each (3,): the traction spread + spin x (x - centre) has this force (N),
        and this moment (N mm) about the face's present centre."""
        area, centre, second = self.moments(positions)
        spin = (
            np.linalg.solve(np.trace(second) * np.eye(3) - second, moment) if np.any(moment) else np.zeros(3)
        )
        return np.asarray(force) / area, spin, centre

    def forces(
        self, positions: np.ndarray, spread: np.ndarray, spin: np.ndarray, centre: np.ndarray
    ) -> np.ndarray:
        """(local nodes, 3) nodal forces in N of the traction spread + spin x (x - centre), MPa; this rank's
        facets only."""
        x = np.einsum("qn,fni->fqi", self._shape, positions[self._facets])
        traction = spread + np.cross(spin, x - centre)
        out = np.zeros_like(positions)
        np.add.at(out, self._facets, np.einsum("fq,qn,fqi->fni", self._weights, self._shape, traction))
        return out
