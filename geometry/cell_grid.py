"""One pitch of a one-sided segment as a tensor grid: thin layers of tetrahedra at every edge where stresses are singular.

In the oblique coordinates (xi, y, z), xi = x - y cot(angle), such a body is a union of boxes, so is its air, and the faces
of all of them lie on a few planes of constant xi, y or z. Between these the grid is graded towards those on which an edge
of the body is re-entrant (cavity, channel, floor of the gap), where stresses are singular. Every layer runs through the
whole cell: at equal numbers of unknowns it is no more accurate than geometry.cell's mesh graded towards the edges.
Each hexahedron is cut into six tetrahedra (Kuhn), mirrored by the parity of its index, so that neighbours fit. The cuts
are the slanted planes through the middle of the gaps. With even numbers of intervals along xi and y the mesh maps to
itself under a half turn about z, and so do the solutions on it.
"""

from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np

from base.errors import InputError
from base.files import atomic_path
from geometry import cad
from geometry.cell import AIR, GAP
from geometry.parameters import ONE_SIDED

#: thickness of the layers at a sharp edge, as a part of the mesh size, and how much thicker each next one may be
EDGE, GROWTH = 0.13, 6.0
_EMPTY = 0


@dataclass(frozen=True)
class Grid:
    """planes: coordinates (n + 1,) of the grid along xi, y and z in mm; tags (nx, ny, nz): whose each box is; 0 = nobody's."""

    planes: tuple
    tags: np.ndarray

    @property
    def volumes(self):
        """(nx, ny, nz) mm3."""
        dx, dy, dz = (np.diff(p) for p in self.planes)
        return dx[:, None, None] * dy[:, None] * dz


def mesh_cell_grid(segment, mesh_size, path, gaps=False, edge=EDGE, growth=GROWTH):
    """Write the cell's mesh to `path`; returns {"body_mm3", "air_mm3", "cells"}, as geometry.cell.mesh_cell does.

    mesh_size: longest edge along xi, y and z, mm; edge: thickness of the layers at singular edges as a part of it; growth:
    largest ratio of neighbouring layers. InputError for a twisting segment, whose chambers slant both ways.
    """
    grid = cell_grid(segment, mesh_size, edge * mesh_size, growth, gaps)
    points, tetrahedra, tags = _tetrahedra(grid)
    points[:, 0] += segment.cot * points[:, 1]
    facets, facet_tags = _facets(segment, points, tetrahedra, tags)
    with atomic_path(Path(path)) as temporary:
        _write(temporary, points, ((2, facets, facet_tags), (4, tetrahedra, tags)))
    of = {tag: float(grid.volumes[grid.tags == tag].sum()) for tag in (cad.BODY, cad.LAYER, AIR)}
    return {"body_mm3": of[cad.BODY] + of[cad.LAYER], "air_mm3": of[AIR], "cells": len(tetrahedra)}


def cell_grid(segment, coarse, fine, growth, gaps=False):
    """The Grid of a one-sided segment's cell: intervals from `fine` (mm) at re-entrant edges up to `coarse`."""
    s = segment
    if s.kind != ONE_SIDED:
        raise InputError(f"kind = '{s.kind}': only a one-sided segment's cell is a tensor grid")
    half = np.array([s.cavity_thickness, s.chamber_thickness, s.chamber_thickness + s.gap]) / (2 * s.sin)
    y = [s.channel_width / 2, s.cavity_width / 2]
    h = s.channel_height / 2
    edges = (
        {-half[1], -half[0], half[0], half[1]},
        {-y[1], -y[0], y[0], y[1]},
        {-h, h, s.cavity_floor, s.core_top, s.cavity_top, *([s.layer_top] if s.layer_thickness else [])},
    )
    limits = ((-half[2], half[2]), (-s.width / 2, s.width / 2), (s.core_bottom, s.chamber_top))
    planes = tuple(_divide(e, lim, coarse, fine, growth, even=i < 2) for i, (e, lim) in enumerate(zip(edges, limits)))
    xi, y, z = np.meshgrid(*((p[1:] + p[:-1]) / 2 for p in planes), indexing="ij")
    return Grid(planes, _owners(s, np.abs(xi), np.abs(y), z, gaps))


def _owners(s, xi, y, z, gaps):
    """Tag of the part of the cell that holds each point; xi and y are distances from the chamber's middle."""
    slot = (xi > s.chamber_thickness / (2 * s.sin)) & (z > s.core_top)
    cavity = (xi < s.cavity_thickness / (2 * s.sin)) & (y < s.cavity_width / 2) & (z > s.cavity_floor) & (z < s.cavity_top)
    channel = (y < s.channel_width / 2) & (np.abs(z) < s.channel_height / 2)
    tags = np.full(xi.shape, cad.BODY)
    tags[z < s.layer_top] = cad.LAYER
    tags[slot] = GAP if gaps else _EMPTY
    tags[cavity | channel] = AIR
    return tags


