"""What stands in a run directory, read for pictures and the report; parts that are not there yet are None."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files import schemas
from pneunet.base.files.record import read_record
from pneunet.base.files.schemas import read_table
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA, MPA_PER_KPA
from pneunet.geometry.designfile import DesignFile, body_tables, read_design_file
from pneunet.reduced.choice import TRAINED


@dataclass(frozen=True, eq=False)
class Solution:
    """The finite element solution. Lengths in mm, body frame; kPa as in the files.

    steps: steps.csv as a structured array (n,), "seconds" counted from the start; pressure of the last
    accepted step in MPa; s (m,), points (m, 3): its centreline; strains: RodStrains of shape (segments, 3) at
    that step; walls: [(segment 1.., side +1/-1, gap 1.., distance)] of the gaps that have walls; history:
    [(pressure in MPa, s, points)] of all steps; solution: the ParaView file, or None; record: run.json.

    From the first touch of walls without contact, or of parts that are far apart along the body, the steps
    are marked (columns walls_overlap, body_overlap): they are not what a real body does.
    """

    steps: np.ndarray
    pressure: float
    s: np.ndarray
    points: np.ndarray
    strains: RodStrains
    history: list[tuple[float, np.ndarray, np.ndarray]]
    walls: list[tuple[int, int, int, float]]
    solution: Path | None
    record: dict

    def __repr__(self) -> str:
        reached = f"{len(self.steps)} steps to {self.pressure_kPa:.4g} kPa"
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


@dataclass(frozen=True, eq=False)
class DesignFolder:
    """directory; design; target (n, 3) and centreline (s (m,), points (m, 3)) in target coordinates; mesh,
    record: the JSON files; solve; stale: the folder holds a solution of another body, or under other loads,
    than design.toml's, which is left out."""

    directory: Path
    design: DesignFile
    target: np.ndarray | None
    centreline: tuple[np.ndarray, np.ndarray] | None
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
    design, solve = read_design_file(directory / "design.toml"), _solve(directory / "solve")
    ours = {"body": body_tables(design.manipulator), "loads": design.loads.table()}
    stale = solve is not None and any(solve.record.get(name, value) != value for name, value in ours.items())
    return DesignFolder(
        directory,
        design,
        _columns(read_table(target, schemas.POINT), schemas.POINT) if target.is_file() else None,
        _centreline(read_table(centreline, schemas.CENTRELINE)) if centreline.is_file() else None,
        read_record(directory / "run.json"),
        read_record(directory / "mesh" / "mesh.json"),
        None if stale else solve,
        stale,
    )


def _solve(directory):
    """The solve, if a step beyond the rest state was accepted; else None."""
    if not (directory / "steps.csv").is_file():
        return None
    steps = read_table(directory / "steps.csv", schemas.STEPS)
    if len(steps) < 2:
        return None
    lines = read_table(directory / "centrelines.csv", schemas.CENTRELINES)
    segments = read_table(directory / "segments.csv", schemas.SEGMENTS)
    last, solution = steps[-1]["step"], directory / "solution.pvd"
    s, points = _centreline(lines[lines["step"] == last])
    strains = _columns(segments[segments["step"] == last], schemas.STRAINS)
    return Solution(
        steps=steps,
        pressure=steps[-1]["pressure_kPa"] * MPA_PER_KPA,
        s=s,
        points=points,
        strains=RodStrains(strains[:, :3], strains[:, 3:]),
        history=[
            (step["pressure_kPa"] * MPA_PER_KPA, *_centreline(lines[lines["step"] == step["step"]]))
            for step in steps[1:]
        ],
        walls=_walls(directory / "walls.csv"),
        solution=solution if solution.is_file() else None,
        record=read_record(directory / "run.json"),
    )


def _columns(table, names):
    """(n, names) of a table from pneunet.base.files.schemas.read_table."""
    return np.column_stack([table[name] for name in names])


def _centreline(table):
    """Arc lengths (n,) and points (n, 3), mm."""
    return table["s_mm"], _columns(table, schemas.POINT)


def _walls(path):
    if not path.is_file():
        return []
    table = read_table(path, [name for name in schemas.WALLS if name not in schemas.WORDS])
    return [
        (int(row["segment"]), 1 if row["side"] == "top" else -1, int(row["gap"]), float(row["distance_mm"]))
        for row in table[np.isfinite(table["distance_mm"])]
    ]
