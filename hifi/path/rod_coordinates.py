"""Large steps of slender bodies: extrapolation and Newton updates in section frames instead of displacements.

A long inflated body rotates by many times what its walls strain, and both the extrapolation of displacements
and the linearised rotation in a Newton step are wrong by the rotation squared. Stations along X1 carry rigid
motions; what is extrapolated, or added, is the *relative* motion of neighbouring stations (composed exactly
in SE(3)) and the position in the section's frame. Between stations motions are interpolated along the
geodesic of SE(3). One station makes it a plain update with one rigid motion taken out; the same code serves
spheres and manipulators.
"""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from pneunet.base import se3
from pneunet.base.frames import FitMoments


class RodCoordinates:
    """Hat functions over stations of the undeformed x axis for the nodes (n, 3) this rank sees, `owned` of
    them first."""

    def __init__(self, nodes: np.ndarray, owned: int, comm: MPI.Comm, spacing: float | None = None):
        self.nodes, self.owned, self.comm = nodes, owned, comm
        x = nodes[:, 0]
        low = comm.allreduce(x.min() if len(x) else np.inf, op=MPI.MIN)
        high = comm.allreduce(x.max() if len(x) else -np.inf, op=MPI.MAX)
        intervals = 0 if spacing is None else max(1, round((high - low) / spacing))
        self.stations = intervals + 1
        position = (x - low) / (high - low) * intervals
        self.left = np.clip(position.astype(int), 0, max(intervals - 1, 0))
        self.right = np.minimum(self.left + 1, intervals)
        self.fraction = (position - self.left)[:, None] if intervals else np.zeros((len(x), 1))
        weights = np.hstack([1 - self.fraction, self.fraction])[:owned]
        columns = np.column_stack([self.left, self.right])[:owned]
        rows = np.repeat(np.arange(len(weights)), 2)
        #: (stations, owned) hat functions
        self._hats = csr_matrix(
            (weights.ravel(), (columns.ravel(), rows)), shape=(self.stations, len(weights))
        )

    def _sum_over_stations(self, rows):
        """(stations, k) hat-weighted sums of the owned nodes' rows (n, k), over all ranks."""
        return self.comm.allreduce(self._hats @ rows, op=MPI.SUM)

    def _interpolate(self, start, between):
        """Poses (n, 4, 4) at the nodes: `start` (stations, 4, 4) continued by fractions of `between`
        (stations, 6)."""
        return start[self.left] @ se3.exp_pose(
            self.fraction * between[self.right] * (self.right > self.left)[:, None]
        )

    def motions(self, positions: np.ndarray) -> np.ndarray:
        """Rigid motions (stations, 4, 4) that carry the undeformed stations' material closest to `positions`
        (n, 3)."""
        X, x = self.nodes[: self.owned], positions[: self.owned]
        outer = np.einsum("ni,nj->nij", X, x).reshape(-1, 9)
        sums = self._sum_over_stations(np.hstack([np.ones((len(X), 1)), X, x, outer]))
        return np.array([FitMoments(row).pose() for row in sums])

    def sections(self, positions: np.ndarray) -> np.ndarray:
        """Section motions (n, 4, 4) at the nodes' own x, from the stations' ones."""
        motions = self.motions(positions)
        return self._interpolate(motions, se3.log_pose(_relative(motions)))

    def extrapolate(self, histories: Sequence[np.ndarray], coefficients: Sequence[float]) -> np.ndarray:
        """Positions (n, 3) extrapolated from earlier ones (m of (n, 3)) with Lagrange coefficients (m,)."""
        relative = [_relative(self.motions(x)) for x in histories]
        # logs relative to the latest state stay far from pi
        latest = relative[-1]
        logs = [se3.log_pose(se3.inverse_pose(latest) @ h) for h in relative]
        predicted = latest @ se3.exp_pose(sum(c * q for c, q in zip(coefficients, logs)))
        local = sum(
            c * _apply(se3.inverse_pose(self.sections(x)), x) for c, x in zip(coefficients, histories)
        )
        return _apply(self._interpolate(_chain(predicted), se3.log_pose(predicted)), local)

    def retract(self, positions: np.ndarray, increment: np.ndarray) -> np.ndarray:
        """Positions (n, 3) after a displacement increment (n, 3), equal to their sum to first order.

        V(s): spatial twist that fits the increment at the stations, linear between them. The motion M of the
        sections obeys M' = M hat(V'), so M_(i+1) = M_i exp(V_(i+1) - V_i): relative motions are integrated
        exactly.
        """
        x, d = positions[: self.owned], increment[: self.owned]
        scale = max(np.abs(self.comm.allreduce(np.abs(positions).max(initial=0.0), op=MPI.MAX)), 1e-300)
        x = x / scale  # conditioning of the normal equations
        cross = np.cross(x, d)
        outer = np.einsum("ni,nj->nij", x, x).reshape(-1, 9)
        sums = self._sum_over_stations(np.hstack([np.ones((len(x), 1)), x, outer, d, cross]))
        twists = np.zeros((self.stations, 6))
        for i, row in enumerate(sums):
            n, first, second = row[0], row[1:4], row[4:13].reshape(3, 3)
            # minimise sum |d - t - w x x|^2 : normal equations for (w, t)
            matrix = np.zeros((6, 6))
            matrix[:3, :3] = np.trace(second) * np.eye(3) - second
            matrix[:3, 3:] = se3.hat(first)
            matrix[3:, :3] = se3.hat(first).T
            matrix[3:, 3:] = n * np.eye(3)
            twists[i] = np.linalg.solve(matrix, np.concatenate([row[16:19], row[13:16]]))
        twists[:, :3] /= scale
        change = np.diff(twists, axis=0, prepend=np.zeros((1, 6)))
        motion = self._interpolate(_chain(se3.exp_pose(change)), change)
        twist = twists[self.left] + self.fraction * (twists[self.right] - twists[self.left])
        rest = increment - twist[:, 3:] - np.cross(twist[:, :3], positions)
        return _apply(motion, positions + rest)


def _relative(motions):
    """Each station's motion with respect to the one before; the first one's with respect to the ground."""
    return np.concatenate([motions[:1], se3.inverse_pose(motions[:-1]) @ motions[1:]])


def _chain(relative):
    """Inverse of `_relative`."""
    out = relative.copy()
    for i in range(1, len(out)):
        out[i] = out[i - 1] @ out[i]
    return out


def _apply(poses, points):
    return np.einsum("nij,nj->ni", poses[:, :3, :3], points) + poses[:, :3, 3]
