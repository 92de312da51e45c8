"""Touching chambers in the unit cell: seen without a contact model, held apart with one. Serial by design."""

import numpy as np
import pytest
from mpi4py import MPI

from base.se3 import exp_rotation
from geometry.cell import mesh_cell
from hifi.cell import CellProblem
from hifi.cell_run import solve_cell
from hifi.cellfile import CellCase
from hifi.contact import ThirdMedium
from hifi.walls import CellWalls
from tests.cases import CASES

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")


@pytest.fixture
def tall():
    return CASES["twist_w15"](angle=60.0, chambers=1)


def run(segment, path, contact, levels, pressure=0.010):
    states, touches = [], []
    solve_cell(CellCase(segment, pressure, 3.0, levels, contact=contact), path, states.append, on_touch=touches.append)
    return states, touches


def test_without_contact_overlap_is_marked_from_first_touch_on(tall, tmp_path):
    states, touches = run(tall, tmp_path / "cell.msh", "none", 10)
    distances, pressures = ([getattr(s, name) for s in states] for name in ("wall_distance", "pressure"))
    assert distances[0] == pytest.approx(tall.gap, abs=1e-9)
    assert (np.diff(distances) < 0).all() and distances[-1] < 0
    assert [s.walls_overlap for s in states] == [d < 0 for d in distances]
    # the load of first touch, from the solver's own steps, against the recorded levels
    assert touches == pytest.approx([np.interp(0.0, distances[::-1], pressures[::-1])], abs=1e-4)


def test_contact_comes_on_at_first_touch_and_keeps_walls_apart(tall, tmp_path):
    loose, _ = run(tall, tmp_path / "loose.msh", "none", 2)
    states, touches = run(tall, tmp_path / "cell.msh", "auto", 2)
    assert [s.contact is None for s in states] == [True, True, False]
    assert states[1].pressure < touches[0] < states[2].pressure
    last = states[-1]
    assert not last.walls_overlap and abs(last.wall_distance) < 0.02 * tall.gap
    assert loose[-1].wall_distance < -0.1 * tall.gap
    # walls that push at each other turn the chambers further
    assert last.contact.force > 0
    assert last.strains.k[0] > 1.01 * loose[-1].strains.k[0]
    # the medium's part in the rod's forces and stiffness is complete
    assert np.concatenate([last.force, last.moment]) == pytest.approx(np.zeros(6), abs=1e-6)
    assert abs(last.stiffness - last.stiffness.T).max() < 1e-8 * abs(last.stiffness).max()
    assert last.unstable == 0


def test_both_walls_of_a_gap_are_whole_and_a_gap_apart(tall, tmp_path):
    mesh_cell(tall, 3.0, tmp_path / "cell.msh", cut=1.3, gaps=True)
    walls = CellWalls(CellProblem(tall, tmp_path / "cell.msh"))
    area = tall.width / tall.sin * (tall.chamber_top - tall.core_top)
    for gap in walls.gaps:
        for wall in gap:
            x = walls.positions(wall)[:, :3]
            assert np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum() / 2 == pytest.approx(area)
    assert walls.distance() == pytest.approx(tall.gap, abs=1e-9)


def test_a_straight_medium_seen_from_a_twisting_frame_is_at_rest(tall, tmp_path):
    """The gradient of F along X1 contains the screw's rotation: without it a body at rest would push."""
    mesh_cell(tall, 3.0, tmp_path / "cell.msh", gaps=True)
    problem = CellProblem(tall, tmp_path / "cell.msh", medium=ThirdMedium())
    twist, X = 0.05, problem.nodes
    problem.strains.value[:] = [1, 0, 0, twist, 0, 0]
    twisted = np.abs(problem.contact_forces()).max()
    back = exp_rotation(-twist * X[:, :1] * [1.0, 0.0, 0.0])
    problem.state.x.array[problem.displacement_dofs] = np.einsum("nij,nj->ni", back, X * [0, 1, 1]) - X * [0, 1, 1]
    assert np.abs(problem.contact_forces()).max() < 0.02 * twisted  # what quadratic elements miss of the rotation
