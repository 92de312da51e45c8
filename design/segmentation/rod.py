"""A rod of pieces of constant strain (k1, k2) in a section frame that is continuous along it, with slopes.

Stretch 1; k2 > 0 bends towards -z of the section frame, as a one-sided segment with its chambers above
does, and k2 < 0 is the same piece rolled by 180 degrees. With w^2 = k1^2 + k2^2, S = sin(wu)/w,
B = (1 - cos wu)/w^2 and C = (wu - sin wu)/w^3 a piece leads over the length u to the point
(u - C k2^2, C k1 k2, -B k2) of the frame at its start. The first and the last piece go on beyond their
ends, so that no length is a parameter. Every parameter moves what follows as a rigid body: exact derivatives
are rotations and velocities of joints.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

SMALL = 0.1  # rad; below it the series are exact to rounding


def _coefficients(w2, u):
    """S, B, C and the slopes of B and C by w^2; any shape."""
    w = np.sqrt(w2)
    t = w * u
    small = abs(t) < SMALL
    w2 = np.where(small, 1.0, w2)
    w = np.where(small, 1.0, w)
    S, cosine = np.sin(t) / w, np.cos(t)
    B, C = (1 - cosine) / w2, (u - S) / w2
    dB = (u * S - 2 * B) / (2 * w2)
    dC = ((S - u * cosine) / (2 * w2) - C) / w2
    if small.any():
        q, u2 = np.where(small, t * t, 0.0), u * u
        S = np.where(small, u * (1 - q / 6 * (1 - q / 20 * (1 - q / 42))), S)
        B = np.where(small, u2 / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56))), B)
        C = np.where(small, u2 * u / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72))), C)
        dB = np.where(small, -u2 * u2 / 24 * (1 - q / 15 * (1 - q * 3 / 112)), dB)
        dC = np.where(small, -u2 * u2 * u / 120 * (1 - q / 21 * (1 - q / 48)), dC)
    return S, B, C, dB, dC


def advance(strains: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, ...]:
    """Where strains (..., 2) lead over lengths u (...): points (..., 3) and frames (..., 3, 3) in the frame
    at the start, and the slopes of both by the strains: velocities (..., 3, 2) of the point, rotations (...,
    3, 2) of the frame."""
    k1, k2 = strains[..., 0], strains[..., 1]
    S, B, C, dB, dC = _coefficients(k1 * k1 + k2 * k2, u)
    k11, k12, k22 = k1 * k1, k1 * k2, k2 * k2
    points = np.empty(S.shape + (3,))
    points[..., 0], points[..., 1], points[..., 2] = u - C * k22, C * k12, -B * k2
    frames = np.empty(S.shape + (3, 3))
    frames[..., 0, 0], frames[..., 0, 1], frames[..., 0, 2] = 1 - B * k22, B * k12, S * k2
    frames[..., 1, 0], frames[..., 1, 1], frames[..., 1, 2] = B * k12, 1 - B * k11, -S * k1
    frames[..., 2, 0], frames[..., 2, 1], frames[..., 2, 2] = -S * k2, S * k1, 1 - B * (k11 + k22)
    v = np.empty(S.shape + (3, 2))
    v[..., 0, 0], v[..., 0, 1] = -2 * k1 * k22 * dC, -2 * k2 * (C + k22 * dC)
    v[..., 1, 0], v[..., 1, 1] = k2 * (C + 2 * k11 * dC), k1 * (C + 2 * k22 * dC)
    v[..., 2, 0], v[..., 2, 1] = -2 * k12 * dB, -B - 2 * k22 * dB
    rotations = np.empty(S.shape + (3, 2))
    rotations[..., 0, 0], rotations[..., 0, 1] = points[..., 0], C * k12
    rotations[..., 1, 0], rotations[..., 1, 1] = C * k12, u - C * k11
    rotations[..., 2, 0], rotations[..., 2, 1] = points[..., 2], B * k1
    return points, frames, v, rotations


@dataclass(frozen=True, eq=False)
class Station:
    """Points of a rod at arc lengths s (n,): piece (n,) index of each one's piece, points (n, 3), frames (n,
    3, 3), and the slopes of a point by its own piece's strains in its frame: velocities and rotations (n, 3,
    2)."""

    s: np.ndarray
    piece: np.ndarray
    points: np.ndarray
    frames: np.ndarray
    velocities: np.ndarray
    rotations: np.ndarray


@dataclass(frozen=True, eq=False)
class PiecewiseRod:
    """start (4, 4): the section frame at s = 0; joints (n - 1,): increasing arc lengths, mm; strains (n, 2):
    (k1, k2) of the pieces, 1/mm."""

    start: np.ndarray
    joints: np.ndarray
    strains: np.ndarray

    @cached_property
    def _ends(self):
        """Origins (n, 3) and frames (n, 3, 3) at the starts of the pieces, and slopes of each piece's end."""
        origins, frames = [self.start[:3, 3]], [self.start[:3, :3]]
        starts = np.concatenate([[0.0], self.joints])
        lengths = np.diff(starts)
        points, turns, v, rotations = advance(self.strains[:-1], lengths)
        for point, turn in zip(points, turns):
            origins.append(origins[-1] + frames[-1] @ point)
            frames.append(frames[-1] @ turn)
        return starts, np.array(origins), np.array(frames), v, rotations

    def at(self, s: np.ndarray) -> Station:
        """The `Station` at arc lengths s (n,), which may lie beyond the ends."""
        starts, origins, frames, _, _ = self._ends
        piece = np.searchsorted(self.joints, s, side="right")
        points, turns, v, rotations = advance(self.strains[piece], s - starts[piece])
        here = frames[piece]
        back = np.swapaxes(turns, 1, 2)
        return Station(
            s,
            piece,
            origins[piece] + (here @ points[..., None])[..., 0],
            here @ turns,
            back @ v,
            back @ rotations,
        )

    def slopes(self, station: Station) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and rotations (n, 3, p) of a station's frames, in these, by all parameters: rotation and
        translation of the start in space, joints, strains (k1, k2 of the first piece, of the second, ...)."""
        starts, origins, frames, v, rotations = self._ends
        n = len(origins)
        turning = np.zeros((3, 6 + n - 1 + 2 * n))
        moving = np.zeros_like(turning)
        turning[:, :3] = np.eye(3)
        moving[:, 3:6] = np.eye(3)
        pivots = np.zeros_like(turning)
        pivots[:, :3] = origins[0][:, None]
        first = np.zeros(turning.shape[1], int)  # the first piece that a parameter moves as a whole
        if n > 1:
            jumps = np.zeros((n - 1, 3))
            jumps[:, :2] = self.strains[:-1] - self.strains[1:]
            turning[:, 6 : 5 + n] = (frames[1:] @ jumps[..., None])[..., 0].T
            pivots[:, 6 : 5 + n] = origins[1:].T
            first[6 : 5 + n] = np.arange(1, n)
            own = slice(5 + n, 5 + n + 2 * (n - 1))
            turning[:, own] = np.moveaxis(frames[:-1] @ rotations, 1, 0).reshape(3, -1)
            moving[:, own] = np.moveaxis(frames[:-1] @ v, 1, 0).reshape(3, -1)
            pivots[:, own] = np.repeat(origins[1:], 2, axis=0).T
        first[5 + n :] = np.repeat(np.arange(1, n + 1), 2)
        moving -= _cross(turning, pivots)
        back = np.swapaxes(station.frames, 1, 2)
        turned = (back.reshape(-1, 3) @ turning).reshape(len(back), 3, -1)
        # R'(w x x) = (R'w) x (R'x)
        place = (back @ station.points[..., None])[..., 0]
        moved = (back.reshape(-1, 3) @ moving).reshape(turned.shape)
        moved[:, 0] += turned[:, 1] * place[:, 2, None] - turned[:, 2] * place[:, 1, None]
        moved[:, 1] += turned[:, 2] * place[:, 0, None] - turned[:, 0] * place[:, 2, None]
        moved[:, 2] += turned[:, 0] * place[:, 1, None] - turned[:, 1] * place[:, 0, None]
        after = (station.piece[:, None] >= first)[:, None, :]
        moved, turned = moved * after, turned * after
        rows = np.arange(len(back))
        for a in range(2):
            column = 5 + n + 2 * station.piece + a
            moved[rows, :, column] = station.velocities[:, :, a]
            turned[rows, :, column] = station.rotations[:, :, a]
        return moved, turned

    def cut(self, places: np.ndarray) -> "PiecewiseRod":
        """The same rod with further joints at `places` (m,), increasing, at which nothing changes."""
        joints = np.concatenate([self.joints, places])
        order = np.argsort(joints, kind="stable")
        middles = np.concatenate([[joints[order][0] - 1.0], joints[order]]) if len(joints) else np.zeros(1)
        return PiecewiseRod(
            self.start,
            joints[order],
            self.strains[np.searchsorted(self.joints, middles, side="right")],
        )


def _cross(a, b):
    """Of columns (3, p)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
