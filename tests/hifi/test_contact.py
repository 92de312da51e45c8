"""Touching chambers in the unit cell: seen without a contact model, held apart with one. Serial by design."""

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.base.se3 import exp_rotation
from pneunet.geometry.cad.cell import mesh_cell
from pneunet.geometry.reference_cases import CASES
from pneunet.hifi.cell.file import CellCase
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.run import solve_cell
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
from pneunet.hifi.contact.medium import ThirdMedium
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.contact.walls import CellWalls
from pneunet.hifi.path.control import LoadControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")

PRESSURE, SIZE = 0.010, 4.0


@pytest.fixture(scope="module")
def tall():
    return CASES["twist_w15"](angle=60.0, chambers=1)


def run(segment, folder, contact, levels, element="tetrahedra", **case):
    """(states, pressures of first touch) up to 10 kPa."""
    states, touches = [], []
    case = CellCase(segment, PRESSURE, SIZE, levels, contact=contact, element=element, **case)
    solve_cell(case, folder / "cell.npz", states.append, on_touch=touches.append)
    return states, touches


@pytest.fixture(scope="module")
def loose(tall, tmp_path_factory):
    return run(tall, tmp_path_factory.mktemp("loose"), "none", 10)


@pytest.fixture(scope="module")
def touching(tall, tmp_path_factory):
    return run(tall, tmp_path_factory.mktemp("touching"), "auto", 2)


def test_without_contact_overlap_is_marked_from_first_touch_on(loose, tall):
    states, touches = loose
    distances, pressures = ([getattr(s, name) for s in states] for name in ("wall_distance", "pressure"))
    assert distances[0] == pytest.approx(tall.gap, abs=1e-9)
    assert (np.diff(distances) < 0).all() and distances[-1] < -0.1 * tall.gap
    assert [s.walls_overlap for s in states] == [d < 0 for d in distances]
    # the load of first touch, from the solver's own steps, against the recorded levels
    assert touches == pytest.approx([np.interp(0.0, distances[::-1], pressures[::-1])], abs=1e-4)


def test_contact_changes_nothing_before_first_touch_and_keeps_walls_apart_beyond(loose, touching, tall):
    states, touches = touching
    assert touches == pytest.approx(loose[1], rel=0.05)
    open_, last = states[1:]
    assert open_.pressure < touches[0] < last.pressure
    assert open_.contact.force == 0.0
    assert open_.strains.k[0] == pytest.approx(loose[0][5].strains.k[0], rel=1e-6)
    assert not last.walls_overlap and abs(last.wall_distance) < 0.02 * tall.gap
    # walls that push at each other turn the chambers further
    assert (
        last.contact.force > 0
        and -0.02 * tall.gap < last.contact.nearest <= last.contact.farthest < 0.02 * tall.gap
    )
    assert last.strains.k[0] > 1.01 * loose[0][-1].strains.k[0]


def test_contact_is_complete_in_the_rod_s_forces_and_stiffness(touching):
    last = touching[0][-1]
    assert np.concatenate([last.force, last.moment]) == pytest.approx(np.zeros(6), abs=1e-6)
    assert abs(last.stiffness - last.stiffness.T).max() < 1e-8 * abs(last.stiffness).max()
    assert last.unstable == 0


def follow(system, target, first):
    run_steps(
        EquilibriumPath(system, LoadControl(), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE)),
        target,
        StepSize(first, 1e-5),
    )


