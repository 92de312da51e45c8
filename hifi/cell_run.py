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
from hifi.contact import ThirdMedium, soften
from hifi.control import LoadControl, VolumeControl
from hifi.newton import NewtonOptions
from hifi.path import EquilibriumPath
from hifi.results import KPA, limit_table, limit_text
from hifi.stepping import StepSize, lagrange_coefficients, run_steps

STRAINS = ("e1", "e2", "e3", "k1_per_mm", "k2_per_mm", "k3_per_mm")
CONTROLS = ("pressure", "volume")
KEYS = (
    *("pressure_kPa", "mesh_size_mm", "levels", "control", "volume_factor", "contact", "graded"),
    *("material", "layer_material", "segment", "held"),
)
CONTACTS = ("auto", "none", "third-medium")
#: size at the body's edges of a graded mesh, over its mesh_size
EDGE = 0.2
#: iterations that a lagged tangent may still need in contact, where tangents age fast
CONTACT_PATIENCE = 10.0


@dataclass(frozen=True)
class CellCase:
    """What CELL.toml says: pressure in MPa, mesh_size in mm, levels equal pressure steps at which the state is recorded.

    held: {index of (e, k): prescribed value, 1/mm for k}; reached from the free state at the top pressure. control:
    'pressure', or 'volume', which walks through a limit point of the pressure up to `volume_factor` times the volume at rest.
    contact: 'third-medium', 'none', or 'auto': none until walls are seen to touch, and the third medium from there on (none
    at all with control 'volume'). graded: elements shrink to mesh_size * EDGE at the body's edges, where stresses are singular.
    """

    segment: Segment
    pressure: float
    mesh_size: float = 1.5
    levels: int = 10
    held: dict = field(default_factory=dict)
    control: str = "pressure"
    volume_factor: float = 2.0
    contact: str = "auto"
    medium: ThirdMedium = ThirdMedium()
    graded: bool = False


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
    contact = data.get("contact", CellCase.contact)
    if contact not in CONTACTS:
        raise InputError(f"{where}: contact = {contact!r} is not known: write 'auto', 'third-medium' or 'none'")
    if contact == "third-medium" and control == "volume":
        raise InputError(f"{where}: contact = 'third-medium' goes with control = 'pressure'")
    graded = data.get("graded", CellCase.graded)
    if not isinstance(graded, bool):
        raise InputError(f"{where}: graded = {graded!r} must be true or false")
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
    return CellCase(segment, pressure, float(mesh_size), levels, held, control, float(volume_factor), contact, graded=graded)


def cell_tables(case):
    """The complete tables of a CellCase, which cell_from_tables reads back."""
    segment = case.segment
    tables = {
        "pressure_kPa": float(f"{case.pressure * KPA:.12g}"),
        "mesh_size_mm": case.mesh_size,
        "levels": case.levels,
        "control": case.control,
        "volume_factor": case.volume_factor,
        "contact": case.contact,
        "graded": case.graded,
        "material": material_to_table(segment.material),
        "segment": to_table(segment),
        "held": {STRAINS[i]: value for i, value in case.held.items()},
    }
    if segment.layer_material is not None:
        tables["layer_material"] = material_to_table(segment.layer_material)
    return tables


class _Touch(Exception):
    """Walls overlap where contact was to be switched on."""


def solve_cell(case, mesh_path, on_state=lambda state: None, on_limit_point=lambda point: None, on_touch=lambda pressure: None):
    """Mesh and solve a CellCase; `on_state(CellState)` sees every recorded level. Returns (last CellState, mesh facts).

    on_limit_point(hifi.path.LimitPoint): told when the pressure has passed one. on_touch(pressure): told the pressure (MPa) of
    first touch, once, before the first state beyond it. ConvergenceError when the path ends short; what was recorded before
    has been seen by `on_state`.
    """
    edge_size = case.mesh_size * EDGE if case.graded else None
    facts = mesh_cell(case.segment, case.mesh_size, mesh_path, gaps=case.contact != "none", edge_size=edge_size)
    seen = []

    def see(state):
        seen.append(state)
        on_state(state)

    if case.contact != "third-medium":
        try:
            return _follow(case, CellProblem(case.segment, mesh_path), see, on_limit_point, on_touch), facts
        except _Touch:
            pass
    problem = CellProblem(case.segment, mesh_path, medium=case.medium)
    return _follow(case, problem, see, on_limit_point, on_touch, len(seen)), facts


