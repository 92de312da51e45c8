"""Solid cylinders in a row, pressed together end to end while each is turned against the next: contact with
an exact solution.

A cell of one cylinder and a gap, at prescribed stretch and twist. Nothing rubs, so that each cylinder is
compressed as if alone: uniformly, by a force that its shortening tells, and without a torque. The ends'
meshes, turned, do not match.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dolfinx.mesh import meshtags
from scipy.optimize import brentq

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import tags
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.system import CellState
from pneunet.hifi.contact.penalty import PenaltyLaw, WallPenalty
from pneunet.hifi.verification import bodies
from pneunet.hifi.verification.cells import held_at
from pneunet.hifi.verification.following import ExactComparison


@dataclass(frozen=True)
class Row:
    """What a cell needs to know of a cylinder of radius and length 1 mm that ends at a gap."""

    gap: float = 0.1
    material: NeoHookean = NeoHookean(1.0)
    layer_material: None = None
    width: float = 2.0
    sides: tuple = (1,)
    core_top: float = -2.0
    sin: float = 1.0
    cot: float = 0.0

    @property
    def pitch(self) -> float:
        return 1.0 + self.gap


def exact_force(row: Row, stretch: float, law: PenaltyLaw) -> float:
    """Axial force (N, tension positive) of the row at this stretch of a pitch, the penalty's overlap
    included."""

    def stress(own):
        return own - 1 / own**2

    def unbalanced(own):
        return stress(own) + law(np.array(own - stretch * row.pitch))[1]

    return float(np.pi * stress(brentq(unbalanced, 0.2, 1.0, xtol=1e-14)))


def pressed(
    folder: Path, size: float = 0.35, stretch: float = 0.8, twist: float = 0.25
) -> tuple[ExactComparison, float, CellState]:
    """(ExactComparison of the axial force, torque in N mm, CellState)."""
    row, penalty = Row(), WallPenalty()
    mesh, cells, facets = bodies.round_body("cylinder", size, tags.BODY)
    ends = np.isin(facets.values, (bodies.PLANE_X, bodies.END))
    facets = meshtags(mesh, 2, facets.indices, np.where(ends, tags.OUTER, facets.values).astype(np.int32))
    problem = CellProblem(row, (mesh, cells, facets), (bodies.OUTER,), centre=0.5, contact=penalty)
    state = held_at(problem, np.ones(6, bool), np.array([stretch, 0, 0, twist, 0, 0]))
    told = (
        "cell: pressed cylinders",
        f"axial force at e1 = {stretch:g}, k1 = {twist:g}",
        f"h = {size:g}",
        problem.unknowns,
    )
    exact = exact_force(row, stretch, penalty.on(row.material.mu, row.gap))
    return ExactComparison(*told, exact, state.force[0]), float(state.moment[0]), state
