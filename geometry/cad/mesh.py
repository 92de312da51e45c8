"""Tagged mesh of a manipulator, with the checks that make a mesh fit for use."""

import json
import logging
import time
from pathlib import Path

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_text
from pneunet.base.files.folder import output_folder
from pneunet.geometry import tags
from pneunet.geometry.cad import body as cad
from pneunet.geometry.cad.grid import save_grid
from pneunet.geometry.cad.meshing import cut_off, refuse_absurd, save, tetrahedral_mesh, write_model
from pneunet.geometry.designfile import read_design_file, segment_table
from pneunet.geometry.fillets import NO_GRID, refuse_fillets
from pneunet.geometry.grids.body import body_grid
from pneunet.geometry.meshfile import MESH, USUAL_ELEMENT, VolumeMesh, open_edges
from pneunet.geometry.parameters import Manipulator

log = logging.getLogger(__name__)


def mesh_design(path: str | Path, directory: str | Path, mesh_size: float | None = None) -> dict:
    """`pneunet mesh`: mesh a design's file into directory/mesh; mesh_size (mm) by default the design's.

    The answer of `mesh_manipulator`, which raises what this raises.
    """
    content = read_design_file(path)
    with output_folder(Path(directory) / "mesh") as folder:
        facts = mesh_manipulator(content.manipulator, mesh_size or content.mesh_size, folder, content.element)
    log.info(f"written: {folder / MESH}, manipulator.msh, manipulator.step, mesh.json")
    return facts


def mesh_manipulator(
    manipulator: Manipulator, mesh_size: float, directory: str | Path, element: str = USUAL_ELEMENT
) -> dict:
    """Write manipulator.npz, which finite elements read, with manipulator.msh, manipulator.step and mesh.json
    for people to `directory`; return the content of mesh.json.

    mesh_size in mm: largest edges of the grid's hexahedra (geometry.grids), or edges of gmsh's tetrahedra;
    element: one of geometry.meshfile.ELEMENTS. Raises InputError when gmsh cannot mesh the body or a check
    fails; nothing is left half-written.
    """
    directory = Path(directory)
    started = time.perf_counter()
    if element == "hexahedra":
        refuse_fillets(manipulator.segments, NO_GRID)
    refuse_absurd(mesh_size, [(s, s.length, s.chambers) for s in manipulator.segments])
    log.info(
        f"mesh: {manipulator.chambers} chambers, {manipulator.length:.0f} mm, elements of {mesh_size:g} mm"
    )

    def facts_of(mesh: VolumeMesh, volumes: dict[str, float], rounding: float = 0.0) -> dict:
        # the segments are kept so that a later run knows whether this mesh is still its own
        return {
            "element": mesh.element,
            "mesh_size_mm": mesh_size,
            "segments": segment_tables(manipulator),
            **volumes,
            **_check(mesh, volumes, len(manipulator.groups), rounding),
            "seconds": time.perf_counter() - started,
        }

    with cad.session():
        try:
            volumes = cad.build(manipulator)
            log.info(
                f"CAD: body {volumes['body_mm3']:.1f} mm3, cavity {volumes['cavity_mm3']:.1f} mm3"
                f" ({time.perf_counter() - started:.1f} s)"
            )
            write_model(directory / "manipulator.step")
            if element == "tetrahedra":
                mesh = _tetrahedra(mesh_size, any(s.fillet for s in manipulator.segments))
        except InputError:
            raise
        except Exception as error:  # gmsh raises plain Exception with its own text
            raise InputError(f"gmsh could not build this body: {error}; try another mesh_size_mm") from None
        if element == "tetrahedra":
            facts = facts_of(mesh, volumes, cut_off())
            save(directory / MESH, mesh, facts)
    if element == "hexahedra":
        grid = body_grid(manipulator, mesh_size)
        mesh, filled = grid.mesh(), grid.mesh(air=True)
        air = float(filled.volumes()[filled.cell_tags == tags.AIR].sum())
        facts = facts_of(mesh, {"body_mm3": float(mesh.volumes().sum()), "cavity_mm3": air})
        save_grid(directory / MESH, mesh, facts)
    write_text(directory / "mesh.json", json.dumps(facts, indent=1) + "\n")
    log.info(
        f"mesh: {facts['cells']} {element}, {facts['vertices']} vertices, cavity closed, smallest quality"
        f" {facts['smallest_quality']:.2f}"
    )
    return facts


def _tetrahedra(mesh_size, rounded):
    """gmsh's VolumeMesh of its current model; two edges and more around a rounded edge."""
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8 * rounded)
    gmsh.option.setNumber("Mesh.MeshSizeMax", mesh_size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.0)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.Algorithm3D", 1)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.optimize("")
    return tetrahedral_mesh()


def segment_tables(manipulator: Manipulator) -> list[dict]:
    """What a mesh depends on, in file units: every dimension, no material."""
    return [segment_table(s) for s in manipulator.segments]


def _check(mesh, volumes, groups, rounding):
    """Counts, areas and quality of a mesh; InputError when a cavity leaks or volumes disagree by more than
    `rounding` (mm3) of curved faces."""
    names = tags.face_names(groups).items()
    areas = {f"{name}_mm2": float(mesh.areas(tag).sum()) for tag, name in names}
    cavities = [
        np.concatenate([mesh.tagged(tag) for tag in tags.cavity_tags(group)])
        for group in range(1, groups + 1)
    ]
    if any(map(open_edges, [*cavities, mesh.facets])):
        raise InputError(
            "mesh: the cavity's or the body's surface is not closed: walls touch or cut each other"
        )
    quality = mesh.qualities()
    mesh_volume = float(mesh.volumes().sum())
    if abs(mesh_volume - volumes["body_mm3"]) > 1e-6 * volumes["body_mm3"] + rounding:
        raise InputError(
            f"mesh: its volume {mesh_volume:.3f} mm3 is not the CAD's {volumes['body_mm3']:.3f} mm3: solids"
            " intersect"
        )
    return {
        "mesh_volume_mm3": mesh_volume,
        "areas": areas,
        "cells": len(mesh.cells),
        "vertices": len(np.unique(mesh.cells)),
        "smallest_quality": float(quality.min()),
        "quality_5_percent": float(np.percentile(quality, 5)),
        "cavity_closed": True,
        "nothing_intersects": True,
    }
