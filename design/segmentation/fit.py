"""A rod against points: misfit across the tangent, slopes, Levenberg and Marquardt's steps, the criterion.

Every point has a foot on the rod. The feet slide along the tangent with each trial (variable projection), so
that the misfit is the part of point minus foot across the tangent. Section frames, where given, count by what
their turns move at a lever's length.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import lgamma

import numpy as np

from pneunet.base import se3
from pneunet.design.segmentation.rod import PiecewiseRod, Station
from pneunet.design.target.target import BENDING, HELICAL
from pneunet.geometry.parameters import PASSIVE, TWISTING

LEVER = 5.0  # mm, half a usual width, at which turns of a section frame are measured
STRAIN = 0.03  # 1/mm, standard deviation of strains before any point is seen
#: mm by which a piece is too short that counts as one standard deviation: in the search, at its end
SOFT, FIRM = 0.1, 0.01
PIECE = 4.0  # price of a piece in the criterion, -2 log of its prior odds
ASTRAY = 0.4  # of the length: feet further from where their points are along the curve are wrong
ENOUGH = 2500  # steps, some two seconds
#: largest steps: rad, mm (start and joints), 1/mm
CAPS = (0.5, 20.0, 0.02)
#: (k1 free, k2 free) -> kind
KINDS = {
    (False, False): PASSIVE,
    (True, False): TWISTING,
    (False, True): BENDING,
    (True, True): HELICAL,
}


@dataclass
class Effort:
    """Steps of Levenberg and Marquardt that a split has taken; above ENOUGH nothing further is tried."""

    steps: int = 0

    @property
    def spent(self) -> bool:
        return self.steps > ENOUGH


@dataclass(frozen=True, eq=False)
class Observations:
    """What a rod is fitted to: points (n, 3), mm, with noise (standard deviation of a coordinate, mm) and,
    where given, frames (n, 3, 3), the section frame base (3, 3) at the first point, weights (n,), 1 on
    average.

    places (n,): first arc lengths of the points, mm. lever: mm at which turns of frames are measured.
    shortest: length of a piece, mm, which slack lets it miss. reach: {kind: (largest |k1|, largest |k2|)} in
    1/mm; a kind that is not named has no limits. noise_seen: the points were enough to tell the noise.
    """

    points: np.ndarray
    noise: float
    places: np.ndarray
    frames: np.ndarray | None = None
    base: np.ndarray | None = None
    weights: np.ndarray | None = None
    lever: float = LEVER
    shortest: float = 20.0
    slack: float = SOFT
    reach: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    noise_seen: bool = True
    effort: Effort = field(default_factory=Effort)

    @property
    def length(self) -> float:
        """Of the curve, mm."""
        return float(self.places[-1])

    @property
    def joint_price(self) -> float:
        """What a joint costs before the points say how well they place it, in units of the criterion."""
        return PIECE + 2 * np.log(self.length / np.sqrt(2 * np.pi))

    @property
    def values(self) -> int:
        """How many numbers there are to be fitted."""
        count = len(self.points) if self.weights is None else int(np.sum(self.weights > 0))
        return count * (2 if self.frames is None else 5)


@dataclass(frozen=True, eq=False)
class RodFit:
    """A rod with free strains (n, 2) and the feet's arc lengths (m,) of the points that it is fitted to."""

    data: Observations
    rod: PiecewiseRod
    free: np.ndarray
    feet: np.ndarray

    @cached_property
    def station(self) -> Station:
        """The rod at the feet."""
        return self.rod.at(self.feet)

    @cached_property
    def away(self) -> np.ndarray:
        """(m, 3) points minus feet, in the rod's frames."""
        back = np.swapaxes(self.station.frames, 1, 2)
        return (back @ (self.data.points - self.station.points)[..., None])[..., 0]

    @cached_property
    def misfit(self) -> np.ndarray:
        """(m, 2), with frames (m, 5), in mm, times the roots of weights."""
        misfit = self.away[:, 1:]
        if self.data.frames is not None:
            turns = se3.log_rotation(np.swapaxes(self.station.frames, 1, 2) @ self.data.frames)
            misfit = np.hstack([misfit, self.data.lever * turns])
        return misfit if self.data.weights is None else misfit * self._roots[:, 1:]

    @property
    def _roots(self):
        """(m, 3 or 6) of the points' weights; what is along the tangent has none."""
        columns = 3 if self.data.frames is None else 6
        assert self.data.weights is not None
        roots = np.repeat(np.sqrt(self.data.weights)[:, None], columns, axis=1)
        roots[:, 0] = 1.0
        return roots

    @property
    def square(self) -> float:
        """Sum of squares of the misfit, mm^2."""
        return float(np.sum(self.misfit**2))

    @property
    def rms(self) -> float:
        """Root mean square distance of points across the rod, mm."""
        return float(np.sqrt(np.mean(np.sum(self.away[:, 1:] ** 2, axis=1))))

    @property
    def left(self) -> int:
        """Values less parameters, of which the rod's own sliding is none."""
        return max(1, self.data.values - len(self.columns) + 1)

    @property
    def noise(self) -> float:
        """Standard deviation of a coordinate of a point by what the parameters leave, mm."""
        share = self.data.values / self.left
        return float(np.sqrt(np.mean(self.misfit[:, :2] ** 2) * share))

    @property
    def frame_noise(self) -> float:
        """The same of the turns of section frames at the lever's length, mm; 0 without frames."""
        if self.data.frames is None:
            return 0.0
        return float(np.sqrt(np.mean(self.misfit[:, 2:] ** 2) * self.data.values / self.left))

    @property
    def poor(self) -> float:
        """By how many of its standard deviations the sum of squares exceeds what noise explains."""
        return (self.square / self.data.noise**2 - self.left) / np.sqrt(2 * self.left)

    @cached_property
    def columns(self) -> np.ndarray:
        """Indices of the parameters that are free, among all of `PiecewiseRod.slopes`."""
        fixed = 5 + len(self.free)
        return np.concatenate([np.arange(fixed), fixed + np.flatnonzero(self.free)])

    @cached_property
    def bounds(self) -> tuple[float, np.ndarray, np.ndarray]:
        """Cost, gradient (-1/2 of it) and curvature by all parameters of the strains' prior and of pieces
        that are too short."""
        data, n = self.data, len(self.free)
        size, fixed = 5 + 3 * n, 5 + n
        gradient, curvature = np.zeros(size), np.zeros((size, size))
        k = np.where(self.free, self.rod.strains, 0.0)
        cost = float(np.sum(k**2)) / STRAIN**2
        gradient[fixed:] = -k.ravel() / STRAIN**2
        diagonal = np.einsum("ii->i", curvature)
        diagonal[fixed:] = self.free.ravel() / STRAIN**2
        if n > 1:
            for i, length in enumerate(self.lengths):
                lacking = data.shortest - length
                if lacking > 0:
                    row = np.zeros(size)
                    row[5 + i] = -1.0 if i > 0 else 0.0
                    row[6 + i] = 1.0 if i < n - 1 else 0.0
                    cost += (lacking / data.slack) ** 2
                    gradient += row * lacking / data.slack**2
                    curvature += np.outer(row, row) / data.slack**2
        return cost, gradient, curvature

    @property
    def sound(self) -> bool:
        """Whether joints are in order and feet about where their points are along the curve."""
        off = np.ptp(self.feet - self.data.places)
        return bool((np.diff(self.rod.joints) > 1.0).all() and off < max(ASTRAY * self.data.length, 20.0))

    @property
    def kinds(self) -> list[str]:
        """Of the pieces, by which strains are free."""
        return [KINDS[bool(a), bool(b)] for a, b in self.free]

    @property
    def lengths(self) -> np.ndarray:
        """(n,) of the pieces, from the first foot to the last one, mm."""
        return np.diff(np.concatenate([[self.feet.min()], self.rod.joints, [self.feet.max()]]))

    @property
    def most(self) -> np.ndarray | float:
        """(n, 2) of the strains' largest magnitudes that can be reached."""
        reach = self.data.reach
        return np.array([reach.get(kind, (np.inf, np.inf)) for kind in self.kinds]) if reach else np.inf

    @cached_property
    def held(self) -> np.ndarray:
        """Places, among the free parameters, of strains on the limit of their reach that the points would
        move further."""
        if not self.data.reach:
            return np.zeros(0, int)
        gradient = np.zeros(self.free.size)
        gradient[np.flatnonzero(self.free)] = self.normal[1][5 + len(self.free) :]
        strains = self.rod.strains
        on = (abs(strains) >= self.most) & (gradient.reshape(strains.shape) * strains >= 0)
        return 5 + len(self.free) + np.flatnonzero(on[self.free])

    @cached_property
    def cost(self) -> float:
        """What is minimised: squares over the noise's, prior and penalties."""
        cost = self.square / self.data.noise**2 + self.bounds[0]
        if self.data.base is not None:
            cost += float(np.sum(self._base_turn**2)) / self.data.noise**2
        return cost

    @cached_property
    def _base_turn(self):
        """By what the section frame at the first point misses the base, in mm at a lever's length."""
        return self.data.lever * se3.log_rotation(self.station.frames[0].T @ self.data.base)

    @cached_property
    def slopes(self) -> np.ndarray:
        """(m, 1 + 2 or 5, p) of the feet along the tangent, then of what is fitted, by all parameters."""
        return self.slopes_of(self.rod, self.station)

    def slopes_of(self, rod: PiecewiseRod, station: Station) -> np.ndarray:
        """The same for a rod that is this one but for cuts."""
        moved, turned = rod.slopes(station)
        if self.data.frames is not None:
            moved = np.concatenate([moved, self._turned(moved, turned, station, rod)], axis=1)
        return moved if self.data.weights is None else moved * self._roots[:, :, None]

    def _turned(self, moved, turned, station, rod):
        """Slopes of the turns of section frames, whose feet slide as points move along, at a lever's
        length."""
        k = np.zeros((len(station.s), 3))
        k[:, :2] = rod.strains[station.piece]
        return self.data.lever * (turned - k[:, :, None] * moved[:, :1])

    @cached_property
    def normal(self) -> tuple[np.ndarray, np.ndarray]:
        """(curvature (q, q), gradient (q,)) of half the cost by the free parameters, Gauss and Newton's."""
        columns, weight = self.columns, 1 / self.data.noise**2
        rows = self.slopes[:, 1:, columns].reshape(-1, len(columns))
        curvature = weight * (rows.T @ rows)
        gradient = weight * (rows.T @ self.misfit.ravel())
        if self.data.base is not None:
            station = self.rod.at(self.feet[:1])
            turn = self._turned(*self.rod.slopes(station), station, self.rod)[0][:, columns]
            curvature += weight * (turn.T @ turn)
            gradient += weight * (turn.T @ self._base_turn)
        _, more_gradient, more_curvature = self.bounds
        curvature += more_curvature[np.ix_(columns, columns)]
        curvature += np.diag(self._vague)
        return curvature, gradient + more_gradient[columns]

    @property
    def _vague(self):
        """Curvature of the priors of start and joints, as wide as everything: it counts where no point does,
        as along the rod's own sliding."""
        wide = 2 * np.pi / self.data.length**2
        vague = np.zeros(len(self.columns))
        vague[:3], vague[3 : 5 + len(self.free)] = 2 * np.pi / np.pi**2, wide
        return vague

    @cached_property
    def covariance(self) -> np.ndarray:
        """(q, q) of the free parameters."""
        return np.linalg.inv(self.normal[0])

    @cached_property
    def criterion(self) -> float:
        """-2 log of the evidence by Laplace's method, but for what all splits share: smaller is better.

        Strains are normally distributed around 0 before any point is seen, joints evenly along the curve, and
        each further piece is e^(PIECE / 2) times less likely.
        """
        joints = len(self.free) - 1
        _, size = np.linalg.slogdet(self.normal[0])
        strains = int(self.free.sum()) * 2 * np.log(STRAIN)
        places = joints * self.data.joint_price - 2 * lgamma(joints + 1)
        return float(self.cost + size + strains + places)

    def stepped(self, step: np.ndarray) -> "RodFit":
        """With the free parameters changed by `step` (q,) and the feet moved along."""
        n = len(self.free)
        full = np.zeros(5 + 3 * n)
        full[self.columns] = step
        start = self.rod.start.copy()
        start[:3, :3] = se3.exp_rotation(full[:3]) @ start[:3, :3]
        start[:3, 3] += full[3:6]
        strains = np.clip(self.rod.strains + full[5 + n :].reshape(n, 2), -self.most, self.most)
        rod = PiecewiseRod(start, self.rod.joints + full[6 : 5 + n], strains)
        slide = self.away[:, 0] - self.slopes[:, 0, self.columns] @ step
        return RodFit(self.data, rod, self.free, self.feet + slide)

    def within_reach(self) -> "RodFit":
        """With strains that can be reached."""
        if not self.data.reach:
            return self
        strains = np.clip(self.rod.strains, -self.most, self.most)
        return RodFit(self.data, PiecewiseRod(self.rod.start, self.rod.joints, strains), self.free, self.feet)

    def settled(self) -> "RodFit":
        """With the feet slid to where they belong."""
        return RodFit(self.data, self.rod, self.free, self.feet + self.away[:, 0])


