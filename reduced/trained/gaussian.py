"""Gaussian processes: smooth functions of several inputs from few points, with their uncertainty.

Prior of each output, in units of its own variance: k(x, x') = exp(-|(x - x') M|^2 / 2) + TREND (1 + x.x'), a
smooth function and a plane whose coefficients are hardly restricted, the metric M a scale for each input and
directions that mix them. Many observations are summed up on `inducing` points (deterministic training
conditional, Rasmussen & Williams 2006, ch. 8.3), exactly when all observations are among them and there are
no slopes. Fitted by reduced.training.regression.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import blas, cholesky, qr

#: prior variance of the plane's coefficients over that of the smooth function
TREND = 100.0
JITTER = 1e-9
#: evaluated at once: what fits into a core's cache; summed up at once: what fits into a small machine's
#: memory
ROWS, MANY_ROWS = 256, 4096


@dataclass(frozen=True)
class GaussianProcess:
    """Means of p outputs at inputs of d numbers, which are shifted by `shift` and divided by `width` first.

    inducing (m, d), observed (n, d): inducing points and inputs of the observations in those units; group
    (n,), trust (n,): of the fit, of the first output; at (r,), ways (r, d): of the Slopes, in those units and
    of length 1. metric (d, e): the kernel's distances are those of inputs times it; weights (m + 1 + d, p):
    of the kernels at the inducing points, the constant and the slopes; variance (p,): each output's prior
    variance; noises: over that.
    """

    shift: np.ndarray
    width: np.ndarray
    inducing: np.ndarray
    observed: np.ndarray
    group: np.ndarray
    trust: np.ndarray
    at: np.ndarray
    ways: np.ndarray
    metric: np.ndarray
    weights: np.ndarray
    variance: np.ndarray
    noise: float
    common_noise: float
    slope_noise: float

    @cached_property
    def _square_metric(self):
        """(d, d): the same distances as the metric's, in as few numbers as can be."""
        return qr(self.metric.T, mode="r")[0][: len(self.metric)].T

    @cached_property
    def points(self) -> np.ndarray:
        """(m, d) inducing points, where distances are the kernel's."""
        return self.inducing @ self._square_metric

    @cached_property
    def to_kernel(self) -> np.ndarray:
        """(d, d): inputs less `shift` times it are where distances are the kernel's."""
        return self._square_metric / self.width[:, None]

    @cached_property
    def plane(self) -> np.ndarray:
        """(d, p): the plane's slopes by the inputs."""
        return self.weights[len(self.points) + 1 :] / self.width[:, None]

    @cached_property
    def _affine(self):
        """What `linear` gives at `shift` (d + 2 + p,), how it grows from there (d, d + 2 + p), and what its
        squares are times (d,)."""
        d, constant = len(self.to_kernel), self.weights[len(self.points)]
        slopes = np.hstack([self.to_kernel, np.zeros((d, 2)), self.plane])
        return np.concatenate([np.zeros(d), [1.0, 0.0], constant]), slopes, np.full(d, -0.5)

    @cached_property
    def _columns(self):
        return columns_of(self.points)

    @cached_property
    def _weighed_points(self):
        m = len(self.points)
        return (self.weights[:m, :, None] * self.points[:, None, :]).reshape(m, -1)

    def linear(self, x: np.ndarray) -> np.ndarray:
        """(n, d + 2 + p) of inputs x (n, d), side by side: those where distances are the kernel's, a (n, d);
        1; -|a|^2/2; the plane."""
        at_shift, slopes, halves = self._affine
        # dot: for a few rows it takes a third of the time of @
        out, d = (x - self.shift).dot(slopes), len(slopes)
        out += at_shift
        out[:, d + 1] = (out[:, :d] ** 2).dot(halves)
        return out

    def kernels(self, linear: np.ndarray) -> np.ndarray:
        """(n, m) at the inducing points, of what `linear` gives."""
        return kernels_at(linear, self._columns)

    @cached_property
    def _kernel_root(self):
        return kernel_root(self.points)

    def _in_prior(self, rows):
        """(m + 1 + d, n) of rows (n, m + 1 + d) as `value_rows` gives them, by weights in units of their
        prior's deviation."""
        m = len(self.points)
        smooth = solved(self._kernel_root, rows[:, :m].T)
        return np.asfortranarray(np.vstack([smooth, np.sqrt(TREND) * rows[:, m:].T]))

    @cached_property
    def _root(self):
        """(m + 1 + d, same) lower factor of what observations, slopes and prior say of the weights
        `_in_prior`, times the noise, as if every output were as noisy as the first: found when asked for,
        since it is ten times the size of all the rest. In these units sums of squares are exact enough
        (measured: to 1e-8, in an eighth of the memory that a QR of all rows takes)."""
        spots, metric, trust = self.inducing, self._square_metric, self.trust.astype(float)
        values = self._in_prior(value_rows(self.observed, spots, metric)).T
        values = whitener(self.group, self.common_noise / self.noise)(trust[:, None] * values)
        total = self.noise * np.eye(len(self.weights)) + values.T @ values
        for start in range(0, len(self.at), MANY_ROWS):
            at, ways = (a[start : start + MANY_ROWS] for a in (self.at, self.ways))
            slopes = self._in_prior(slope_rows(self.observed[at], ways, spots, metric)) * trust[at]
            total += self.noise / self.slope_noise * (slopes @ slopes.T)
        return cholesky(total, lower=True)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """(n, p) at inputs (n, d)."""
        if len(x) > ROWS:
            return np.concatenate([self(x[i : i + ROWS]) for i in range(0, len(x), ROWS)])
        linear = self.linear(x)
        curved = self.kernels(linear).dot(self.weights[: len(self.points)])
        return curved + linear[:, len(self.to_kernel) + 2 :]

    def with_slopes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(the same, derivatives by the inputs (n, p, d))."""
        if len(x) > ROWS:
            means, slopes = zip(*(self.with_slopes(x[i : i + ROWS]) for i in range(0, len(x), ROWS)))
            return np.concatenate(means), np.concatenate(slopes)
        linear, d = self.linear(x), len(self.to_kernel)
        kernels = self.kernels(linear)
        curved = kernels.dot(self.weights[: len(self.points)])
        # d k(a, b)/d a = k (b - a)
        first = kernels @ self._weighed_points
        slope = first.reshape(len(x), curved.shape[1], -1) - curved[:, :, None] * linear[:, None, :d]
        return curved + linear[:, d + 2 :], slope @ self.to_kernel.T + self.plane.T

    def deviation(self, x: np.ndarray) -> np.ndarray:
        """(n, p) standard deviation of the outputs, without noise; on the first call some ten seconds for the
        root of all observations."""
        _, explained, known = self._unknown(x)
        missed = np.maximum(1 - (explained**2).sum(axis=0), 0)
        return np.sqrt((self.noise * (known**2).sum(axis=0) + missed)[:, None] * self.variance)

    def covariance(self, x: np.ndarray) -> np.ndarray:
        """(n, n) covariance of an output at inputs (n, d) over its prior variance, without noise."""
        a, explained, known = self._unknown(x)
        return kernel(a, a) - explained.T @ explained + self.noise * known.T @ known

    def _unknown(self, x):
        """Inputs where distances are the kernel's, and roots (., n): of the prior that inducing points
        explain, of what is left there."""
        z = (x - self.shift) / self.width
        rows = self._in_prior(value_rows(z, self.inducing, self._square_metric))
        known = solved(self._root, rows)
        return z @ self._square_metric, rows[: len(self.points)], known


def columns_of(b: np.ndarray) -> np.ndarray:
    """(e + 2, m) of points b (m, e): their product with a, 1, -|a|^2/2 side by side (n, e + 2) is -|a -
    b|^2/2."""
    # contiguous by rows: a product of two rows with it takes a third of the time that it takes by columns
    return np.ascontiguousarray(np.vstack([b.T, (b * b).sum(axis=1) / -2, np.ones(len(b))]))


def kernels_at(linear: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(n, m) kernels at points of which `columns` (e + 2, m) tell, of what GaussianProcess.linear gives."""
    k = linear[:, : len(columns)].dot(columns)
    return np.exp(k, out=k)


