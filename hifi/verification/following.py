"""Bodies of one material under loads with a common value, followed to given loads; what was computed beside
what is exact."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from pneunet.base.materials.laws import NeoHookean
from pneunet.hifi.body.problem import BodyProblem, Support
from pneunet.hifi.body.system import BodySystem
from pneunet.hifi.fem.loads import AppliedLoad
from pneunet.hifi.fem.materials import Material
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import Newton, NewtonOptions, NewtonResult
from pneunet.hifi.path.rod_coordinates import RodCoordinates
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.path.system import PathControl
from pneunet.hifi.verification.bodies import TaggedMesh


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
    def relative_error(self) -> float:
        return abs(self.computed / self.reference - 1)


def body_system(
    mesh: TaggedMesh,
    supports: list[Support],
    loads: list[AppliedLoad],
    material: Material | None = None,
    spacing: float | None = None,
) -> BodySystem:
    """BodySystem (neo-Hookean with mu = 1 MPa by default) whose load is the common value of all `loads`."""
    problem = BodyProblem(*mesh, material or NeoHookean(1.0), supports, loads)

    def apply(value):
        for load in loads:
            load.value.value = value

    return BodySystem(
        problem, RodCoordinates(problem.nodes, problem.owned_nodes, problem.mesh.comm, spacing), apply
    )


def follow(
    system: BodySystem,
    loads: Sequence[float],
    observe: Callable[[], Any],
    first: float = 0.1,
    control: PathControl | None = None,
    start: float = 0.0,
    options: NewtonOptions | None = None,
) -> list:
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


def solve_from(
    system: BodySystem,
    load: float,
    displacement: Callable[[np.ndarray], np.ndarray],
    pressure: Callable[[np.ndarray], np.ndarray],
) -> NewtonResult:
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


def from_all_ranks(
    problem: BodyProblem, chosen: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """(positions before, displacements) of the nodes where chosen(X (n, 3)) -> (n,) bool, each once."""
    owned = slice(problem.owned_nodes)
    X, u = problem.nodes[owned], problem.displacement()[owned]
    rows = problem.mesh.comm.allgather((X[chosen(X)], u[chosen(X)]))
    return tuple(np.concatenate(part) for part in zip(*rows))


def displacement_at(problem: BodyProblem, point: Sequence[float]) -> np.ndarray:
    """(3,) displacement in mm of the node at `point`."""
    X, u = from_all_ranks(problem, lambda X: np.linalg.norm(X - point, axis=1) < 1e-9)
    assert len(X) == 1, f"no node at {point}"
    return u[0]


def largest(problem: BodyProblem, values: np.ndarray) -> float:
    """Largest absolute value over all ranks."""
    return problem.mesh.comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX)
