"""Tables of a solve: one row, or block of rows, for each accepted step."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_csv, write_csv
from pneunet.base.files.schemas import CENTRELINES, MARKS, SEGMENTS, STEPS, WALLS
from pneunet.base.units import KPA_PER_MPA
from pneunet.hifi.body.manipulator import Measured
from pneunet.hifi.contact.touch import Load
from pneunet.hifi.fem.agreement import on_rank_0

COLUMNS = {"steps": STEPS, "centrelines": CENTRELINES, "segments": SEGMENTS}


class Tables:
    """CSV files of a run, rewritten whole after every accepted step so that a kill leaves them valid; their
    rows are known to rank 0 alone. gaps: (segment, side, number, width in mm) of each row of walls.csv;
    shares: of the pressure in each group's cavity, which several groups have as further columns of
    steps.csv."""

    def __init__(
        self, comm: MPI.Comm, directory: Path, gaps: list[tuple], shares: Sequence[float] = (1.0,)
    ) -> None:
        self.comm, self.directory, self.gaps = comm, directory, gaps
        self.shares = shares if len(shares) > 1 else ()
        of_groups = tuple(f"pressure_{group}_kPa" for group in range(1, len(self.shares) + 1))
        self.columns = COLUMNS | {"steps": STEPS + of_groups}
        self.rows: dict[str, list] = {name: [] for name in COLUMNS}

    def resume(self, last: int) -> list[tuple]:
        """Go on from an earlier run's files, with its rows up to step `last`; collective.

        Returns (Load, wall distance, body distance, contact force) of these steps, for a
        hifi.contact.touch.TouchWatch. InputError when the files are of another version's making.
        """
        return on_rank_0(self.comm, lambda: self._read(last))

    def _read(self, last: int) -> list[tuple]:
        for name, columns in self.columns.items():
            path = self.directory / f"{name}.csv"
            try:
                header, rows = read_csv(path)
            except InputError as error:
                raise InputError(f"{error}: solve without --resume") from None
            if tuple(header) != columns:
                raise InputError(f"{path}: has not the columns of this version: solve without --resume")
            for number, row in enumerate(rows, start=2):
                if len(row) != len(columns) or not _numbers(row):
                    raise InputError(f"{path}: row {number} is damaged: solve without --resume")
            self.rows[name] = [row for row in rows if int(row[0]) <= last]
            of_steps = Counter(int(row[0]) for row in self.rows[name])
            if list(of_steps) != list(range(last + 1)) or len(set(of_steps.values())) > 1:
                raise InputError(f"{path}: rows are missing, or there twice: solve without --resume")
        seen = ("smallest_wall_distance_mm", "body_distance_mm", "contact_force_N")
        return [
            (
                Load(float(step["pressure_kPa"]) / KPA_PER_MPA, float(step["dead_load_fraction"])),
                *(float(step[name]) for name in seen),
            )
            for step in self._steps()
        ]

    def _steps(self) -> list[dict[str, Any]]:
        return [dict(zip(STEPS, row)) for row in self.rows["steps"]]

    def history(self) -> list[dict[str, float | bool]]:
        """run.json's list of the steps; rank 0."""
        counts = ("iterations", "factorisations", "stability_factorisations")
        return [
            {
                "step": int(step["step"]),
                "pressure_kPa": float(step["pressure_kPa"]),
                **{name: int(step[name]) for name in counts},
                **{name: bool(int(step[name])) for name in MARKS},
            }
            for step in self._steps()
        ]

    def accepted(self, m: Measured) -> None:
        on_rank_0(self.comm, lambda: self._write(m))

    def _write(self, m: Measured) -> None:
        tip, touch, marks = m.frames[-1, :3, 3], m.touch, [int(holds) for holds in m.touch.marks.values()]
        at = [m.step, m.pressure * KPA_PER_MPA]
        row = [*at, m.iterations, m.factorisations, m.volume, *tip]
        row += [touch.wall_distance, marks[0], touch.body_distance, marks[1], touch.contact_force]
        row += [m.largest_stretch, m.unstable, m.dead_loads, m.stability_factorisations, m.seconds]
        row += [m.pressure * share * KPA_PER_MPA for share in self.shares]
        self.rows["steps"].append(row)
        self.rows["centrelines"] += [[*at, s, *g[:3, 3], *marks] for s, g in zip(m.stations, m.frames)]
        strains = enumerate(zip(m.strains.e, m.strains.k), start=1)
        self.rows["segments"] += [[*at, i, *e, *k, *marks] for i, (e, k) in strains]
        for name, columns in self.columns.items():
            write_csv(self.directory / f"{name}.csv", columns, self.rows[name])
        walls = [[*gap, distance] for gap, distance in zip(self.gaps, m.walls)]
        write_csv(self.directory / "walls.csv", WALLS, walls)


def _numbers(row):
    try:
        for cell in row:
            float(cell)
    except ValueError:
        return False
    return row[0].isdigit()
