"""What stands in a run directory, read for pictures and the report; parts that are not there yet are None."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_columns, read_csv
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.designfile import Design, body_tables, read_design
from pneunet.reduced.choice import TRAINED

POINTS = ["x_mm", "y_mm", "z_mm"]
STEP_COLUMNS = [
    "step",
    "pressure_kPa",
    "iterations",
    "factorisations",
    "volume_mm3",
    "tip_x_mm",
    "tip_y_mm",
    "tip_z_mm",
    "smallest_wall_distance_mm",
    "walls_overlap",
    "body_distance_mm",
    "body_overlap",
    "largest_stretch",
    "seconds",
]


@dataclass(frozen=True)
class Solution:
    """The finite element solution. Lengths in mm, body frame; kPa as in the files.

    steps: {column: (n,)}, "seconds" counted from the start; pressure of the last accepted step in MPa; s
    (m,), points (m, 3): its centreline; strains: RodStrains of shape (segments, 3) at that step; walls:
    [(segment 1.., side +1/-1, gap 1.., distance)] of the gaps that have walls; history: [(pressure in MPa, s,
    points)] of all steps; solution: the ParaView file, or None; record: run.json.

    From the first touch of walls without contact, or of parts that are far apart along the body, the steps
    are marked (columns walls_overlap, body_overlap): they are not what a real body does.
    """

    steps: dict
    pressure: float
    s: np.ndarray
    points: np.ndarray
    strains: RodStrains
    history: list
    walls: list
    solution: Path | None
    record: dict

    def __repr__(self) -> str:
        reached = f"{len(self.steps['step'])} steps to {self.pressure_kPa:.4g} kPa"
        return f"<Solution: {reached}, tip at {self.tip.round(2)} mm>"

    @property
    def pressure_kPa(self) -> float:
        """Of the last accepted step."""
        return self.pressure * KPA_PER_MPA

    @property
    def tip(self) -> np.ndarray:
        """(3,) last point of the centreline, mm."""
        return self.points[-1]

    @property
    def fields(self) -> list[Path]:
        """ParaView's files, one a step, in order; pyvista.read opens them."""
        return sorted(self.solution.parent.glob("step_*.vtu")) if self.solution else []

    @property
    def walls_overlap(self) -> bool:
        return bool(self.steps["walls_overlap"][-1])

    @property
    def body_overlap(self) -> bool:
        return bool(self.steps["body_overlap"][-1])

    @property
    def contact(self) -> bool:
        """Whether a contact model kept neighbouring walls apart."""
        return bool(self.record.get("contact", False))


@dataclass(frozen=True)
class DesignFolder:
    """directory; design; target (n, 3) and centreline (s (m,), points (m, 3)) in target coordinates; mesh,
    record: the JSON files; solve; stale: the folder holds a solution of another body, or under other loads,
    than design.toml's, which is left out."""

    directory: Path
    design: Design
    target: np.ndarray | None
    centreline: tuple | None
    record: dict
    mesh: dict
    solve: Solution | None
    stale: bool = False

    @property
    def law(self) -> str:
        """Name of the law that `pneunet design` took."""
        return self.record.get("inputs", {}).get("law", TRAINED)


def read_design_folder(directory: str | Path) -> "DesignFolder":
    """The DesignFolder in a directory that holds at least design.toml; InputError otherwise."""
    directory = Path(directory)
    if not (directory / "design.toml").is_file():
        raise InputError(f"{directory}: holds no design.toml: give the folder that `pneunet design -o` wrote")
    target = directory / "target.csv"
    centreline = directory / "centreline.csv"
    columns = read_columns(centreline, ["s_mm", *POINTS]) if centreline.is_file() else None
    design, solve = read_design(directory / "design.toml"), _solve(directory / "solve")
    ours = {"body": body_tables(design.manipulator), "loads": design.loads.table()}
    stale = solve is not None and any(solve.record.get(name, value) != value for name, value in ours.items())
    return DesignFolder(
        directory,
        design,
        read_columns(target, POINTS) if target.is_file() else None,
        None if columns is None else (columns[:, 0], columns[:, 1:]),
        _json(directory / "run.json"),
        _json(directory / "mesh" / "mesh.json"),
        None if stale else solve,
        stale,
    )


def _json(path):
    """The JSON object in a file; {} when it is not there."""
    if not path.is_file():
        return {}
    try:
        return json.loads(path.read_text())
    except ValueError as error:
        raise InputError(f"{path}: not valid JSON ({error})") from None


def _solve(directory):
    """The solve, if a step beyond the rest state was accepted; else None."""
    if not (directory / "steps.csv").is_file():
        return None
    table = read_columns(directory / "steps.csv", STEP_COLUMNS)
    if len(table) < 2:
        return None
    last = table[-1, 0]
    centrelines = read_columns(directory / "centrelines.csv", ["step", "s_mm", *POINTS])
    centreline = centrelines[centrelines[:, 0] == last]
    strains = read_columns(
        directory / "segments.csv", ["step", "e1", "e2", "e3", "k1_rad_per_mm", "k2_per_mm", "k3_per_mm"]
    )
    strains = strains[strains[:, 0] == last]
    solution = directory / "solution.pvd"
    return Solution(
        steps=dict(zip(STEP_COLUMNS, table.T)),
        pressure=table[-1, 1] * 1e-3,
        s=centreline[:, 1],
        points=centreline[:, 2:],
        strains=RodStrains(strains[:, 1:4], strains[:, 4:7]),
        history=[(row[1] * 1e-3, *_step(centrelines, row[0])) for row in table[1:]],
        walls=_walls(directory / "walls.csv"),
        solution=solution if solution.is_file() else None,
        record=_json(directory / "run.json"),
    )


def _step(centrelines, number):
    rows = centrelines[centrelines[:, 0] == number]
    return rows[:, 1], rows[:, 2:]


def _walls(path):
    if not path.is_file():
        return []
    header, rows = read_csv(path)
    read = [dict(zip(header, row)) for row in rows]
    found = [
        (int(r["segment"]), 1 if r["side"] == "top" else -1, int(r["gap"]), float(r["distance_mm"]))
        for r in read
    ]
    return [gap for gap in found if np.isfinite(gap[3])]
