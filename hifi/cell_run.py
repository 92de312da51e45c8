"""`pneunet cell`: one pitch of a segment from rest to a pressure, free or at prescribed strains, with its rod stiffness."""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from base.errors import ConvergenceError, InputError
from base.files import output_directory, write_csv
from base.materials import material_from_table, material_to_table
from base.record import write_record
from base.tables import as_table, number, read_toml, refuse_unknown, to_table
from geometry.cell import mesh_cell
from geometry.designfile import segment_from_table
from geometry.parameters import Segment
from hifi.cell import CellProblem
from hifi.cell_system import RELATIVE_TOLERANCE, CellSystem
from hifi.control import LoadControl, VolumeControl
from hifi.newton import NewtonOptions
from hifi.path import EquilibriumPath
from hifi.results import KPA, limit_table, limit_text
from hifi.stepping import StepSize, run_steps

STRAINS = ("e1", "e2", "e3", "k1_per_mm", "k2_per_mm", "k3_per_mm")
CONTROLS = ("pressure", "volume")
KEYS = (
    *("pressure_kPa", "mesh_size_mm", "levels", "control", "volume_factor"),
    *("material", "layer_material", "segment", "held"),
)


@dataclass(frozen=True)
class CellCase:
    """What CELL.toml says: pressure in MPa, mesh_size in mm, levels equal pressure steps at which the state is recorded.

    held: {index of (e, k): prescribed value, 1/mm for k}; reached from the free state at the top pressure. control:
    'pressure', or 'volume', which walks through a limit point of the pressure up to `volume_factor` times the volume at rest.
    """

    segment: Segment
    pressure: float
    mesh_size: float = 1.5
    levels: int = 10
    held: dict = field(default_factory=dict)
    control: str = "pressure"
    volume_factor: float = 2.0


def read_cell(path):
    """The CellCase in a TOML file; InputError with file, table and key otherwise."""
    return cell_from_tables(read_toml(path), str(path))


def cell_from_tables(data, where):
    """The CellCase in the tables of a CELL.toml; `where` is what errors call them."""
    refuse_unknown(data, KEYS, where)
    for key in ("material", "segment"):
        if key not in data:
            raise InputError(f"{where}: key '{key}' is missing")
    control = data.get("control", "pressure")
    if control not in CONTROLS:
        raise InputError(f"{where}: control = {control!r} is not known: write 'pressure' or 'volume'")
    if control == "pressure" and "pressure_kPa" not in data:
        raise InputError(f"{where}: key 'pressure_kPa' is missing")

    def ranged(key, default, low, high, integer=False):
        value = number(data.get(key, default), key, where, integer=integer)
        if not low <= value <= high:
            raise InputError(f"{where}: {key} = {value:g} must lie in {low:g}..{high:g}")
        return value

    pressure = ranged("pressure_kPa", 1.0, 1e-3, 2000) / KPA
    mesh_size = ranged("mesh_size_mm", CellCase.mesh_size, 0.1, 20)
    levels = ranged("levels", CellCase.levels, 1, 1000, integer=True)
    volume_factor = ranged("volume_factor", CellCase.volume_factor, 1.001, 100)
    held_table = as_table(data.get("held", {}), f"{where} [held]")
    refuse_unknown(held_table, STRAINS, f"{where} [held]")
    held = {STRAINS.index(key): float(number(value, key, f"{where} [held]")) for key, value in held_table.items()}
    if held and control == "volume":
        raise InputError(f"{where}: [held] strains go with control = 'pressure'")
    row = as_table(data["segment"], f"{where} [segment]")
    row.setdefault("chambers", 1)
    material, layer_material = (
        material_from_table(data[key], f"{where} [{key}]") if key in data else None for key in ("material", "layer_material")
    )
    segment = segment_from_table(row, f"{where} [segment]", material, layer_material)
    return CellCase(segment, pressure, float(mesh_size), levels, held, control, float(volume_factor))


def cell_tables(case):
    """The complete tables of a CellCase, which cell_from_tables reads back."""
    segment = case.segment
    tables = {
        "pressure_kPa": float(f"{case.pressure * KPA:.12g}"),
        "mesh_size_mm": case.mesh_size,
        "levels": case.levels,
        "control": case.control,
        "volume_factor": case.volume_factor,
        "material": material_to_table(segment.material),
        "segment": to_table(segment),
        "held": {STRAINS[i]: value for i, value in case.held.items()},
    }
    if segment.layer_material is not None:
        tables["layer_material"] = material_to_table(segment.layer_material)
    return tables


