"""Facets of a body's surface (hifi.fem.facets): the samples every geometric measure is made of."""

from itertools import combinations

import numpy as np

from pneunet.hifi.fem.facets import kind_of
from pneunet.hifi.fem.mixed_field import MixedField

#: edges of dolfinx's reference tetrahedron, in the order of its P2 edge nodes 4..9
EDGES = [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]


#: corners of dolfinx's reference hexahedron, x running fastest
_CUBE = np.array([(i % 2, i // 2 % 2, i // 4) for i in range(8)])
_CUBE_EDGES = [(a, b) for a, b in combinations(range(8), 2) if np.abs(_CUBE[a] - _CUBE[b]).sum() == 1]
_CUBE_SIDES = sorted(np.flatnonzero(_CUBE[:, i] == end).tolist() for i in range(3) for end in (0, 1))
#: cell -> for each of its displacement nodes the corners in whose middle it lies
VERTICES = {
    "tetrahedron": [*((i,) for i in range(4)), *EDGES],
    "hexahedron": [*((i,) for i in range(8)), *_CUBE_EDGES, *map(tuple, _CUBE_SIDES), tuple(range(8))],
}


def _facets(cell, rings):
    """Local nodes of facets with these rings of corners: corners, middles of edges, a square's own."""
    number = {tuple(sorted(corners)): node for node, corners in enumerate(VERTICES[cell])}
    rows = []
    for ring in rings:
        edges = [number[tuple(sorted(pair))] for pair in zip(ring, [*ring[1:], ring[0]])]
        rows.append([*ring, *edges, *([number[tuple(sorted(ring))]] if len(ring) == 4 else [])])
    return np.array(rows)


#: cell -> local nodes of its facets: that opposite each vertex of a tetrahedron; of a hexahedron in dolfinx's
#: order
FACETS = {
    "tetrahedron": _facets("tetrahedron", [[v for v in range(4) if v != i] for i in range(4)]),
    "hexahedron": _facets("hexahedron", [[a, b, d, c] for a, b, c, d in _CUBE_SIDES]),
}


def facet_nodes(problem: MixedField, *tags: int) -> np.ndarray:
    """(facets, 6 or 9) displacement nodes of the tagged facets on this rank, corners ordered so that normals
    point out.

    A facet between two cells is seen from that with the lower tag: the body's. It is reported by the rank
    that owns its cell, so that sums over ranks count it once.
    """
    topology = problem.mesh.topology
    topology.create_connectivity(2, 3)
    topology.create_connectivity(3, 2)
    to_cell, to_facet = topology.connectivity(2, 3), topology.connectivity(3, 2)
    owned_cells = topology.index_map(3).size_local
    dofmap = problem.displacement_space.dofmap
    local_nodes = FACETS[problem.cell_name]
    turned = kind_of(local_nodes).turned
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
            row = nodes[local_nodes[local]]
            a, b, c = problem.nodes[row[:3]]
            if np.dot(np.cross(b - a, c - a), problem.nodes[nodes].mean(axis=0) - a) > 0:
                row = row[turned]
            rows.append(row)
    return np.array(rows, dtype=int).reshape(-1, local_nodes.shape[1])


def reference_areas(problem: MixedField, facets: np.ndarray) -> np.ndarray:
    """(facets, p) undeformed areas in mm^2 that stand for the facets' Gauss points."""
    kind = kind_of(facets)
    corners = problem.nodes[facets[:, : kind.corners]]
    return kind.reference_area * kind.gauss_weights * kind.stretched(kind.gauss, corners)


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
    """Integrals over the part of a surface with low <= X1 <= high, as weights on its nodes; exact where
    facets are flat and have parallel edges.

    area (mm2); centre (3,) = int X dA; nodes (n,); weights (n,) = int N dA; first (n, 3) = int X N dA.
    places (all local nodes, 3): of the nodes, when they are not the problem's own.
    """

    def __init__(
        self,
        problem: MixedField,
        facets: np.ndarray,
        low: float = -np.inf,
        high: float = np.inf,
        places: np.ndarray | None = None,
    ):
        kind = kind_of(facets)
        X = problem.nodes if places is None else places
        X1 = X[facets[:, : kind.corners], 0]
        facets = facets[(X1.max(axis=1) > low) & (X1.min(axis=1) < high)]
        nodes, inverse = np.unique(facets, return_inverse=True)
        inverse = inverse.reshape(facets.shape)
        self.nodes, self.area, self.centre = nodes, 0.0, np.zeros(3)
        self.weights, self.first = np.zeros(len(nodes)), np.zeros((len(nodes), 3))
        for row, facet in zip(inverse, X[facets]):
            for triangle in kind.triangles:
                self._add(kind, row, facet, triangle, low, high)

    def _add(self, kind, row, facet, triangle, low, high):
        """What one triangle (3, 2) of the reference shape contributes."""
        polygon, ends = np.eye(3), kind.shape(triangle) @ facet[:, 0]
        if ends.min() < low:
            polygon = _clip(polygon, ends - low, keep_below=False)
        if ends.max() > high:
            polygon = _clip(polygon, ends - high, keep_below=True)
        for i in range(1, len(polygon) - 1):
            part = polygon[[0, i, i + 1]] @ triangle
            places = kind.barycentric @ part
            reference = abs(np.linalg.det(part[1:] - part[0])) / 2
            w = kind.weights * reference * kind.stretched(places, facet[: kind.corners])
            N = kind.shape(places)
            X = N @ facet
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
        kind = kind_of(self._facets)
        places = (kind.barycentric @ kind.triangles).reshape(-1, 2)
        corners = problem.nodes[self._facets[:, : kind.corners]]
        self._weights = np.tile(kind.weights / 2, len(kind.triangles)) * kind.stretched(places, corners)
        self._shape = kind.shape(places)

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
