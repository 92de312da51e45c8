"""The same periodic body cut elsewhere: part of a cell's tetrahedra moved by one pitch, every one as it
was."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from pneunet.geometry.meshfile import read_mesh
from pneunet.geometry.tags import AIR


def recut(path: str | Path, other: str | Path, pitch: float, beyond: float) -> None:
    """Write to `other` the cell meshed at `path` with the tetrahedra whose centroid has x > `beyond` (mm) one
    pitch to the left.

    The new cut is the jagged surface that those tetrahedra leave.
    """
    mesh, facts = read_mesh(path)
    X, tets = mesh.points, mesh.cells
    shift = (X[tets][:, :, 0].mean(axis=1) > beyond).astype(int)
    solid = mesh.cell_tags != AIR
    sides = np.sort(tets[solid][:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]], axis=2)
    shift_of_face = dict(zip(map(tuple, sides.reshape(-1, 3)), np.repeat(shift[solid], 4)))
    moved = 2 * tets + shift[:, None]
    facets = 2 * mesh.facets + [[shift_of_face[tuple(row)]] for row in np.sort(mesh.facets, axis=1)]
    used = np.unique(moved)
    replace(
        mesh,
        points=X[used // 2] - np.outer(used % 2, [pitch, 0, 0]),
        cells=np.searchsorted(used, moved),
        facets=np.searchsorted(used, facets),
    ).write(other, facts)