def solve_cell(case, mesh_path, on_state=lambda state: None, on_limit_point=lambda point: None):
    """Mesh and solve a CellCase; `on_state(CellState)` sees every recorded level. Returns (last CellState, mesh facts).

    on_limit_point(hifi.path.LimitPoint): told when the pressure has passed one. ConvergenceError when the path ends short; what
    was recorded before has been seen by `on_state`.
    """
    facts = mesh_cell(case.segment, case.mesh_size, mesh_path)
    problem = CellProblem(case.segment, mesh_path)
    mu, options = case.segment.material.mu, NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE)
    system = CellSystem(problem)
    last, effort, started = [], {"steps": 0, "factorisations": 0, "seconds": 0.0}, time.perf_counter()

    def count(step):
        effort["steps"] += 1
        effort["factorisations"] += step.factorisations
        effort["seconds"] = time.perf_counter() - started

    def record():
        last[:] = [replace(system.measure(), **effort)]
        on_state(last[0])

    try:
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

        passed = 0

        def keep(step):
            count(step)
            nonlocal passed
            for point in path.limit_points[passed:]:
                on_limit_point(point)
            passed = len(path.limit_points)
            if step.load in marks:
                record()

        run_steps(path, target, StepSize(first, 1e-4 * first, milestones=marks), keep)
        if case.held:
            system = _hold(problem, system, case, options, count)
            record()
        return last[0], facts
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


HEADER = [
    *"pressure_kPa volume_mm3 e1 e2 e3 k1_rad_per_mm k2_per_mm k3_per_mm k_norm_per_mm k_dot_e_per_mm".split(),
    *"force1_N force2_N force3_N moment1_N_mm moment2_N_mm moment3_N_mm unstable_directions largest_stretch".split(),
    *(f"K{i}{j}" for i in range(1, 7) for j in range(1, 7)),
    *(f"kirchhoff{i}{j}" for i in range(1, 5) for j in range(1, 5)),
]


def run_cell(path, directory, say=print):
    """`pneunet cell`: solve CELL.toml; directory/cell gets cell.csv (a row a level), cell.msh and run.json."""
    case = read_cell(path)
    out = output_directory(Path(directory)) / "cell"
    rows, limit_points, started = [], [], time.perf_counter()

    def name(point):
        limit_points.append(limit_table(point))
        say(limit_text(point))

    def keep(state):
        e, k = state.strains.e, state.strains.k
        rows.append(
            [state.pressure * KPA, state.volume, *e, *k, np.linalg.norm(k), k @ e, *state.force, *state.moment, state.unstable]
            + [state.largest_stretch, *state.stiffness.ravel(), *state.kirchhoff_stiffness.ravel()]
        )
        write_csv(out / "cell.csv", HEADER, rows)
        say(
            f"{state.pressure * KPA:7.2f} kPa  e1 {e[0]:.4f}  k1 {k[0] * 1e3:.2f} rad/m  k2 {k[1] * 1e3:.2f} 1/m  k3 {k[2] * 1e3:.2f} 1/m  "
            f"volume {state.volume:.1f} mm3  "
            f"stretch {state.largest_stretch:.2f}  {'stable' if not state.unstable else f'UNSTABLE in {state.unstable}'}"
        )

    status, facts = "reached what was asked for", {}
    try:
        _, facts = solve_cell(case, out / "cell.msh", keep, name)
    except ConvergenceError as error:
        status = str(error)
    write_record(
        out,
        status=status,
        segment=to_table(case.segment) | {"material": material_to_table(case.segment.material)},
        control=case.control,
        limit_points=limit_points,
        mesh={"mesh_size_mm": case.mesh_size, **facts},
        wall_seconds=time.perf_counter() - started,
    )
    if not facts:
        raise ConvergenceError(f"cell: {status}; {len(rows)} levels are in {out}; try less pressure or control = 'volume'")
    say(f"done: {len(rows)} states in {out / 'cell.csv'}; K in N, N mm, N mm2 per unit of (e, k)")
