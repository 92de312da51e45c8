"""Solid unit cells at prescribed strains: a cylinder stretched and twisted, a block bent in plane strain;
their forces are known."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dolfinx.mesh import CellType

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import tags
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellState, CellSystem
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.verification import bodies, closed_forms
from pneunet.hifi.verification.following import ExactComparison

CURVATURES = (0.1, 0.25, 0.5)
REST = np.eye(6)[0]


@dataclass(frozen=True)
class Solid:
    """What a cell needs to know of a body without chambers."""

    pitch: float
    width: float
    material: NeoHookean = NeoHookean(1.0)
    layer_material: None = None
    sides: tuple = ()


def held_at(problem: CellProblem, held: np.ndarray, strains: np.ndarray) -> CellState:
    """The CellState at the `strains` (6,) that are `held` (6,) bool, the others free."""
    system = CellSystem(problem, held, (0.0, 0.0), (REST, np.where(held, strains - REST, 0.0)))
    path = EquilibriumPath(
        system, LoadControl("the held strains"), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE)
    )
    run_steps(path, 1.0, StepSize(0.25, 1e-3))
    state = system.measure()
    system.destroy()
    return state


def torsion(
    folder: Path,
    size: float = 0.3,
    stretch: float = 1.2,
    twist: float = 0.5,
    element: CellType = CellType.tetrahedron,
) -> list[ExactComparison]:
    """Torque and axial force of the cylinder as a cell; the gauge is its whole mantle."""
    problem = CellProblem(
        Solid(1.0, 2.0), bodies.round_body("cylinder", size, tags.BODY, element), (bodies.OUTER,), centre=0.5
    )
    state = held_at(problem, np.ones(6, bool), np.array([stretch, 0, 0, twist, 0, 0]))
    torque, axial = closed_forms.torsion(stretch, twist)
    told, at = (f"h = {size:g}", problem.unknowns), f"at lambda = {stretch:g}, psi = {twist:g}"
    return [
        ExactComparison("cell: solid cylinder", f"torque {at}", *told, torque, state.moment[0]),
        ExactComparison("cell: solid cylinder", f"axial force {at}", *told, axial, state.force[0]),
    ]


def flexure(
    cells: tuple[int, int] = (2, 16),
    pitch: float = 0.2,
    thickness: float = 0.07,
    element: CellType = CellType.tetrahedron,
) -> list[ExactComparison]:
    """Moments of the block as a cell, its stretch free; rollers on its sides, the gauge on its top and
    bottom."""
    box = bodies.box(
        (pitch, thickness, 1.0),
        (cells[0], 1, cells[1]),
        lambda X: X - [0, thickness / 2, 0.5],
        tags.BODY,
        element,
    )
    sides = {bodies.PLANE_Y: 1, bodies.END_Y: 1}
    problem = CellProblem(
        Solid(pitch, 1.0), box, (bodies.PLANE_Z, bodies.END_Z), centre=pitch / 2, rollers=sides
    )
    held, rows = np.array([False, True, True, True, True, True]), []
    for k in CURVATURES:
        state = held_at(problem, held, np.array([1.0, 0, 0, 0, k, 0]))
        told = f"{cells[0]} x 1 x {cells[1]}", problem.unknowns
        rows.append(
            ExactComparison(
                "cell: flexed block",
                f"M at k = {k:g}",
                *told,
                closed_forms.flexure_moment(k),
                state.moment[1] / thickness,
            )
        )
    return rows