def _follow(case, problem, on_state, on_limit_point, on_touch, known=0):
    """Last CellState of the path, of which `on_state` has seen the first `known` states. _Touch when walls meet and `case`
    wants contact from there on."""
    medium, mu = problem.medium, case.segment.material.mu
    options = NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE)
    if medium:
        options.patience = CONTACT_PATIENCE
    system = CellSystem(problem)
    switch = case.contact == "auto" and case.control == "pressure"
    distances = [(0.0, system.walls.distance())]
    count, last, passed = 0, [], 0
    effort, started = {"steps": 0, "factorisations": 0, "seconds": 0.0}, time.perf_counter()

    def spend(step):
        effort["steps"] += 1
        effort["factorisations"] += step.factorisations
        effort["seconds"] = time.perf_counter() - started

    def record():
        nonlocal count
        count += 1
        if count > known:
            kept = system.state.copy()
            if medium:
                soften(system, medium, options)
            last[:] = [replace(system.measure(), **effort)]
            if medium:
                medium.softening, system.state = 0.0, kept
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

        def keep(step):
            nonlocal passed
            spend(step)
            for point in path.limit_points[passed:]:
                on_limit_point(point)
            passed = len(path.limit_points)
            if not medium and distances[-1][1] > 0:
                distances.append((problem.pressure.value.item(), system.walls.distance()))
                if distances[-1][1] <= 0:
                    on_touch(_first_touch(distances))
                    if switch:
                        raise _Touch
            if step.load in marks:
                record()
                path.newton.current &= not medium

        run_steps(path, target, StepSize(first, 1e-4 * first, milestones=marks), keep)
        if case.held:
            system = _hold(problem, system, case, options, spend)
            if not medium and distances[-1][1] > 0 and system.walls.distance() <= 0:
                on_touch(case.pressure)
                if switch:
                    raise _Touch
            record()
        return last[0]
    finally:
        system.destroy()


def _first_touch(distances):
    """Pressure at which the wall distance passes zero, from (pressure, distance) of which the last is the first below zero."""
    pressures, gaps = np.array(distances[-3:]).T
    return float(sum(p * w for p, w in zip(pressures, lagrange_coefficients(gaps, 0.0))))


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
    *"pressure_kPa volume_mm3 e1 e2 e3 k1_rad_per_mm k2_per_mm k3_per_mm k_norm_per_mm k_dot_e_per_mm".split(),
    *"force1_N force2_N force3_N moment1_N_mm moment2_N_mm moment3_N_mm unstable_directions largest_stretch".split(),
    *"wall_distance_mm walls_overlap contact_force_N contact_area_mm2 contact_nearest_mm contact_farthest_mm contact_gamma".split(),
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
            + [state.largest_stretch]
            + [state.wall_distance, int(state.walls_overlap), *_contact(state)]
            + [*state.stiffness.ravel(), *state.kirchhoff_stiffness.ravel()]
        )
        write_csv(out / "cell.csv", HEADER, rows)
        say(
            f"{state.pressure * KPA:7.2f} kPa  e1 {e[0]:.4f}  k1 {k[0] * 1e3:.2f} rad/m  k2 {k[1] * 1e3:.2f} 1/m  k3 {k[2] * 1e3:.2f} 1/m  "
            f"volume {state.volume:.1f} mm3  "
            f"stretch {state.largest_stretch:.2f}  {'stable' if not state.unstable else f'UNSTABLE in {state.unstable}'}  "
            f"wall distance {state.wall_distance:.3f} mm{_pushing(state)}{'  WALLS OVERLAP' * state.walls_overlap}"
        )

    def touch(pressure):
        touched.append(pressure * KPA)
        alone = case.contact == "none" or case.control == "volume"
        then = "beyond it states are marked 'walls overlap'" if alone else "going on with contact"
        say(f"walls touch at {touched[0]:.2f} kPa; {then}")

    status, facts, touched = "reached what was asked for", {}, []
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
        raise ConvergenceError(f"cell: {status}; {len(rows)} levels are in {out}; try less pressure or control = 'volume'")
    say(f"done: {len(rows)} states in {out / 'cell.csv'}; K in N, N mm, N mm2 per unit of (e, k)")
