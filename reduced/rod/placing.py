"""Where a rod of pieces with constant strains lies, and how that changes with the pieces: exact derivatives.

A piece is its twist over its whole length, X = L (k, e) undeformed: it moves the frame by exp(X). A change dX
moves everything behind it rigidly, by the spatial twist Ad(g) J(X) dX (base.left_jacobian), and a station on
it by Ad(g) t J(t X) dX. Stations are asked for at fractions of the rod's deformed length, so they also slide
along it as pieces get longer.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.base import se3
from pneunet.base.left_jacobian import LeftJacobian, adjoint

#: rad: longer turns are cut into equal elements, which is what the Jacobian's series is exact for
LARGEST_TURN = 3.0


@dataclass(frozen=True, eq=False)
class Stations:
    """Stations of a rod: poses (s, 4, 4); turns, moves (s, 3, 6 m): derivatives by the pieces' twists (m, 6)
    of the frames, d column = (turns dX) x column, and of their origins, mm."""

    poses: np.ndarray
    turns: np.ndarray
    moves: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """(s, 3), mm."""
        return self.poses[:, :3, 3]


class PlacedRod:
    """The rod of pieces with twists (m, 6) = (k, e) times undeformed length, from base_pose (4, 4) on."""

    def __init__(self, twists: np.ndarray, base_pose: np.ndarray) -> None:
        self.twists, self.base_pose = twists, base_pose
        self.lengths = np.linalg.norm(twists[:, 3:], axis=1)
        self.ends = np.cumsum(self.lengths)
        turn = np.linalg.norm(twists[:, :3], axis=1)
        self._cuts = np.maximum(np.ceil(turn / LARGEST_TURN), 1).astype(int)
        self._owner = np.repeat(np.arange(len(twists)), self._cuts)
        self._first = np.cumsum(self._cuts) - self._cuts
        self._elements = (twists / self._cuts[:, None])[self._owner]

    @property
    def length(self) -> float:
        """Deformed, mm."""
        return float(self.ends[-1])

    @cached_property
    def _joints(self):
        """Poses (n + 1, 4, 4) of the elements' ends, their derivatives (n + 1, 6, m, 6), spatial twists."""
        J = LeftJacobian(self._elements)
        steps, m = J.pose, len(self.twists)
        poses = np.empty((len(steps) + 1, 4, 4))
        poses[0] = self.base_pose
        for before, step, after in zip(poses, steps, poses[1:]):
            before.dot(step, after)
        by = np.zeros((len(poses), 6, m, 6))
        own = adjoint(poses[:-1]) @ J.matrix / self._cuts[self._owner][:, None, None]
        for i, owner in enumerate(self._owner):
            by[i + 1] = by[i]
            by[i + 1, :, owner] += own[i]
        return poses, by

    @cached_property
    def stretching(self) -> np.ndarray:
        """(m, 6) derivative of each piece's deformed length by its twist."""
        out = np.zeros_like(self.twists)
        out[:, 3:] = self.twists[:, 3:] / self.lengths[:, None]
        return out

    def locate(self, fractions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(pieces (s,), shares of them (s,) that lie before) of stations at fractions (s,) of the deformed
        length."""
        s = np.asarray(fractions, float) * self.length
        piece = np.minimum(np.searchsorted(self.ends, s, side="right"), len(self.ends) - 1)
        return piece, (s - self.ends[piece]) / self.lengths[piece] + 1

    def _elements_at(self, fractions):
        """(pieces (s,), shares of them (s,), elements (s,), shares of them (s,)) of stations."""
        piece, share = self.locate(fractions)
        within = share * self._cuts[piece]
        number = np.clip(within.astype(int), 0, self._cuts[piece] - 1)
        return piece, share, self._first[piece] + number, within - number

    def points(self, fractions: np.ndarray) -> np.ndarray:
        """(s, 3) stations at fractions (s,) of the deformed length, mm."""
        _, _, element, t = self._elements_at(fractions)
        steps = se3.exp_pose(t[:, None] * self._elements[element])
        return (self._joints[0][element] @ steps)[:, :3, 3]

    def at(self, fractions: np.ndarray, sliding: bool = True) -> Stations:
        """The stations at fractions (s,) of the deformed length; sliding: these fractions are kept as pieces
        change, otherwise the shares of the pieces that they lie at."""
        piece, share, element, t = self._elements_at(fractions)
        joints, by_joints = self._joints
        J = LeftJacobian(t[:, None] * self._elements[element])
        poses, by = joints[element] @ J.pose, by_joints[element]
        s = np.arange(len(piece))
        by[s, :, piece] += adjoint(joints[element]) @ J.matrix * (t / self._cuts[piece])[:, None, None]
        if sliding:
            shift = self._shift(np.asarray(fractions, float), piece, share)
            by += (adjoint(poses) @ self.twists[piece, :, None])[..., None] * shift[:, None]
        by = by.reshape(len(piece), 6, -1)
        return Stations(poses, by[:, :3], by[:, 3:] - se3.hat(poses[:, :3, 3]) @ by[:, :3])

    def _shift(self, fractions, piece, share):
        """(s, m, 6) derivatives of the shares of the pieces that stations at fractions of the length lie
        at."""
        before = np.arange(len(self.twists)) < piece[:, None]
        weight = fractions[:, None] - before
        weight[np.arange(len(piece)), piece] -= share
        return (weight / self.lengths[piece][:, None])[..., None] * self.stretching
