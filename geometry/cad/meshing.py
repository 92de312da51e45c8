"""From gmsh's model to a mesh on disk: arrays for finite elements, gmsh's own file for people."""

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import atomic_path
from pneunet.geometry.meshfile import VolumeMesh
from pneunet.geometry.parameters import Segment

#: some 13 million unknowns: beyond any direct solver
MOST_CELLS = 3e6
#: gmsh's types of linear elements
TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON = 2, 3, 4, 5


def refuse_absurd(mesh_size: float, parts: Iterable[tuple[Segment, float, int]]) -> None:
    """InputError where [(segment, length in mm, its chambers)] have room for too many cells of mesh_size
    (mm)."""
    room = sum(
        s.width * length * (s.core_top - s.core_bottom)
        + s.width * chambers * len(s.sides) * s.chamber_thickness / s.sin * (s.chamber_top - s.core_top)
        for s, length, chambers in parts
    )
    cells = 6 * np.sqrt(2) * room / mesh_size**3  # regular tetrahedra
    if cells > MOST_CELLS:
        fit = np.ceil(100 * mesh_size * np.cbrt(cells / MOST_CELLS)) / 100
        raise InputError(
            f"mesh_size_mm = {mesh_size:g} would give some {cells:.3g} cells, more than {MOST_CELLS:g}:"
            f" choose a coarser mesh, {fit:g} mm or more"
        )


def tetrahedral_mesh() -> VolumeMesh:
    """What the current gmsh model has meshed of its tagged volumes and faces, group after group."""
    numbers, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(numbers)

    def elements(dim, kind, corners):
        groups = gmsh.model.getPhysicalGroups(dim)
        owners = [(e, tag) for _, tag in groups for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)]
        rows = [gmsh.model.mesh.getElementsByType(kind, e)[1].reshape(-1, corners) for e, _ in owners]
        given = np.repeat(np.array([tag for _, tag in owners]), [len(each) for each in rows])
        return np.searchsorted(numbers[order], np.concatenate(rows)), given

    return VolumeMesh(points.reshape(-1, 3)[order], *elements(3, TETRAHEDRON, 4), *elements(2, TRIANGLE, 3))


def cut_off() -> float:
    """mm3 that flat facets cut off from, or add to, the curved faces of the current gmsh model: their areas
    times the mean distance of the middles of their edges from the face."""
    numbers, points, _ = gmsh.model.mesh.getNodes()
    order, total = np.argsort(numbers), 0.0
    for _, face in gmsh.model.getEntities(2):
        if gmsh.model.getType(2, face) == "Plane":
            continue
        triangles = gmsh.model.mesh.getElementsByType(TRIANGLE, face)[1].reshape(-1, 3)
        corners = points.reshape(-1, 3)[order][np.searchsorted(numbers[order], triangles)]
        middles = (corners + np.roll(corners, 1, axis=1)) / 2
        nearest = gmsh.model.getClosestPoint(2, face, middles.ravel())[0].reshape(middles.shape)
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        total += float(areas / 2 @ np.linalg.norm(nearest - middles, axis=2).mean(axis=1))
    return total


def save(path: Path, mesh: VolumeMesh, facts: dict[str, Any]) -> None:
    """Write the .npz `path` and, beside it, gmsh's file of the current model."""
    gmsh.option.setNumber("Mesh.Binary", 1)
    write_model(path.with_suffix(".msh"))
    mesh.write(path, facts)


def write_model(path: Path) -> None:
    """Write gmsh's current model as .step or its mesh as .msh. gmsh says nothing of a full disk: the file's
    end tells whether it is whole."""
    with atomic_path(path) as temporary, _quiet():
        try:
            gmsh.write(str(temporary))
        except Exception as error:
            raise OSError(errno.EIO, str(error).replace(str(temporary), "it")) from None
        with open(temporary, "rb") as stream:
            stream.seek(max(temporary.stat().st_size - 100, 0))
            last = stream.read().split()[-1:]
        if not last or not last[0].startswith((b"END-ISO", b"$End")):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@contextmanager
def _quiet() -> Iterator[None]:
    """OpenCASCADE's STEP writer prints a banner straight to file descriptor 1."""
    kept = os.dup(1)
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
