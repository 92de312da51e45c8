"""Extrapolation and retraction in section frames."""

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.base import se3
from pneunet.hifi.path.rod_coordinates import RodCoordinates
from pneunet.hifi.path.stepping import lagrange_coefficients


def largest(values):
    """Largest absolute entry over all ranks."""
    return MPI.COMM_WORLD.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX)


@pytest.fixture
def beam():
    """Nodes of a 60 x 8 x 6 mm block, split over the ranks by x, and its rod coordinates."""
    comm = MPI.COMM_WORLD
    axes = np.linspace(0, 60, 61), np.linspace(-4, 4, 5), np.linspace(-3, 3, 4)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    nodes = np.array_split(grid.reshape(-1, 3), comm.size)[comm.rank]
    return nodes, RodCoordinates(nodes, len(nodes), comm, spacing=6.0)


def screw(nodes, k, e):
    """Positions of a straight rod bent to uniform strains."""
    twist = np.concatenate([k, e])
    poses = se3.exp_pose(nodes[:, :1] * twist)
    section = np.column_stack([np.zeros(len(nodes)), nodes[:, 1:]])
    return np.einsum("nij,nj->ni", poses[:, :3, :3], section) + poses[:, :3, 3]


def bent(nodes, t):
    return screw(nodes, t * np.array([0.02, 0.05, -0.01]), np.array([1 + 0.1 * t, 0.0, 0.02 * t]))


def test_retraction_is_first_order_consistent(beam):
    nodes, rod = beam
    x = bent(nodes, 1.0)
    d = np.cos(0.1 * nodes[:, ::-1]) + 0.05 * np.cross([0.3, -1.0, 2.0], x)
    errors = [largest(rod.retract(x, h * d) - x - h * d) / h for h in (1e-3, 5e-4)]
    size = largest(d)
    assert errors[0] < 5e-3 * size
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.05)


def test_retraction_integrates_a_curling_increment(beam):
    """The linearised velocity of growing curvature, stepped far, must curl the beam instead of stretching
    it."""
    nodes, rod = beam
    h = 1e-6
    curl = np.array([0.0, 0.04, 0.0])
    e1 = np.array([1.0, 0.0, 0.0])
    velocity = (screw(nodes, h * curl, e1) - screw(nodes, -h * curl, e1)) / (2 * h)
    exact = screw(nodes, curl, e1)
    plain, retracted = largest(nodes + velocity - exact), largest(rod.retract(nodes, velocity) - exact)
    assert plain > 20.0  # 2.4 rad of curl
    assert retracted < 0.3


def test_extrapolation_follows_strains_that_grow_linearly(beam):
    nodes, rod = beam
    known = [0.2, 0.5, 0.7]
    for wanted in (0.5, 1.3):
        weights = lagrange_coefficients(known, wanted)
        predicted = rod.extrapolate([bent(nodes, t) for t in known], weights)
        error = largest(predicted - bent(nodes, wanted))
        assert error < (1e-9 if wanted in known else 0.15)  # hat functions blend what is curved within 6 mm


def test_one_station_removes_a_rigid_motion():
    rng = np.random.default_rng(1)
    nodes = np.random.default_rng(0).normal(size=(40, 3))
    rod = RodCoordinates(nodes, 40, MPI.COMM_SELF)
    motion = se3.exp_pose(rng.normal(size=6))
    assert rod.motions(se3.transform(motion, nodes)) == pytest.approx(motion[None], abs=1e-12)
    assert rod.sections(se3.transform(motion, nodes)) == pytest.approx(
        np.broadcast_to(motion, (40, 4, 4)), abs=1e-12
    )
