"""Picture of a deformed cell, repeated by its screw: where do neighbouring chambers touch?"""

from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base import se3
from pneunet.base.system.libraries import load_vtk
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry import tags
from pneunet.hifi.contact.walls import CellWalls, distances_from
from pneunet.hifi.fem import surface
from pneunet.hifi.fem.facets import kind_of

PITCHES = 3
DIVISIONS = 3


def draw_cell(problem: Any, state: Any, path: Path, pitches: int = PITCHES) -> bool:
    """Write the picture of a hifi.cell.system.CellState of a hifi.cell.problem.CellProblem to `path` (PNG);
    False without gaps.

    The problem's own state is as before. Needs pyvista and matplotlib.
    """
    from pneunet.base.pictures.rendering import edges
    from pneunet.base.pictures.walls import FIELD, TOUCHING, draw_walls

    load_vtk()
    kept = problem.strains.value.copy()
    problem.strains.value[:] = state.strains.vector
    try:
        distances = node_distances(CellWalls(problem), state.array)
    finally:
        problem.strains.value[:] = kept
    facets = surface.facet_nodes(problem, tags.OUTER)
    of_facets = distances[facets]
    facing = np.isfinite(of_facets).all(axis=1)
    if not facing.any():
        return False
    shifts = problem.segment.pitch * (np.arange(pitches) - (pitches - 1) / 2)
    images = [(turn, shift) for shift in shifts for turn in problem.turns]
    rest, moved = (
        np.concatenate(x) for x in zip(*(_positions(problem, state, facets, *image) for image in images))
    )
    body = _mesh(rest)
    body.point_data["moved"] = _fine(moved)
    # facets share their points, so that only real edges are edges
    body = body.clean(tolerance=1e-6, absolute=True)
    lines, _ = edges(body)
    for mesh in (body, lines):
        mesh.points = mesh.point_data["moved"]
    walls = _mesh(moved[np.tile(facing, len(images))])
    walls.point_data[FIELD] = np.tile(_fine(of_facets[facing][..., None])[:, 0], len(images))
    gap, contact = problem.segment.gap, state.contact is not None
    told = (
        f"walls overlap by {-state.wall_distance:.2f} mm"
        if state.walls_overlap
        else f"walls {state.wall_distance:.3f} mm apart"
    )
    title = f"{state.pressure * KPA_PER_MPA:.4g} kPa, {'' if contact else 'no '}contact: {told}"
    draw_walls(path, body, lines, walls, gap, title, TOUCHING * gap if contact else 0.0)
    return True


def node_distances(walls: CellWalls, array: np.ndarray) -> np.ndarray:
    """(nodes,) signed distances (mm) from the wall opposite, of the displacement nodes on the walls of a
    CellWalls; nan elsewhere."""
    out = np.full(len(walls.problem.nodes), np.nan)
    for pair in walls.gaps:
        placed = [walls.positions(wall, array) for wall in pair]
        for wall, own, other in zip(pair, placed, placed[::-1]):
            np.fmin.at(out, wall.facets.ravel(), distances_from(other, own.reshape(-1, 3)))
    return out


def _positions(problem, state, facets, turn, shift):
    """(rest, deformed) positions (facets, nodes, 3) in mm of the image by a half turn of the facets of the
    pitch that lies `shift` mm further along the body."""
    X = problem.nodes[facets] * turn + [shift, 0, 0]
    screw = se3.exp_pose(state.strains.twist_vector * X[..., :1])
    local = X * [0, 1, 1] + problem.displacement(state.array)[facets] * turn
    return X, np.einsum("...ij,...j->...i", screw[..., :3, :3], local) + screw[..., :3, 3]


def _fine(values):
    """(points, m) of (facets, nodes, m): at the corners of the flat triangles that a facet is drawn as."""
    return np.einsum("tcn,fnm->ftcm", kind_of(values).flat(DIVISIONS), values).reshape(-1, values.shape[-1])


def _mesh(facets):
    """pyvista.PolyData of flat triangles, three points each."""
    import pyvista

    points = _fine(facets)
    triangles = np.arange(len(points)).reshape(-1, 3)
    return pyvista.PolyData(points, np.column_stack([np.full(len(triangles), 3), triangles]).ravel())
