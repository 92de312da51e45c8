"""From gmsh's model to a mesh on disk: arrays for finite elements, gmsh's own file for people."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import atomic_path
from pneunet.geometry.meshfile import TetrahedralMesh
from pneunet.geometry.parameters import Segment

#: some 13 million unknowns: beyond any direct solver
MOST_CELLS = 3e6
#: gmsh's types of linear elements
TRIANGLE, TETRAHEDRON = 2, 4


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
        fit = mesh_size * np.cbrt(cells / MOST_CELLS)
        raise InputError(
            f"mesh_size_mm = {mesh_size:g} would give some {cells:.0e} cells, more than {MOST_CELLS:.0e}:"
            f" choose a coarser mesh, {fit:.2g} mm or more"
        )


def tetrahedral_mesh() -> TetrahedralMesh:
    """What the current gmsh model has meshed of its tagged volumes and faces, group after group."""
    numbers, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(numbers)

    def elements(dim, kind, corners):
        groups = gmsh.model.getPhysicalGroups(dim)
        owners = [(e, tag) for _, tag in groups for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)]
        rows = [gmsh.model.mesh.getElementsByType(kind, e)[1].reshape(-1, corners) for e, _ in owners]
        given = np.repeat(np.array([tag for _, tag in owners]), [len(each) for each in rows])
        return np.searchsorted(numbers[order], np.concatenate(rows)), given

    return TetrahedralMesh(
        points.reshape(-1, 3)[order], *elements(3, TETRAHEDRON, 4), *elements(2, TRIANGLE, 3)
    )


def save(path: Path, mesh: TetrahedralMesh, facts: dict[str, Any]) -> None:
    """Write the .npz `path` and, beside it, gmsh's file of the current model."""
    with atomic_path(path.with_suffix(".msh")) as temporary:
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(temporary))
    mesh.write(path, facts)
