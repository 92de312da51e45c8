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
    """Folder with manipulator.npz, mesh.json and mesh.npz for this mesh size (mm); made once.

    mesh.npz: points (n, 3) in mm, tets (m, 4), base, cavity and channel (k, 4) tets whose first three
    vertices are a facet of that surface, all of positive volume, and the rules with which ours integrates:
    volume_points (q, 3), volume_weights, facet_points (q, 2), facet_weights on the unit simplices.
    """
    from pneunet.geometry.cad.mesh import mesh_manipulator, segment_tables

    directory, manipulator = Path(directory), manipulator or segment()
    facts = directory / "mesh.json"
    if facts.exists() and (directory / "mesh.npz").exists():
        known = json.loads(facts.read_text())
        if known["mesh_size_mm"] == mesh_size and known["segments"] == json.loads(
            json.dumps(segment_tables(manipulator))
        ):
            return directory
    mesh_manipulator(manipulator, mesh_size, directory, "tetrahedra")
    with atomic_path(directory / "mesh.npz") as temporary:
        with open(temporary, "wb") as file:
            np.savez(file, **arrays(directory / "manipulator.npz"))
    return directory


def arrays(path):
    """What mesh.npz holds, of a mesh of ours."""
    from pneunet.geometry import tags
    from pneunet.geometry.meshfile import read_mesh

    mesh, _ = read_mesh(path)
    found = {"points": mesh.points, "tets": mesh.cells}
    for name, tag in (("base", tags.BASE), ("cavity", tags.CAVITY), ("channel", tags.CHANNEL)):
        found[name] = owners(mesh.cells, mesh.tagged(tag))
    assert len(np.unique(mesh.cells)) == len(mesh.points)
    return found | rules()


def owners(tets, facets):
    """Tets (k, 4) that own the facets (k, 3), in an even permutation that brings the facet to the front."""
    fronts = np.concatenate(
        [tets[:, even] for even in ([0, 1, 2, 3], [1, 0, 3, 2], [0, 2, 3, 1], [2, 1, 3, 0])]
    )

    def keys(corners):
        return np.sort(corners, axis=1) @ np.array([2**42, 2**21, 1])

    known = keys(fronts[:, :3])
    order = np.argsort(known)
    return fronts[order[np.searchsorted(known[order], keys(facets))]]


def rules():
    from basix import CellType, make_quadrature

    from pneunet.hifi.fem.mixed_field import DEGREE

    volume = make_quadrature(CellType.tetrahedron, DEGREE)
    facet = make_quadrature(CellType.triangle, DEGREE)
    return {
        "volume_points": volume[0],
        "volume_weights": volume[1],
        "facet_points": facet[0],
        "facet_weights": facet[1],
    }
