"""A BodyProblem as a system for Newton's method: section-frame updates and a tangent that turns with the
body."""

from collections.abc import Callable, Sequence

import numpy as np
from mpi4py import MPI

from pneunet.hifi.body.problem import BodyProblem
from pneunet.hifi.contact.correction import ContactCorrection
from pneunet.hifi.fem.solver import DirectSolver
from pneunet.hifi.path.rod_coordinates import RodCoordinates


class BodySystem:
    """State: the mixed vector with ghosts. `apply_load(load)` sets the values of the problem's loads, each
    linear in it."""

    def __init__(
        self, problem: BodyProblem, coordinates: RodCoordinates, apply_load: Callable[[float], None]
    ):
        self.problem, self.coordinates, self.apply_load = problem, coordinates, apply_load
        self.comm = problem.mesh.comm
        self._matrix = problem.create_tangent()
        self.solver = DirectSolver(self._matrix, self.comm, problem.symmetric)
        self._spread = problem.state.copy()
        self._load = 0.0
        apply_load(0.0)
        self._nodes = problem.displacement_space.dofmap.index_map.size_global
        self._owned_displacements = problem.displacement_dofs[: problem.owned_nodes]

    # ---- state and load
    @property
    def state(self) -> np.ndarray:
        return self.problem.array

    @state.setter
    def state(self, array: np.ndarray) -> None:
        self.problem.set_array(array)

    @property
    def load(self) -> float:
        return self._load

    @load.setter
    def load(self, value: float) -> None:
        self._load = value
        self.apply_load(value)

    def steer(self, apply_load: Callable[[float], None], load: float) -> None:
        """From here on the load is what `apply_load` sets, and begins at `load`; what was set before
        stays."""
        self.apply_load, self.load = apply_load, load

    def at_supports(self, state: np.ndarray) -> np.ndarray:
        """`state` with supported displacements at their values for the present load."""
        return self.problem.supported(state, self._load)

    # ---- residual and tangent
    def residual(self) -> tuple[np.ndarray, float]:
        return self.problem.residual()

    def load_gradient(self) -> np.ndarray:
        """(owned dofs,) derivative of the residual by the load, which it is linear in; zero at supports."""
        load, ends = self._load, []
        for value in (0.0, 1.0):
            self.apply_load(value)
            ends.append(self.problem.external_force())
        self.apply_load(load)
        return self.problem.unsupported(ends[1] - ends[0])

    def factorise(self) -> None:
        self.problem.assemble_tangent(self._matrix)
        self.solver.factorise()
        self._rotation_then = self._rotations()
        touching = self.problem.contact.points(factorised=True)
        self._contact = ContactCorrection(touching, total=self.comm.allreduce)
        self.renew()

    @property
    def overreach(self) -> float:
        return self.problem.contact.overreach

    def renew(self) -> bool | None:
        """Take which walls touch now: see ContactCorrection.renew."""
        contact = self.problem.contact
        return self._contact.renew(contact.points(), contact.gradients, self._solve)

    def _rotations(self):
        return self.coordinates.sections(self.coordinates.nodes + self.problem.displacement())[:, :3, :3]

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(owned dofs,) approximation of K^-1 right at the current state, K with what touches now."""
        return self._contact.corrected(self._solve(right), np.sqrt(self.dot(right, right)), straight=True)

    def correction(self, residual: np.ndarray) -> np.ndarray:
        """(owned dofs,): what brings the residual to zero, walls that come into touch or part by it
        included."""
        return self._contact.corrected(-self._solve(residual), np.sqrt(self.dot(residual, residual)))

    def _solve(self, right):
        """(owned dofs, ...) approximation of K^-1 right with the factorised tangent.

        The factorised tangent is turned with the body: a rigidly rotated part has the tangent R K R^T, so a
        lagged one serves as long as the *strains* have not changed much, whatever the sections' rotations.
        """
        dofs = self._owned_displacements
        turn = np.einsum("nij,nkj->nik", self._rotations(), self._rotation_then)[: len(dofs)]
        turned = right.copy()
        turned[dofs] = np.einsum("nji,nj...->ni...", turn, right[dofs])
        solution = (self.solver.solve if right.ndim == 1 else self.solver.solve_many)(turned)
        solution[dofs] = np.einsum("nij,nj...->ni...", turn, solution[dofs])
        return solution

    @property
    def unstable(self) -> int | None:
        """Directions in which the factorised state is unstable at fixed loads; None when the matrix is
        unsymmetric."""
        if not self.factorisations:
            return 0  # at rest
        negative = self.solver.negative_pivots
        return None if negative is None else negative - self.problem.constraints

    @property
    def factorisations(self) -> int:
        return self.solver.factorisations

    # ---- geometry of the state space
    def moved(self, state: np.ndarray, increment: np.ndarray) -> np.ndarray:
        """State after an increment (owned dofs,): displacement retracted, pressure added, supported values
        kept."""
        self._spread.x.array[: len(increment)] = increment
        self._spread.x.scatter_forward()
        full = self._spread.x.array
        dofs, nodes = self.problem.displacement_dofs, self.coordinates.nodes
        moved = state + full
        moved[dofs] = self.coordinates.retract(nodes + state[dofs], full[dofs]) - nodes
        fixed = self.problem.fixed_dofs
        moved[fixed] = state[fixed]
        return moved

    def extrapolated(self, states: Sequence[np.ndarray], weights: Sequence[float]) -> np.ndarray:
        """Lagrange extrapolation of states in section frames."""
        predicted = sum(w * a for w, a in zip(weights, states))
        dofs, X = self.problem.displacement_dofs, self.coordinates.nodes
        predicted[dofs] = self.coordinates.extrapolate([X + a[dofs] for a in states], weights) - X
        return predicted

    def dot(self, a: np.ndarray, b: np.ndarray) -> float:
        return self.comm.allreduce(float(a @ b), op=MPI.SUM)

    def volume(self) -> float:
        return self.problem.cavity_volume()

    # ---- the metric of arc length: root mean square displacement of the nodes
    def positions(self) -> np.ndarray:
        return self.problem.array[self._owned_displacements].ravel()

    def positions_part(self, increment: np.ndarray) -> np.ndarray:
        return increment[self._owned_displacements].ravel()

    def mean_square(self, a: np.ndarray, b: np.ndarray) -> float:
        return self.dot(a, b) / self._nodes

    def mean_square_row(self, a: np.ndarray) -> np.ndarray:
        """(owned dofs,) gradient of mean_square(a, positions)."""
        row = np.zeros(self.problem.owned)
        row[self._owned_displacements.ravel()] = a / self._nodes
        return self.problem.unsupported(row)

    def destroy(self) -> None:
        self.solver.destroy()
        self._matrix.destroy()
        self.problem.destroy()
