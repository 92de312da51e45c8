"""The same periodic body cut elsewhere: part of a cell's tetrahedra moved by one pitch, every one as it
was."""

from pathlib import Path

import gmsh
import numpy as np

from pneunet.geometry.cad import body as cad
from pneunet.geometry.tags import AIR


def recut(path: str | Path, other: str | Path, pitch: float, beyond: float) -> None:
    """Write to `other` the cell meshed at `path` with the tetrahedra whose centroid has x > `beyond` (mm) one
    pitch to the left.

    The new cut is the jagged surface that those tetrahedra leave.
    """
    with cad.session("recut"):
        gmsh.merge(str(path))
        tags, x, _ = gmsh.model.mesh.getNodes()
        X = np.zeros((int(tags.max()) + 1, 3))
        X[tags.astype(int)] = x.reshape(-1, 3)
        solids = {tag: _elements(3, tag, 4) for _, tag in gmsh.model.getPhysicalGroups(3)}
        faces = {tag: _elements(2, tag, 3) for _, tag in gmsh.model.getPhysicalGroups(2)}
    shift_of_face = {}
    moved = {}
    for tag, tets in solids.items():
        shift = (X[tets][:, :, 0].mean(axis=1) > beyond).astype(int)
        moved[tag] = tets * 2 + shift[:, None]
        if tag != AIR:
            for opposite in range(4):
                for key, s in zip(np.sort(np.delete(tets, opposite, axis=1), axis=1), shift):
                    shift_of_face[tuple(key)] = s
    faces = {
        tag: np.array([2 * row + shift_of_face[tuple(np.sort(row))] for row in rows])
        for tag, rows in faces.items()
    }
    used = np.unique(np.concatenate([tets.ravel() for tets in moved.values()]))
    points = X[used // 2] - np.outer(used % 2, [pitch, 0, 0])
    with cad.session("recut"):
        gmsh.model.addDiscreteEntity(3, 1)
        gmsh.model.mesh.addNodes(3, 1, np.arange(1, len(used) + 1), points.ravel())
        for dim, kind, groups in ((3, 4, moved), (2, 2, faces)):
            for i, (tag, rows) in enumerate(groups.items(), start=2):
                gmsh.model.addDiscreteEntity(dim, i)
                gmsh.model.mesh.addElementsByType(i, kind, [], np.searchsorted(used, rows.ravel()) + 1)
                gmsh.model.addPhysicalGroup(dim, [i], tag)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(other))


def _elements(dim, tag, corners):
    kind = {3: 4, 2: 2}[dim]
    entities = gmsh.model.getEntitiesForPhysicalGroup(dim, tag)
    return (
        np.concatenate([gmsh.model.mesh.getElementsByType(kind, e)[1] for e in entities])
        .astype(int)
        .reshape(-1, corners)
    )
