"""A run's bodies over its load steps, as triangles with numbers at their corners: what a scene in a browser,
a window or a film shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.schemas import MEAN_STRETCH, step_file
from pneunet.base.pictures.walls import FIELD
from pneunet.base.progress import progress
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.report.bodies import listed_steps, read_step
from pneunet.design.report.labels import plain
from pneunet.design.report.rundata import DesignFolder
from pneunet.geometry.designfile import DesignFile
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.outline import body_surface
from pneunet.reduced.rod.prediction import predict_design

if TYPE_CHECKING:
    from pyvista import UnstructuredGrid

#: point data -> (what it is, with its unit; factor to that unit; colours, as matplotlib and plotly call them)
FIELDS = {
    MEAN_STRETCH: ("largest principal stretch", 1.0, "viridis"),
    FIELD: ("distance of facing walls, mm", 1.0, "RdYlBu"),
    "pressure": ("pressure in the silicone, kPa", KPA_PER_MPA, "RdBu"),
}
#: of a body without finite elements
REDUCED_STEPS, SPACING = 8, 2.0


@dataclass(frozen=True, eq=False)
class LoadSteps:
    """name; labels: of the n steps; triangles (m, 3) into points, n of (v, 3) in mm, target coordinates;
    fields: {key of FIELDS: n of (v,)}, nan where there is none; lines: the centrelines, n of (k, 3);
    target (t, 3) or None; solved: whether these are finite elements."""

    name: str
    labels: tuple[str, ...]
    triangles: np.ndarray
    points: list[np.ndarray]
    fields: dict[str, list[np.ndarray]]
    lines: list[np.ndarray]
    target: np.ndarray | None
    solved: bool

    def of_steps(self, steps: Sequence[int]) -> "LoadSteps":
        """The same of some steps only."""
        return LoadSteps(
            self.name,
            tuple(self.labels[i] for i in steps),
            self.triangles,
            [self.points[i] for i in steps],
            {key: [values[i] for i in steps] for key, values in self.fields.items()},
            [self.lines[i] for i in steps],
            self.target,
            self.solved,
        )

    def limits(self, key: str) -> tuple[float, float]:
        """Of a field over all steps, without the outermost hundredth at each end: corners of solids are
        singular."""
        values = np.concatenate(self.fields[key])
        values = values[np.isfinite(values)]
        if not len(values):
            return 0.0, 1.0
        low, high = np.percentile(values, [1, 99])
        if key == FIELD:  # centred on walls that touch
            return -float(max(abs(low), abs(high))), float(max(abs(low), abs(high)))
        return float(low), float(high) if high > low else float(low) + 1e-6


def load_steps(run: DesignFolder, law: SegmentLaw, corners: bool = False) -> LoadSteps:
    """The LoadSteps of a run folder: of its finite elements, without their fields of the law's rod. corners:
    only the elements' corners, a quarter of the triangles. InputError where the fields are damaged."""
    solve = run.solve
    if solve is None or solve.solution is None:
        return _reduced(run.design, run.target, law)
    files = listed_steps(solve.solution)
    pressures = {step_file(int(row["step"])): row["pressure_kPa"] for row in solve.steps}
    lines = {step_file(i): points for i, (_, _, points) in enumerate(solve.history, start=1)}
    rest = np.column_stack([solve.s, np.zeros((len(solve.s), 2))])
    pose, labels, points, shown_lines = run.design.base_pose, [], [], []
    fields: dict[str, list[np.ndarray]] = {}
    triangles, nodes = np.zeros((0, 3), int), np.zeros(0, int)
    for i, path in enumerate(progress(files, "load steps")):
        grid = read_step(path)
        if i == 0:
            triangles, nodes = outer_surface(grid, corners)
        if grid.n_points <= nodes.max():
            raise InputError(f"{path}: is of another mesh than {files[0].name}: solve again")
        moved = np.asarray(grid.points)[nodes] + np.asarray(grid.point_data["displacement"])[nodes]
        points.append(se3.transform(pose, moved))
        for key, (_, factor, _) in FIELDS.items():
            if key in grid.point_data:
                values = factor * np.asarray(grid.point_data[key], float)[nodes]
                fields.setdefault(key, []).append(values)
        labels.append(f"{plain(pressures[path.name], 1)} kPa" if path.name in pressures else path.stem)
        shown_lines.append(se3.transform(pose, lines.get(path.name, rest)))
    fields = {
        key: values
        for key, values in fields.items()
        if len(values) == len(files) and np.isfinite(np.concatenate(values)).any()
    }
    name = run.design.name
    return LoadSteps(name, tuple(labels), triangles, points, fields, shown_lines, run.target, True)


def outer_surface(grid: "UnstructuredGrid", corners: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """(triangles (m, 3), nodes of the grid (v,) that they are between) of a solid's outside: what encloses
    all else, closed cavities left out."""
    from scipy.spatial import cKDTree

    surface = grid.extract_surface(nonlinear_subdivision=0 if corners else 1).triangulate().connectivity()
    region = np.asarray(surface.point_data["RegionId"])
    sizes = [np.prod(np.ptp(surface.points[region == r], axis=0)) for r in range(region.max() + 1)]
    keep = region == int(np.argmax(sizes))
    faces = surface.faces.reshape(-1, 4)[:, 1:]
    faces = faces[keep[faces].all(axis=1)]
    used, triangles = np.unique(faces, return_inverse=True)
    # VTK's numbers of the points are those of corners alone
    _, nodes = cKDTree(grid.points).query(surface.points[used])
    return triangles.reshape(-1, 3), nodes


def _reduced(design: DesignFile, target: np.ndarray | None, law: SegmentLaw) -> LoadSteps:
    labels: list[str] = []
    points: list[np.ndarray] = []
    lines: list[np.ndarray] = []
    triangles = np.zeros((0, 3), int)
    for share in np.linspace(0, 1, REDUCED_STEPS + 1):
        pressure = design.scaled(share * design.largest_pressure)
        try:
            line = predict_design(design, pressure, law, SPACING)
        except ConvergenceError:
            if not points:
                raise
            break
        vertices, quads, _ = body_surface(design.manipulator, line, SPACING)
        triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
        points.append(vertices)
        lines.append(line.points)
        labels.append(f"{plain(share * design.largest_pressure * KPA_PER_MPA, 1)} kPa")
    return LoadSteps(design.name, tuple(labels), triangles, points, {}, lines, target, False)
