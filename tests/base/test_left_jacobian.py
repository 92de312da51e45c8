"""The differential of the exponential on SE(3) and its own derivative, against differences of exp_pose."""

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.left_jacobian import LeftJacobian, adjoint, commutator, wrench_commutator

RNG = np.random.default_rng(3)


def twist_of(matrix):
    return np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0], *matrix[:3, 3]])


@pytest.mark.parametrize("turn", [0.0, 1e-7, 0.1, 1.5, 3.9])
def test_left_jacobian_and_its_slope_by_differences(turn):
    twist, wrench, step = RNG.standard_normal(6), RNG.standard_normal(6), 1e-6
    twist[:3] *= turn / np.linalg.norm(twist[:3])
    J, slope = LeftJacobian(twist[None]), np.empty((6, 6))
    np.testing.assert_allclose(J.pose[0], se3.exp_pose(twist), atol=1e-12)
    for i, d in enumerate(step * np.eye(6)):
        moved = (
            (se3.exp_pose(twist + d) - se3.exp_pose(twist - d))
            / (2 * step)
            @ se3.inverse_pose(se3.exp_pose(twist))
        )
        np.testing.assert_allclose(J.matrix[0, :, i], twist_of(moved), atol=2e-9)
        ahead, behind = (LeftJacobian((twist + s * d)[None]).matrix[0].T @ wrench for s in (1, -1))
        slope[:, i] = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(J.slope(wrench[None])[0], slope, atol=2e-8)


def test_commutator_and_adjoint_are_those_of_the_matrices():
    x, y, w = RNG.standard_normal((3, 1, 6))
    X, Y = se3.hat_pose(x[0]), se3.hat_pose(y[0])
    np.testing.assert_allclose(commutator(x)[0] @ y[0], twist_of(X @ Y - Y @ X), atol=1e-14)
    np.testing.assert_allclose(commutator(x)[0].T @ w[0], wrench_commutator(w)[0] @ x[0], atol=1e-14)
    pose = se3.exp_pose(x[0])
    np.testing.assert_allclose(
        adjoint(pose[None])[0] @ y[0], twist_of(pose @ Y @ se3.inverse_pose(pose)), atol=1e-14
    )
