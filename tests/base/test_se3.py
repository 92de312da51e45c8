"""Rotations and rigid motions: against scipy's matrix exponential, and inverse of each other at every
angle."""

import numpy as np
import pytest
from scipy.linalg import expm

from pneunet.base import se3

AXES = [[1, 0, 0], [0, -1, 0], [0.6, -0.48, 0.64]]
#: both sides of where a series takes over, and up to half a turn
ANGLES = [0.0, 1e-12, 1e-7, 0.99e-4, 1.01e-4, 0.99e-3, 1.01e-3, 0.1, 2.0, np.pi - 1e-3, np.pi - 1e-6]


@pytest.fixture
def random():
    return np.random.default_rng(1)


def matrix(twist):
    """The 4x4 generator of a twist, written out."""
    (wx, wy, wz), v = twist[:3], twist[3:]
    rows = [[0, -wz, wy, v[0]], [wz, 0, -wx, v[1]], [-wy, wx, 0, v[2]], [0, 0, 0, 0]]
    return np.array(rows, float)


def test_exponential_is_the_matrix_exponential(random):
    twists = random.normal(size=(50, 6)) * random.uniform(0, 2, (50, 1))
    expected = np.array([expm(matrix(t)) for t in twists])
    assert se3.exp_pose(twists) == pytest.approx(expected, abs=1e-13)
    assert se3.exp_rotation(twists[:, :3]) == pytest.approx(expected[:, :3, :3], abs=1e-13)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("axis", AXES)
def test_logarithm_undoes_the_exponential(axis, angle):
    twist = np.concatenate([angle * np.array(axis), [30.0, -2.0, 5.0]])
    pose = se3.exp_pose(twist)
    assert pose == pytest.approx(expm(matrix(twist)), abs=1e-12)
    assert se3.log_rotation(pose[:3, :3]) == pytest.approx(twist[:3], abs=1e-12)
    assert se3.log_pose(pose) == pytest.approx(twist, abs=1e-10)


@pytest.mark.parametrize("axis", AXES)
def test_half_a_turn_has_a_logarithm_up_to_its_sign(axis):
    rotation = 2 * np.outer(axis, axis) - np.eye(3)
    vector = se3.log_rotation(rotation)
    assert np.linalg.norm(vector) == pytest.approx(np.pi)
    assert se3.exp_rotation(vector) == pytest.approx(rotation, abs=1e-12)


def test_leading_dimensions_are_kept(random):
    twists = random.uniform(-1, 1, size=(2, 3, 6))  # less than half a turn
    poses = se3.exp_pose(twists)
    assert poses.shape == (2, 3, 4, 4)
    assert poses[1, 2] == pytest.approx(se3.exp_pose(twists[1, 2]))
    assert se3.log_pose(poses) == pytest.approx(twists)
    assert se3.hat(twists[..., :3]) @ twists[0, 0, 3:] == pytest.approx(
        np.cross(twists[..., :3], twists[0, 0, 3:])
    )


def test_inverse_and_transform(random):
    pose = se3.make_pose(se3.exp_rotation([0.3, -1.0, 0.2]), [4.0, 5.0, 6.0])
    assert se3.inverse_pose(pose) @ pose == pytest.approx(np.eye(4), abs=1e-14)
    points = random.normal(size=(5, 3))
    homogeneous = np.column_stack([points, np.ones(5)])
    assert se3.transform(pose, points) == pytest.approx((homogeneous @ pose.T)[:, :3])
