"""Linear solver (MUMPS LDL^T) and Newton's method with a lagged tangent. Knows nothing of stepping."""

from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from petsc4py import PETSc


class NotConverged(RuntimeError):
    """This solve failed; the stepper decides what to try next."""


class PredictorTooFar(NotConverged):
    """The predicted state is further from equilibrium than what failed before: not worth a factorisation."""


class DirectSolver:
    """MUMPS factorisation of the problem's tangent: LDL^T when symmetric (a closed cavity), LU otherwise."""

    def __init__(self, matrix, comm, symmetric=True):
        self.matrix = matrix
        self.symmetric = symmetric
        self.factorisations = 0
        self.ksp = PETSc.KSP().create(comm)
        self.ksp.setType("preonly")
        pc = self.ksp.getPC()
        pc.setType("cholesky" if symmetric else "lu")
        pc.setFactorSolverType("mumps")
        self.ksp.setOperators(matrix)
        pc.setFactorSetUpSolverType()
        self._solution, self._right = matrix.createVecs()
        factor = pc.getFactorMatrix()
        factor.setMumpsIcntl(7, 5)  # metis: up to 5x better than the automatic choice on these matrices
        factor.setMumpsIcntl(14, 60)  # workspace for pivoting, in percent
        factor.setMumpsIcntl(24, 1)  # a singular pivot is told, not a crash

    def factorise(self):
        self.ksp.setOperators(self.matrix)
        self.ksp.setUp()
        self.factorisations += 1
        if self.ksp.getPC().getFactorMatrix().getMumpsInfog(1) < 0:
            raise NotConverged("the tangent could not be factorised (out of memory or singular)")

    def solve(self, right):
        """Solution vector of K x = right; owned by this solver, overwritten by the next call."""
        self.ksp.solve(right, self._solution)
        return self._solution

    def destroy(self):
        self.ksp.destroy()
        self._solution.destroy()
        self._right.destroy()


@dataclass
class NewtonOptions:
    """relative_tolerance: of the pressure load's norm (absolute_tolerance in N, for no load at all).

    patience: a new tangent is factorised when the lagged one would need more than this many iterations to finish;
    about what a factorisation costs in units of iterations (8 to 10 at 30k to 150k dofs).
    """

    relative_tolerance: float = 1e-8
    absolute_tolerance: float = 1e-11
    patience: float = 8.0
    maximum_iterations: int = 40
    growth_limit: float = 1e4


@dataclass
class NewtonResult:
    iterations: int
    residuals: list = field(default_factory=list)


class Newton:
    """Newton iterations on residual(state) = internal force + pressure * load, updated through `RodCoordinates`."""

    def __init__(self, problem, coordinates, options=None):
        self.problem, self.coordinates = problem, coordinates
        self.options = options or NewtonOptions()
        self.tangent = problem.create_tangent()
        self.solver = DirectSolver(self.tangent, problem.mesh.comm)
        self.factorised_at = None
        self._increment = problem.state.copy()
        self._turned = self.tangent.createVecRight()
        self.timings = {"residual": 0.0, "tangent": 0.0, "factorise": 0.0, "solve": 0.0}

    def factorise(self, pressure):
        """Assemble and factorise the tangent at the current state."""
        t = perf_counter()
        self.problem.assemble_tangent(self.tangent, pressure)
        t1 = perf_counter()
        self.timings["tangent"] += t1 - t
        self.solver.factorise()
        self.timings["factorise"] += perf_counter() - t1
        self.factorised_at = pressure
        self._rotation_then = self._rotations()

    def _rotations(self):
        return self.coordinates.sections(self.coordinates.nodes + self.problem.displacement())[:, :3, :3]

    def apply_inverse(self, right):
        """Approximate K^-1 right (a PETSc vector) at the current state, as an array over owned and ghost dofs.

        The factorised tangent is turned with the body: a rigidly rotated part has the tangent R K R^T, so a lagged
        one serves as long as the *strains* have not changed much, whatever the sections' rotations.
        """
        t = perf_counter()
        dofs = self.problem.displacement_dofs[: self.problem.owned_nodes]
        turn = np.einsum("nij,nkj->nik", self._rotations(), self._rotation_then)
        owned = turn[: len(dofs)]
        right.copy(self._turned)
        local = self._turned.array
        local[dofs] = np.einsum("nji,nj->ni", owned, local[dofs])
        solution = self._to_array(self.solver.solve(self._turned))
        dofs = self.problem.displacement_dofs
        solution[dofs] = np.einsum("nij,nj->ni", turn, solution[dofs])
        self.timings["solve"] += perf_counter() - t
        return solution

    def residual(self, pressure):
        """(residual vector, its norm, norm of the forces it balances)."""
        t = perf_counter()
        r, scale = self.problem.residual(pressure)
        norm = r.norm()
        self.timings["residual"] += perf_counter() - t
        return r, norm, scale

    def load_direction(self):
        """d(state)/d(pressure) with the factorised tangent, as an array over owned and ghost dofs."""
        return -self.apply_inverse(self.problem.load_force())

    def _to_array(self, vector):
        local = self._increment.x.array
        local[: len(vector.array)] = vector.array
        self._increment.x.scatter_forward()
        return self._increment.x.array.copy()

    def move(self, array, increment):
        """State array after an increment: displacement retracted, pressure added, supported values kept."""
        dofs, nodes = self.problem.displacement_dofs, self.coordinates.nodes
        moved = array + increment
        moved[dofs] = self.coordinates.retract(nodes + array[dofs], increment[dofs]) - nodes
        fixed = self.problem.fixed_dofs
        moved[fixed] = array[fixed]
        return moved

    def solve(self, pressure):
        """Iterate from the current state to equilibrium at `pressure` (MPa); NotConverged otherwise."""
        o = self.options
        r, norm, scale = self.residual(pressure)
        history = [norm]
        fresh = False
        for iteration in range(1, o.maximum_iterations + 1):
            if norm <= o.relative_tolerance * scale + o.absolute_tolerance:
                return NewtonResult(iteration - 1, history)
            tolerance = o.relative_tolerance * scale + o.absolute_tolerance
            if self.factorised_at is None or (not fresh and iterations_left(history, tolerance) > o.patience):
                self.factorise(pressure)
                fresh = True
            else:
                fresh = False
            self.problem.set_array(self.move(self.problem.array, -self.apply_inverse(r)))
            r, norm, scale = self.residual(pressure)
            history.append(norm)
            if not np.isfinite(norm) or norm > o.growth_limit * max(history[0], scale):
                raise NotConverged(f"residual grew to {norm:.1e} N")
        raise NotConverged(
            f"residual {norm:.1e} N after {o.maximum_iterations} iterations (tolerance {o.relative_tolerance * scale:.1e} N)"
        )

    def destroy(self):
        self.solver.destroy()
        self.tangent.destroy()
        self._turned.destroy()
        self.problem.destroy()


def iterations_left(history, tolerance):
    """Iterations to `tolerance` at the rate of the last two residuals; 0 when there is no rate yet."""
    if len(history) < 2:
        return 0.0
    rate = history[-1] / history[-2]
    return np.inf if rate >= 1 else np.log(tolerance / history[-1]) / np.log(rate)
