"""One pitch of a segment from rest to a pressure, free or at prescribed strains, with its rod stiffness."""

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pneunet.geometry.cad.cell import mesh_cell
from pneunet.geometry.cad.grid import grid_cell
from pneunet.hifi.cell.file import EDGE, CellCase
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.symmetry import characters, group, strains_of
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellState, CellSystem
from pneunet.hifi.contact.medium import soften
from pneunet.hifi.contact.touch import Load, TouchWatch
from pneunet.hifi.path.control import LoadControl, VolumeControl
from pneunet.hifi.path.equilibrium import EquilibriumPath, LimitPoint
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps

log = logging.getLogger(__name__)
#: iterations that a lagged tangent may still need in contact, where tangents age fast
CONTACT_PATIENCE = 10.0


def solve_cell(
    case: CellCase,
    mesh_path: str | Path,
    on_state: Callable[[CellState], object] = lambda state: None,
    on_limit_point: Callable[[LimitPoint], object] = lambda point: None,
    on_touch: Callable[[float], object] = lambda pressure: None,
) -> tuple[CellState, dict]:
    """Mesh and solve a CellCase; `on_state(CellState)` sees every recorded level. Returns (last CellState,
    mesh facts).

    on_limit_point(hifi.path.equilibrium.LimitPoint): told when the pressure has passed one.
    on_touch(pressure): told the pressure (MPa) of first touch, once, before the first state beyond it.
    ConvergenceError when the path ends short; what was recorded before has been seen by `on_state`.
    """
    facts, medium = mesh_of(case, mesh_path), case.medium if case.contact == "third-medium" else None
    problem = CellProblem(
        case.segment, mesh_path, medium=medium, contact=case.penalty if case.contact == "auto" else None
    )
    return follow_path(case, problem, on_state, on_limit_point, on_touch), facts


def _has_half_turns(case):
    """Whether a part of the case's cell will do."""
    turns = group(case.segment.kind)
    alike = strains_of(characters(turns)[0], turns)[list(case.held)].all()
    return case.element == "hexahedra" and bool(alike)


def mesh_of(case: CellCase, path: str | Path) -> dict:
    """Write the mesh that the case asks for, of the whole cell or, where that will do, of a part of it; its
    facts."""
    edge, gaps = case.mesh_size * EDGE if case.graded else None, case.contact == "third-medium"
    if case.element == "tetrahedra":
        return mesh_cell(case.segment, case.mesh_size, path, gaps=gaps, edge_size=edge)
    return grid_cell(case.segment, case.mesh_size, path, edge, gaps, _has_half_turns(case))


def follow_path(
    case: CellCase,
    problem: CellProblem,
    on_state: Callable[[CellState], object] = lambda state: None,
    on_limit_point: Callable[[LimitPoint], object] = lambda point: None,
    on_touch: Callable[[float], object] = lambda pressure: None,
) -> CellState:
    """`solve_cell` of a CellProblem that has its mesh already: the last CellState of the path."""
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
        # the tangent that was measured at rest leads the path, and is one of its factorisations
        path.newton.current = not medium
        effort["factorisations"] += path.newton.current

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
        path = EquilibriumPath(system, LoadControl("the way to the held strains"), options)
        run_steps(path, 1.0, StepSize(0.25, 1e-3), on_step)
    except BaseException:
        system.destroy()
        raise
    free.destroy()
    return system
