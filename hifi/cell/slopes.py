"""Derivatives of a cell's free states, of the strains and of the stiffness: by its shape, along
geometry.shape_numbers.DIRECTIONS, and by how its material stiffens, geometry.shape_numbers.STIFFENING.

The mesh moves with the shape (geometry.grids.morph), so that its own error hardly enters. At a free state
R(x, q; s) = 0, x the unknowns and multipliers and q the strains; the residual and the second derivatives are
differenced along s, all the rest is solved exactly with the tangent that is factorised there (direct
sensitivity analysis; e.g. Choi & Kim, Structural Sensitivity Analysis, 2005):
    dq = -C^-1 (R_q' - A^T R_x'),  dx = -K^-1 R_x' - A dq,  A = K^-1 R_xq,  C = R_qq - R_xq^T A
    dC = Z^T (dH along s, x and q) Z,  Z = (-A, 1), H all second derivatives.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import Yeoh
from pneunet.geometry import tags
from pneunet.geometry.grids.morph import Morph
from pneunet.geometry.shape_numbers import DIRECTIONS, STIFFENING, changed
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.system import CellSystem

#: normal pitches or, for the angle, degrees; and of c10. Walls begin to push over micrometres: at a hundred
#: times these steps slopes in contact are off by a tenth
STEP, ANGLE_STEP, MATERIAL_STEP = 1e-6, 1e-4, 1e-5
#: mm; places that are one
SAME = 1e-8


class StateSlopes:
    """For a hifi.cell.problem.CellProblem, which must be where its segment is: InputError where the mesh ends
    elsewhere, since planes were made one (geometry.snapping). Derivatives by the stiffening are for Yeoh's
    law, zero for others."""

    def __init__(self, problem: CellProblem):
        self.problem, home, vertices = problem, problem.segment, problem.mesh.geometry.x.copy()
        if not np.abs(Morph(home, home)(vertices) - vertices).max() < SAME:
            raise InputError(
                "slopes: a ceiling next to the core's top, which the grid has made one plane: no derivative"
                " is known there"
            )
        self._home = problem.placement
        self._moved, self.steps = [], []
        for name, change in DIRECTIONS[home.kind].items():
            self.steps.append(ANGLE_STEP if name == "angle" else STEP)
            other = changed(home, change, self.steps[-1])
            problem.move(other, Morph(home, other)(vertices))
            self._moved.append(problem.placement)
        problem.placement = self._home
        self.steps += [MATERIAL_STEP] * len(STIFFENING)

    def of(self, system: CellSystem, stiffness: bool = True) -> tuple[np.ndarray, np.ndarray | None]:
        """(slopes of the strains (d, 6), of CellState.stiffness (d, 6, 6) or None) by the d directions at a
        free state of `system`, a CellSystem that has just been factorised there. mm, N, and normal pitches,
        degrees or parts of c10."""
        problem, state = self.problem, system.state.copy()
        inner, slope = system.derivatives()
        rates = []
        for number, step in enumerate(self.steps):
            with self._changed(number):
                there = system.derivatives()
            rates.append(np.concatenate([there[0] - inner, there[1] - slope]) / step)
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
        influences = [A, *(influence for influence, _, _ in others)]
        slopes = []
        for number, (step, way) in enumerate(zip(self.steps, ways.T)):
            system.state = state + step * way
            with self._changed(number):
                slopes.append((self._second_derivatives(influences) / problem.segment.pitch - here) / step)
        system.state = state
        return strains.T, np.array(slopes)

    @contextmanager
    def _changed(self, number: int) -> Iterator[None]:
        """The problem one step along a direction."""
        if number < len(self._moved):
            self.problem.placement = self._moved[number]
            try:
                yield
            finally:
                self.problem.placement = self._home
            return
        material, constants = self.problem.segment.material, self.problem.constants[tags.BODY]
        if not isinstance(material, Yeoh):
            yield
            return
        constant = constants[("c20", "c30")[number - len(self._moved)]]
        kept = constant.value.copy()
        constant.value = kept + MATERIAL_STEP * material.c10
        try:
            yield
        finally:
            constant.value = kept

    def _second_derivatives(self, influences):
        """(6, 6) sum of Z^T H Z over the classes of symmetry, Z = (-influence, 1) of each."""
        classes = self.problem.classes
        ways = [(-a[: each.unknowns], np.eye(6)) for each, a in zip(classes, influences)]
        total = self.problem.second_derivative(ways)
        for each, a, (unknowns, _) in zip(classes, influences, ways):
            # the gauge, bilinear in its multipliers and the rest
            rows = each.gauge.T @ unknowns + each.gauge_strains * each.strains
            crossed = -a[each.unknowns :].T @ rows
            total += crossed + crossed.T
        return total
