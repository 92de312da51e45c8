"""The section frame: the best rigid fit of a piece of wall, the same everywhere in the project."""

import numpy as np

from pneunet.base import se3


def best_rigid_fit(reference, deformed, weights):
    """Pose (4, 4) of the rigid motion that carries `reference` points (n, 3) closest to `deformed` ones (n,
    3).

    Weighted least squares with `weights` (n,), e.g. areas in mm^2 (Kabsch, Acta Cryst. A 32, 922, 1976). The
    section frame at undeformed arc length s is this motion applied to the frame at (s, 0, 0): `frame_at`.
    """
    reference, deformed, w = (np.asarray(a, float) for a in (reference, deformed, weights))
    moments = FitMoments.of(reference, deformed, w)
    return moments.pose()


class FitMoments:
    """Moments (16 numbers) that determine a best rigid fit; add them up over ranks or patches, then ask for
    the pose."""

    def __init__(self, values):
        self.values = np.asarray(values, float)

    @classmethod
    def of(cls, reference, deformed, weights):
        w = weights[:, None]
        return cls(
            np.concatenate(
                [
                    [weights.sum()],
                    (w * reference).sum(0),
                    (w * deformed).sum(0),
                    ((w * reference).T @ deformed).ravel(),
                ]
            )
        )

    def __add__(self, other):
        return FitMoments(self.values + other.values)

    def pose(self):
        total = self.values[0]
        mean_reference, mean_deformed = self.values[1:4] / total, self.values[4:7] / total
        covariance = self.values[7:16].reshape(3, 3) / total - np.outer(mean_reference, mean_deformed)
        U, _, Vt = np.linalg.svd(covariance)
        R = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
        return se3.make_pose(R, mean_deformed - R @ mean_reference)


def frame_at(motion, s):
    """Section frames (..., 4, 4): `motion` (..., 4, 4) applied to the undeformed frame at (s, 0, 0), s in
    mm."""
    undeformed = np.broadcast_to(np.eye(4), np.shape(motion)).copy()
    undeformed[..., 0, 3] = s
    return motion @ undeformed