def test_in_contact_stiffness_is_the_slope_of_forces_at_prescribed_strains(tall, tmp_path):
    mesh_cell(tall, SIZE, tmp_path / "cell.npz")
    problem = CellProblem(tall, tmp_path / "cell.npz", contact=WallPenalty())
    free = CellSystem(problem)
    follow(free, PRESSURE, 0.004)
    state, rest = free.measure(), free.state.copy()
    direction, h, ends = np.array([0.01, -0.005, 0.004, 0.001, 0.0008, -0.0006]), 2e-3, []
    for sign in (1, -1):
        held = CellSystem(problem, np.ones(6, bool), (PRESSURE, 0.0), (rest[-6:], sign * h * direction))
        held.state = rest.copy()
        follow(held, 1.0, 1.0)
        moved = held.measure()
        ends.append(np.concatenate([moved.force, moved.moment]))
        held.destroy()
    free.destroy()
    assert state.contact.force > 0.01
    product = state.stiffness @ direction
    assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(
        product, rel=1e-4, abs=1e-4 * np.linalg.norm(product)
    )


def test_a_prescribed_twist_in_contact(touching, tall, tmp_path):
    """What it takes to twist further is what the free state's compliance says."""
    free, change = touching[0][-1], 2e-4
    states, _ = run(tall, tmp_path, "auto", 1, held={3: free.strains.k[0] + change})
    forces = np.concatenate([states[-1].force, states[-1].moment])
    assert np.delete(forces, 3) == pytest.approx(np.zeros(5), abs=1e-6)
    assert forces[3] == pytest.approx(change / np.linalg.inv(free.stiffness)[3, 3], rel=0.1)


def test_volume_control_goes_through_contact(touching, tall, tmp_path):
    """Led by the volume the path comes by the states that the pressure leads to."""
    first, last = touching[0][0], touching[0][-1]
    states, touches = run(
        tall, tmp_path, "auto", 1, control="volume", volume_factor=last.volume / first.volume
    )
    assert touches == pytest.approx(touching[1], rel=0.05)
    assert states[-1].pressure == pytest.approx(last.pressure, rel=1e-6)
    assert states[-1].contact.force == pytest.approx(last.contact.force, rel=1e-5)


def test_the_third_medium_finds_the_same_contact(tall, tmp_path):
    """In the quarter of the cell that symmetry leaves."""
    here, there = (run(tall, tmp_path, c, 1, "hexahedra")[0][-1] for c in ("third-medium", "auto"))
    assert here.contact.gamma == pytest.approx(ThirdMedium().gamma[1]) and not here.walls_overlap
    assert here.strains.k[0] == pytest.approx(there.strains.k[0], rel=1e-3)
    assert here.contact.force == pytest.approx(there.contact.force, rel=0.02)


def test_both_walls_of_a_gap_are_whole_and_a_gap_apart(tall, tmp_path):
    mesh_cell(tall, SIZE, tmp_path / "cell.npz", cut=1.3, gaps=True)
    walls = CellWalls(CellProblem(tall, tmp_path / "cell.npz"))
    area = tall.width / tall.sin * (tall.chamber_top - tall.core_top)
    for gap in walls.gaps:
        for wall in gap:
            x = walls.positions(wall)[:, :3]
            assert np.linalg.norm(
                np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1
            ).sum() / 2 == pytest.approx(area)
    assert walls.distance() == pytest.approx(tall.gap, abs=1e-9)


def test_a_straight_medium_seen_from_a_twisting_frame_is_at_rest(tall, tmp_path):
    """The gradient of F along X1 contains the screw's rotation: without it a body at rest would push."""
    mesh_cell(tall, SIZE, tmp_path / "cell.npz", gaps=True)
    problem = CellProblem(tall, tmp_path / "cell.npz", medium=ThirdMedium())
    twist, X = 0.05, problem.nodes
    problem.strains.value[:] = [1, 0, 0, twist, 0, 0]
    twisted = np.abs(problem.medium_forces()).max()
    back = exp_rotation(-twist * X[:, :1] * [1.0, 0.0, 0.0])
    problem.state.x.array[problem.displacement_dofs] = np.einsum("nij,nj->ni", back, X * [0, 1, 1]) - X * [
        0,
        1,
        1,
    ]
    # what quadratic elements miss of the rotation
    assert np.abs(problem.medium_forces()).max() < 0.02 * twisted
