"""Gaussian processes: smooth functions of several inputs from few points, with their uncertainty.

Prior of each output, in units of its own variance: k(x, x') = exp(-|(x - x')/scales|^2 / 2) + TREND (1 + t(x).t(x')) with
trend functions t of the inputs, whose coefficients are hardly restricted, and noise on the observations. Scales and noise are
shared by all outputs and maximise the likelihood (Rasmussen & Williams 2006, ch. 2 and 5), its variance profiled out.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

#: prior variance of the trend's coefficients over that of the rest
TREND = 100.0
LOG_NOISE = (np.log(1e-6), np.log(1e-1))
LOG_SCALE = (np.log(0.3), np.log(100.0))


@dataclass(frozen=True)
class GaussianProcess:
    """Means of p outputs at inputs of d numbers: `weights` on `points` (n, d), inputs shifted and scaled by `shift` and `width`.

    scales (d,): lengths of the kernel in scaled inputs; trend (d + 1, p): constant and slopes; factor: Cholesky factor of
    the observations' covariance; variance (p,) of each output's prior.
    """

    shift: np.ndarray
    width: np.ndarray
    scales: np.ndarray
    points: np.ndarray
    weights: np.ndarray
    trend: np.ndarray
    factor: np.ndarray
    variance: np.ndarray
    noise: float

    def __call__(self, x, derivative=False):
        """(m, p) at inputs (m, d); with `derivative` also (m, p, d)."""
        z = (x - self.shift) / self.width
        a = z / self.scales
        kernel = _kernel(a, self.points)
        mean = kernel @ self.weights + self.trend[0] + z @ self.trend[1:]
        if not derivative:
            return mean
        n, p = self.weights.shape
        # d k(a, b)/d a = k (b - a)
        first = kernel @ (self.weights[:, :, None] * self.points[:, None, :]).reshape(n, -1)
        slope = first.reshape(len(x), p, -1) - (mean - self.trend[0] - z @ self.trend[1:])[:, :, None] * a[:, None, :]
        return mean, (slope / self.scales + self.trend[1:].T) / self.width

    def deviation(self, x):
        """(m, p) standard deviation of the outputs without noise."""
        z = (x - self.shift) / self.width
        mixed = _kernel(z / self.scales, self.points) + TREND * (1 + z @ (self.points * self.scales).T)
        reduction = solve_triangular(self.factor, mixed.T, lower=True)
        own = 1 + TREND * (1 + (z**2).sum(axis=1))
        return np.sqrt(np.maximum(own - (reduction**2).sum(axis=0), 1e-12))[:, None] * np.sqrt(self.variance)


def _kernel(a, b):
    squares = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    return np.exp(-0.5 * np.maximum(squares, 0))


def fit(x, y, trust=None, most=600, seed=0):
    """The GaussianProcess through y (n, p) at x (n, d). Its scales are found on at most `most` of the points.

    trust (n,): the observations' noise is the noise over trust squared, for outputs that are quotients by something small.
    """
    trust = np.ones(len(x)) if trust is None else trust
    shift, width = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-12)
    z = (x - shift) / width
    chosen = np.random.default_rng(seed).permutation(len(z))[:most] if len(z) > most else np.arange(len(z))
    begin = np.append(np.full(z.shape[1], np.log(3.0)), np.log(1e-4))
    found = minimize(
        _misfit,
        begin,
        (z[chosen], y[chosen] - y[chosen].mean(axis=0), trust[chosen] ** -2),
        jac=True,
        method="L-BFGS-B",
        bounds=[LOG_SCALE] * z.shape[1] + [LOG_NOISE],
        options={"maxiter": 150},
    )
    scales, noise = np.exp(found.x[:-1]), float(np.exp(found.x[-1]))
    return condition(x, y, trust, shift, width, scales, noise)


def condition(x, y, trust, shift, width, scales, noise):
    """The GaussianProcess with given scales through y (n, p) at x (n, d)."""
    z = (x - shift) / width
    mean = y.mean(axis=0)
    covariance = _kernel(z / scales, z / scales) + TREND * (1 + z @ z.T) + noise * np.diag(trust**-2)
    factor = cholesky(covariance, lower=True)
    weights = cho_solve((factor, True), y - mean)
    variance = ((y - mean) * weights).sum(axis=0) / len(z)
    trend = TREND * np.vstack([weights.sum(axis=0), z.T @ weights])
    trend[0] += mean
    return GaussianProcess(shift, width, scales, z / scales, weights, trend, factor, variance, noise)


def _misfit(log, z, y, doubt):
    """Minus the log likelihood, each output's variance profiled out, and its gradient by the logarithms of scales and noise."""
    n, p = y.shape
    scales, noise = np.exp(log[:-1]), np.exp(log[-1])
    a = z / scales
    kernel = _kernel(a, a)
    try:
        factor = cho_factor(kernel + TREND * (1 + z @ z.T) + noise * np.diag(doubt), lower=True)
    except np.linalg.LinAlgError:
        return 1e10, np.zeros(len(log))
    weights = cho_solve(factor, y)
    variance = (y * weights).sum(axis=0) / n
    value = n / 2 * np.log(variance).sum() + p * np.log(np.diag(factor[0])).sum()
    inverse = cho_solve(factor, np.eye(n))
    outer = p / 2 * inverse - (weights / variance) @ weights.T / 2
    s = outer * kernel
    rows = s.sum(axis=1)
    by_scale = 2 * (rows @ a**2 - (a * (s @ a)).sum(axis=0))
    return value, np.append(by_scale, noise * np.diag(outer) @ doubt)
