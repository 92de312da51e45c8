"""The unit cell as a system for Newton's method, and what an equilibrium of it says about the rod."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from pneunet.base.strains import RodStrains
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.contact.correction import ContactCorrection
from pneunet.hifi.fem.solver import DirectSolver

#: of the gap: an overlap at which contact has failed
TOO_DEEP = 0.05
#: of mu pitch^2, the size of the forces in a cell
RELATIVE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class CellState:
    """One equilibrium, per undeformed length: strains (e, k); force (N) and moment (N mm) in the section
    frame.

    stiffness (6, 6): d(force, moment)/d(e, k) in N, N mm and N mm2; volume: air in one pitch, mm3; pressure
    in MPa; unstable: directions in which the cell is unstable at this pressure (its free strains included).
    wall_distance: smallest signed distance (mm) of neighbouring chambers' walls, `gap` that at rest;
    walls_overlap: it is negative and there was no contact model, or one that has failed to hold them apart.
    contact: hifi.contact.walls.WallContact of the gap with the largest force, None without contact. array:
    the mixed state of the problem (hifi.cell.problem), what pictures and checks are made of. steps,
    factorisations in them and seconds: what it took to come here from rest (hifi.cell.run).
    """

    pressure: float
    strains: RodStrains
    force: np.ndarray
    moment: np.ndarray
    stiffness: np.ndarray
    volume: float
    unstable: int
    largest_stretch: float
    wall_distance: float
    gap: float = np.inf
    contact: object = None
    array: np.ndarray | None = field(default=None, repr=False)
    steps: int = 0
    factorisations: int = 0
    seconds: float = 0.0

    @property
    def screw_compliance(self) -> np.ndarray:
        """(2, 2) of 1/N and 1/(N mm2): how k.k/2 and k.e of a free state change under the wrench m = a k + b
        e, n = b k.

        This wrench is in equilibrium along a screw by itself, so that the gauge carries nothing, and k.k and
        k.e are the same for every line and every gauge: so is this part of the compliance. The rest of
        `stiffness` belongs to the section frame.
        """
        e, k = self.strains.e, self.strains.k
        wrenches = np.array([np.concatenate([0 * k, k]), np.concatenate([k, e])])
        return wrenches @ np.linalg.solve(self.stiffness, wrenches.T)

    @property
    def walls_overlap(self) -> bool:
        return self.wall_distance < (0.0 if self.contact is None else -TOO_DEEP * self.gap)

    @property
    def kirchhoff_stiffness(self) -> np.ndarray:
        """(4, 4) stiffness in (e1, k1, k2, k3) when the shears e2 and e3 relax."""
        kept, relaxed = [0, 3, 4, 5], [1, 2]
        K = self.stiffness
        return K[np.ix_(kept, kept)] - K[np.ix_(kept, relaxed)] @ np.linalg.solve(
            K[np.ix_(relaxed, relaxed)], K[np.ix_(relaxed, kept)]
        )


class CellSystem:
    """State: unknowns of the cell, six gauge multipliers, six strains. Increments hold the strains that are
    free.

    held (6,) bool: which of (e, k) are prescribed. The load ramps: at `load` the pressure is pressure[0] +
    load * pressure[1] (MPa) and the held strains are strains[0] + load * strains[1]. By default the load is
    the pressure and all strains are free. Strains enter increments and residuals times the pitch, which makes
    their entries forces and lengths.
    """

    def __init__(
        self,
        problem: CellProblem,
        held: np.ndarray | None = None,
        pressure: tuple[float, float] = (0.0, 1.0),
        strains: tuple[np.ndarray, np.ndarray] | None = None,
    ):
        self.problem, self.pitch = problem, problem.segment.pitch
        # strains of other classes than the states' stay as they are
        self.held = ~problem.classes[0].strains
        if held is not None:
            self.held = self.held | held
        self._free = np.flatnonzero(~self.held)
        self._pressure = pressure
        self._strains = (
            [np.eye(6)[0], np.zeros(6)] if strains is None else [np.asarray(s, float) for s in strains]
        )
        self._inner = sum(problem.gauge.shape)
        self._x = np.concatenate([np.zeros(self._inner), self._strains[0]])
        self._solver, self._factors = None, [_Factor() for _ in problem.classes]
        self._factorisations = 0
        self.walls = problem.walls
        self.load = 0.0
        self.state = self.at_supports(self._x)

    # ---- state and load
    @property
    def state(self) -> np.ndarray:
        return self._x

    @state.setter
    def state(self, x: np.ndarray) -> None:
        self._x = x
        self.problem.array[:] = self.problem.expand(x[: self.problem.unknowns])
        self.problem.strains.value[:] = x[-6:]

    @property
    def load(self) -> float:
        return self._load

    @load.setter
    def load(self, value: float) -> None:
        self._load = value
        self.problem.pressure.value = self._pressure[0] + value * self._pressure[1]

    def at_supports(self, state: np.ndarray) -> np.ndarray:
        """`state` with the held strains at their values for the present load."""
        state = state.copy()
        state[-6:][self.held] = (self._strains[0] + self._load * self._strains[1])[self.held]
        return state

    # ---- residual and tangent
    def derivatives(self) -> tuple[np.ndarray, np.ndarray]:
        """Of a pitch's potential at the current state: by unknowns and multipliers (n,), in N and, by the
        pressure field, mm3; by all six strains (6,), in N mm for e and N mm2 for k."""
        n = self.problem.unknowns
        forces, slope = self.problem.residual()
        gauge, gauge_strains = self.problem.gauge, self.problem.gauge_strains
        multipliers, strains = self._x[n:-6], self._x[-6:]
        r = np.concatenate([forces + gauge @ multipliers, gauge.T @ self._x[:n] + gauge_strains @ strains])
        return r, slope + gauge_strains.T @ multipliers

    def residual(self) -> tuple[np.ndarray, float]:
        r, slope = self.derivatives()
        return np.concatenate(
            [r, slope[self._free] / self.pitch]
        ), self.problem.segment.material.mu * self.pitch**2

    def load_gradient(self) -> np.ndarray:
        """Derivative of the residual by the load; through held strains with the factorised tangent's
        coupling."""
        kept, ends = self.problem.pressure.value.copy(), []
        for value in (0.0, 1.0):
            self.problem.pressure.value = value
            ends.append(self.residual()[0])
        self.problem.pressure.value = kept
        gradient = self._pressure[1] * (ends[1] - ends[0])
        if self.held.any():
            rate = np.where(self.held, self._strains[1], 0.0)
            gradient += np.concatenate(
                [self._mixed @ rate, (self._curvature @ rate)[self._free] / self.pitch]
            )
        return gradient

    def factorise(self) -> None:
        """Factorise the tangent. influence (unknowns and multipliers, 6): how these resist strains, K^-1
        d2Pi/du d(e,k); condensed (6, 6): d2Pi/d(e,k)2 with the rest in equilibrium, N mm a pitch and so
        on."""
        matrix, mixed, self._curvature = self.problem.tangent()
        self._solver = self._factors[0].of(matrix)
        self._factorisations += 1
        self._mixed = np.vstack([mixed, self.problem.gauge_strains])
        self._mixed *= self.problem.classes[0].strains
        self.influence = self._solver.solve_many(self._mixed)
        self.condensed = self._curvature - self._mixed.T @ self.influence
        self._contact = ContactCorrection(self.problem.contact.points(factorised=True))
        self.renew()

    def renew(self) -> bool | None:
        """Take which walls touch now: see ContactCorrection.renew."""
        return self._contact.renew(self.problem.contact.points(), self._gap_gradients, self._solve)

    def _gap_gradients(self, names):
        rows, n = self.problem.contact.gradients(names), self.problem.unknowns
        multipliers = sp.csr_matrix((len(names), self._inner - n))
        return sp.hstack([rows[:, :n], multipliers, rows[:, n:][:, self._free] / self.pitch], format="csr")

    def solve(self, right: np.ndarray) -> np.ndarray:
        """K^-1 right in (unknowns, multipliers, free strains times pitch), K the factorised tangent with what
        touches now."""
        return self._contact.corrected(
            self._solve(right[:, None])[:, 0], np.linalg.norm(right), straight=True
        )

    def correction(self, residual: np.ndarray) -> np.ndarray:
        """What brings the residual to zero, walls that come into touch or part by it included."""
        return self._contact.corrected(-self._solve(residual[:, None])[:, 0], np.linalg.norm(residual))

    def solve_inner(self, right: np.ndarray) -> np.ndarray:
        """Inverse of the factorised tangent at held strains times right (unknowns and multipliers, n)."""
        return self._solver.solve_many(right)

    def _solve(self, right):
        """K^-1 right (., columns) with the factorised tangent: bordering."""
        free, n = self._free, self._inner
        z = self.solve_inner(right[:n])
        if not len(free):
            return z
        C = self.condensed[np.ix_(free, free)]
        q = np.linalg.solve(C, right[n:] * self.pitch - self._mixed[:, free].T @ z)
        return np.vstack([z - self.influence[:, free] @ q, q * self.pitch])

    @property
    def unstable(self) -> int:
        """Unstable directions of the factorised state: each multiplier takes one negative pivot, strains
        count apart."""
        free = self.condensed[np.ix_(self._free, self._free)]
        own = self.problem.classes[0]
        inner = self._solver.negative_pivots - own.constraints - own.gauge.shape[1]
        return inner + int(np.count_nonzero(np.linalg.eigvalsh(free) < 0))

    @property
    def overreach(self) -> float:
        return self.problem.contact.overreach

    @property
    def factorisations(self) -> int:
        return self._factorisations

    def moved(self, state: np.ndarray, increment: np.ndarray) -> np.ndarray:
        moved = state.copy()
        n = len(state) - 6
        moved[:n] += increment[:n]
        moved[n + self._free] += increment[n:] / self.pitch
        return moved

    def extrapolated(self, states: Sequence[np.ndarray], weights: Sequence[float]) -> np.ndarray:
        return sum(w * x for w, x in zip(weights, states))

    def dot(self, a: np.ndarray, b: np.ndarray) -> float:
        return float(a @ b)

    def volume(self) -> float:
        """Volume (mm3) of the air in one pitch."""
        return self.problem.air_volume()

    # ---- what the rod needs
    def measure(self) -> CellState:
        """CellState of the present equilibrium; factorises its tangent, in all classes of symmetry."""
        self.factorise()
        stiffness, unstable = self.condensed.copy(), self.unstable
        for number in range(1, len(self.problem.classes)):
            _, part, more = self.of_class(number)
            stiffness += part
            unstable += more
        _, slope = self.derivatives()
        q = self._x[-6:]
        return CellState(
            float(self.problem.pressure.value),
            RodStrains(q[:3].copy(), q[3:].copy()),
            slope[:3] / self.pitch,
            slope[3:] / self.pitch,
            stiffness / self.pitch,
            self.problem.air_volume(),
            unstable,
            self.problem.stretch.largest(),
            self.walls.distance(),
            self.problem.segment.gap if self.walls.gaps else np.inf,
            self.problem.measure_contact(),
            self.problem.array.copy(),
        )

    def of_class(self, number: int) -> tuple[np.ndarray, np.ndarray, int]:
        """(influence, condensed, unstable directions) of another class of symmetry at the factorised
        state."""
        each = self.problem.classes[number]
        matrix, mixed, curvature = self.problem.tangent_of(number)
        mixed = np.vstack([mixed, each.gauge_strains * each.strains])
        solver = self._factors[number].of(matrix)
        influence = solver.solve_many(mixed)
        condensed = curvature - mixed.T @ influence
        own = condensed[np.ix_(each.strains, each.strains)]
        unstable = solver.negative_pivots - each.constraints - each.gauge.shape[1]
        return influence, condensed, unstable + int(np.count_nonzero(np.linalg.eigvalsh(own) < 0))

    def destroy(self) -> None:
        for factor in self._factors:
            factor.release()


class _Factor:
    """The factorised matrix of a class of symmetry; what its pattern has cost is kept."""

    def __init__(self):
        self._arrays = self._matrix = self._solver = None

    def of(self, matrix):
        """DirectSolver that has factorised a symmetric CSR matrix, of the same `indices` while its pattern is
        the same."""
        if self._arrays and self._arrays[1] is matrix.indices:
            self._arrays[2][:] = matrix.data
            self._matrix.stateIncrease()
        else:
            self.release()
            # at which PETSc's matrix looks; it copies nothing
            self._arrays = matrix.indptr, matrix.indices, matrix.data
            self._matrix = PETSc.Mat().createAIJWithArrays(matrix.shape, self._arrays, comm=MPI.COMM_SELF)
            self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            self._solver = DirectSolver(self._matrix, MPI.COMM_SELF)
        self._solver.factorise()
        return self._solver

    def release(self):
        if self._solver is not None:
            self._solver.destroy()
            self._matrix.destroy()
            self._solver = None
