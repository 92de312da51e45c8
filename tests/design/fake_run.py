"""A run directory as the commands leave it, small and consistent: the "finite elements" are the reduced model
with every strain (departure from rest) times `FACTOR`, so the report's numbers can be foreseen."""

import json

import numpy as np

from pneunet.base.files.atomic import write_csv
from pneunet.base.files.schemas import CENTRELINE, CENTRELINES, POINT, SEGMENTS, STEPS, WALLS
from pneunet.base.strains import RodStrains
from pneunet.geometry.designfile import DesignFile, body_tables, write_design_file
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced import AnalyticLaw, predict
from pneunet.reduced.rod.prediction import segment_strains

FACTOR = 0.8
POSE = np.array([[0.0, -1.0, 0.0, 5.0], [1.0, 0.0, 0.0, -3.0], [0.0, 0.0, 1.0, 2.0], [0.0, 0.0, 0.0, 1.0]])
TWIST = Segment("twisting", 60.0, 4, chamber_height=5.5, gap=2.0, cavity_floor=0.5)
HELIX = Segment("one-sided", 60.0, 9, gap=1.5)
PLANE = Segment("one-sided", 90.0, 4, gap=1.5)


class Scaled(AnalyticLaw):
    """FACTOR times the analytic model's strains."""

    def strains(self, segment, pressure):
        rest = RodStrains.unstrained().vector
        return RodStrains.of_vector(rest + FACTOR * (super().strains(segment, pressure).vector - rest))


def make_run(
    directory,
    segments=(TWIST, PLANE, HELIX),
    pressure=0.02,
    reached=1.0,
    overlap=0.0,
    contact=False,
    solve=True,
    fields=True,
):
    """Fill `directory`; the solve ends at `reached` times the pressure (MPa), one gap overlaps by `overlap`
    mm there, with `contact` as a contact model's penetration."""
    manipulator, model = Manipulator(segments), AnalyticLaw()
    design = DesignFile(manipulator, pressure, name="test arm", base_pose=POSE, target="target.csv")
    directory.mkdir(parents=True, exist_ok=True)
    write_design_file(directory / "design.toml", design)
    line = predict(manipulator, pressure, model, base_pose=POSE)
    wave = np.column_stack([np.zeros_like(line.s), np.zeros_like(line.s), 1.5 * (1 - np.cos(line.s / 20.0))])
    write_csv(directory / "target.csv", POINT, line.points + wave)
    write_csv(directory / "centreline.csv", CENTRELINE, np.column_stack([line.s, line.points]))
    record = {"command": "pneunet design target.csv", "revision": "abc", "inputs": {"law": "analytic"}}
    (directory / "run.json").write_text(json.dumps(record))
    if not solve:
        return design
    (directory / "mesh").mkdir(exist_ok=True)
    (directory / "mesh" / "mesh.json").write_text(
        json.dumps({"cells": 1000, "mesh_size_mm": 2.0, "volumes": {"body_mm3": 1234.5}})
    )
    _solve(directory / "solve", design, Scaled(), reached, overlap, contact, fields)
    return design


def _solve(folder, design, model, reached, overlap, contact, fields):
    folder.mkdir(exist_ok=True)
    manipulator = design.manipulator
    steps, centrelines, segments = [], [], []
    for n, p in enumerate(design.largest_pressure * reached * np.linspace(0, 1, 5)):
        line = predict(manipulator, design.scaled(p), model, spacing=3.0)
        each = segment_strains(manipulator, line).vector
        work = (4, 2) if n else (0, 0)
        steps.append(
            [n, p * 1e3, *work, 900 + 4e3 * p, *line.points[-1], 1.0 - 10 * p, 0, 20.0, 0, 0, 1 + 5 * p]
            + [0, 0, 0, 1.5 * n]
        )
        centrelines += [[n, p * 1e3, s, *point, 0, 0] for s, point in zip(line.s, line.points)]
        segments += [[n, p * 1e3, i + 1, *one, 0, 0] for i, one in enumerate(each)]
    walls = [
        [i + 1, "top" if side > 0 else "bottom", gap, s.gap, s.gap * (0.4 + 0.5 * gap / s.chambers)]
        for i, s in enumerate(manipulator.segments)
        for side in s.sides
        for gap in range(1, s.chambers)
    ]
    if overlap:
        walls[0][4] = -overlap
        steps[-1][8:10] = -overlap, int(not contact)
    for name, columns, rows in (("steps", STEPS, steps), ("centrelines", CENTRELINES, centrelines)):
        write_csv(folder / f"{name}.csv", columns, rows)
    write_csv(folder / "segments.csv", SEGMENTS, segments)
    write_csv(folder / "walls.csv", WALLS, walls)
    (folder / "run.json").write_text(
        json.dumps(
            {
                "command": "mpirun -n 2 pneunet solve design.toml",
                "ranks": 2,
                "dofs": 12345,
                "versions": {"dolfinx": "0.5.2"},
                "status": "reached",
                "contact": contact,
                "first_touch_kPa": 0.9e3 * design.largest_pressure * reached if overlap else None,
                "body": body_tables(manipulator),
                "pressure_shares": list(design.shares),
                "steps": [[1], [2]],
            }
        )
    )
    if fields:
        _fields(folder, manipulator, line)


def _fields(folder, manipulator, line):
    """solution.pvd with one .vtu: hexahedra of a bar, displaced by the line's section frames."""
    import pyvista

    s0 = manipulator.segments[0]
    x = np.linspace(0, manipulator.length, 60)
    grid = pyvista.RectilinearGrid(
        x, np.linspace(-s0.width / 2, s0.width / 2, 5), np.linspace(-2, 4, 4)
    ).cast_to_unstructured_grid()
    rest = np.asarray(grid.points, float)
    poses = line.at(np.clip(rest[:, 0], 0, line.s[-1]))
    local = rest * [0, 1, 1]
    moved = np.einsum("nij,nj->ni", poses[:, :3, :3], local) + poses[:, :3, 3]
    grid.point_data["displacement"] = moved - rest
    grid.point_data["mean_stretch"] = 1 + 0.1 * np.abs(rest[:, 2])
    grid.point_data["pressure"] = np.zeros(grid.n_points)
    facing = (rest[:, 2] > 2) & (np.abs(rest[:, 0] - 20.0) < 5)
    grid.point_data["wall_distance_mm"] = np.where(facing, 0.1 * rest[:, 1], np.nan)
    grid.save(folder / "solution_0.vtu")
    (folder / "solution.pvd").write_text(
        '<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>'
        '<DataSet timestep="20" part="0" file="solution_0.vtu"/></Collection></VTKFile>'
    )
