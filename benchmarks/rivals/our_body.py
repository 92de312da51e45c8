"""The ramp's body in pneunet: the mixed problem of `hifi` and its direct solver; and hifi's own ramp.

The only module of the rivals that knows hifi's inside (`meshes` knows its quadrature degrees).
"""

import numpy as np
from mpi4py import MPI
from ramp import MILESTONES, MPA, MU, Body

from benchmarks.rivals.meshes import segment
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import tags
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.body.problem import BodyProblem, Support
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.loads import Pressure
from pneunet.hifi.fem.solver import DirectSolver


class OurBody(Body):
    """Plain displacement updates, no section frames, no secants: what the strategies of `ramp` say and no
    more."""

    def __init__(self, path, comm=MPI.COMM_WORLD):
        super().__init__()
        self.pressure = Pressure((tags.CAVITY, tags.CHANNEL))
        self.problem = BodyProblem(
            *compat.read_mesh(path, comm), NeoHookean(MU), [Support(tags.BASE)], [self.pressure]
        )
        self.dofs, self.speaks = self.problem.dofs, comm.rank == 0
        self.matrix = self.problem.create_tangent()
        self.solver = DirectSolver(self.matrix, comm)
        self.problem.assemble_tangent(self.matrix)

    @property
    def state(self):
        return self.problem.array.copy()

    @state.setter
    def state(self, values):
        self.problem.set_array(values)

    def balance(self, pressure):
        with self.timed("residual"):
            self.pressure.value.value = pressure
            residual, scale = self.problem.residual()
            return residual, np.sqrt(self.problem.mesh.comm.allreduce(residual @ residual)), scale

    def factorise(self, pressure):
        with self.timed("tangent"):
            self.pressure.value.value = pressure
            self.problem.assemble_tangent(self.matrix)
        with self.timed("factorise"):
            self.solver.factorise()

    def solve(self, right):
        with self.timed("solve"):
            solution = np.zeros(len(self.problem.array))  # ghosts follow when the state is set
            solution[: len(right)] = self.solver.solve(right)
            return solution

    def displacements(self):
        return self.problem.nodes, self.problem.displacement()


class BestBody:
    """hifi's own stepping, with everything that it measures at a step."""

    def __init__(self, path, comm=MPI.COMM_WORLD):
        self.solve = ManipulatorSolve(segment(), path, comm)
        self.problem, self.newton = self.solve.problem, self.solve.path.newton
        self.dofs, self.speaks = self.problem.dofs, comm.rank == 0

    def warm_up(self):
        self.solve.measure()
        self.newton.residual()
        matrix = self.problem.create_tangent()
        self.problem.assemble_tangent(matrix)
        matrix.destroy()
        self.newton.timings = dict.fromkeys(self.newton.timings, 0.0)

    def ramp(self, tolerance):
        self.newton.options.relative_tolerance = tolerance
        result = self.solve.run(
            MILESTONES[-1] * MPA, milestones=[load * MPA for load in MILESTONES], stability=False
        )
        return [(step.load / MPA, step.iterations, step.factorisations) for step in result.steps]

    @property
    def factorisations(self):
        return self.solve.system.factorisations

    @property
    def seconds(self):
        return self.newton.timings

    def displacements(self):
        return self.problem.nodes, self.problem.displacement()