def capped(step: np.ndarray, joints: int) -> np.ndarray:
    """A step (q,) shortened to the largest one that the linear model is good for."""
    sizes = (
        np.linalg.norm(step[:3]) / CAPS[0],
        np.linalg.norm(step[3:6]) / CAPS[1],
        abs(step[6 : 6 + joints]).max(initial=0.0) / CAPS[1],
        abs(step[6 + joints :]).max(initial=0.0) / CAPS[2],
    )
    return step / max(1.0, *sizes)


def refined(fit: RodFit, steps: int = 30, enough: float = 0.02) -> RodFit:
    """The local optimum, by Levenberg and Marquardt's steps until one gains less than `enough`."""
    damping = 1e-3
    fit = fit.within_reach()
    for _ in range(steps):
        curvature, gradient = fit.normal
        if len(fit.held):
            curvature, gradient = curvature.copy(), gradient.copy()
            curvature[fit.held], curvature[:, fit.held], gradient[fit.held] = 0.0, 0.0, 0.0
            curvature[fit.held, fit.held] = 1.0
        diagonal = np.diag(curvature)
        while True:
            step = np.linalg.solve(curvature + np.diag(damping * diagonal), gradient)
            step = capped(step, len(fit.free) - 1)
            trial = fit.stepped(step)
            if trial.sound and abs(trial.away[:, 0]).max() > 0.2:
                trial = trial.settled()
            gain = fit.cost - trial.cost if trial.sound else -np.inf
            fit.data.effort.steps += 1
            if gain > 0:
                break
            if damping > 1e3 or -gain < enough:
                return fit
            damping *= 10
        fit = trial
        damping = max(1e-6, damping / 10)
        if gain < enough:
            break
    return fit
