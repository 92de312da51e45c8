"""What stands in a run directory, read for pictures and the report; parts that are not there yet, or damaged,
are None."""

from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files import schemas
from pneunet.base.files.record import read_record
from pneunet.base.files.schemas import STEP_FILES, read_table
from pneunet.base.quantities import LARGEST_NUMBER, shown
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA, MPA_PER_KPA
from pneunet.geometry.designfile import DesignFile, body_tables, read_design_file
from pneunet.reduced.choice import TRAINED

#: columns of steps.csv that are infinite where there is nothing to be near to
DISTANCES = ("smallest_wall_distance_mm", "body_distance_mm")
#: what the report reads of the records, and of what type it is where it stands there
OF_DESIGN: dict[str, Any] = {"inputs": dict, "inputs.law": str}
OF_SOLVE: dict[str, Any] = {"contact": bool, "control": str, "limit_points": list}
OF_SOLVE |= {"pressure_kPa": Real, "mesh_size_mm": Real}
OF_SOLVE |= {
    f"{touch}_{what}": Real
    for touch in ("first_touch", "first_body_touch")
    for what in ("kPa", "dead_load_fraction")
}


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
        return sorted(self.solution.parent.glob(STEP_FILES)) if self.solution else []

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
    than design.toml's, which is left out; damaged: what else is left out, a sentence each."""

    directory: Path
    design: DesignFile
    target: np.ndarray | None
    centreline: tuple[np.ndarray, np.ndarray] | None
    record: dict
    mesh: dict
    solve: Solution | None
    stale: bool = False
    damaged: tuple[str, ...] = ()

    @property
    def law(self) -> str:
        """Name of the law that `pneunet design` took."""
        return self.record.get("inputs", {}).get("law", TRAINED)

    def require_whole(self) -> None:
        """InputError for the first part that is damaged."""
        if self.damaged:
            raise InputError(f"{self.directory / self.damaged[0]}")


def read_design_folder(directory: str | Path) -> "DesignFolder":
    """The DesignFolder in a directory that holds at least a sound design.toml; InputError otherwise."""
    directory, damaged = Path(directory), []

    def whole(read, name, *arguments, instead=None):
        """What `read` finds in a file or folder of the directory."""
        try:
            return read(directory / name, *arguments) if (directory / name).exists() else instead
        except InputError as error:
            damaged.append(str(error).removeprefix(f"{directory}/"))
            return instead

    if not (directory / "design.toml").exists():
        raise InputError(f"{directory}: holds no design.toml: give the folder that `pneunet design -o` wrote")
    design = read_design_file(directory / "design.toml")
    record = whole(_record, "solve/run.json", OF_SOLVE, instead={})
    walls = whole(_walls, "solve/walls.csv", design, instead=[])
    solve = whole(_solve, "solve", design, walls, record)
    ours = {"body": body_tables(design.manipulator), "loads": design.loads.table()}
    ours["pressure_shares"] = list(design.shares)
    stale = solve is not None and any(record.get(name, value) != value for name, value in ours.items())
    return DesignFolder(
        directory,
        design,
        whole(_target, "target.csv"),
        whole(_centreline_file, "centreline.csv"),
        whole(_record, "run.json", OF_DESIGN, instead={}),
        whole(read_record, "mesh/mesh.json", instead={}),
        None if stale else solve,
        stale,
        tuple(damaged),
    )


def _record(path, kinds):
    """run.json; InputError where a key that is read again holds something else."""
    record = read_record(path)
    for name, kind in kinds.items():
        value: object = record
        for key in name.split("."):
            value = value.get(key) if isinstance(value, dict) else value
        if value is not None and (not isinstance(value, kind) or (value != value)):
            raise InputError(f"{path}: '{name}' is {shown(value)}, which no run has written")
    for point in record.get("limit_points", []):
        if not isinstance(point, dict) or not {"kind", "pressure_kPa", "volume_mm3"} <= set(point):
            raise InputError(f"{path}: 'limit_points' holds {shown(point)}, which no run has written")
        numbers = point["pressure_kPa"], point["volume_mm3"]
        if not all(isinstance(value, (int, float)) and np.isfinite(value) for value in numbers):
            raise InputError(f"{path}: 'limit_points' holds {shown(point)}, which no run has written")
    return record


def _finite(path, names):
    """A table whose columns `names` are finite."""
    table = read_table(path, names)
    for name in names:
        bad = np.flatnonzero(~(np.abs(table[name]) <= LARGEST_NUMBER))
        if len(bad):
            raise InputError(f"{path} row {bad[0] + 2}: '{name}' is not a finite number")
    return table


def _solve(directory, design, walls, record):
    """The solve, if a step beyond the rest state was accepted; else None."""
    if not (directory / "steps.csv").exists():
        return None
    steps = _finite(directory / "steps.csv", [name for name in schemas.STEPS if name not in DISTANCES])
    if len(steps) < 2:
        return None
    read_table(directory / "steps.csv", DISTANCES)
    lines = _finite(directory / "centrelines.csv", schemas.CENTRELINES)
    segments = _finite(directory / "segments.csv", schemas.SEGMENTS)
    last, solution = steps[-1]["step"], directory / "solution.pvd"
    strains = _columns(segments[segments["step"] == last], schemas.STRAINS)
    if len(strains) != len(design.manipulator.segments):
        raise InputError(f"{directory / 'segments.csv'}: holds {len(strains)} segments in the last step")
    history = [
        (
            step["pressure_kPa"] * MPA_PER_KPA,
            *_centreline(lines[lines["step"] == step["step"]], directory / "centrelines.csv"),
        )
        for step in steps[1:]
    ]
    _, s, points = history[-1]
    return Solution(
        steps=steps,
        pressure=steps[-1]["pressure_kPa"] * MPA_PER_KPA,
        s=s,
        points=points,
        strains=RodStrains(strains[:, :3], strains[:, 3:]),
        history=history,
        walls=walls,
        solution=solution if solution.exists() else None,
        record=record,
    )


def _columns(table, names):
    """(n, names) of a table from pneunet.base.files.schemas.read_table."""
    return np.column_stack([table[name] for name in names])


def _target(path):
    return _columns(_finite(path, schemas.POINT), schemas.POINT)


def _centreline_file(path):
    return _centreline(_finite(path, schemas.CENTRELINE), path)


def _centreline(table, path):
    """Arc lengths (n,) and points (n, 3), mm."""
    if len(table) < 2 or not (np.diff(table["s_mm"]) > 0).all():
        raise InputError(f"{path}: 's_mm' of a step does not rise from row to row")
    return table["s_mm"], _columns(table, schemas.POINT)


def _walls(path, design):
    table = read_table(path, [name for name in schemas.WALLS if name not in schemas.WORDS])
    known = np.arange(1, len(design.manipulator.segments) + 1)
    if not np.isin(table["segment"], known).all() or not np.isfinite(table["gap"]).all():
        raise InputError(f"{path}: names a segment or a gap that the design has not")
    return [
        (int(row["segment"]), 1 if row["side"] == "top" else -1, int(row["gap"]), float(row["distance_mm"]))
        for row in table[np.isfinite(table["distance_mm"])]
    ]
