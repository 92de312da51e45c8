"""run.json of a solve: how far it has come, by what, and what that took."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.files.record import write_record
from pneunet.base.units import KPA_PER_MPA
from pneunet.hifi.body.manipulator import ManipulatorSolve, Measured
from pneunet.hifi.fem.agreement import on_rank_0
from pneunet.hifi.runs.solve.goal import Goal
from pneunet.hifi.runs.solve.progress import break_stretch
from pneunet.hifi.runs.solve.tables import Tables


class Record:
    """Writes run.json after every accepted state, so that a run that is ended by force has one.

    started: time.perf_counter() at which the run began, less the seconds of the run that it goes on from.
    about: entries that do not change. extras: what is measured at the end, by name, which the user adds.
    """

    def __init__(
        self,
        directory: Path,
        solve: ManipulatorSolve,
        goal: Goal,
        tables: Tables,
        started: float,
        about: dict[str, Any],
        extras: dict[str, Any],
    ) -> None:
        self.directory, self.solve, self.goal, self.tables = directory, solve, goal, tables
        self.started, self.extras = started, extras
        breaks_at = break_stretch(solve.manipulator)
        self.about = about | {"stretch_at_break": breaks_at if np.isfinite(breaks_at) else None}

    def accepted(self, m: Measured) -> None:
        self.finished("running, or ended by force", m)

    def finished(self, status: str, m: Measured, failures: Sequence[tuple[float, str]] = ()) -> None:
        """Record how the run ended at its last state, after `failures` to go on, (parameter, why) each."""
        on_rank_0(self.solve.comm, lambda: self.save(status, m, failures))

    def save(self, status: str, m: Measured, failures: Sequence[tuple[float, str]] = ()) -> None:
        """The same, of rank 0 alone."""
        newton, history = self.solve.path.newton, self.tables.history()
        write_record(
            self.directory,
            status=status,
            pressure_reached_kPa=m.pressure * KPA_PER_MPA,
            **self.goal.table,
            limit_points=[point.table() for point in m.limit_points],
            **m.touch.table(),
            **self.extras,
            **self.about,
            dofs=self.solve.problem.dofs,
            ranks=self.solve.comm.size,
            wall_seconds=time.perf_counter() - self.started,
            largest_stretch=m.largest_stretch,
            timings=newton.timings,
            newton=vars(newton.options),
            failed_attempts=[[self.solve.path.told(at), why] for at, why in failures],
            stability_factorisations=sum(row["stability_factorisations"] for row in history),
            steps=history,
        )
