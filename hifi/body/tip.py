"""How the tip of an inflated manipulator yields, and how hard it pushes: passive tip stiffness and blocked
force."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from pneunet.base.errors import ConvergenceError
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry import tags
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import Manipulator
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.body.system import BodySystem
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.surface import FaceQuadrature


def compliance(system: BodySystem, tag: int, frame: np.ndarray) -> np.ndarray:
    """(6, 6) compliance of a tagged face at fixed loads, from the tangent at the present state, which it
    factorises.

    The face is loaded as hifi.fem.loads.EndLoad does, by a dead force and a dead moment about the origin of
    `frame` (4, 4), and answers with the displacement and rotation that do work on them: those of the rigid
    motion that fits the face's displacement best (least squares over its reference area). All in the axes of
    `frame`; order force, moment; mm/N, rad/N = mm/(N mm), rad/(N mm). Symmetric where the tangent is. A tip
    moment that acts already has a tangent of its own, unsymmetric, which is left out.
    """
    problem, positions = system.problem, system.problem.nodes + system.problem.displacement()
    face, spread = FaceQuadrature(problem, tag), fem.Function(problem.displacement_space)
    axes, origin = frame[:3, :3], frame[:3, 3]
    centre = face.moments(positions)[1]
    rights = []
    for unit in np.eye(6):
        force, moment = axes @ unit[:3], axes @ unit[3:]
        moment = moment + np.cross(origin - centre, force)
        spread.x.array[:] = face.forces(positions, *face.traction(positions, force, moment)).ravel()
        compat.scatter_add(spread)
        right = np.zeros(problem.owned)
        owned = problem.displacement_dofs[: problem.owned_nodes]
        right[owned] = spread.x.array.reshape(-1, 3)[: problem.owned_nodes]
        rights.append(problem.unsupported(right))
    system.factorise()
    answers = [system.solve(right) for right in rights]
    return np.array([[system.dot(right, answer) for answer in answers] for right in rights])


def stiffness(solve: ManipulatorSolve) -> dict[str, Any]:
    """run.json's `tip_stiffness`: the inverse of the tip's compliance in its section frame, of a
    ManipulatorSolve; collective."""
    frame = solve.sections.frames()[-1]
    K = np.linalg.inv(compliance(solve.system, tags.TIP, frame))
    return {
        "pressure_kPa": float(solve.pressure.value.value) * KPA_PER_MPA,
        **solve.measure().touch.marks,
        "rows": (
            "force_N, moment_N_mm; columns: displacement_mm, rotation_rad; in axes and about origin of the"
            " tip's section frame"
        ),
        "frame_origin_mm": frame[:3, 3].tolist(),
        "frame_axes": frame[:3, :3].T.tolist(),
        "matrix": K.tolist(),
    }


def blocked_force(
    manipulator: Manipulator,
    mesh_path: Path,
    pressure: float,
    loads: DeadLoads,
    comm: MPI.Comm,
    contact: WallPenalty | None = None,
    shares: Sequence[float] | None = None,
) -> dict[str, Any]:
    """run.json's `blocked_force`: what the tip, held where it is at rest, pushes with at `pressure` (MPa;
    of several groups the largest, of which `shares` are parts); collective.

    Gravity acts from the start, tip loads do not: they would go straight into what holds the tip. Force and
    moment about the tip frame's origin at rest, body axes. Where the held body cannot be inflated so far, the
    last pressure reached counts.
    """
    held = ManipulatorSolve(
        manipulator,
        mesh_path,
        comm,
        loads=DeadLoads(gravity=loads.gravity),
        hold_tip=True,
        contact=contact,
        shares=shares,
    )
    try:
        if pressure or held.dead:
            held.run(pressure)
        reached = "the pressure asked for"
    except ConvergenceError as error:
        reached = str(error)
    force, moment = held.problem.reaction(tags.TIP, [manipulator.length, 0.0, 0.0])
    measured = held.measure()
    held.destroy()
    return {
        "pressure_kPa": measured.pressure * KPA_PER_MPA,
        "reached": reached,
        **measured.touch.marks,
        "force_N": (-force).tolist(),
        "moment_N_mm": (-moment).tolist(),
        "unstable_directions": measured.unstable,
    }
