"""Bodies of one material under loads with a common value, followed to given loads; what was computed beside
what is exact."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from pneunet.base.materials.laws import NeoHookean
from pneunet.hifi.body.problem import BodyProblem
from pneunet.hifi.body.system import BodySystem
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import Newton
from pneunet.hifi.path.rod_coordinates import RodCoordinates
from pneunet.hifi.path.stepping import StepSize, run_steps


@dataclass(frozen=True)
class ExactComparison:
    """One number computed and exact; case and quantity in words, mesh by its resolution."""

    case: str
    quantity: str
    mesh: str
    dofs: int
    reference: float
    computed: float

    @property
    def relative_error(self):
        return abs(self.computed / self.reference - 1)


def body_system(mesh, supports, loads, material=None, spacing=None):
    """BodySystem (neo-Hookean with mu = 1 MPa by default) whose load is the common value of all `loads`."""
    problem = BodyProblem(*mesh, material or NeoHookean(1.0), supports, loads)

    def apply(value):
        for load in loads:
            load.value.value = value

    return BodySystem(
        problem, RodCoordinates(problem.nodes, problem.owned_nodes, problem.mesh.comm, spacing), apply
    )


def follow(system, loads, observe, first=0.1, control=None, start=0.0, options=None):
    """[observe()] at each of the growing `loads`, or values of another control's parameter from `start`
    on."""
    seen = {}
    path = EquilibriumPath(system, control or LoadControl(), options, start)
    run_steps(
        path,
        loads[-1],
        StepSize(first, 1e-4, milestones=tuple(loads)),
        lambda step: seen.update({step.load: observe()}),
    )
    return [seen[load] for load in loads]


def solve_from(system, load, displacement, pressure):
    """Newton at `load` from the fields displacement(X (n, 3)) -> (n, 3) and pressure(X) -> (n,),
    interpolated."""
    problem = system.problem
    state = problem.array.copy()
    state[problem.displacement_dofs] = displacement(problem.nodes)
    state[problem.pressure_dofs] = pressure(
        problem.pressure_space.tabulate_dof_coordinates()[: len(problem.pressure_dofs)]
    )
    system.load = load
    system.state = system.at_supports(state)
    return Newton(system, LoadControl()).solve(load)


def from_all_ranks(problem, chosen):
    """(positions before, displacements) of the nodes where chosen(X (n, 3)) -> (n,) bool, each once."""
    owned = slice(problem.owned_nodes)
    X, u = problem.nodes[owned], problem.displacement()[owned]
    rows = problem.mesh.comm.allgather((X[chosen(X)], u[chosen(X)]))
    return tuple(np.concatenate(part) for part in zip(*rows))


def displacement_at(problem, point):
    """(3,) displacement in mm of the node at `point`."""
    X, u = from_all_ranks(problem, lambda X: np.linalg.norm(X - point, axis=1) < 1e-9)
    assert len(X) == 1, f"no node at {point}"
    return u[0]


def largest(problem, values):
    """Largest absolute value over all ranks."""
    return problem.mesh.comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX)
