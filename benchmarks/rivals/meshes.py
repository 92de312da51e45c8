"""The meshes of the speed benches, as each code wants them: manipulator.npz for ours, mesh.npz for the
others."""

import json
from pathlib import Path

import numpy as np

from pneunet.base.files.atomic import atomic_path


def segment():
    """Case twist-w12, 60 degrees, three pairs of chambers."""
    from pneunet.geometry import Manipulator
    from pneunet.geometry.reference_cases import CASES

    return Manipulator((CASES["twist_w12"](angle=60.0, chambers=3),))


def make(directory, mesh_size, manipulator=None):
    """Folder with manipulator.npz, mesh.json and mesh.npz of this grid's size (mm); made once.

    mesh.npz: points (n, 3) in mm, cells (m, 8), base, cavity and channel (k, 8) cells whose first four
    vertices are a facet of that surface, turned and not mirrored, and the rules with which ours integrates on
    the unit cube and square: volume_points (q, 3), volume_weights, facet_points (q, 2), facet_weights.
    """
    from pneunet.geometry.cad.mesh import mesh_manipulator, segment_tables

    directory, manipulator = Path(directory), manipulator or segment()
    facts, segments = directory / "mesh.json", json.loads(json.dumps(segment_tables(manipulator)))
    if facts.exists() and (directory / "mesh.npz").exists():
        known = json.loads(facts.read_text())
        if known["mesh_size_mm"] == mesh_size and known["segments"] == segments:
            return directory
    mesh_manipulator(manipulator, mesh_size, directory, "hexahedra")
    with atomic_path(directory / "mesh.npz") as temporary:
        with open(temporary, "wb") as file:
            np.savez(file, **arrays(directory / "manipulator.npz"))
    return directory


def arrays(path):
    """What mesh.npz holds, of a mesh of ours."""
    from pneunet.geometry import tags
    from pneunet.geometry.meshfile import read_mesh

    mesh, _ = read_mesh(path)
    found = {"points": mesh.points, "cells": mesh.cells}
    for name, tag in (("base", tags.BASE), ("cavity", tags.CAVITY), ("channel", tags.CHANNEL)):
        found[name] = owners(mesh.cells, mesh.tagged(tag))
    assert len(np.unique(mesh.cells)) == len(mesh.points)
    return found | rules()


#: turns of a hexahedron that bring each of its faces to the bottom
TURNS = (
    [0, 1, 2, 3, 4, 5, 6, 7],
    [4, 7, 6, 5, 0, 3, 2, 1],
    [0, 4, 5, 1, 3, 7, 6, 2],
    [3, 2, 6, 7, 0, 1, 5, 4],
    [0, 3, 7, 4, 1, 2, 6, 5],
    [1, 5, 6, 2, 0, 4, 7, 3],
)


def owners(cells, facets):
    """Cells (k, 8) that own the facets (k, 4), turned so that the facet is their bottom."""
    turned = np.concatenate([cells[:, turn] for turn in TURNS])

    def keys(corners):
        return np.sort(corners, axis=1)[:, :3] @ np.array([2**42, 2**21, 1])

    known = keys(turned[:, :4])
    order = np.argsort(known)
    return turned[order[np.searchsorted(known[order], keys(facets))]]


def rules():
    from basix import CellType, make_quadrature

    from pneunet.hifi.fem.mixed_field import DEGREE

    volume = make_quadrature(CellType.hexahedron, DEGREE)
    facet = make_quadrature(CellType.quadrilateral, DEGREE)
    return {
        "volume_points": volume[0],
        "volume_weights": volume[1],
        "facet_points": facet[0],
        "facet_weights": facet[1],
    }
