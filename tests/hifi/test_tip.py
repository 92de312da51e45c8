"""Passive tip stiffness against differences under real tip loads and against beams; blocked force against
plain statics."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.base import se3
from pneunet.geometry import Manipulator, Segment, tags
from pneunet.geometry.cad.mesh import mesh_manipulator
from pneunet.geometry.loading import DeadLoads
from pneunet.hifi.body import tip
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.body.problem import Support
from pneunet.hifi.fem.surface import FaceQuadrature
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.verification import bodies
from pneunet.hifi.verification.following import body_system

LENGTH, WIDTH, HEIGHT = STRIP = 30.0, 3.0, 2.0


def test_a_straight_strip_is_a_beam():
    """Compliances L/EA, L^3/3EI, L^2/2EI, L/EI with E = 3 mu = 3 MPa, and the torsion of a rectangle
    (Timoshenko)."""
    mesh = bodies.strip(STRIP, (30, 3, 2))
    system = body_system(mesh, [Support(bodies.PLANE_X)], [])
    C = tip.compliance(system, bodies.END, se3.make_pose(np.eye(3), [LENGTH, 0.0, 0.0]))
    system.destroy()
    assert abs(C - C.T).max() < 1e-9 * abs(C).max()
    E, Iy, Iz = 3.0, WIDTH * HEIGHT**3 / 12, HEIGHT * WIDTH**3 / 12
    torsion = WIDTH * HEIGHT**3 * (1 / 3 - 0.21 * HEIGHT / WIDTH * (1 - (HEIGHT / WIDTH) ** 4 / 12))
    beam = [LENGTH / (E * WIDTH * HEIGHT), LENGTH**3 / (3 * E * Iz), LENGTH**3 / (3 * E * Iy)]
    beam += [LENGTH / torsion, LENGTH / (E * Iy), LENGTH / (E * Iz)]
    assert np.diag(C) == pytest.approx(beam, rel=0.04)
    # a force along z turns the tip by minus what a moment about y moves it along -z
    assert C[4, 2] == pytest.approx(-(LENGTH**2) / (2 * E * Iy), rel=0.04) and C[5, 1] == pytest.approx(
        LENGTH**2 / (2 * E * Iz), rel=0.04
    )


@pytest.fixture
def finger(shared_directory):
    """(Manipulator, mesh file) of a small soft body."""
    manipulator = Manipulator((Segment("one-sided", 60.0, 2),))
    if MPI.COMM_WORLD.rank == 0:
        mesh_manipulator(manipulator, 3.5, shared_directory, "tetrahedra")
    MPI.COMM_WORLD.barrier()
    return manipulator, shared_directory / "manipulator.npz"


def test_stiffness_of_an_inflated_body_is_the_slope_under_real_tip_loads(finger):
    """Small dead tip loads, force and moment, on top of the pressure, forth and back."""
    options, small = NewtonOptions(relative_tolerance=1e-11), np.array([2e-3, -1e-3, 1e-3, 4e-3, 5e-3, -3e-3])
    solve = ManipulatorSolve(*finger, newton_options=options)
    solve.run(0.02)
    frame = solve.sections.frames()[-1]
    K = np.array(tip.stiffness(solve)["matrix"])
    solve.destroy()
    face = []
    for sign in (1, -1):
        loads = DeadLoads(
            tip_force=tuple(sign * frame[:3, :3] @ small[:3]),
            tip_moment=tuple(sign * frame[:3, :3] @ small[3:]),
        )
        loaded = ManipulatorSolve(*finger, newton_options=options, loads=loads)
        loaded.run(0.02)
        problem = loaded.problem
        face.append(
            (
                loaded.sections.frames()[-1],
                FaceQuadrature(problem, tags.TIP).moments(problem.nodes + problem.displacement())[1],
            )
        )
        loaded.destroy()
    ahead, behind = (pose for pose, _ in face)
    turn = se3.log_rotation(ahead[:3, :3] @ behind[:3, :3].T)
    moved = np.concatenate([ahead[:3, 3] - behind[:3, 3], turn]).reshape(2, 3) / 2 @ frame[:3, :3]
    # the loads acted at the face's centre, the stiffness is about the frame's origin
    arm = (sum(centre for _, centre in face) / 2 - frame[:3, 3]) @ frame[:3, :3]
    acting = np.concatenate([small[:3], small[3:] + np.cross(arm, small[:3])])
    wanted = np.linalg.solve(K, acting).reshape(2, 3)
    for found, expected in zip(moved, wanted):  # displacement, rotation
        assert found == pytest.approx(expected, rel=1e-3, abs=1e-3 * abs(expected).max())


def test_a_held_tip_is_pushed_by_pressure_and_gravity(finger):
    """Base and tip together carry the weight and nothing else, since a closed cavity pushes itself
    nowhere."""
    manipulator, path = finger
    gravity = (0.0, 3000.0, -9810.0)
    held = ManipulatorSolve(manipulator, path, loads=DeadLoads(gravity=gravity), hold_tip=True)
    held.run(0.005)
    assert held.sections.frames()[-1] == pytest.approx(
        se3.make_pose(np.eye(3), [manipulator.length, 0, 0]), abs=1e-9
    )
    at_base, at_tip = (held.problem.reaction(tag)[0] for tag in (tags.BASE, tags.TIP))
    held.destroy()
    volume = json.loads((path.parent / "mesh.json").read_text())["body_mm3"]
    assert -(at_base + at_tip) == pytest.approx(1.07e-9 * volume * np.array(gravity), rel=1e-5, abs=1e-7)
    # which would go straight into what holds the tip
    loads = DeadLoads(gravity=gravity, tip_force=(1.0, 0.0, 0.0))
    result = tip.blocked_force(manipulator, path, 0.005, loads, MPI.COMM_WORLD)
    assert result["force_N"] == pytest.approx(-at_tip, rel=1e-6) and result["force_N"][0] > 0.01  # it pushes
    assert result["pressure_kPa"] == pytest.approx(5.0) and result["unstable_directions"] == 0
