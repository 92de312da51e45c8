"""Equilibria of the unit cell over growing pressure, with the rod's tangent stiffness at each of them."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from base.strains import RodStrains
from hifi.solver import DirectSolver, NotConverged, iterations_left
from hifi.stepping import lagrange_coefficients

TOLERANCE, PATIENCE, MAXIMUM = 1e-9, 8.0, 30


@dataclass(frozen=True)
class CellState:
    """One equilibrium, per undeformed length: strains (e, k); force (N) and moment (N mm) in the section frame.

    stiffness (6, 6): d(force, moment)/d(e, k); volume: air in one pitch, mm3; pressure in MPa.
    """

    pressure: float
    strains: RodStrains
    force: np.ndarray
    moment: np.ndarray
    stiffness: np.ndarray
    volume: float


class CellPath:
    """Pressure path of a CellProblem for `hifi.stepping.run_steps`; strains free, or all held at `fixed_strains` (6,)."""

    def __init__(self, problem, fixed_strains=None):
        self.problem = problem
        self.fixed = fixed_strains is not None
        if self.fixed:
            problem.strains.value[:] = fixed_strains
        self.load, self.factorisations = 0.0, 0
        n = problem.unknowns
        self._x = np.concatenate([np.zeros(n + 6), problem.strains.value])  # unknowns, gauge multipliers, strains
        self._accepted = []
        self._solver = self._matrix = None
        if self.fixed:
            self._newton()
        else:
            self._factorise()
        self._accepted = [(0.0, self._x.copy())]

    def _set(self, x):
        self._x = x
        n = self.problem.unknowns
        self.problem.state.x.array[:] = self.problem.expand(x[:n])
        self.problem.strains.value[:] = x[n + 6 :]

    def _factorise(self):
        matrix, mixed, self._curvature = self.problem.tangent()
        if self._matrix is None:
            self._matrix = PETSc.Mat().createAIJ(matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data), comm=MPI.COMM_SELF)
            self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            self._solver = DirectSolver(self._matrix, MPI.COMM_SELF)
            self._right = self._matrix.createVecRight()
        else:
            self._matrix.setValuesCSR(matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data)
            self._matrix.assemble()
        self._solver.factorise()
        self.factorisations += 1
        self._mixed = np.vstack([mixed, self.problem.gauge_strains])
        self._influence = np.column_stack([self._solve(column) for column in self._mixed.T])
        self._condensed = self._curvature - self._mixed.T @ self._influence

    def _solve(self, right):
        self._right.array[:] = right
        return self._solver.solve(self._right).array.copy()

    def _residual(self):
        """(residual of the unknowns and the gauge, residual of the strains (6,))."""
        n = self.problem.unknowns
        forces, slope = self.problem.residual()
        gauge, gauge_strains = self.problem.gauge, self.problem.gauge_strains
        multipliers, strains = self._x[n : n + 6], self._x[n + 6 :]
        r = np.concatenate([forces + gauge @ multipliers, gauge.T @ self._x[:n] + gauge_strains @ strains])
        return r, slope + gauge_strains.T @ multipliers

    def _correction(self, r, slope):
        z = self._solve(r)
        if self.fixed:
            return np.concatenate([-z, np.zeros(6)])
        dq = np.linalg.solve(self._condensed, self._mixed.T @ z - slope)
        return np.concatenate([-z - self._influence @ dq, dq])

    def _norm(self, r, slope):
        return np.sqrt(r @ r + (0.0 if self.fixed else slope @ slope / self.problem.segment.pitch**2))

    def _newton(self):
        """Iterate to equilibrium at the problem's pressure; the list of residual norms."""
        material, pitch = self.problem.segment.material, self.problem.segment.pitch
        tolerance = TOLERANCE * material.mu * pitch**2
        r, slope = self._residual()
        history, fresh = [self._norm(r, slope)], False
        while history[-1] > tolerance:
            if len(history) > MAXIMUM or not np.isfinite(history[-1]):
                raise NotConverged(f"cell residual {history[-1]:.1e} N after {len(history) - 1} iterations")
            if self._solver is None or (not fresh and iterations_left(history, tolerance) > PATIENCE):
                self._factorise()
                fresh = True
            else:
                fresh = False
            self._set(self._x + self._correction(r, slope))
            r, slope = self._residual()
            history.append(self._norm(r, slope))
        return history

    def _pressure_slope(self):
        """d(unknowns, strains)/dP at the factorised state; the residual is linear in P."""
        at = []
        for value in (0.0, 1.0):
            self.problem.pressure.value = value
            at.append(self._residual())
        return self._correction(at[1][0] - at[0][0], at[1][1] - at[0][1])

    def advance(self, load):
        """Equilibrium at pressure `load` (MPa): (iterations, factorisations, residual); NotConverged restores."""
        before, kept = self.factorisations, self._x.copy()
        known = self._accepted[-3:]
        if len(known) == 1:
            x = known[0][1] + load * self._pressure_slope()
        else:
            x = sum(w * v for w, (_, v) in zip(lagrange_coefficients([t for t, _ in known], load), known))
        self.problem.pressure.value = load
        self._set(x)
        try:
            history = self._newton()
        except NotConverged:
            self._set(kept)
            self.problem.pressure.value = self.load
            self._factorise()
            raise
        self.load = load
        self._accepted = known[-2:] + [(load, self._x.copy())]
        return len(history) - 1, self.factorisations - before, history[-1]

    def state(self):
        """CellState of the present equilibrium; factorises its tangent."""
        self._factorise()
        pitch = self.problem.segment.pitch
        _, slope = self._residual()
        q = self._x[-6:]
        return CellState(
            self.load,
            RodStrains(q[:3].copy(), q[3:].copy()),
            slope[:3] / pitch,
            slope[3:] / pitch,
            self._condensed / pitch,
            self.problem.air_volume(),
        )

    def destroy(self):
        if self._solver is not None:
            self._solver.destroy()
            self._matrix.destroy()
            self._right.destroy()
