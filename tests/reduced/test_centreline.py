"""Rod kinematics: closed curves of known shape, the paper's Eqs 22-26 taken literally, exact sampling."""

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.reduced.rod.centreline import centreline, free_shapes


def test_bending_is_a_circle_towards_minus_z():
    radius, stretch = 40.0, 1.1
    line = centreline([60.0], RodStrains([[stretch, 0, 0]], [[0, stretch / radius, 0]]))
    angle = line.arc_length / radius
    expected = radius * np.stack([np.sin(angle), 0 * angle, np.cos(angle) - 1], axis=1)
    np.testing.assert_allclose(line.points, expected, atol=1e-11)
    np.testing.assert_allclose(
        line.tangents, np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1), atol=1e-11
    )
    assert line.length == pytest.approx(66.0)


def test_screw_has_the_radius_and_pitch_of_its_strains():
    strains = RodStrains([[1.05, -0.02, 0.0]], [[0.03, 0.04, 0.0]])
    line = centreline([300.0], strains)
    axis = strains.k[0] / np.linalg.norm(strains.k[0])
    in_plane = line.points - np.outer(line.points @ axis, axis)
    basis = np.linalg.svd(in_plane - in_plane.mean(0))[2][:2]
    x, y = basis @ in_plane.T
    solution = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1), x**2 + y**2, rcond=None)[0]
    radius = np.sqrt(solution[2] + solution[0] ** 2 + solution[1] ** 2)
    assert radius == pytest.approx(1 / strains.helix_cylinder_curvature[0], rel=1e-9)
    turns = 300.0 * np.linalg.norm(strains.k) / (2 * np.pi)
    assert (line.points[-1] @ axis) / turns == pytest.approx(strains.helix_pitch[0], rel=1e-9)


def test_joints_are_the_papers_products_of_end_rotations():
    rng = np.random.default_rng(1)
    lengths = np.array([20.0, 7.0, 35.0])
    strains = RodStrains([1, 0, 0] + 0.05 * rng.standard_normal((3, 3)), 0.03 * rng.standard_normal((3, 3)))
    # Eqs 24-26: every piece built on its own, turned by the product of the rotations before it, moved to
    # their end
    rotation, end, expected = np.eye(3), np.zeros(3), [np.zeros((1, 3))]
    for i, length in enumerate(lengths):
        s = length * np.arange(1, 5) / 4
        poses = se3.exp_pose(strains.twist_vector[i] * s[:, None])
        own = poses[:, :3, 3]
        expected.append(own @ rotation.T + end)
        rotation, end = rotation @ poses[-1, :3, :3], expected[-1][-1]
    line = centreline(lengths, strains, spacing=0.7)
    s = np.concatenate([[0.0], *(start + n * np.arange(1, 5) / 4 for start, n in zip([0, 20, 27], lengths))])
    np.testing.assert_allclose(line.at(s)[:, :3, 3], np.concatenate(expected), atol=1e-11)
    np.testing.assert_allclose(line.poses[-1, :3, :3], rotation, atol=1e-12)
    assert {0.0, 20.0, 27.0, 62.0} <= set(line.s)


def test_sampling_does_not_depend_on_the_spacing_and_moves_with_the_base():
    strains = RodStrains([[1.1, 0.02, 0], [1, 0, 0]], [[0.02, 0.03, 0], [0, 0, 0]])
    base = se3.exp_pose(np.array([0.3, -0.2, 0.5, 1.0, 2.0, 3.0]))
    s = np.linspace(0, 50, 23)
    coarse = centreline([30.0, 20.0], strains, spacing=15.0)
    fine = centreline([30.0, 20.0], strains, spacing=0.3, base_pose=base)
    np.testing.assert_allclose(fine.at(s), base @ coarse.at(s), atol=1e-10)
    assert fine.length == pytest.approx(coarse.length) == pytest.approx(30 * np.hypot(1.1, 0.02) + 20)


def test_many_designs_at_once_are_those_one_by_one():
    rng = np.random.default_rng(4)
    lengths = rng.uniform(5, 40, (7, 3))
    strains = RodStrains(
        [1, 0, 0] + 0.05 * rng.standard_normal((7, 3, 3)), 0.03 * rng.standard_normal((7, 3, 3))
    )
    base = se3.exp_pose(rng.standard_normal((7, 6)))
    s, poses = free_shapes(lengths, strains, 5, base)
    for i in range(7):
        one = centreline(lengths[i], RodStrains(strains.e[i], strains.k[i]), 1.0, base[i])
        np.testing.assert_allclose(poses[i], one.at(s[i]), atol=1e-10)
    with pytest.raises(InputError, match=r"strains: give e and k of shape \(2, 3, 3\)"):
        free_shapes(lengths[:2], strains)


def test_bad_input_names_the_argument():
    unit = RodStrains([[1.0, 0, 0]], [[0.0, 0, 0]])
    with pytest.raises(InputError, match="lengths"):
        centreline([0.0], unit)
    with pytest.raises(InputError, match="strains"):
        centreline([1.0, 2.0], unit)
    with pytest.raises(InputError, match="spacing"):
        centreline([1.0], unit, spacing=0)
    with pytest.raises(InputError, match="arc lengths on the rod"):
        centreline([1.0], unit).at([2.0])
