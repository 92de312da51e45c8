"""Rod kinematics on SE(3): section frames along a rod whose strains are constant on each piece.

The frame (origin c, rotation Q) obeys c' = Q e, Q' = Q hat(k) per undeformed length, so over a piece it moves
by the closed-form screw exp(s (k, e)), and the pieces follow one another by products. Frames, not tangents,
are continuous at joints; with the paper's words (Eqs 22-26) the product of the pieces' end rotations turns
the next piece.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains


@dataclass(frozen=True, eq=False)
class Centreline:
    """Section frames along a rod.

    s : (n,) increasing undeformed arc length from the base, mm; every joint is a sample.
    poses : (n, 4, 4) section frames, mm. Between two samples the strains are constant.
    """

    s: np.ndarray
    poses: np.ndarray

    def __repr__(self) -> str:
        tip = self.points[-1].round(2)
        return f"<Centreline: {len(self.s)} frames, {self.length:.1f} mm, tip at {tip} mm>"

    @property
    def points(self) -> np.ndarray:
        """(n, 3) origins of the section frames, mm."""
        return self.poses[:, :3, 3]

    @property
    def strains(self) -> RodStrains:
        """RodStrains of the n-1 intervals between samples."""
        relative = se3.inverse_pose(self.poses[:-1]) @ self.poses[1:]
        return RodStrains.from_relative_pose(relative, np.diff(self.s))

    @property
    def tangents(self) -> np.ndarray:
        """(n, 3) unit tangents of the line of origins; at a joint that of the piece which begins there."""
        e = self.strains.e[self._interval(self.s)]
        tangents = (self.poses[:, :3, :3] @ e[:, :, None])[:, :, 0]
        return tangents / np.linalg.norm(tangents, axis=1, keepdims=True)

    @property
    def arc_length(self) -> np.ndarray:
        """(n,) deformed arc length at the samples, mm."""
        return np.concatenate([[0.0], np.cumsum(self.strains.stretch * np.diff(self.s))])

    @property
    def length(self) -> float:
        """Deformed length, mm."""
        return float(self.arc_length[-1])

    def at(self, s: ArrayLike) -> np.ndarray:
        """Section frames (n, 4, 4) at any undeformed arc lengths s (n,) in mm on the rod: exact, not
        interpolated."""
        s = np.asarray(s, float)
        reach = self.s[-1] - self.s[0]
        if s.size and (s.min() < self.s[0] - 1e-9 * reach or s.max() > self.s[-1] + 1e-9 * reach):
            raise InputError(f"s: give undeformed arc lengths on the rod, {self.s[0]:g}..{self.s[-1]:g} mm")
        i = self._interval(s)
        return self.poses[i] @ se3.exp_pose(self.strains.twist_vector[i] * (s - self.s[i])[:, None])

    def _interval(self, s):
        return np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)


def centreline(
    lengths: ArrayLike, strains: RodStrains, spacing: float = 1.0, base_pose: np.ndarray | None = None
) -> Centreline:
    """The Centreline of pieces in a row.

    lengths : (m,) undeformed lengths, mm, > 0. strains : RodStrains with e, k of shape (m, 3). spacing :
    largest distance of samples, mm. base_pose : (4, 4) frame of the base, default the identity.
    """
    lengths = np.asarray(lengths, float)
    if lengths.ndim != 1 or not lengths.size or not (lengths > 0).all():
        raise InputError("lengths: give one length larger than 0 mm for every piece")
    if strains.e.shape != (lengths.size, 3) or strains.k.shape != (lengths.size, 3):
        raise InputError(f"strains: give e and k of shape ({lengths.size}, 3), one row for every piece")
    if not spacing > 0:
        raise InputError(f"spacing = {spacing:g} mm must be larger than 0")
    m, basis, rate = lengths.size, se3.screw_basis(strains.twist_vector), np.linalg.norm(strains.k, axis=-1)
    counts = np.maximum(np.ceil(lengths / spacing - 1e-9).astype(int), 1)
    ends, last = np.cumsum(lengths), np.cumsum(counts)
    piece = np.repeat(np.arange(m), counts)
    within = (np.arange(piece.size) - (last - counts)[piece]) * (lengths / counts)[piece]
    # of the whole pieces, then of the samples in them
    rates, reaches = np.concatenate([rate, rate[piece]]), np.concatenate([lengths, within])
    coefficients = se3.screw_coefficients(rates, reaches)
    joints = _joints(coefficients[:m], basis, base_pose)
    s, poses = np.empty(piece.size + 1), np.empty((piece.size + 1, 4, 4))
    s[:-1], s[-1] = (ends - lengths)[piece] + within, ends[-1]
    moved = (joints[:-1, None] @ basis).reshape(m, 4, 16)[piece]
    np.matmul(coefficients[m:, None], moved, out=poses[:-1].reshape(-1, 1, 16))
    poses[-1] = joints[-1]
    return Centreline(s, poses)


def free_shapes(
    lengths: ArrayLike, strains: RodStrains, samples: int = 20, base_pose: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """(s (n, m samples + 1) in mm, poses (n, m samples + 1, 4, 4)) of n designs at once, of m pieces each.

    lengths : (n, m) undeformed lengths, mm, > 0. strains : RodStrains with e, k of shape (n, m, 3). samples :
    points of every piece, joints included. base_pose : (4, 4) or (n, 4, 4), default the identity. What
    `centreline` does for one.
    """
    lengths = np.asarray(lengths, float)
    if lengths.ndim != 2 or not lengths.size or not (lengths > 0).all():
        raise InputError("lengths: give (designs, pieces) lengths larger than 0 mm")
    if strains.e.shape != (*lengths.shape, 3) or strains.k.shape != (*lengths.shape, 3):
        raise InputError(
            f"strains: give e and k of shape {(*lengths.shape, 3)}, one row for every piece of every design"
        )
    if samples < 1:
        raise InputError(f"samples = {samples}: give at least 1 for every piece")
    n, m = lengths.shape
    basis, rate = se3.screw_basis(strains.twist_vector), np.linalg.norm(strains.k, axis=-1)
    joints = _joints(se3.screw_coefficients(rate, lengths), basis, base_pose)
    within = lengths[..., None] * np.arange(samples) / samples
    s, poses = np.empty((n, m * samples + 1)), np.empty((n, m * samples + 1, 4, 4))
    s[:, :-1] = (within + (np.cumsum(lengths, axis=1) - lengths)[..., None]).reshape(n, -1)
    moved = (joints[:, :-1, None] @ basis).reshape(n, m, 4, 16)
    poses[:, :-1] = (se3.screw_coefficients(rate[..., None], within) @ moved).reshape(n, -1, 4, 4)
    s[:, -1], poses[:, -1] = lengths.sum(axis=1), joints[:, -1]
    return s, poses


def _joints(coefficients, basis, base_pose):
    """Poses of the joints (..., m + 1, 4, 4) of pieces in a row from their screws: coefficients (..., m, 4),
    basis (..., m, 4, 4, 4)."""
    lead, m = coefficients.shape[:-2], coefficients.shape[-2]
    steps = (coefficients[..., None, :] @ basis.reshape(*lead, m, 4, 16)).reshape(*lead, m, 4, 4)
    joints = np.empty((*lead, m + 1, 4, 4))
    pose = joints[..., 0, :, :]
    pose[...] = se3.IDENTITY if base_pose is None else base_pose
    for step, joint in zip(steps.swapaxes(0, -3), joints.swapaxes(0, -3)[1:]):
        pose = np.matmul(pose, step, out=joint)
    return joints
