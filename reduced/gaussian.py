"""Gaussian processes: smooth functions of several inputs from few points, with their uncertainty.

Prior of each output, in units of its own variance: k(x, x') = exp(-|(x - x')/scales|^2 / 2) + TREND (1 + x.x'), a smooth function
and a plane whose coefficients are hardly restricted; noise on the observations, and noise that those of a group (the states of one
mesh) have in common. Scales and noises are shared by the outputs and maximise the likelihood, with each output's variance profiled
out (Rasmussen & Williams 2006, ch. 2 and 5). Many observations are summed up on `inducing` points of their own (deterministic
training conditional, ch. 8.3), exactly when all of them are taken.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, qr, solve_triangular
from scipy.optimize import minimize

#: prior variance of the plane's coefficients over that of the smooth function
TREND = 100.0
LOG_NOISE = (np.log(1e-6), np.log(1e-1))
LOG_SCALE = (np.log(0.3), np.log(100.0))
JITTER = 1e-9
#: evaluated at once: what fits into a core's cache
ROWS = 256


@dataclass(frozen=True)
class GaussianProcess:
    """Means of p outputs at inputs of d numbers, which are shifted by `shift` and divided by `width` first.

    observed (n, d): inputs of the observations in those units, the `inducing` (m) first; group (n,), trust (n,): of `fit`, of the
    first output. scales (d,): of the kernel, in those units too; weights (m + 1 + d, p): of the kernels at the inducing points, the
    constant and the slopes; variance (p,): each output's prior variance.
    """

    shift: np.ndarray
    width: np.ndarray
    observed: np.ndarray
    group: np.ndarray
    inducing: int
    trust: np.ndarray
    scales: np.ndarray
    weights: np.ndarray
    variance: np.ndarray
    noise: float
    common_noise: float

    @cached_property
    def points(self):
        """(m, d) inducing points in units of the scales."""
        return self.observed[: self.inducing] / self.scales

    @cached_property
    def _root(self):
        """(m + 1 + d, same) triangular factor for the deviation, as if every output were as noisy as the first: found when asked for,
        since it is ten times the size of all the rest."""
        system = _System(self.observed, self.group, self.inducing, self.scales, self.noise, self.common_noise)
        return qr(system.rows(self.trust[:, None]), mode="r")[0][: len(self.weights)]

    @cached_property
    def _kernel_root(self):
        return cholesky(_kernel(self.points, self.points) + JITTER * np.eye(len(self.points)), lower=True)

    def __call__(self, x, derivative=False):
        """(n, p) at inputs (n, d); with `derivative` also (n, p, d)."""
        if len(x) > ROWS:
            parts = [self(x[i : i + ROWS], derivative) for i in range(0, len(x), ROWS)]
            return tuple(map(np.concatenate, zip(*parts))) if derivative else np.concatenate(parts)
        z = (x - self.shift) / self.width
        a, m = z / self.scales, len(self.points)
        smooth, constant, slopes = self.weights[:m], self.weights[m], self.weights[m + 1 :]
        kernel = _kernel(a, self.points)
        curved = kernel @ smooth
        mean = curved + constant + z @ slopes
        if not derivative:
            return mean
        # d k(a, b)/d a = k (b - a)
        p = smooth.shape[1]
        first = kernel @ (smooth[:, :, None] * self.points[:, None, :]).reshape(m, -1)
        slope = first.reshape(len(x), p, -1) - curved[:, :, None] * a[:, None, :]
        return mean, (slope / self.scales + slopes.T) / self.width

    def deviation(self, x):
        """(n, p) standard deviation of the outputs, without noise."""
        z = (x - self.shift) / self.width
        kernel = _kernel(z / self.scales, self.points)
        basis = np.hstack([kernel, np.ones((len(x), 1)), z])
        missed = 1 - (solve_triangular(self._kernel_root, kernel.T, lower=True) ** 2).sum(axis=0)
        known = self.noise * (solve_triangular(self._root, basis.T, trans="T") ** 2).sum(axis=0)
        return np.sqrt((known + np.maximum(missed, 0))[:, None] * self.variance)


@dataclass(frozen=True)
class SideBySide:
    """Gaussian processes of consecutive outputs, each with scales and noise of its own, as one."""

    processes: tuple

    def __call__(self, x, derivative=False):
        found = [process(x, derivative) for process in self.processes]
        if not derivative:
            return np.concatenate(found, axis=1)
        return tuple(np.concatenate(part, axis=1) for part in zip(*found))

    def deviation(self, x):
        return np.concatenate([process.deviation(x) for process in self.processes], axis=1)


def fit_side_by_side(x, y, group, trust, widths, like=None):
    """SideBySide processes of `widths` outputs each; the rest as for `fit`."""
    ends = np.cumsum([0, *widths])
    likes = like.processes if like else [None] * len(widths)
    return SideBySide(tuple(fit(x, y[:, a:b], group, trust[:, a:b], like=known) for a, b, known in zip(ends, ends[1:], likes)))


def _kernel(a, b):
    k = a @ b.T
    k -= (a * a).sum(axis=1)[:, None] / 2
    k -= (b * b).sum(axis=1) / 2
    return np.exp(np.minimum(k, 0, out=k), out=k)


def fit(x, y, group, trust=None, most=500, inducing=1000, seed=0, like=None):
    """The GaussianProcess through y (n, p) at x (n, d); `like`: another one whose scales and noise are taken as they are.

    group (n,): equal where noise is common. trust (n, p), the same within a group: what noises are divided by, for outputs that
    are quotients by something small.
    Scales are found on at most `most` of the observations.
    """
    trust = np.ones(y.shape) if trust is None else trust
    shift, width = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-12)
    z, order = (x - shift) / width, np.random.default_rng(seed).permutation(len(x))
    if like is not None:
        shift, width = like.shift, like.width
        found = like.scales, like.noise, like.common_noise
        return _condition((x - shift) / width, y, group, trust, order, inducing, shift, width, *found)
    some = order[:most]
    data = [(y[np.ix_(some, g)], trust[some, g[0]]) for g in _alike(trust)]
    centred = [(v - (t[:, None] ** 2 * v).sum(axis=0) / (t**2).sum(), 1 / t) for v, t in data]
    same = group[some][:, None] == group[some]
    found = minimize(
        _misfit,
        np.append(np.full(z.shape[1], np.log(3.0)), np.log([1e-4, 1e-4])),
        (z[some], centred, same),
        jac=True,
        method="L-BFGS-B",
        bounds=[LOG_SCALE] * z.shape[1] + [LOG_NOISE] * 2,
        options={"maxiter": 100},
    )
    return _condition(z, y, group, trust, order, inducing, shift, width, np.exp(found.x[:-2]), *np.exp(found.x[-2:]).tolist())


def _alike(trust):
    """Columns of equal trust, as lists."""
    groups = {}
    for j, column in enumerate(trust.T):
        groups.setdefault(column.tobytes(), []).append(j)
    return list(groups.values())


class _System:
    """Least-squares rows of observations at z (n, d), the first m of which are the inducing points, and of the prior."""

    def __init__(self, z, group, m, scales, noise, common_noise):
        points, d = z[:m] / scales, z.shape[1]
        kernel_root = cholesky(_kernel(points, points) + JITTER * np.eye(len(points)), lower=True)
        self.basis = np.hstack([_kernel(z / scales, points), np.ones((len(z), 1)), z])
        self.prior = np.zeros((self.basis.shape[1],) * 2)
        self.prior[: len(points), : len(points)], self.prior[len(points) :, len(points) :] = kernel_root.T, np.eye(1 + d) / np.sqrt(TREND)
        self.white, self._noise = _whitener(group, common_noise / noise), noise

    def rows(self, trust):
        """(n + m + 1 + d, m + 1 + d) for observations of this trust (n, 1)."""
        return np.vstack([self.white(trust * self.basis), np.sqrt(self._noise) * self.prior])


def _condition(z, y, group, trust, order, inducing, shift, width, scales, noise, common_noise):
    z, y, group, trust, m = z[order], y[order], group[order], trust[order], min(inducing, len(z))
    system = _System(z, group, m, scales, noise, common_noise)
    weights, variance = np.zeros((system.basis.shape[1], y.shape[1])), np.zeros(y.shape[1])
    for columns in _alike(trust):
        t = trust[:, columns[0]][:, None]
        shifted = (t**2 * y[:, columns]).sum(axis=0) / (t**2).sum()
        right = system.white(t * (y[:, columns] - shifted))
        q, r = qr(system.rows(t), mode="economic")
        w = solve_triangular(r, q[: len(z)].T @ right)
        missed = right - system.white(t * system.basis) @ w
        variance[columns] = ((missed**2).sum(axis=0) / noise + ((system.prior @ w) ** 2).sum(axis=0)) / len(z)
        w[m] += shifted
        weights[:, columns] = w
    return GaussianProcess(shift, width, z, group, m, trust[:, 0], scales, weights, variance, noise, common_noise)


def _whitener(group, ratio):
    """(n, p) -> (n, p): times the inverse root of I + ratio (1 where rows are of one group)."""
    _, index, count = np.unique(group, return_inverse=True, return_counts=True)
    part = 1 - 1 / np.sqrt(1 + ratio * count)

    def white(a):
        sums = np.zeros((len(count), a.shape[1]))
        np.add.at(sums, index, a)
        return a - (part / count)[index, None] * sums[index]

    return white


def _misfit(log, z, data, same):
    """Minus the log likelihood, each output's variance profiled out, and its gradient by the logarithms of scales and noises."""
    n, scales, noises = len(z), np.exp(log[:-2]), np.exp(log[-2:])
    a = z / scales
    kernel = _kernel(a, a)
    prior = kernel + TREND * (1 + z @ z.T)
    value, outer_sum, by_noise = 0.0, np.zeros((n, n)), np.zeros(2)
    for y, doubt in data:
        p = y.shape[1]
        noise = np.outer(doubt, doubt) * (noises[0] * np.eye(n) + noises[1] * same)
        try:
            factor = cho_factor(prior + noise, lower=True)
        except np.linalg.LinAlgError:
            return 1e10, np.zeros(len(log))
        weights = cho_solve(factor, y)
        variance = (y * weights).sum(axis=0) / n
        value += n / 2 * np.log(variance).sum() + p * np.log(np.diag(factor[0])).sum()
        outer = p / 2 * cho_solve(factor, np.eye(n)) - (weights / variance) @ weights.T / 2
        outer_sum += outer
        doubted = outer * np.outer(doubt, doubt)
        by_noise += noises * [np.trace(doubted), doubted[same].sum()]
    s = outer_sum * kernel
    by_scale = 2 * (s.sum(axis=1) @ a**2 - (a * (s @ a)).sum(axis=0))
    return value, np.append(by_scale, by_noise)
