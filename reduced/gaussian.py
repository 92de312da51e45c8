"""Gaussian processes: smooth functions of several inputs from few points, with their uncertainty.

Prior of each output, in units of its own variance: k(x, x') = exp(-|(x - x')/scales|^2 / 2) + TREND (1 + x.x'), a smooth function
and a plane whose coefficients are hardly restricted; and noise on the observations. Scales and noise are shared by the outputs
and maximise the likelihood, with each output's variance profiled out (Rasmussen & Williams 2006, ch. 2 and 5). Many observations
are summed up on `inducing` points of their own (deterministic training conditional, ch. 8.3), exactly when all of them are taken.
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


@dataclass(frozen=True)
class GaussianProcess:
    """Means of p outputs at inputs of d numbers, which are shifted by `shift` and divided by `width` first.

    scales (d,): of the kernel, in those units; points (m, d): in units of the scales too; weights (m + 1 + d, p): of the kernels
    at the points, the constant and the slopes. root (m + 1 + d, same): triangular factor for the deviation, as if every
    output were as noisy as the first; variance (p,): each output's prior variance.
    """

    shift: np.ndarray
    width: np.ndarray
    scales: np.ndarray
    points: np.ndarray
    weights: np.ndarray
    root: np.ndarray
    variance: np.ndarray
    noise: float

    @cached_property
    def _kernel_root(self):
        return cholesky(_kernel(self.points, self.points) + JITTER * np.eye(len(self.points)), lower=True)

    def __call__(self, x, derivative=False):
        """(n, p) at inputs (n, d); with `derivative` also (n, p, d)."""
        z = (x - self.shift) / self.width
        a, m = z / self.scales, len(self.points)
        kernel, (smooth, constant, slopes) = _kernel(a, self.points), np.split(self.weights, [m, m + 1])
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
        known = self.noise * (solve_triangular(self.root, basis.T, trans="T") ** 2).sum(axis=0)
        return np.sqrt((known + np.maximum(missed, 0))[:, None] * self.variance)


def _kernel(a, b):
    squares = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    return np.exp(-0.5 * np.maximum(squares, 0))


def fit(x, y, trust=None, most=500, inducing=1000, seed=0, like=None):
    """The GaussianProcess through y (n, p) at x (n, d); `like`: another one whose scales and noise are taken as they are.

    trust (n, p): an observation's noise is the common one over its trust, for outputs that are quotients by something small.
    Scales are found on at most `most` of the observations.
    """
    trust = np.ones(y.shape) if trust is None else trust
    shift, width = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-12)
    z, order = (x - shift) / width, np.random.default_rng(seed).permutation(len(x))
    if like is not None:
        shift, width = like.shift, like.width
        return _condition((x - shift) / width, y, trust, _alike(trust), order[:inducing], shift, width, like.scales, like.noise)
    some = order[:most]
    groups = _alike(trust)
    data = [(y[np.ix_(some, g)], trust[some, g[0]]) for g in groups]
    centred = [(v - (t[:, None] ** 2 * v).sum(axis=0) / (t**2).sum(), t**-2) for v, t in data]
    found = minimize(
        _misfit,
        np.append(np.full(z.shape[1], np.log(3.0)), np.log(1e-4)),
        (z[some], centred),
        jac=True,
        method="L-BFGS-B",
        bounds=[LOG_SCALE] * z.shape[1] + [LOG_NOISE],
        options={"maxiter": 100},
    )
    scales, noise = np.exp(found.x[:-1]), float(np.exp(found.x[-1]))
    return _condition(z, y, trust, groups, order[:inducing], shift, width, scales, noise)


def _alike(trust):
    """Columns of equal trust, as lists."""
    groups = {}
    for j, column in enumerate(trust.T):
        groups.setdefault(column.tobytes(), []).append(j)
    return list(groups.values())


def _condition(z, y, trust, groups, chosen, shift, width, scales, noise):
    points, (d, p) = z[chosen] / scales, (z.shape[1], y.shape[1])
    m = len(points)
    basis = np.hstack([_kernel(z / scales, points), np.ones((len(z), 1)), z])
    kernel_root = cholesky(_kernel(points, points) + JITTER * np.eye(m), lower=True)
    prior = np.zeros((m + 1 + d, m + 1 + d))
    prior[:m, :m], prior[m:, m:] = kernel_root.T, np.eye(1 + d) / np.sqrt(TREND)
    weights, variance, roots = np.zeros((m + 1 + d, p)), np.zeros(p), []
    for group in groups:
        t = trust[:, group[0]][:, None]
        shifted = (t**2 * y[:, group]).sum(axis=0) / (t**2).sum()
        q, r = qr(np.vstack([t * basis, np.sqrt(noise) * prior]), mode="economic")
        right = t * (y[:, group] - shifted)
        w = solve_triangular(r, q[: len(z)].T @ right)
        misfit = ((right - t * (basis @ w)) ** 2).sum(axis=0) / noise + ((prior @ w) ** 2).sum(axis=0)
        variance[group] = misfit / len(z)
        w[m] += shifted
        weights[:, group] = w
        roots.append(r)
    return GaussianProcess(shift, width, scales, points, weights, roots[0], variance, noise)


def _misfit(log, z, data):
    """Minus the log likelihood, each output's variance profiled out, and its gradient by the logarithms of scales and noise."""
    n, scales, noise = len(z), np.exp(log[:-1]), np.exp(log[-1])
    a = z / scales
    kernel = _kernel(a, a)
    prior = kernel + TREND * (1 + z @ z.T)
    value, outer_sum, by_noise = 0.0, np.zeros((n, n)), 0.0
    for y, doubt in data:
        p = y.shape[1]
        try:
            factor = cho_factor(prior + np.diag(noise * doubt), lower=True)
        except np.linalg.LinAlgError:
            return 1e10, np.zeros(len(log))
        weights = cho_solve(factor, y)
        variance = (y * weights).sum(axis=0) / n
        value += n / 2 * np.log(variance).sum() + p * np.log(np.diag(factor[0])).sum()
        outer = p / 2 * cho_solve(factor, np.eye(n)) - (weights / variance) @ weights.T / 2
        outer_sum += outer
        by_noise += noise * np.diag(outer) @ doubt
    s = outer_sum * kernel
    by_scale = 2 * (s.sum(axis=1) @ a**2 - (a * (s @ a)).sum(axis=0))
    return value, np.append(by_scale, by_noise)