def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n, m) exp(-|a - b|^2/2) of points (n, e) and (m, e)."""
    k = np.column_stack([a, np.ones(len(a)), (a * a).sum(axis=1) / -2]) @ columns_of(b)
    return np.exp(k, out=k)


def kernel_root(points: np.ndarray) -> np.ndarray:
    """(m, m) lower factor of the kernels among points (m, e)."""
    return cholesky(kernel(points, points) + JITTER * np.eye(len(points)), lower=True)


def solved(root: np.ndarray, columns: np.ndarray, transposed: bool = False) -> np.ndarray:
    """(m, n) root^-1 columns, or root^-T columns, of a lower root (m, m). In Fortran's order both, else they
    are copied first. (Measured: for one column of 1,600 BLAS's own routine takes 0.12 ms where
    scipy.linalg.solve_triangular takes 1.7.)"""
    if columns.shape[1] == 1:
        return blas.dtrsv(root, columns[:, 0], lower=1, trans=int(transposed))[:, None]
    return blas.dtrsm(1.0, root, columns, lower=1, trans_a=int(transposed))


def value_rows(z: np.ndarray, spots: np.ndarray, metric: np.ndarray) -> np.ndarray:
    """(n, m + 1 + d) at z (n, d): kernels at spots (m, d), constant and plane."""
    return np.hstack([kernel(z @ metric, spots @ metric), np.ones((len(z), 1)), z])


def slope_rows(z: np.ndarray, ways: np.ndarray, spots: np.ndarray, metric: np.ndarray) -> np.ndarray:
    """(r, m + 1 + d) their derivatives along ways (r, d) at z (r, d)."""
    a, t, points = z @ metric, ways @ metric, spots @ metric
    # d k(a, b)/d a = k (b - a)
    along = kernel(a, points) * (t @ points.T - (t * a).sum(axis=1)[:, None])
    return np.hstack([along, np.zeros((len(z), 1)), ways])


def whitener(group: np.ndarray, ratio: float) -> Callable[[np.ndarray], np.ndarray]:
    """(n, p) -> (n, p): times the inverse root of I + ratio (1 where rows are of one group)."""
    _, index, count = np.unique(group, return_inverse=True, return_counts=True)
    part = 1 - 1 / np.sqrt(1 + ratio * count)

    def white(a):
        sums = np.zeros((len(count), a.shape[1]))
        np.add.at(sums, index, a)
        return a - (part / count)[index, None] * sums[index]

    return white
