"""`pneunet cell`: one pitch of a segment from rest to a pressure, free or at prescribed strains, with its rod
stiffness."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pneunet.base.errors import ConvergenceError
from pneunet.base.files.atomic import output_directory, write_csv
from pneunet.base.files.record import write_record
from pneunet.base.files.toml import to_table
from pneunet.base.materials.laws import material_to_table
from pneunet.geometry.cad.cell import mesh_cell
from pneunet.hifi.cell.file import EDGE, read_cell
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
from pneunet.hifi.contact.medium import soften
from pneunet.hifi.contact.picture import draw_cell
from pneunet.hifi.contact.touch import Load, TouchWatch
from pneunet.hifi.path.control import LoadControl, VolumeControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.runs.solve.tables import KPA, limit_table, limit_text

#: iterations that a lagged tangent may still need in contact, where tangents age fast
CONTACT_PATIENCE = 10.0


def solve_cell(
    case,
    mesh_path,
    on_state=lambda state: None,
    on_limit_point=lambda point: None,
    on_touch=lambda pressure: None,
):
    """Mesh and solve a CellCase; `on_state(CellState)` sees every recorded level. Returns (last CellState,
    mesh facts).

    on_limit_point(hifi.path.equilibrium.LimitPoint): told when the pressure has passed one.
    on_touch(pressure): told the pressure (MPa) of first touch, once, before the first state beyond it.
    ConvergenceError when the path ends short; what was recorded before has been seen by `on_state`.
    """
    edge_size = case.mesh_size * EDGE if case.graded else None
    medium = case.medium if case.contact == "third-medium" else None
    facts = mesh_cell(case.segment, case.mesh_size, mesh_path, gaps=medium is not None, edge_size=edge_size)
    problem = CellProblem(
        case.segment, mesh_path, medium=medium, contact=case.penalty if case.contact == "auto" else None
    )
    return _follow(case, problem, on_state, on_limit_point, on_touch), facts


def _follow(case, problem, on_state, on_limit_point, on_touch):
    """Last CellState of the path."""
    medium, mu = problem.medium, case.segment.material.mu
    options = NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE)
    if medium:
        options.patience = CONTACT_PATIENCE
    system = CellSystem(problem)
    watch, touched, last, passed = TouchWatch(), False, [], 0
    effort, started = {"steps": 0, "factorisations": 0, "seconds": 0.0}, time.perf_counter()

    def spend(step):
        effort["steps"] += 1
        effort["factorisations"] += step.factorisations
        effort["seconds"] = time.perf_counter() - started

    def look():
        """Tell of the first touch, once. A medium pushes long before it."""
        nonlocal touched
        if not touched and not medium:
            met = watch.see(
                Load(problem.pressure.value.item()), system.walls.distance(), contact_force=system.overreach
            ).walls_from
            if met:
                touched = True
                on_touch(met.pressure)

    def record():
        kept = system.state.copy()
        if medium:
            soften(system, medium, options)
        last[:] = [replace(system.measure(), **effort)]
        if medium:
            medium.softening, system.state = 0.0, kept
        on_state(last[0])

    try:
        look()
        record()
        rest = system.volume()
        if case.control == "volume":
            start, target = rest, rest * case.volume_factor
            control, first = VolumeControl(), 0.02 * (target - rest)
        else:
            start, target = 0.0, case.pressure
            control, first = LoadControl(), min(0.02 * mu, case.pressure)
        marks = tuple(np.linspace(start, target, case.levels + 1)[1:])
        path = EquilibriumPath(system, control, options, start)

        def keep(step):
            nonlocal passed
            spend(step)
            for point in path.limit_points[passed:]:
                on_limit_point(point)
            passed = len(path.limit_points)
            look()
            if step.load in marks:
                record()
                path.newton.current &= not medium

        run_steps(path, target, StepSize(first, 1e-4 * first, milestones=marks), keep)
        if case.held:
            system = _hold(problem, system, case, options, spend)
            look()
            record()
        return last[0]
    finally:
        system.destroy()


def _hold(problem, free, case, options, on_step):
    """A system with prescribed strains at the top pressure, walked there from the free state."""
    held = np.isin(np.arange(6), list(case.held))
    start = free.state[-6:].copy()
    change = np.zeros(6)
    for i, value in case.held.items():
        change[i] = value - start[i]
    system = CellSystem(problem, held, (case.pressure, 0.0), (start, change))
    system.state = free.state.copy()
    try:
        run_steps(EquilibriumPath(system, LoadControl(), options), 1.0, StepSize(0.25, 1e-3), on_step)
    except BaseException:
        system.destroy()
        raise
    free.destroy()
    return system


def _contact(state):
    """The contact columns of a state: zero force without contact."""
    c = state.contact
    return [c.force, c.area, c.nearest, c.farthest, c.gamma] if c else [0.0, 0.0, np.nan, np.nan, np.nan]


def _pushing(state):
    return f"  contact force {state.contact.force:.3f} N" if state.contact else ""


HEADER = [
    *"pressure_kPa volume_mm3 e1 e2 e3 k1_rad_per_mm k2_per_mm k3_per_mm".split(),
    *"k_norm_per_mm k_dot_e_per_mm force1_N force2_N force3_N moment1_N_mm moment2_N_mm moment3_N_mm".split(),
    *"unstable_directions largest_stretch wall_distance_mm walls_overlap contact_force_N".split(),
    *"contact_area_mm2 contact_nearest_mm contact_farthest_mm contact_gamma".split(),
    *(f"K{i}{j}" for i in range(1, 7) for j in range(1, 7)),
    *(f"kirchhoff{i}{j}" for i in range(1, 5) for j in range(1, 5)),
]


def run_cell(path, directory, say=print):
    """`pneunet cell`: solve CELL.toml; directory/cell gets cell.csv (a row a level), cell.msh, run.json and
    walls.png, the last state."""
    case = read_cell(path)
    out = output_directory(Path(directory)) / "cell"
    rows, limit_points, started = [], [], time.perf_counter()

    def name(point):
        limit_points.append(limit_table(point))
        say(limit_text(point))

    def keep(state):
        last[:] = [state]
        e, k = state.strains.e, state.strains.k
        rows.append(
            [
                state.pressure * KPA,
                state.volume,
                *e,
                *k,
                np.linalg.norm(k),
                k @ e,
                *state.force,
                *state.moment,
                state.unstable,
            ]
            + [state.largest_stretch]
            + [state.wall_distance, int(state.walls_overlap), *_contact(state)]
            + [*state.stiffness.ravel(), *state.kirchhoff_stiffness.ravel()]
        )
        write_csv(out / "cell.csv", HEADER, rows)
        say(
            f"{state.pressure * KPA:7.2f} kPa  e1 {e[0]:.4f}  k1 {k[0] * 1e3:.2f} rad/m  k2 {k[1] * 1e3:.2f}"
            f" 1/m  k3 {k[2] * 1e3:.2f} 1/m  volume {state.volume:.1f} mm3  stretch"
            f" {state.largest_stretch:.2f} "
            f" {'stable' if not state.unstable else f'UNSTABLE in {state.unstable}'}  wall distance"
            f" {state.wall_distance:.3f} mm{_pushing(state)}{'  WALLS OVERLAP' * state.walls_overlap}"
        )

    def touch(pressure):
        touched.append(pressure * KPA)
        then = (
            "beyond it states are marked 'walls overlap'"
            if case.contact == "none"
            else "contact holds them apart"
        )
        say(f"walls touch at {touched[0]:.2f} kPa; {then}")

    status, facts, touched, last = "reached what was asked for", {}, [], []
    try:
        _, facts = solve_cell(case, out / "cell.msh", keep, name, touch)
    except ConvergenceError as error:
        status = str(error)
    write_record(
        out,
        status=status,
        segment=to_table(case.segment) | {"material": material_to_table(case.segment.material)},
        control=case.control,
        limit_points=limit_points,
        contact=case.contact,
        first_touch_kPa=touched[0] if touched else None,
        walls_overlap=any(row[HEADER.index("walls_overlap")] for row in rows),
        mesh={"mesh_size_mm": case.mesh_size, "graded": case.graded, **facts},
        wall_seconds=time.perf_counter() - started,
    )
    if not facts:
        raise ConvergenceError(
            f"cell: {status}; {len(rows)} levels are in {out}; try less pressure or control = 'volume'"
        )
    drawn = draw_cell(CellProblem(case.segment, out / "cell.msh"), last[0], out / "walls.png")
    say(
        f"done: {len(rows)} states in {out / 'cell.csv'}{', the last one in walls.png' * drawn}; K in N, N"
        " mm, N mm2 per unit of (e, k)"
    )