def _divide(edges, limits, coarse, fine, growth, even):
    """Planes (n + 1,) between the limits, graded towards the edges; `even`: their number of intervals, if symmetric."""
    stations = _distinct([*limits, *edges])
    sharp = [any(abs(s - e) < 1e-9 for e in edges) for s in stations]
    planes = [stations[0]]
    for i, (a, b) in enumerate(zip(stations, stations[1:])):
        middle = even and 2 * i == len(stations) - 2
        steps = _graded(b - a, sharp[i], sharp[i + 1], coarse, fine, growth, middle)
        planes += [*(a + np.cumsum(steps[:-1])), b]
    return np.array(planes)


def _distinct(values):
    """Sorted, those that only rounding tells apart once."""
    kept = []
    for value in sorted(values):
        if not kept or value - kept[-1] > 1e-9:
            kept.append(value)
    return kept


def _graded(length, sharp_start, sharp_end, coarse, fine, growth, even):
    """Intervals (n,) that fill `length`, as few as will do: at most `fine` at a sharp end, then growing up to `coarse`."""
    n = 1 + sharp_start + sharp_end
    while True:
        if not even or n % 2 == 0:
            index = np.arange(n)
            ends = [d for d, sharp in ((index, sharp_start), (n - 1 - index, sharp_end)) if sharp]
            sizes = np.minimum(fine * growth ** np.minimum.reduce(ends), coarse) if ends else np.full(n, coarse)
            if sizes.sum() >= length * (1 - 1e-9):
                return sizes * (length / sizes.sum())
        n += 1


def _tetrahedra(grid):
    """points (n, 3) in (xi, y, z), tetrahedra (m, 4) and their tags (m,); nobody's boxes and points left out."""
    shape = grid.tags.shape
    boxes = np.argwhere(grid.tags != _EMPTY)
    parity = boxes % 2
    rows = []
    for order in permutations(range(3)):
        path = np.zeros((4, 3), int)
        for step, axis in enumerate(order, start=1):
            path[step:, axis] = 1
        corner = boxes[:, None, :] + (path ^ parity[:, None, :])
        rows.append(np.ravel_multi_index(np.moveaxis(corner, -1, 0), np.add(shape, 1)))
    tetrahedra = np.concatenate(rows)
    used, tetrahedra = np.unique(tetrahedra, return_inverse=True)
    points = np.stack(np.meshgrid(*grid.planes, indexing="ij"), axis=-1).reshape(-1, 3)[used]
    tags = np.tile(grid.tags[tuple(boxes.T)], len(rows))
    return points, tetrahedra.reshape(-1, 4), tags


def _facets(segment, points, tetrahedra, tags):
    """(facets (n, 3), tags (n,)) of the channel's wall, the cavities' and the body's outside, cuts left out."""
    s, solid = segment, np.isin(tags, (cad.BODY, cad.LAYER))
    facets = np.sort(np.concatenate([np.delete(tetrahedra, i, axis=1) for i in range(4)]), axis=1)
    owners = np.tile(np.arange(len(tetrahedra)), 4)
    key = (facets[:, 0] * len(points) + facets[:, 1]) * len(points) + facets[:, 2]
    _, first, inverse, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    bodies, air = (np.bincount(inverse, of[owners], len(count)) for of in (solid, tags == AIR))
    facets = facets[first]
    corners = points[facets]
    xi = corners[..., 0] - s.cot * corners[..., 1]
    on_cut = (np.abs(np.abs(xi) - s.pitch / 2) < 1e-6).all(axis=1)
    half = np.array([s.channel_width, s.channel_height]) / 2 + 1e-6
    in_channel = (np.abs(corners[..., 1:]) < half).all(axis=(1, 2))
    wall = (bodies == 1) & (air == 1)
    found = np.select([wall & in_channel, wall, (bodies == 1) & ~on_cut], [cad.CHANNEL, cad.CAVITY, cad.OUTER], 0)
    return facets[found > 0], found[found > 0]


def _write(path, points, blocks):
    """Gmsh's MSH 2.2 in text; blocks of (gmsh's element type, nodes (n, k), physical tags (n,))."""
    with open(path, "w") as file:
        file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(points)}\n")
        np.savetxt(file, np.column_stack([np.arange(1, len(points) + 1), points]), fmt=["%d"] + ["%.17g"] * 3)
        file.write(f"$EndNodes\n$Elements\n{sum(len(tags) for _, _, tags in blocks)}\n")
        number = 1
        for kind, nodes, tags in blocks:
            n = len(tags)
            head = [np.arange(number, number + n), np.full(n, kind), np.full(n, 2), tags, tags]
            np.savetxt(file, np.column_stack([*head, nodes + 1]), fmt="%d")
            number += n
        file.write("$EndElements\n")
