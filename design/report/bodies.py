"""Bodies to render: the reduced model's, the finite elements', curves as tubes (base.pictures.rendering makes
pictures of them)."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base import se3
from pneunet.base.pictures.rendering import edges
from pneunet.base.pictures.walls import FIELD
from pneunet.design.report.labels import TARGET, segment_colour
from pneunet.geometry.parameters import Manipulator
from pneunet.reduced.rod.laws import SegmentLaw

if TYPE_CHECKING:
    from pyvista import PolyData, UnstructuredGrid


def tube(points: np.ndarray, radius: float = 0.9, colour: str = TARGET) -> tuple["PolyData", dict]:
    """A curve (n, 3) as something to render."""
    import pyvista

    return pyvista.lines_from_points(np.asarray(points, float)).tube(radius=radius), {"color": colour}


def body_mesh(
    manipulator: Manipulator, pressure: float, law: SegmentLaw, base_pose: np.ndarray | None
) -> "PolyData":
    """The reduced model's body (pyvista.PolyData, mm, target coordinates), cell data "segment" 1.. ."""
    import pyvista

    from pneunet.reduced.rod.outline import body_surface

    vertices, quads, segments = body_surface(manipulator, pressure, law, base_pose=base_pose)
    mesh = pyvista.PolyData(vertices, np.column_stack([np.full(len(quads), 4), quads]).ravel())
    mesh.cell_data["segment"] = segments + 1
    return mesh


def painted(mesh: "PolyData") -> list[tuple["PolyData", dict]]:
    """A body in the colours of its segments, with its sharp edges, as things to render."""
    from matplotlib.colors import to_rgb

    mesh = mesh.copy()
    segments = np.asarray(mesh.cell_data["segment"]) - 1
    colours = np.array([to_rgb(segment_colour(i)) for i in range(segments.max() + 1)])
    mesh.cell_data["colour"] = (255 * colours[segments]).astype(np.uint8)
    return [(mesh, {"scalars": "colour", "rgb": True, "preference": "cell"}), edges(mesh)]


def read_solution(path: str | Path) -> "UnstructuredGrid":
    """The last step of a ParaView collection as the undeformed pyvista grid with its point data."""
    import pyvista

    reader = pyvista.get_reader(str(path))
    reader.set_active_time_value(reader.time_values[-1])
    return reader.read()[0]


def facing_walls(surface: "PolyData") -> "PolyData | None":
    """The part of a solution's surface where walls face each other across a gap (point data FIELD); None
    without any."""
    if FIELD not in surface.point_data:
        return None
    facing = np.isfinite(surface.point_data[FIELD])
    walls = surface.extract_points(facing, adjacent_cells=False, include_cells=True).extract_surface()
    return walls if walls.n_cells else None


def deformed_surface(
    grid: "UnstructuredGrid", base_pose: np.ndarray
) -> tuple["PolyData", tuple["PolyData", dict]]:
    """(surface, sharp edges) of a solution, moved by its displacement and into target coordinates; point data
    "displacement length" (mm) beside the solver's own."""
    surface = grid.extract_surface(nonlinear_subdivision=1)
    surface.point_data["displacement length"] = np.linalg.norm(surface.point_data["displacement"], axis=1)
    # the edges of the undeformed shape, carried along: a bent wall gets none
    lines, look = edges(surface)
    for mesh in (surface, lines):
        mesh.points = se3.transform(base_pose, mesh.points + mesh.point_data["displacement"])
    return surface, (lines, look)
