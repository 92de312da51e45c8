"""Rotations and rigid motions in closed form.

A pose is a 4x4 homogeneous matrix, a twist a 6-vector (rotation vector, translation part); every function
takes and returns arrays with any leading dimensions. Formulas: Murray, Li & Sastry, A Mathematical
Introduction to Robotic Manipulation (1994), App. A; series below `SMALL` keep them exact to rounding.
"""

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError

SMALL = 1e-4
#: (4, 4), of poses; read only
IDENTITY = np.eye(4)
IDENTITY.flags.writeable = False


def _generators():
    """(6, 4, 4) hat_pose of the unit twists."""
    out = np.zeros((6, 4, 4))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        out[i, k, j], out[i, j, k], out[3 + i, i, 3] = 1.0, -1.0, 1.0
    return out


_GENERATORS = _generators()


def is_pose(given: ArrayLike) -> bool:
    """Whether it is (4, 4): a rotation, a finite origin, and a last row 0, 0, 0, 1."""
    pose = np.asarray(given)
    if pose.shape != (4, 4) or pose.dtype.kind not in "fi" or not np.isfinite(pose).all():
        return False
    R = pose[:3, :3]
    turns = abs(R.T @ R - np.eye(3)).max() <= 1e-6 and np.linalg.det(R) > 0
    return bool(turns and (pose[3] == [0, 0, 0, 1]).all())


def checked_pose(given: ArrayLike, name: str) -> np.ndarray:
    """A pose (4, 4) as floats; InputError by this name for anything else."""
    if not is_pose(given):
        raise InputError(f"{name} must be (4, 4): a rotation, an origin in mm, and a last row 0, 0, 0, 1")
    return np.asarray(given, float)


def hat(vector: ArrayLike) -> np.ndarray:
    """Skew matrices (..., 3, 3) of vectors (..., 3): hat(a) b = a x b."""
    v = np.asarray(vector, float)
    return (v @ _GENERATORS[:3, :3, :3].reshape(3, 9)).reshape(v.shape[:-1] + (3, 3))


def _coefficients(angle):
    """sin t/t, (1-cos t)/t^2 for angles t of any shape."""
    t2 = angle * angle
    small = angle < SMALL
    t = np.where(small, 1.0, angle)
    a = np.where(small, 1 - t2 / 6, np.sin(t) / t)
    b = np.where(small, 0.5 - t2 / 24, 2 * np.sin(t / 2) ** 2 / t**2)
    return a[..., None, None], b[..., None, None]


def exp_rotation(vector: ArrayLike) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) in rad (Rodrigues)."""
    W = hat(vector)
    a, b = _coefficients(np.linalg.norm(vector, axis=-1))
    return np.eye(3) + a * W + b * W @ W


def log_rotation(rotation: ArrayLike) -> np.ndarray:
    """Rotation vectors (..., 3) of rotation matrices (..., 3, 3), angle in [0, pi], through unit
    quaternions."""
    from scipy.spatial.transform import Rotation

    R = np.asarray(rotation, float)
    return Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec().reshape(R.shape[:-2] + (3,))


def hat_pose(twist: ArrayLike) -> np.ndarray:
    """Matrices (..., 4, 4) of twists (..., 6), the exponents of their poses."""
    twist = np.asarray(twist, float)
    return (twist @ _GENERATORS.reshape(6, 16)).reshape(twist.shape[:-1] + (4, 4))


def screw_basis(twist: ArrayLike) -> np.ndarray:
    """(..., 4, 4, 4): the powers 0 to 3 of X = hat_pose(twist), which exp(s X) is a combination of, since X^4
    = -|w|^2 X^2."""
    out = np.empty(np.shape(twist)[:-1] + (4, 4, 4))
    out[..., 0, :, :], out[..., 1, :, :] = IDENTITY, hat_pose(twist)
    out[..., 2, :, :] = out[..., 1, :, :] @ out[..., 1, :, :]
    out[..., 3, :, :] = out[..., 2, :, :] @ out[..., 1, :, :]
    return out


def screw_coefficients(rate: np.ndarray, s: float | np.ndarray = 1.0) -> np.ndarray:
    """(..., 4) coefficients of `screw_basis` in exp(s X), for |w| = rate: 1, s, s^2 (1 - cos t)/t^2, s^3 (t -
    sin t)/t^3, t = s rate."""
    t = s * rate
    small = abs(t) < SMALL
    ts = np.where(small, 1.0, t)
    half, ratio = np.sin(ts / 2), s / ts
    squared, t2 = ratio * ratio, t * t
    out = np.empty(t.shape + (4,))
    out[..., 0], out[..., 1] = 1.0, s
    out[..., 2] = np.where(small, s * s * (0.5 - t2 / 24), 2 * half * half * squared)
    out[..., 3] = np.where(small, s * s * s * (1 / 6 - t2 / 120), (ts - np.sin(ts)) * squared * ratio)
    return out


def exp_pose(twist: ArrayLike) -> np.ndarray:
    """Poses (..., 4, 4) of twists (..., 6) = (rotation vector, translation part)."""
    twist = np.asarray(twist, float)
    w, v = twist[..., :3], twist[..., 3:]
    W, rate = hat(w), np.linalg.norm(w, axis=-1)
    WW = W @ W
    a, b = _coefficients(rate)
    c = screw_coefficients(rate)[..., 3, None, None]
    out = np.zeros(twist.shape[:-1] + (4, 4))
    out[..., :3, :3] = np.eye(3) + a * W + b * WW
    out[..., :3, 3] = ((np.eye(3) + b * W + c * WW) @ v[..., None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def log_pose(pose: ArrayLike) -> np.ndarray:
    """Twists (..., 6) of poses (..., 4, 4); inverse of `exp_pose` for rotation angles below pi."""
    pose = np.asarray(pose, float)
    w = log_rotation(pose[..., :3, :3])
    W = hat(w)
    t = np.linalg.norm(w, axis=-1)
    small = t < 1e-3
    ts = np.where(small, 1.0, t)
    coefficient = np.where(small, 1 / 12 + t * t / 720, (1 - 0.5 * ts / np.tan(ts / 2)) / ts**2)
    inverse = np.eye(3) - 0.5 * W + coefficient[..., None, None] * W @ W
    v = (inverse @ pose[..., :3, 3, None])[..., 0]
    return np.concatenate([w, v], axis=-1)


def inverse_pose(pose: ArrayLike) -> np.ndarray:
    """Inverse rigid motions (..., 4, 4)."""
    pose = np.asarray(pose, float)
    Rt = np.swapaxes(pose[..., :3, :3], -1, -2)
    out = np.zeros_like(pose)
    out[..., :3, :3] = Rt
    out[..., :3, 3] = -(Rt @ pose[..., :3, 3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def make_pose(rotation: ArrayLike, origin: ArrayLike) -> np.ndarray:
    """Poses (..., 4, 4) of rotations (..., 3, 3) and origins (..., 3)."""
    rotation, origin = np.asarray(rotation, float), np.asarray(origin, float)
    out = np.zeros(rotation.shape[:-2] + (4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = rotation, origin, 1.0
    return out


def transform(pose: np.ndarray, points: ArrayLike) -> np.ndarray:
    """Points (n, 3) moved by one pose (4, 4)."""
    return np.asarray(points) @ pose[:3, :3].T + pose[:3, 3]
