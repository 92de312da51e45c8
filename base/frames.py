"""The section frame: the best rigid fit of a piece of wall, the same everywhere in the project."""

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base import se3


def best_rigid_fit(reference: ArrayLike, deformed: ArrayLike, weights: ArrayLike) -> np.ndarray:
    """Pose (4, 4) of the rigid motion that carries `reference` points (n, 3) closest to `deformed` ones (n,
    3).

    Weighted least squares with `weights` (n,), e.g. areas in mm^2 (Kabsch, Acta Cryst. A 32, 922, 1976). The
    section frame at undeformed arc length s is this motion applied to the frame at (s, 0, 0): `frame_at`.
    """
    return FitMoments.of(*(np.asarray(a, float) for a in (reference, deformed, weights))).pose()


class FitMoments:
    """Moments (16 numbers) that determine a best rigid fit; add them up over ranks or patches, then ask for
    the pose."""

    def __init__(self, values: ArrayLike) -> None:
        self.values = np.asarray(values, float)

    @classmethod
    def of(cls, reference: np.ndarray, deformed: np.ndarray, weights: np.ndarray) -> "FitMoments":
        """Of points (n, 3), (n, 3) and weights (n,)."""
        w = weights[:, None]
        first, second = (w * reference).sum(0), ((w * reference).T @ deformed).ravel()
        return cls(np.concatenate([[weights.sum()], first, (w * deformed).sum(0), second]))

    def __add__(self, other: "FitMoments") -> "FitMoments":
        return FitMoments(self.values + other.values)

    def pose(self) -> np.ndarray:
        """(4, 4) of `best_rigid_fit`."""
        total = self.values[0]
        mean_reference, mean_deformed = self.values[1:4] / total, self.values[4:7] / total
        covariance = self.values[7:16].reshape(3, 3) / total - np.outer(mean_reference, mean_deformed)
        U, _, Vt = np.linalg.svd(covariance)
        R = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
        return se3.make_pose(R, mean_deformed - R @ mean_reference)


def frame_at(motion: np.ndarray, s: float | np.ndarray) -> np.ndarray:
    """Section frames (..., 4, 4): `motion` (..., 4, 4) applied to the undeformed frame at (s, 0, 0), s in
    mm."""
    undeformed = np.broadcast_to(np.eye(4), np.shape(motion)).copy()
    undeformed[..., 0, 3] = s
    return motion @ undeformed
