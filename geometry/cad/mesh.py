"""Tagged tetrahedral mesh of a manipulator, with the checks that make a mesh fit for use."""

import json
import logging
import os
import time
from contextlib import contextmanager
from pathlib import Path

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import atomic_path, write_text
from pneunet.base.files.folder import output_folder
from pneunet.base.files.toml import to_table
from pneunet.geometry import tags
from pneunet.geometry.cad import body as cad
from pneunet.geometry.designfile import read_design_file
from pneunet.geometry.parameters import Manipulator

log = logging.getLogger(__name__)


def mesh_design(path: str | Path, directory: str | Path, mesh_size: float | None = None) -> dict:
    """`pneunet mesh`: mesh a design's file into directory/mesh; mesh_size (mm) by default the design's.

    The answer of `mesh_manipulator`, which raises what this raises.
    """
    content = read_design_file(path)
    with output_folder(Path(directory) / "mesh") as folder:
        facts = mesh_manipulator(content.manipulator, mesh_size or content.mesh_size, folder)
    log.info(f"written: {folder / 'manipulator.msh'}, manipulator.step, mesh.json")
    return facts


def mesh_manipulator(manipulator: Manipulator, mesh_size: float, directory: str | Path) -> dict:
    """Write manipulator.msh, manipulator.step and mesh.json to `directory`; return the content of mesh.json.

    mesh_size in mm (tetrahedron edge). Raises InputError when gmsh cannot mesh it or a check fails; nothing
    is left half-written.
    """
    directory = Path(directory)
    started = time.perf_counter()
    cells = 6 * np.sqrt(2) * manipulator.length * manipulator.segments[0].width * 8 / mesh_size**3
    if cells > 3e6:  # some 13 million unknowns: beyond any direct solver
        raise InputError(
            f"mesh_size_mm = {mesh_size:g} would give some {cells:.0e} cells: choose a coarser mesh"
        )
    with cad.session():
        try:
            volumes = cad.build(manipulator)
            log.info(
                f"CAD: body {volumes['body_mm3']:.1f} mm3, cavity {volumes['cavity_mm3']:.1f} mm3"
                f" ({time.perf_counter() - started:.1f} s)"
            )
            with atomic_path(directory / "manipulator.step") as temporary, _quiet():
                gmsh.write(str(temporary))
            gmsh.option.setNumber("Mesh.MeshSizeMax", mesh_size)
            gmsh.option.setNumber("Mesh.MeshSizeMin", 0.0)
            gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.option.setNumber("Mesh.Algorithm3D", 1)
            gmsh.option.setNumber("Mesh.RandomSeed", 1)
            gmsh.model.mesh.generate(3)
            gmsh.model.mesh.optimize("")
        except InputError:
            raise
        except Exception as error:  # gmsh raises plain Exception with its own text
            raise InputError(f"gmsh could not build this body: {error}; try another mesh_size_mm") from None
        # the segments are kept so that a later run knows whether this mesh is still its own
        facts = {
            "mesh_size_mm": mesh_size,
            "segments": segment_tables(manipulator),
            **volumes,
            **_check(volumes),
        }
        with atomic_path(directory / "manipulator.msh") as temporary:
            gmsh.option.setNumber("Mesh.Binary", 1)
            gmsh.write(str(temporary))
    facts["seconds"] = time.perf_counter() - started
    write_text(directory / "mesh.json", json.dumps(facts, indent=1) + "\n")
    log.info(
        f"mesh: {facts['cells']} cells, {facts['vertices']} vertices, cavity closed, smallest quality"
        f" {facts['smallest_quality']:.2f}"
    )
    return facts


def segment_tables(manipulator: Manipulator) -> list[dict]:
    """What a mesh depends on, in file units: every dimension, no material."""
    return [to_table(s) for s in manipulator.segments]


@contextmanager
def _quiet():
    """OpenCASCADE's STEP writer prints a banner straight to file descriptor 1."""
    kept = os.dup(1)
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _node_positions():
    """(largest tag + 1, 3) coordinates by node tag."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    positions = np.zeros((int(tags.max()) + 1, 3))
    positions[tags.astype(int)] = coordinates.reshape(-1, 3)
    return positions


def _facet_nodes(tag):
    """Node tags (n, 3) of the triangles in a physical face group."""
    entities = gmsh.model.getEntitiesForPhysicalGroup(2, tag)
    nodes = [gmsh.model.mesh.getElementsByType(2, entity)[1].reshape(-1, 3) for entity in entities]
    return np.concatenate(nodes).astype(int) if nodes else np.zeros((0, 3), int)


def tet_volumes_and_quality(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed volumes (n,) in mm3 and mean-ratio quality (n,), 1 for a regular tetrahedron, of corners (n, 4,
    3)."""
    edges = corners[:, [1, 2, 3, 2, 3, 3]] - corners[:, [0, 0, 0, 1, 1, 2]]
    volumes = np.einsum("ni,ni->n", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) / 6
    return volumes, 12 * np.cbrt(3 * volumes) ** 2 * np.sign(volumes) / np.einsum("nei,nei->n", edges, edges)


def open_edges(nodes: np.ndarray) -> int:
    """Number of edges of a triangle soup (n, 3) that are not shared by exactly two triangles; 0 for a closed
    surface."""
    edges = np.sort(np.concatenate([nodes[:, [0, 1]], nodes[:, [1, 2]], nodes[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    return int(np.count_nonzero(counts != 2))


def _check(volumes):
    """Counts, areas and quality of the current mesh; InputError when the cavity leaks or volumes disagree."""
    positions = _node_positions()
    facets = {tag: _facet_nodes(tag) for tag in tags.FACE_NAMES}
    areas = {}
    for tag, name in tags.FACE_NAMES.items():
        xyz = positions[facets[tag]]
        areas[f"{name}_mm2"] = float(
            np.linalg.norm(np.cross(xyz[:, 1] - xyz[:, 0], xyz[:, 2] - xyz[:, 0]), axis=1).sum() / 2
        )
    cavity = np.concatenate([facets[tags.CAVITY], facets[tags.CHANNEL]])
    if open_edges(cavity) or open_edges(np.concatenate(list(facets.values()))):
        raise InputError(
            "mesh: the cavity's or the body's surface is not closed: walls touch or cut each other"
        )
    tets = gmsh.model.mesh.getElementsByType(4)[1].reshape(-1, 4).astype(int)
    cell_volumes, quality = tet_volumes_and_quality(positions[tets])
    mesh_volume = float(cell_volumes.sum())
    if abs(mesh_volume - volumes["body_mm3"]) > 1e-6 * volumes["body_mm3"]:
        raise InputError(
            f"mesh: its volume {mesh_volume:.3f} mm3 is not the CAD's {volumes['body_mm3']:.3f} mm3: solids"
            " intersect"
        )
    if quality.min() <= 0:
        raise InputError("mesh: a tetrahedron is inverted; try another mesh_size_mm")
    return {
        "mesh_volume_mm3": mesh_volume,
        "areas": areas,
        "cells": len(tets),
        "vertices": len(np.unique(tets)),
        "smallest_quality": float(quality.min()),
        "quality_5_percent": float(np.percentile(quality, 5)),
        "cavity_closed": True,
        "nothing_intersects": True,
    }
