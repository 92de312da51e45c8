"""The section frame: best rigid fit of weighted points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pneunet.base import se3
from pneunet.base.frames import FitMoments, best_rigid_fit, frame_at

RANDOM = np.random.default_rng(2)
POINTS = RANDOM.uniform(-3, 3, (40, 3)) + [20.0, 0.0, 0.0]
WEIGHTS = RANDOM.uniform(0.1, 1, 40)
MOTION = se3.exp_pose([0.5, 2.4, -1.0, 7.0, -3.0, 11.0])


@pytest.mark.parametrize("flatten", [[1, 1, 1], [1, 1, 0]], ids=["body", "plane"])
def test_a_known_motion_is_recovered(flatten):
    points = POINTS * flatten
    assert best_rigid_fit(points, se3.transform(MOTION, points), WEIGHTS) == pytest.approx(MOTION, abs=1e-12)


def test_fit_of_a_deformed_body_is_the_weighted_least_squares_one():
    deformed = se3.transform(MOTION, POINTS) + RANDOM.normal(scale=0.5, size=POINTS.shape)
    mean_then, mean_now = (np.average(p, axis=0, weights=WEIGHTS) for p in (POINTS, deformed))
    rotation = Rotation.align_vectors(deformed - mean_now, POINTS - mean_then, WEIGHTS)[0].as_matrix()
    pose = best_rigid_fit(POINTS, deformed, WEIGHTS)
    assert pose[:3, :3] == pytest.approx(rotation, abs=1e-7)
    assert se3.transform(pose, mean_then[None])[0] == pytest.approx(mean_now)


def test_a_mirror_image_is_fitted_by_a_rotation():
    pose = best_rigid_fit(POINTS, POINTS * [1, -1, 1], WEIGHTS)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)


def test_moments_add_up_over_ranks():
    deformed = se3.transform(MOTION, POINTS) + RANDOM.normal(scale=0.5, size=POINTS.shape)
    whole = FitMoments.of(POINTS, deformed, WEIGHTS)
    parts = [FitMoments.of(POINTS[i::3], deformed[i::3], WEIGHTS[i::3]) for i in range(3)]
    assert (parts[0] + parts[1] + parts[2]).values == pytest.approx(whole.values)
    assert whole.pose() == pytest.approx(best_rigid_fit(POINTS, deformed, WEIGHTS))


def test_frames_stand_on_the_undeformed_axis_moved_along():
    frames = frame_at(np.stack([np.eye(4), MOTION]), np.array([3.0, 20.0]))
    assert frames[0, :3, 3] == pytest.approx([3.0, 0.0, 0.0])
    assert frames[1, :3, 3] == pytest.approx(se3.transform(MOTION, np.array([[20.0, 0.0, 0.0]]))[0])
    assert frames[1, :3, :3] == pytest.approx(MOTION[:3, :3])
