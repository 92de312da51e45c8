"""Bodies to render: the reduced model's, the finite elements', curves as tubes (base.pictures.rendering makes
pictures of them)."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.files.reading import open_file
from pneunet.base.files.text import read_text
from pneunet.base.pictures.rendering import View, edges, view_of
from pneunet.base.pictures.walls import FIELD
from pneunet.design.report.comparison import Comparison
from pneunet.design.report.labels import TARGET, rgb, segment_colour
from pneunet.design.report.rundata import DesignFolder
from pneunet.geometry.parameters import Manipulator
from pneunet.reduced.rod.centreline import Centreline
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.prediction import predict, predict_design

if TYPE_CHECKING:
    from pyvista import PolyData, UnstructuredGrid

#: bytes of a step's file
LARGEST_FIELDS = 2_000_000_000


def tube(points: np.ndarray, radius: float = 0.9, colour: str = TARGET) -> tuple["PolyData", dict]:
    """A curve (n, 3) as something to render."""
    import pyvista

    return pyvista.lines_from_points(np.asarray(points, float)).tube(radius=radius), {"color": colour}


def body_mesh(manipulator: Manipulator, line: Centreline) -> "PolyData":
    """The body along a Centreline of it, as the reduced model has it (pyvista.PolyData, mm), cell data
    "segment" 1.. ."""
    import pyvista

    from pneunet.reduced.rod.outline import body_surface

    vertices, quads, segments = body_surface(manipulator, line)
    mesh = pyvista.PolyData(vertices, np.column_stack([np.full(len(quads), 4), quads]).ravel())
    mesh.cell_data["segment"] = segments + 1
    return mesh


def painted(mesh: "PolyData") -> list[tuple["PolyData", dict]]:
    """A body in the colours of its segments, with its sharp edges, as things to render."""
    mesh = mesh.copy()
    segments = np.asarray(mesh.cell_data["segment"]) - 1
    colours = np.array([rgb(segment_colour(i)) for i in range(segments.max() + 1)], np.uint8)
    mesh.cell_data["colour"] = colours[segments]
    return [(mesh, {"scalars": "colour", "rgb": True, "preference": "cell"}), edges(mesh)]


def read_solution(path: str | Path) -> "UnstructuredGrid":
    """The last step of a ParaView collection, as `read_step` gives it."""
    return read_step(listed_steps(path)[-1])


def listed_steps(path: str | Path) -> list[Path]:
    """The files that a ParaView collection names, in order, all of them beside it; InputError otherwise."""
    try:
        listed = ElementTree.fromstring(read_text(path)).findall(".//DataSet")
        listed.sort(key=lambda each: float(each.get("timestep", "nan")))
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error})") from None
    names = [each.get("file", "") for each in listed]
    if not names:
        raise InputError(f"{path}: is damaged (it names no file)")
    if any(not name or Path(name).name != name for name in names):
        raise InputError(f"{path}: names a file that does not lie beside it")
    return [Path(path).with_name(name) for name in names]


def read_step(path: str | Path) -> "UnstructuredGrid":
    """A step's file as the undeformed pyvista grid with its point data; InputError where that is damaged."""
    from vtkmodules.vtkCommonCore import vtkObject

    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()  # the reader's own words come in many lines
    try:
        grid = _read_grid(path)
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
    corners = np.asarray(grid.cell_connectivity) if grid.n_cells else np.zeros(1, int)
    moved = grid.point_data.get("displacement", np.empty(0))
    sound = grid.n_cells and corners.min() >= 0 and corners.max() < grid.n_points
    if not sound or np.shape(moved) != (grid.n_points, 3) or not np.isfinite([moved, grid.points]).all():
        raise InputError(f"{path}: is damaged: it holds no body with finite displacements")
    return grid


def _read_grid(path):
    import pyvista

    try:
        with open_file(path, LARGEST_FIELDS) as stream:  # VTK itself crashes on half a file
            for _, element in ElementTree.iterparse(stream):
                element.clear()
        return pyvista.read(path)
    except InputError:
        raise
    except Exception as error:  # the reader's are of many types
        raise InputError(f"{path}: is damaged ({error})") from None


@dataclass(frozen=True, eq=False)
class Scene:
    """The bodies of a report, in target coordinates, and the view that holds them and the target.

    reduced: at the last pressure of the finite elements, without them at the design's. rest: at none. solved:
    `deformed_surface`. None for what there is not.
    """

    reduced: "PolyData | None"
    rest: "PolyData"
    solved: "tuple[PolyData, tuple[PolyData, dict]] | None"
    view: View

    @classmethod
    def of(cls, run: DesignFolder, comparison: Comparison, law: SegmentLaw) -> "Scene":
        """Of a folder, whose fields are sound, and of what was compared there."""
        design, solve, reduced, solved = run.design, run.solve, None, None
        pressure = design.pressure if solve is None else design.scaled(solve.pressure)
        if (comparison.reduced if solve is None else comparison.reduced_at_solve) is not None:
            reduced = body_mesh(design.manipulator, predict_design(design, pressure, law))
        if solve is not None and solve.solution is not None:
            solved = deformed_surface(read_solution(solve.solution), design.base_pose)
        unloaded = predict(design.manipulator, 0.0, law, base_pose=design.base_pose)
        rest = body_mesh(design.manipulator, unloaded)
        held = [np.asarray(body.points) for body in (reduced, solved and solved[0]) if body is not None]
        held += [c for c in (run.target, comparison.solved, comparison.reduced) if c is not None]
        return cls(reduced, rest, solved, view_of(np.vstack(held or [rest.points])))


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
