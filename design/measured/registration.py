"""From the camera's coordinates to the design's: the rigid motion that puts the markers at rest where they
belong."""

import numpy as np

from pneunet.base import se3
from pneunet.base.frames import best_rigid_fit

#: markers count as lying on a line when they leave it by less than this share of its length
ON_A_LINE = 0.02


def register(measured: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Pose (4, 4) that moves points (k, 3) closest to others (k, 3), in least squares.

    What points on a line leave open is the turn about that line: there it is the smallest one.
    """
    if line_of(wanted) is None:
        return best_rigid_fit(measured, wanted, np.ones(len(wanted)))
    a, b = measured.mean(axis=0), wanted.mean(axis=0)
    return _shortest(measured - a, wanted - b, a, b)


def line_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """(point (3,), direction (3,)) of the line that points (k, 3) lie on; None where they span more, or where
    they are one point."""
    centre = points.mean(axis=0)
    _, size, vt = np.linalg.svd(points - centre, full_matrices=False)
    if len(size) > 1 and size[1] > ON_A_LINE * size[0] or not size[0] > 0:
        return None
    return centre, vt[0] * (1 if vt[0] @ (points[-1] - points[0]) >= 0 else -1)


def turned_about(line: tuple[np.ndarray, np.ndarray], moving: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Pose (4, 4): the turn about a line (point, direction) that brings points (m, 3) closest to others."""
    centre, axis = line
    p, q = moving - centre, wanted - centre
    sine = np.sum(axis * np.cross(p, q))
    cosine = np.sum(p * q) - np.sum((p @ axis) * (q @ axis))
    R = se3.exp_rotation(axis * np.arctan2(sine, cosine))
    return se3.make_pose(R, centre - R @ centre)


def _shortest(p, q, a, b):
    """The smallest turn that takes the line of p to that of q."""
    along, wanted = (np.linalg.svd(points, full_matrices=False)[2][0] for points in (p, q))
    if np.sum(p @ along * (q @ wanted)) < 0:
        along = -along
    cross = np.cross(along, wanted)
    if np.linalg.norm(cross) < 1e-12:  # about any direction across, by nothing or by half a turn
        cross = np.linalg.svd(along[None])[2][1]
    turn = cross / np.linalg.norm(cross) * np.arctan2(np.linalg.norm(np.cross(along, wanted)), along @ wanted)
    R = se3.exp_rotation(turn)
    return se3.make_pose(R, b - R @ a)
