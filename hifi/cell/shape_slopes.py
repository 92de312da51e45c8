"""Derivatives of a cell's free states by its shape: of the strains and of the stiffness, along
geometry.shape_numbers.DIRECTIONS.

The mesh moves with the shape (geometry.cad.morph), so that its own error hardly enters. At a free state R(x,
q; s) = 0, x the unknowns and multipliers and q the strains; the residual and the second derivatives are
differenced along s, all the rest is solved exactly with the tangent that is factorised there (direct
sensitivity analysis; e.g. Choi & Kim, Structural Sensitivity Analysis, 2005):
    dq = -C^-1 (R_q' - A^T R_x'),  dx = -K^-1 R_x' - A dq,  A = K^-1 R_xq,  C = R_qq - R_xq^T A
    dC = Z^T (dH along s, x and q) Z,  Z = (-A, 1), H all second derivatives.
"""

import numpy as np

from pneunet.geometry.cad.morph import moved
from pneunet.geometry.shape_numbers import DIRECTIONS, changed
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.system import CellSystem

#: normal pitches or, for the angle, degrees
STEP, ANGLE_STEP = 1e-4, 1e-2


class ShapeSlopes:
    """For a hifi.cell.problem.CellProblem, which must be where its segment is."""

    def __init__(self, problem: CellProblem):
        self.problem, home, vertices = problem, problem.segment, problem.mesh.geometry.x.copy()
        kept = problem.placement
        self._moved, self.steps = [], []
        for name, change in DIRECTIONS[home.kind].items():
            self.steps.append(ANGLE_STEP if name == "angle" else STEP)
            other = changed(home, change, self.steps[-1])
            problem.move(other, moved(vertices, home, other))
            self._moved.append(problem.placement)
        problem.placement = kept

    def of(self, system: CellSystem, stiffness: bool = True) -> tuple[np.ndarray, np.ndarray | None]:
        """(slopes of the strains (d, 6), of CellState.stiffness (d, 6, 6) or None) by the d directions at a
        free state of `system`, a CellSystem that has just been factorised there. mm, N, and normal pitches or
        degrees."""
        problem, state, home = self.problem, system.state.copy(), self.problem.placement
        inner, slope = self._residual(state)
        rates = []
        for placement, step in zip(self._moved, self.steps):
            problem.placement = placement
            there = self._residual(state)
            rates.append(np.concatenate([there[0] - inner, there[1] - slope]) / step)
        problem.placement = home
        rates = np.array(rates).T
        inner, slope = rates[:-6], rates[-6:]
        A, C, free = system.influence, system.condensed, problem.classes[0].strains
        strains = np.zeros_like(slope)
        strains[free] = -np.linalg.solve(C[np.ix_(free, free)], (slope - A.T @ inner)[free])
        if not stiffness:
            return strains.T, None
        ways = np.vstack([-system.solve_inner(inner) - A @ strains, strains])
        others = [system.of_class(number) for number in range(1, len(problem.classes))]
        here = (C + sum(condensed for _, condensed, _ in others)) / problem.segment.pitch
        Z, slopes = [np.vstack([-a, np.eye(6)]) for a in [A, *(influence for influence, _, _ in others)]], []
        for placement, step, way in zip(self._moved, self.steps, ways.T):
            problem.placement = placement
            system.state = state + step * way
            slopes.append((self._second_derivatives(Z) / problem.segment.pitch - here) / step)
        problem.placement, system.state = home, state
        return strains.T, np.array(slopes)

    def _residual(self, state):
        """(of unknowns and multipliers, of the strains) at the problem's state, `state` (unknowns + 12,)."""
        problem, n = self.problem, self.problem.unknowns
        forces, slope = problem.residual()
        u, multipliers, q = state[:n], state[n:-6], state[-6:]
        inner = np.concatenate(
            [forces + problem.gauge @ multipliers, problem.gauge.T @ u + problem.gauge_strains @ q]
        )
        return inner, slope + problem.gauge_strains.T @ multipliers

    def _second_derivatives(self, Z):
        """(6, 6) sum of Z^T H Z over the classes of symmetry, each with its Z."""
        total = np.zeros((6, 6))
        for number, (each, z) in enumerate(zip(self.problem.classes, Z)):
            tangent = self.problem.tangent_of(number) if number else self.problem.tangent()
            matrix, mixed, curvature = tangent
            mixed = z[:-6].T @ np.vstack([mixed, each.gauge_strains * each.strains])
            total += z[:-6].T @ (matrix @ z[:-6]) + mixed + mixed.T + curvature
        return total
