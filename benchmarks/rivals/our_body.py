"""The ramp's body in pneunet: the mixed problem of `hifi` and its direct solver; and hifi's own ramp.

The only module of the rivals that knows hifi's inside.
"""

import numpy as np
from mpi4py import MPI
from ramp import MILESTONES, MPA, MU, Body

from base.materials import NeoHookean
from geometry import cad
from hifi import compat
from hifi.manipulator import ManipulatorSolve
from hifi.problem import MixedProblem, Support
from hifi.solver import DirectSolver


class OurBody(Body):
    name = "pneunet"

    def __init__(self, path, comm=MPI.COMM_WORLD):
        super().__init__()
        self.problem = MixedProblem(*compat.read_mesh(path, comm), NeoHookean(MU), (cad.CAVITY, cad.CHANNEL), [Support(cad.BASE)])
        self.dofs, self.fixed = self.problem.dofs, self.problem.fixed_dofs
        self.matrix = self.problem.create_tangent()
        self.solver = DirectSolver(self.matrix, comm)
        self._right = self.matrix.createVecRight()
        self.speaks = comm.rank == 0
        self.problem.assemble_tangent(self.matrix, 0.0)

    @property
    def state(self):
        return self.problem.array.copy()

    @state.setter
    def state(self, values):
        self.problem.set_array(values)

    def balance(self, pressure):
        with self.timed("residual"):
            residual, scale = self.problem.residual(pressure)
            return residual.array.copy(), residual.norm(), scale

    def factorise(self, pressure):
        with self.timed("tangent"):
            self.problem.assemble_tangent(self.matrix, pressure)
        with self.timed("factorise"):
            self.solver.factorise()

    def solve(self, right):
        with self.timed("solve"):
            self._right.array[:] = right
            solution = np.zeros(len(self.problem.array))
            owned = self.solver.solve(self._right).array
            solution[: len(owned)] = owned
            return solution

    def displacements(self):
        return self.problem.nodes, self.problem.displacement()


class BestBody:
    """hifi's own stepping, with everything that it measures at a step."""

    def __init__(self, path, comm=MPI.COMM_WORLD):
        from benchmarks.rivals.meshes import segment

        self.solve = ManipulatorSolve(segment(), path, comm)
        self.problem, self.newton = self.solve.problem, self.solve.newton
        self.dofs, self.speaks = self.problem.dofs, comm.rank == 0

    def warm_up(self):
        self.solve.measure()
        self.problem.residual(0.0)
        self.problem.load_force()
        self.problem.assemble_tangent(self.newton.tangent, 0.0)
        self.newton.timings = dict.fromkeys(self.newton.timings, 0.0)

    def ramp(self, tolerance):
        self.newton.options.relative_tolerance = tolerance
        result = self.solve.run(MILESTONES[-1] * MPA, milestones=[load * MPA for load in MILESTONES])
        return [(step.load / MPA, step.iterations, step.factorisations) for step in result.steps]

    @property
    def factorisations(self):
        return self.newton.solver.factorisations

    @property
    def seconds(self):
        return self.newton.timings

    def displacements(self):
        return self.problem.nodes, self.problem.displacement()
