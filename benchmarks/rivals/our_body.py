"""The ramp's body in pneunet: the mixed problem of `hifi` and its direct solver, nothing else of it.

The only module of the rivals that knows hifi's inside.
"""

import numpy as np
from mpi4py import MPI
from ramp import MU, Body

from base.materials import NeoHookean
from geometry import cad
from hifi import compat
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
        self.balance(0.0)  # compiled, vectors made
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
