"""checkpoint.npz: the memory of an equilibrium path on disk, for a run that goes on after a kill on any
number of ranks.

It holds the accepted states that the predictor extrapolates and the state at which the lagged tangent was
factorised, so that the run which goes on iterates as the killed one would have. Values are stored with the
undeformed coordinates of their nodes, sorted by them: each rank finds its own.
"""

import json
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from pneunet.base.errors import InputError
from pneunet.base.files.archive import Member, read_archive, write_archive
from pneunet.hifi.body.manipulator import ManipulatorSolve, Measured
from pneunet.hifi.fem.agreement import gathered, on_rank_0
from pneunet.hifi.path.equilibrium import EquilibriumPath, LimitPoint, PathState
from pneunet.hifi.path.stepping import Step

CHECKPOINT = "checkpoint.npz"
#: mm; nodes of another mesh are further apart than this, and one that is moved by the rounding of its file is
#: not
NEAR = 1e-6
SCHEMA = "pneunet-checkpoint-1"
KEYS = {"belongs_to": dict, "stage": str}
#: bytes of a checkpoint of the largest mesh
LARGEST = 16_000_000_000
#: what the file holds: a accepted states, s with the one that was factorised, the nodes of both fields
MEMBERS = {
    "step": Member("f", (len(fields(Step)),), gaps=True),
    "parameter": Member("f", ("a",)),
    "load": Member("f", ("s",)),
    "volume": Member("f", ("a",)),
    "trusted": Member("f", gaps=True),
    "first_compliance": Member("f", gaps=True),
    "limit_points": Member("f", ("limit points", 3)),
    "timings": Member("f", ("timings",)),
    "displacement_mm_nodes": Member("f", ("nodes", 3)),
    "displacement_mm": Member("f", ("s", "nodes", 3)),
    "multiplier_MPa_nodes": Member("f", ("multiplier nodes", 3)),
    "multiplier_MPa": Member("f", ("s", "multiplier nodes")),
}


class Checkpoint:
    """Writes where the path of a solve is after every accepted step, once what it refers to is on disk.

    identity: {name: JSON value} of what the run is of; `read_checkpoint` compares it.
    """

    def __init__(self, directory: Path, solve: ManipulatorSolve, identity: dict[str, Any]) -> None:
        self.directory, self.solve, self.identity = directory, solve, identity

    def accepted(self, m: Measured) -> None:
        if not m.step:
            return
        solve, path, problem, newton = self.solve, self.solve.path, self.solve.problem, self.solve.path.newton
        factorised = [newton.factorised_at] if newton.current else []
        states = [a.state for a in path.accepted] + [state for state, _ in factorised]
        content = {
            "step": np.array(astuple(solve.last_step), float),
            "parameter": np.array([a.parameter for a in path.accepted]),
            "load": np.array([a.load for a in path.accepted] + [load for _, load in factorised]),
            "volume": np.array([a.volume for a in path.accepted]),
            "trusted": np.array(path.trusted),
            "first_compliance": np.array(path.first_compliance),
            "limit_points": np.array(
                [[p.load, p.volume, p.kind == "maximum"] for p in path.limit_points]
            ).reshape(-1, 3),
            "timings": np.array(list(newton.timings.values())),
        }
        for name, dofs, nodes, owned in _fields(problem):
            X = gathered(problem.mesh.comm, nodes[:owned])
            values = [gathered(problem.mesh.comm, state[dofs[:owned]]) for state in states]
            if problem.mesh.comm.rank == 0:
                order = np.lexsort(np.round(X, 6).T)
                content |= {f"{name}_nodes": X[order], name: np.array(values)[:, order]}

        about, path = {"belongs_to": self.identity, "stage": solve.stage}, self.directory / CHECKPOINT
        on_rank_0(problem.mesh.comm, lambda: write_archive(path, SCHEMA, about, content))


def read_checkpoint(directory: Path, identity: dict[str, Any]) -> dict[str, Any] | None:
    """{name: array} of the checkpoint in `directory` and its "stage", None without one; InputError when it is
    of something else than `identity`."""
    path = directory / CHECKPOINT
    if not path.exists():
        return None
    about, content = read_archive(
        path, SCHEMA, "a checkpoint", "solve without --resume", KEYS, lambda *_: MEMBERS, LARGEST
    )
    theirs, ours = about["belongs_to"], json.loads(json.dumps(identity, default=float))
    size = theirs.get("mesh_size_mm")
    if size != ours["mesh_size_mm"]:
        raise InputError(f"{path}: mesh_size_mm is {size} there: add --mesh-size-mm {size}")
    for name, value in ours.items():
        if theirs.get(name) != value:
            raise InputError(f"{path}: belongs to another {name} than the design's: solve without --resume")
    accepted, states = len(content["parameter"]), len(content["load"])
    # only the size of the next step may be infinite
    if not 1 <= accepted <= states <= accepted + 1 or not np.isfinite(content["step"][:-1]).all():
        raise InputError(f"{path}: members 'step', 'load' hold no accepted step: solve without --resume")
    return content | {"stage": about["stage"]}


def restore(content: dict[str, np.ndarray], path: EquilibriumPath) -> Step:
    """Put the EquilibriumPath where the checkpoint was written; its Step. Collective; InputError when the
    mesh is another."""
    problem = path.system.problem
    states = np.zeros((len(content["load"]), len(problem.array)))
    furthest, sizes = 0.0, True
    for name, dofs, nodes, owned in _fields(problem):
        distance, index = cKDTree(content[f"{name}_nodes"]).query(nodes)
        furthest = max(furthest, distance.max(initial=0.0))
        sizes &= problem.mesh.comm.allreduce(owned, op=MPI.SUM) == len(content[f"{name}_nodes"])
        states[:, dofs] = content[name][:, index]
    furthest = problem.mesh.comm.allreduce(furthest, op=MPI.MAX)
    if furthest > NEAR or not sizes:
        raise InputError(
            f"{CHECKPOINT}: belongs to another mesh (a node is {furthest:.1e} mm away): solve without"
            " --resume"
        )
    loads, parameters = content["load"].tolist(), content["parameter"].tolist()
    accepted = [PathState(*each) for each in zip(parameters, loads, states, content["volume"].tolist())]
    factorised_at = (states[-1], loads[-1]) if len(states) > len(accepted) else None
    path.resume(accepted, float(content["trusted"]), factorised_at)
    path.first_compliance = float(content["first_compliance"])
    path.limit_points = [
        LimitPoint(p, v, "maximum" if top else "minimum") for p, v, top in content["limit_points"].tolist()
    ]
    path.newton.timings = dict(zip(path.newton.timings, content["timings"].tolist()))
    number, load, iterations, factorisations, *rest = content["step"].tolist()
    return Step(int(number), load, int(iterations), int(factorisations), *rest)


def _fields(problem):
    """(name, index into the state array, coordinates in mm, number of owned nodes) of both fields, ghosts
    included."""
    space, dofs = problem.pressure_space, problem.pressure_dofs
    return (
        ("displacement_mm", problem.displacement_dofs, problem.nodes, problem.owned_nodes),
        (
            "multiplier_MPa",
            dofs,
            space.tabulate_dof_coordinates()[: len(dofs)],
            space.dofmap.index_map.size_local,
        ),
    )
