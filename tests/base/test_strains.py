"""Rod strains: every derived number against a helix sampled from its frames and differentiated as a curve."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from pneunet.base import se3
from pneunet.base.strains import RodStrains, helix_frenet

SCREWS = [
    ([1.0, 0.0, 0.0], [0.02, 0.03, 0.0]),
    ([1.15, 0.04, -0.02], [0.025, 0.03, -0.01]),
    ([0.95, -0.1, 0.0], [-0.03, 0.01, 0.02]),
]
screw = pytest.mark.parametrize(("e", "k"), SCREWS)


def positions(strains, s):
    """Points (n, 3) of the line at undeformed arc lengths s (n,)."""
    return se3.exp_pose(np.multiply.outer(s, strains.twist_vector))[:, :3, 3]


def differentiated(e, k):
    """(stretch, Frenet curvature, Frenet torsion) in the middle of 60 mm of the sampled line."""
    s = np.linspace(0, 60, 121)
    curve = [Chebyshev.fit(s, column, 20) for column in positions(RodStrains(e, k), s).T]
    first, second, third = (np.array([c.deriv(d)(30.0) for c in curve]) for d in (1, 2, 3))
    binormal = np.cross(first, second)
    speed = np.linalg.norm(first)
    return speed, np.linalg.norm(binormal) / speed**3, binormal @ third / (binormal @ binormal)


@screw
def test_stretch_curvature_and_torsion_are_those_of_the_curve(e, k):
    strains = RodStrains(e, k)
    speed, curvature, torsion = differentiated(e, k)
    assert strains.stretch == pytest.approx(speed, rel=1e-8)
    assert strains.frenet_curvature == pytest.approx(curvature, rel=1e-7)
    assert strains.frenet_torsion == pytest.approx(torsion, rel=1e-6)


@screw
def test_cylinder_and_pitch_are_those_of_the_helix(e, k):
    strains = RodStrains(e, k)
    turn = 2 * np.pi / np.linalg.norm(k)
    points = positions(strains, np.linspace(0, turn, 41))
    axis = np.array(k) / np.linalg.norm(k)
    centre = points[:-1].mean(axis=0)
    out = points - centre
    radius = np.linalg.norm(out - np.outer(out @ axis, axis), axis=1)
    assert radius == pytest.approx(1 / strains.helix_cylinder_curvature, rel=1e-9)
    # along the axis, right-handed positive, whichever way k points
    advance = (points[-1] - points[0]) @ axis
    assert strains.helix_pitch == pytest.approx(advance, rel=1e-9)


@screw
def test_helix_frenet_is_the_way_back(e, k):
    strains = RodStrains(e, k)
    curvature, torsion = helix_frenet(strains.helix_cylinder_curvature, strains.helix_pitch)
    assert (curvature, torsion) == pytest.approx((strains.frenet_curvature, strains.frenet_torsion))


def test_the_octopus_helix():
    """Cylinder curvature 70 1/m and pitch 90 mm: Frenet 34.9 1/m and 35.0 1/m (targets' numbers)."""
    assert helix_frenet(0.070, 90.0) == pytest.approx((0.0349, 0.0350), abs=5e-5)


def test_twist_is_per_deformed_length():
    assert RodStrains([1.25, 0, 0], [0.03, 0, 0]).twist_per_deformed_length == pytest.approx(0.024)


def test_straight_and_plane_lines_have_no_helix():
    straight, arc = RodStrains.unstrained(), RodStrains([1, 0, 0], [0, 0.02, 0])
    assert (straight.stretch, straight.frenet_curvature, straight.helix_cylinder_curvature) == (1.0, 0.0, 0.0)
    assert straight.helix_pitch == np.inf
    assert (arc.helix_pitch, arc.frenet_torsion) == (0.0, 0.0)
    assert arc.helix_cylinder_curvature == pytest.approx(0.02)


def test_six_numbers_and_mirror_images():
    e, k = (np.array(column) for column in zip(*SCREWS))
    strains = RodStrains.of_vector(np.hstack([e, k]))
    assert (strains.e == e).all() and (strains.k == k).all() and strains.vector.shape == (3, 6)
    flip = np.diag([1.0, -1.0, 1.0, 1.0])
    image = flip @ se3.exp_pose(strains.twist_vector) @ flip
    assert image == pytest.approx(se3.exp_pose(strains.mirrored.twist_vector), abs=1e-14)


def test_strains_of_a_relative_pose_for_many_segments_at_once():
    e, k = (np.array(column) for column in zip(*SCREWS))
    lengths = np.array([5.0, 8.0, 40.0])
    pose = se3.exp_pose(lengths[:, None] * RodStrains(e, k).twist_vector)
    strains = RodStrains.from_relative_pose(pose, lengths)
    assert strains.e == pytest.approx(e) and strains.k == pytest.approx(k)
    assert strains.frenet_curvature.shape == (3,)
