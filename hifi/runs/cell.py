"""`pneunet cell`: one pitch of a segment from rest to a pressure, with a table, a record and a picture."""

import logging
import time
from pathlib import Path

import numpy as np

from pneunet.base.errors import ConvergenceError
from pneunet.base.files.atomic import write_csv
from pneunet.base.files.folder import output_folder
from pneunet.base.files.record import write_record
from pneunet.base.files.schemas import CELL
from pneunet.base.files.toml import to_table
from pneunet.base.materials.laws import material_to_table
from pneunet.base.system.interrupts import Interrupted
from pneunet.base.system.progress import Pace
from pneunet.base.units import KPA_PER_MPA, PER_MM_PER_M
from pneunet.hifi.cell.file import read_cell
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.run import solve_cell
from pneunet.hifi.cell.system import CellState
from pneunet.hifi.contact.picture import draw_cell
from pneunet.hifi.path.equilibrium import LimitPoint

log = logging.getLogger(__name__)


def run_cell(path: str | Path, directory: str | Path) -> None:
    """Solve CELL.toml; directory/cell gets cell.csv (a row a level), cell.npz, run.json and walls.png of the
    last state.

    InputError on bad input; ConvergenceError, with what was reached in cell.csv, when the path ends short.
    """
    case = read_cell(path)
    with output_folder(Path(directory) / "cell") as out:
        _solve(case, out)


def _solve(case, out):
    """The files of `run_cell`."""
    limit_points: list[LimitPoint] = []
    states: list[CellState] = []
    touched: list[float] = []
    rows, started, pace = [], time.perf_counter(), Pace()

    def pass_limit_point(point: LimitPoint) -> None:
        limit_points.append(point)
        log.info(point.text)

    def keep(state: CellState) -> None:
        rows.append(_row(state))
        write_csv(out / "cell.csv", CELL, rows)
        states[:] = [state]
        log.info(_line(state) + pace.left(len(rows) / (case.levels + 1)) * (len(rows) <= case.levels))

    def touch(pressure: float) -> None:
        touched.append(pressure * KPA_PER_MPA)
        then = "contact holds them apart"
        if case.contact == "none":
            then = "beyond it states are marked 'walls overlap'"
        log.info(f"walls touch at {touched[0]:.2f} kPa; {then}")

    status, facts, interrupted = "reached what was asked for", {}, False
    try:
        _, facts = solve_cell(case, out / "cell.npz", keep, pass_limit_point, touch)
    except ConvergenceError as error:
        status = str(error)
    except KeyboardInterrupt:
        reached = states[0].pressure * KPA_PER_MPA if states else 0.0
        status, interrupted = f"interrupted after {reached:.4g} kPa", True
    write_record(
        out,
        status=status,
        segment=to_table(case.segment) | {"material": material_to_table(case.segment.material)},
        control=case.control,
        limit_points=[point.table() for point in limit_points],
        contact=case.contact,
        first_touch_kPa=touched[0] if touched else None,
        walls_overlap=any(row[CELL.index("walls_overlap")] for row in rows),
        mesh={"mesh_size_mm": case.mesh_size, "graded": case.graded, **facts},
        wall_seconds=time.perf_counter() - started,
    )
    if interrupted:
        raise Interrupted(f"{status}; {len(rows)} levels are in {out}")
    if not facts:
        raise ConvergenceError(
            f"cell: {status}; {len(rows)} levels are in {out}; try less pressure or control = 'volume'"
        )
    drawn = draw_cell(CellProblem(case.segment, out / "cell.npz"), states[0], out / "walls.png")
    log.info(
        f"done: {len(rows)} states in {out / 'cell.csv'}{', the last one in walls.png' * drawn}; K in N, N"
        " mm, N mm2 per unit of (e, k)"
    )


def _row(state):
    """What cell.csv says of a CellState: no force without contact."""
    e, k, c = state.strains.e, state.strains.k, state.contact
    return [
        *(state.pressure * KPA_PER_MPA, state.volume, *e, *k, np.linalg.norm(k), k @ e),
        *(*state.force, *state.moment, state.unstable, state.largest_stretch),
        *(state.wall_distance, int(state.walls_overlap)),
        *((c.force, c.area, c.nearest, c.farthest, c.gamma) if c else (0.0, 0.0, np.nan, np.nan, np.nan)),
        *(*state.stiffness.ravel(), *state.kirchhoff_stiffness.ravel()),
    ]


def _line(state):
    k1, k2, k3 = state.strains.k / PER_MM_PER_M
    stable = f"UNSTABLE in {state.unstable}" if state.unstable else "stable"
    pushing = f"  contact force {state.contact.force:.3f} N" if state.contact else ""
    return (
        f"{state.pressure * KPA_PER_MPA:7.2f} kPa  e1 {state.strains.e[0]:.4f}  k1 {k1:.2f} rad/m"
        f"  k2 {k2:.2f} 1/m  k3 {k3:.2f} 1/m  volume {state.volume:.1f} mm3"
        f"  stretch {state.largest_stretch:.2f}  {stable}"
        f"  wall distance {state.wall_distance:.3f} mm{pushing}{'  WALLS OVERLAP' * state.walls_overlap}"
    )
