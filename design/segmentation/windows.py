"""A helix fitted to every stretch of a curve, all stretches of a length at once: where splits start from.

A stretch grows cell by cell from each place while it can still be one piece, and starts from what it was
before. Its own frame is free, so that no stretch waits for its neighbours.
"""

from dataclasses import dataclass

import numpy as np

from pneunet.base import se3
from pneunet.design.segmentation.fit import LEVER, STRAIN
from pneunet.design.segmentation.rod import advance

CELL = 8.0  # mm
MOST_CELLS = 64
FIRST_STEPS, STEPS = 5, 2  # of Gauss and Newton: of the first stretches, of grown ones
SMOOTH = 10.0  # mm to either side that the first arc lengths are smoothed over
LEAST_POINTS = 3  # of a stretch
HOPELESS = 80.0  # by which a stretch's squares may exceed what noise explains, in units of its variance


def arc_lengths(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed points (n, 3) and their arc lengths (n,) in mm, by local quadratics in the index.

    The raw polyline's length is that of the noise where points are close: the spacing is taken from the
    growth of squared distances with the index instead.
    """
    n = len(points)
    spacing = 0.0
    for stride in (1, 2, 4, 8):
        if 2 * stride < n:
            near, far = (
                np.mean(np.sum((points[m:] - points[:-m]) ** 2, axis=1)) for m in (stride, 2 * stride)
            )
            # where the curve turns within a stride it seems too small
            spacing = max(spacing, np.sqrt(max(far - near, 1e-3 * far) / 3) / stride)
    half = min(int(SMOOTH / spacing), (n - 1) // 2)
    if half < 2:
        smooth = points
    else:
        width = 2 * half + 1
        place = np.arange(width) - half
        fit = np.linalg.pinv(np.vander(place, 3))
        first = np.clip(np.arange(n) - half, 0, n - width)
        weights = np.vander(place, 3) @ fit
        windows = points[first[:, None] + np.arange(width)]
        smooth = np.einsum("nw,nwc->nc", weights[np.arange(n) - first], windows)
    steps = np.linalg.norm(np.diff(smooth, axis=0), axis=1)
    return smooth, np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True, eq=False)
class Stretch:
    """A helix on cells `first` to `last`: square: sum of squared misfits, mm^2; strains (2,) and their
    inverse variances times the noise's, wald (2,): what setting each to zero adds to the square; pose (4, 4)
    of its frame at arc length s; values: numbers fitted less parameters."""

    first: int
    last: int
    square: float
    strains: np.ndarray
    wald: np.ndarray
    pose: np.ndarray
    s: float
    left: int


class Stretches:
    """All `Stretch`es, `found`, of points (n, 3) at first arc lengths s (n,), mm.

    floor: least noise, mm. shortest: length of the first stretches, mm. noise: what these say, at least the
    floor; estimate: without it.
    """

    def __init__(
        self,
        points: np.ndarray,
        s: np.ndarray,
        floor: float,
        shortest: float,
        frames: np.ndarray | None = None,
    ) -> None:
        self.points, self.s, self.frames = points, s, frames
        count = int(np.clip(min(s[-1] / CELL, (len(s) - 1) / 2), 1, MOST_CELLS))
        self.edges = np.linspace(0, s[-1], count + 1)
        self.index = np.searchsorted(s, self.edges)
        self.index[-1] = len(s)
        self.feet = np.tile(s, (count, 1))
        self.noise = self.estimate = floor
        self.noise_seen = False
        self.found: dict[tuple[int, int], Stretch] = {}
        least = max(1, int(np.ceil(min(shortest, s[-1]) / (s[-1] / count) - 0.1)))
        self._start(s, least)
        active = np.arange(count)
        for cells in range(least, count + 1):
            active = active[active + cells <= count]
            some = self.index[active + cells] - self.index[active] >= LEAST_POINTS
            fitted = active[some]
            if not len(fitted):
                continue
            self._fit(fitted, cells, STEPS if self.found else FIRST_STEPS)
            if cells == least:
                self._estimate_noise(floor)
                # once more, now that it is known how much of the torsion is noise
                self.strains[:, 0] = 0.0
                self._fit(fitted, cells, FIRST_STEPS)
            fits = [self.found[a, a + cells] for a in fitted]
            hopeful = [f.square < self.noise**2 * (f.left + HOPELESS) for f in fits]
            if cells >= 2 * least - 1:  # below, every length is needed for stretches to fill the curve
                active = np.sort(np.concatenate([active[~some], fitted[np.array(hopeful, bool)]]))
        if (0, count) not in self.found:
            self._fit(np.zeros(1, int), count, FIRST_STEPS)

    def _start(self, s, least):
        """First poses, at the middles of the first stretches, and strains from quadratics."""
        count = len(self.index) - 1
        self.origin, self.turn = np.empty((count, 3)), np.empty((count, 3, 3))
        self.strains, self.place = np.zeros((count, 2)), np.empty(count)
        for a in range(count):
            last = min(a + least, count)
            i, j = self.index[max(0, last - least)], self.index[last]
            if j - i < 3:
                i, j = max(0, j - 3), max(3, j)
            x = s[i:j] - s[i:j].mean()
            scale = max(x.max(), 1e-9)
            c = np.linalg.lstsq(np.vander(x / scale, 3), self.points[i:j], rcond=None)[0]
            self.place[a], self.origin[a] = s[i:j].mean(), c[2]
            tangent = c[1] / np.linalg.norm(c[1])
            bend = 2 * c[0] / scale**2
            bend = bend - (bend @ tangent) * tangent
            self.strains[a, 1] = min(np.linalg.norm(bend), 3 * STRAIN)
            down = bend if self.strains[a, 1] > 1e-9 else np.eye(3)[np.argmin(abs(tangent))]
            down = down - (down @ tangent) * tangent
            up = -down / np.linalg.norm(down)
            self.turn[a] = np.column_stack([tangent, np.cross(up, tangent), up])
            if self.frames is not None:
                self._from_frames(a, s, self.frames, i, j)

    def _from_frames(self, a, s, frames, i, j):
        self.turn[a] = frames[(i + j) // 2]
        turned = se3.log_rotation(frames[i].T @ frames[j - 1]) / max(s[j - 1] - s[i], 1e-9)
        self.strains[a] = np.clip(turned[:2], -3 * STRAIN, 3 * STRAIN)

    def _fit(self, a, cells, steps):
        first, count = self.index[a], self.index[a + cells] - self.index[a]
        offsets = np.arange(count.max())
        inside = offsets < count[:, None]
        index = np.minimum(first[:, None] + offsets, len(self.points) - 1)
        points, feet = self.points[index], np.take_along_axis(self.feet[a], index, axis=1)
        frames = None if self.frames is None else self.frames[index]
        origin, turn, k, place = self.origin[a], self.turn[a], self.strains[a], self.place[a]
        prior = np.zeros(8)
        prior[:6], prior[6:] = 1e-6, 1 / STRAIN**2
        prior *= self.noise**2
        prior[:6] += 1e-9
        for _ in range(steps):
            p, turns, v, rotations = advance(k[:, None, :], feet - place[:, None])
            back = np.swapaxes(turns, 2, 3)
            away = (back @ ((points - origin[:, None]) @ turn - p)[..., None])[..., 0]
            slopes = np.zeros(p.shape + (8,))
            slopes[..., :3] = back @ -se3.hat(p)
            slopes[..., 3:6] = back
            slopes[..., 6:] = back @ v
            rows, misfit = slopes[..., 1:, :], away[..., 1:]
            if frames is not None:
                turned = np.concatenate([back, np.zeros_like(back), back @ rotations], axis=-1)
                turned[..., :2, :] -= k[:, None, :, None] * slopes[..., :1, :]
                rows = np.concatenate([rows, LEVER * turned], axis=-2)
                seen = se3.log_rotation(back @ np.swapaxes(turn, 1, 2)[:, None] @ frames)
                misfit = np.concatenate([misfit, LEVER * seen], axis=-1)
            rows = (rows * inside[..., None, None]).reshape(len(a), -1, 8)
            misfit = (misfit * inside[..., None]).reshape(len(a), -1)
            curvature = np.swapaxes(rows, 1, 2) @ rows
            gradient = (misfit[:, None] @ rows)[:, 0]
            gradient[:, 6:] -= prior[6:] * k
            np.einsum("aii->ai", curvature)[:] += prior
            damped = curvature.copy()
            np.einsum("aii->ai", damped)[:] *= 1 + 1e-4
            step = np.linalg.solve(damped, gradient[..., None])[..., 0]
            size = np.maximum.reduce(
                [
                    np.linalg.norm(step[:, :3], axis=1) / 0.5,
                    np.linalg.norm(step[:, 3:6], axis=1) / 20.0,
                    abs(step[:, 6:]).max(axis=1) / 0.02,
                    np.ones(len(a)),
                ]
            )
            step /= size[:, None]
            feet = feet + away[..., 0] - (slopes[..., 0, :] @ step[..., None])[..., 0]
            origin = origin + (turn @ step[:, 3:6, None])[..., 0]
            turn = turn @ se3.exp_rotation(step[:, :3])
            k = k + step[:, 6:]
            square = np.sum(misfit**2, axis=1) - np.sum(step * gradient, axis=1)
        self.origin[a], self.turn[a], self.strains[a] = origin, turn, k
        # the feet of the points that follow are taken as far off as the last one inside
        last = count - 1
        rows_ = np.arange(len(a))
        for row, (start, start_index, n) in enumerate(zip(a, first, count)):
            shift = feet[row, last[row]] - self.feet[start, start_index + n - 1]
            self.feet[start, start_index : start_index + n] = feet[row, :n]
            self.feet[start, start_index + n :] += shift
        inverse = np.linalg.inv(curvature)
        wald = k**2 / np.maximum(np.einsum("aii->ai", inverse)[:, 6:], 1e-300)
        values = count * misfit.shape[1] // len(offsets)
        poses = se3.make_pose(turn, origin)
        for row in rows_:
            start = int(a[row])
            self.found[start, start + cells] = Stretch(
                start,
                start + cells,
                max(float(square[row]), 0.0),
                k[row],
                wald[row],
                poses[row],
                float(place[row]),
                int(values[row]) - 7,
            )

    def _estimate_noise(self, floor):
        """From the median of what the shortest stretches leave; those across a joint leave more."""
        spread = [f.square / f.left for f in self.found.values() if f.left >= 5]
        self.noise_seen = bool(spread)
        if spread:
            left = np.median([f.left for f in self.found.values() if f.left >= 5])
            usual = (1 - 2 / (9 * left)) ** 3  # median of chi squared over its degrees of freedom
            self.estimate = float(np.sqrt(np.median(spread) / usual))
        self.noise = max(self.estimate, floor)
