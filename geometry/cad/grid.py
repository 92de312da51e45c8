"""Grids of hexahedra in the files that tetrahedra have: arrays for finite elements, gmsh's own for people."""

from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from pneunet.geometry import tags
from pneunet.geometry.cad.body import session
from pneunet.geometry.cad.meshing import HEXAHEDRON, QUADRILATERAL, refuse_absurd, save
from pneunet.geometry.grids.cell import HALF_TURNS, cell_grid
from pneunet.geometry.meshfile import VolumeMesh
from pneunet.geometry.parameters import Segment


def grid_cell(
    segment: Segment,
    size: float,
    path: str | Path,
    layer: float | None = None,
    gaps: bool = False,
    part: bool = False,
    like: Segment | None = None,
    cut: int = 1,
) -> dict[str, Any]:
    """Write the mesh of geometry.grids.cell.cell_grid to `path`, an .npz, and beside it gmsh's .msh; returns
    {"body_mm3", "air_mm3", "cells", "part"}, volumes of the whole pitch. InputError when there would be too
    many elements."""
    sized = like or segment
    refuse_absurd(size / cut, [(sized, sized.pitch, 1)])
    mesh = cell_grid(segment, size, layer, gaps, part, like, cut).mesh(air=True)
    volumes, copies = mesh.volumes(), 1 + part * len(HALF_TURNS[segment.kind])
    air, medium = mesh.cell_tags == tags.AIR, mesh.cell_tags == tags.GAP
    facts = {
        "body_mm3": copies * float(volumes[~air & ~medium].sum()),
        "air_mm3": copies * float(volumes[air].sum()),
        "cells": len(mesh.cells),
        "part": part,
    }
    save_grid(Path(path), mesh, facts)
    return facts


def save_grid(path: Path, mesh: VolumeMesh, facts: dict[str, Any]) -> None:
    """Write the .npz `path` of hexahedra, and gmsh's file of them, of discrete entities with the same
    groups."""
    with session(path.stem):
        groups = (
            (3, HEXAHEDRON, mesh.cells, mesh.cell_tags),
            (2, QUADRILATERAL, mesh.facets, mesh.facet_tags),
        )
        for dim, kind, rows, of in groups:
            for tag in np.unique(of).tolist():
                gmsh.model.addDiscreteEntity(dim, tag)
                if dim == 3 and tag == of.min():  # elements may name the nodes of another entity
                    numbers = np.arange(1, len(mesh.points) + 1)
                    gmsh.model.mesh.addNodes(dim, tag, numbers, mesh.points.ravel())
                gmsh.model.mesh.addElementsByType(tag, kind, [], (rows[of == tag] + 1).ravel())
                gmsh.model.addPhysicalGroup(dim, [tag], tag)
        for tag, name in tags.face_names(tags.MOST_GROUPS).items():
            gmsh.model.setPhysicalName(2, tag, name)
        for tag in np.unique(mesh.cell_tags).tolist():
            gmsh.model.setPhysicalName(3, tag, _called(tag))
        save(path, mesh, facts)


def _called(tag):
    """What people call a volume."""
    for first, name in ((tags.GAP, "gap"), (tags.LAYER, "layer of segment"), (tags.AIR, "air")):
        if tag >= first:
            return name if first in (tags.GAP, tags.AIR) else f"{name} {tag - first + 1}"
    return f"segment {tag - tags.BODY + 1}"
