"""Facets of a body's surface as quadratic triangles: the samples every geometric measure is made of."""

import numpy as np

#: edges of dolfinx's reference tetrahedron, in the order of its P2 edge nodes 4..9
EDGES = [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]
#: local P2 nodes of the facet opposite each vertex: three corners, then the mid-edges (01, 12, 20)
FACETS = []
for _opposite in range(4):
    _corners = [v for v in range(4) if v != _opposite]
    _edges = [tuple(sorted((_corners[i], _corners[(i + 1) % 3]))) for i in range(3)]
    FACETS.append(_corners + [4 + EDGES.index(e) for e in _edges])


def facet_nodes(problem, *tags):
    """(facets, 6) displacement nodes of the tagged facets on this rank, corners ordered so that normals point out.

    A facet is reported by the rank that owns its cell, so that sums over ranks count it once.
    """
    topology = problem.mesh.topology
    topology.create_connectivity(2, 3)
    topology.create_connectivity(3, 2)
    to_cell, to_facet = topology.connectivity(2, 3), topology.connectivity(3, 2)
    owned_cells = topology.index_map(3).size_local
    dofmap = problem.displacement_space.dofmap
    rows = []
    for tag in tags:
        for facet in problem.facet_tags.find(tag):
            cell = to_cell.links(facet)[0]
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


def reference_areas(problem, facets):
    """(facets,) undeformed areas in mm^2."""
    a, b, c = (problem.nodes[facets[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def split(facets):
    """(4 facets, 3) linear triangles of quadratic ones (facets, 6), same orientation."""
    return np.concatenate([facets[:, [0, 3, 5]], facets[:, [3, 1, 4]], facets[:, [5, 4, 2]], facets[:, [3, 4, 5]]])
