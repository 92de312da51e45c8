"""Gaussian processes: smooth functions of several inputs from few points, with their uncertainty.

Prior of each output, in units of its own variance: k(x, x') = exp(-|(x - x') M|^2 / 2) + TREND (1 + x.x'), a
smooth function and a plane whose coefficients are hardly restricted, the metric M a scale for each input and
directions that mix them; noise on the observations, and noise that those of a group (the states of one mesh)
have in common. Slopes are observed too: directional derivatives, with a noise of their own. Metric and noises
are shared by the outputs and maximise the likelihood, with each output's variance profiled out (Rasmussen &
Williams 2006, ch. 2, 5 and 9.4). Many observations are summed up on `inducing` points (deterministic training
conditional, ch. 8.3), exactly when all observations are among them and there are no slopes.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag, cholesky, lapack, qr, solve_triangular
from scipy.optimize import minimize

#: prior variance of the plane's coefficients over that of the smooth function
TREND = 100.0
#: noises of observations, groups and slopes over the prior variance. What a mesh adds, measured by remeshing,
#: is about a percent of how designs differ: without that bound the likelihood may take for noise what designs
#: do near their limit loads
LOG_NOISES = tuple((np.log(1e-6), np.log(most)) for most in (1e-4, 1e-5, 1.0))
LOG_SCALE = (np.log(0.3), np.log(100.0))
JITTER = 1e-9
#: of an output, which may be constant
LEAST_VARIANCE = 1e-20
#: evaluated at once: what fits into a core's cache; summed up at once: what fits into a small machine's
#: memory
ROWS, MANY_ROWS = 256, 4096
#: where the likelihood starts from: scales; noise of observations, of groups, of slopes. It has several
#: maxima: the best one counts
STARTS = ((3.0, 1e-5, 1e-5, 1e-3), (6.0, 1e-4, 1e-6, 1e-2))
#: inducing points lie at observations and this far from them, in standard deviations of the inputs, along the
#: ways of their slopes
AWAY = 0.5
#: further directions of the metric beside the inputs themselves, where slopes tell them. (Measured: up to a
#: fifth off the error with slopes; from values alone they fit the chance of the sample, and the error of
#: designs not seen grows by up to a quarter.)
EXTRA = 2
#: steps towards the largest likelihood, from a start and from what another process has found
MOST_STEPS, MORE_STEPS = 100, 30
#: the likelihood takes a slope for a difference over this, in standard deviations of the inputs
NEAR = 1e-2


@dataclass(frozen=True)
class Slopes:
    """Derivatives of p outputs along `ways` (r, d), changes of the inputs, at the observations `at` (r,):
    values (r, p)."""

    at: np.ndarray
    ways: np.ndarray
    values: np.ndarray

    def of(self, chosen):
        return Slopes(self.at[chosen], self.ways[chosen], self.values[chosen])

    def columns(self, chosen):
        return Slopes(self.at, self.ways, self.values[:, chosen])

    def in_units(self, width):
        """With inputs in units of width (d,) and every way of length 1."""
        ways = self.ways / width
        size = np.maximum(np.linalg.norm(ways, axis=1), 1e-12)[:, None]
        return Slopes(self.at, ways / size, self.values / size)


def no_slopes(inputs, outputs):
    return Slopes(np.zeros(0, int), np.zeros((0, inputs)), np.zeros((0, outputs)))


@dataclass(frozen=True)
class GaussianProcess:
    """Means of p outputs at inputs of d numbers, which are shifted by `shift` and divided by `width` first.

    inducing (m, d), observed (n, d): inducing points and inputs of the observations in those units; group
    (n,), trust (n,): of `fit`, of the first output; at (r,), ways (r, d): of the Slopes, in those units and
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
    def points(self):
        """(m, d) inducing points, where distances are the kernel's."""
        return self.inducing @ self._square_metric

    @cached_property
    def to_kernel(self):
        """(d, d): inputs less `shift` times it are where distances are the kernel's."""
        return self._square_metric / self.width[:, None]

    @cached_property
    def plane(self):
        """(d, p): the plane's slopes by the inputs."""
        return self.weights[len(self.points) + 1 :] / self.width[:, None]

    @cached_property
    def _affine(self):
        """What `linear` gives at `shift` (d + 2 + p,), how it grows from there (d, d + 2 + p), and what its
        squares are times (d,)."""
        d, constant = len(self.to_kernel), self.weights[len(self.points)]
        at_shift, slopes = (
            np.concatenate([np.zeros(d), [1.0, 0.0], constant]),
            [self.to_kernel, np.zeros((d, 2)), self.plane],
        )
        return at_shift, np.hstack(slopes), np.full(d, -0.5)

    @cached_property
    def _columns(self):
        return _columns(self.points)

    @cached_property
    def _weighed_points(self):
        return (self.weights[: len(self.points), :, None] * self.points[:, None, :]).reshape(
            len(self.points), -1
        )

    def linear(self, x):
        """(n, d + 2 + p) of inputs x (n, d), side by side: those where distances are the kernel's, a (n, d);
        1; -|a|^2/2; the plane."""
        at_shift, slopes, halves = self._affine
        # dot: for a few rows it takes a third of the time of @
        out, d = (x - self.shift).dot(slopes), len(slopes)
        out += at_shift
        out[:, d + 1] = (out[:, :d] ** 2).dot(halves)
        return out

    def kernels(self, linear):
        """(n, m) at the inducing points, of what `linear` gives."""
        k = linear[:, : len(self._columns)].dot(self._columns)
        return np.exp(k, out=k)

    @cached_property
    def _kernel_root(self):
        return _kernel_root(self.points)

    def _in_prior(self, rows):
        """(m + 1 + d, n) of rows (n, m + 1 + d) as `_value_rows` gives them, by weights in units of their
        prior's deviation."""
        m = len(self.points)
        return np.vstack(
            [solve_triangular(self._kernel_root, rows[:, :m].T, lower=True), np.sqrt(TREND) * rows[:, m:].T]
        )

    @cached_property
    def _root(self):
        """(m + 1 + d, same) lower factor of what observations, slopes and prior say of the weights
        `_in_prior`, times the noise, as if every output were as noisy as the first: found when asked for,
        since it is ten times the size of all the rest. In these units sums of squares are exact enough
        (measured: to 1e-8, in an eighth of the memory that a QR of all rows takes)."""
        spots, metric, trust = self.inducing, self._square_metric, self.trust.astype(float)
        values = self._in_prior(_value_rows(self.observed, spots, metric)).T
        values = _whitener(self.group, self.common_noise / self.noise)(trust[:, None] * values)
        total = self.noise * np.eye(len(self.weights)) + values.T @ values
        for start in range(0, len(self.at), MANY_ROWS):
            at, ways = (a[start : start + MANY_ROWS] for a in (self.at, self.ways))
            slopes = self._in_prior(_slope_rows(self.observed[at], ways, spots, metric)) * trust[at]
            total += self.noise / self.slope_noise * (slopes @ slopes.T)
        return cholesky(total, lower=True)

    def __call__(self, x, derivative=False):
        """(n, p) at inputs (n, d); with `derivative` also (n, p, d)."""
        if len(x) > ROWS:
            parts = [self(x[i : i + ROWS], derivative) for i in range(0, len(x), ROWS)]
            return tuple(map(np.concatenate, zip(*parts))) if derivative else np.concatenate(parts)
        linear, d = self.linear(x), len(self.to_kernel)
        kernel = self.kernels(linear)
        curved = kernel.dot(self.weights[: len(self.points)])
        mean = curved + linear[:, d + 2 :]
        if not derivative:
            return mean
        # d k(a, b)/d a = k (b - a)
        first = kernel @ self._weighed_points
        slope = first.reshape(len(x), curved.shape[1], -1) - curved[:, :, None] * linear[:, None, :d]
        return mean, slope @ self.to_kernel.T + self.plane.T

    def deviation(self, x):
        """(n, p) standard deviation of the outputs, without noise."""
        _, explained, known = self._unknown(x)
        missed = np.maximum(1 - (explained**2).sum(axis=0), 0)
        return np.sqrt((self.noise * (known**2).sum(axis=0) + missed)[:, None] * self.variance)

    def covariance(self, x):
        """(n, n) covariance of an output at inputs (n, d) over its prior variance, without noise."""
        a, explained, known = self._unknown(x)
        return _kernel(a, a) - explained.T @ explained + self.noise * known.T @ known

    def _unknown(self, x):
        """Inputs where distances are the kernel's, and roots (., n): of the prior that inducing points
        explain, of what is left there."""
        z = (x - self.shift) / self.width
        rows = self._in_prior(_value_rows(z, self.inducing, self._square_metric))
        return (
            z @ self._square_metric,
            rows[: len(self.points)],
            solve_triangular(self._root, rows, lower=True),
        )


def _columns(b):
    """(e + 2, m) of points b (m, e): their product with a, 1, -|a|^2/2 side by side (n, e + 2) is -|a -
    b|^2/2."""
    # contiguous by rows: a product of two rows with it takes a third of the time that it takes by columns
    return np.ascontiguousarray(np.vstack([b.T, (b * b).sum(axis=1) / -2, np.ones(len(b))]))


def _kernel(a, b):
    k = np.column_stack([a, np.ones(len(a)), (a * a).sum(axis=1) / -2]) @ _columns(b)
    return np.exp(k, out=k)


def _kernel_root(points):
    """(m, m) lower factor of the kernels among points (m, e)."""
    return cholesky(_kernel(points, points) + JITTER * np.eye(len(points)), lower=True)


def _value_rows(z, spots, metric):
    """(n, m + 1 + d) at z (n, d): kernels at spots (m, d), constant and plane."""
    return np.hstack([_kernel(z @ metric, spots @ metric), np.ones((len(z), 1)), z])


def _slope_rows(z, ways, spots, metric):
    """(r, m + 1 + d) their derivatives along ways (r, d) at z (r, d)."""
    a, t, points = z @ metric, ways @ metric, spots @ metric
    # d k(a, b)/d a = k (b - a)
    along = _kernel(a, points) * (t @ points.T - (t * a).sum(axis=1)[:, None])
    return np.hstack([along, np.zeros((len(z), 1)), ways])


def fit(
    x,
    y,
    group,
    trust=None,
    slopes=None,
    most=400,
    inducing=1500,
    seed=0,
    like=None,
    again=False,
    noises=LOG_NOISES,
):
    """The GaussianProcess through y (n, p) at x (n, d) and Slopes there.

    like: another one whose metric and noise are taken, or with `again` looked for once more, from there.
    group (n,): equal where noise is common. trust (n, p), the same within a group: what noises are divided
    by, for outputs that are quotients by something small. Metric and noise are found on at most `most` of the
    observations, spread over the groups, and as many slopes; noises: bounds like LOG_NOISES.
    """
    trust, slopes = np.ones(y.shape) if trust is None else trust, slopes or no_slopes(x.shape[1], y.shape[1])
    random = np.random.default_rng(seed)
    shift, width = (like.shift, like.width) if like else (x.mean(axis=0), np.maximum(x.std(axis=0), 1e-12))
    z, steep = (x - shift) / width, slopes.in_units(width)
    spots = np.vstack([z, z[steep.at] + AWAY * steep.ways])
    spots = spots[random.permutation(len(spots))[:inducing]] if len(spots) > inducing else spots
    if like:
        metric, found = like.metric, (like.noise, like.common_noise, like.slope_noise)
    if again or not like:
        some, steepest = _spread_over(group, random)[:most], random.permutation(len(steep.at))[:most]
        extra = EXTRA if len(steep.at) else 0
        starts = [_logarithms(metric, found)] if like else [_start(z.shape[1], extra, *s) for s in STARTS]
        metric, found = _most_likely(
            z, y, group, trust, some, steep.of(steepest), starts, MORE_STEPS if like else MOST_STEPS, noises
        )
    return _condition(z, y, group, trust, spots, steep, shift, width, metric, found)


def _most_likely(z, y, group, trust, some, slopes, starts, steps, noises):
    """(metric, (noise, common noise, noise of slopes)) by the observations `some` and all slopes."""
    d = z.shape[1]
    points = np.vstack(
        [z[some], z[slopes.at] - NEAR / 2 * slopes.ways, z[slopes.at] + NEAR / 2 * slopes.ways]
    )
    data = []
    for columns in _alike(trust):
        t, v = trust[some, columns[0]], y[np.ix_(some, columns)]
        centred = v - (t[:, None] ** 2 * v).sum(axis=0) / (t**2).sum()
        data.append(
            (np.vstack([centred, slopes.values[:, columns]]), 1 / np.append(t, trust[slopes.at, columns[0]]))
        )
    same = group[some][:, None] == group[some]
    bounds = [LOG_SCALE] * d + [(None, None)] * (len(starts[0]) - d - 3) + list(noises)
    settings = {"jac": True, "method": "L-BFGS-B", "bounds": bounds, "options": {"maxiter": steps}}
    best = min(
        (minimize(_misfit, start, (points, data, same), **settings) for start in starts),
        key=lambda result: result.fun,
    ).x
    return _metric(best, d), tuple(np.exp(best[-3:]).tolist())


def _spread_over(groups, random):
    """(n,) the rows in random order, one of each group first, then another of each, and so on: states of one
    path are alike, and would tell the likelihood how smooth the path is and little on how paths differ.
    (Measured: up to a third off the error.)"""
    order = random.permutation(len(groups))
    _, index, count = np.unique(groups[order], return_inverse=True, return_counts=True)
    turn = np.empty(len(order), int)
    turn[np.argsort(index, kind="stable")] = np.concatenate([np.arange(n) for n in count])
    return order[np.argsort(turn, kind="stable")]


def _start(d, extra, scale, *noises):
    mixed = 0.1 * np.random.default_rng(0).normal(size=(d, extra))
    return _logarithms(np.hstack([np.eye(d) / scale, mixed]), noises)


def _logarithms(metric, noises):
    """What the likelihood is a function of: logarithms of scales and noises, and the directions between them
    as they are."""
    d = len(metric)
    return np.concatenate([-np.log(np.diag(metric)), metric[:, d:].T.ravel(), np.log(noises)])


def _metric(log, d):
    """(d, d + extra) of `_logarithms`."""
    return np.hstack([np.diag(np.exp(-log[:d])), log[d:-3].reshape(-1, d).T])


def _alike(trust):
    """Columns of equal trust, as lists."""
    groups = {}
    for j, column in enumerate(trust.T):
        groups.setdefault(column.tobytes(), []).append(j)
    return list(groups.values())


class _System:
    """Least-squares rows of observations at z (n, d), of slopes there, and of the prior, by weights of
    kernels at spots (m, d)."""

    def __init__(self, z, group, at, ways, spots, metric, noises):
        noise, common_noise, slope_noise = noises
        self._values, self._slopes = _value_rows(z, spots, metric), _slope_rows(z[at], ways, spots, metric)
        self._at, self._weight = at, np.sqrt(noise / slope_noise)
        self.prior = block_diag(_kernel_root(spots @ metric).T, np.eye(1 + z.shape[1]) / np.sqrt(TREND))
        self._white, self._noise = _whitener(group, common_noise / noise), noise

    def rows(self, trust):
        """(n + r + size, size) for observations of this trust (n,)."""
        return np.vstack([self.weighed(self._values, self._slopes, trust), np.sqrt(self._noise) * self.prior])

    def weighed(self, values, slopes, trust):
        """(n + r, .) of (n, .) and (r, .): each with unit noise."""
        t = trust[:, None]
        return np.vstack([self._white(t * values), self._weight * t[self._at] * slopes])


def _condition(z, y, group, trust, spots, slopes, shift, width, metric, noises):
    at, m, p = slopes.at, len(spots), y.shape[1]
    system = _System(z, group, at, slopes.ways, spots, metric, noises)
    size = m + 1 + z.shape[1]
    weights, variance = np.zeros((size, p)), np.zeros(p)
    for columns in _alike(trust):
        t, k = trust[:, columns[0]], len(columns)
        shifted = (t[:, None] ** 2 * y[:, columns]).sum(axis=0) / (t**2).sum()
        right = np.zeros((len(z) + len(at) + size, k))
        right[:-size] = system.weighed(y[:, columns] - shifted, slopes.values[:, columns], t)
        # of [A b] = Q R the last columns hold Q^T b and, below, what no weights can fit
        r = qr(np.hstack([system.rows(t), right]), mode="r", overwrite_a=True, check_finite=False)[0][
            : size + k
        ]
        w = solve_triangular(r[:size, :size], r[:size, size:])
        variance[columns] = (r[size:, size:] ** 2).sum(axis=0) / noises[0] / (len(z) + len(at))
        w[m] += shifted
        weights[:, columns] = w
    return GaussianProcess(
        shift, width, spots, z, group, trust[:, 0], at, slopes.ways, metric, weights, variance, *noises
    )


def _whitener(group, ratio):
    """(n, p) -> (n, p): times the inverse root of I + ratio (1 where rows are of one group)."""
    _, index, count = np.unique(group, return_inverse=True, return_counts=True)
    part = 1 - 1 / np.sqrt(1 + ratio * count)

    def white(a):
        sums = np.zeros((len(count), a.shape[1]))
        np.add.at(sums, index, a)
        return a - (part / count)[index, None] * sums[index]

    return white


def _misfit(log, points, data, same):
    """Minus the log likelihood, each output's variance profiled out, and its gradient by `_logarithms`.

    points: of the observations, then both ends of the slopes; data: [(y, doubt)] of observations and slopes.
    """
    n, r = len(same), (len(points) - len(same)) // 2
    d, noises = points.shape[1], np.exp(log[-3:])
    metric = _metric(log, d)
    a = points @ metric
    kernel = _kernel(a, a)
    plane = _differences(np.hstack([np.ones((len(points), 1)), points]), n)
    prior = _differences(_differences(kernel, n).T, n) + TREND * plane @ plane.T
    value, outer_sum, by_noise = 0.0, np.zeros((n + r, n + r)), np.zeros(3)
    own = np.repeat(noises[[0, 2]], [n, r])
    for y, doubt in data:
        p = y.shape[1]
        noise = np.diag(own * doubt**2)
        noise[:n, :n] += np.outer(doubt[:n], doubt[:n]) * (noises[1] * same)
        factor, failed = lapack.dpotrf(prior + noise, lower=True, overwrite_a=True)
        if failed:
            return 1e10, np.zeros(len(log))
        value += p * np.log(np.diag(factor)).sum()
        inverse, _ = lapack.dpotri(factor, lower=True, overwrite_c=True)
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        weights = inverse @ y
        variance = np.maximum((y * weights).sum(axis=0) / (n + r), LEAST_VARIANCE)
        value += (n + r) / 2 * np.log(variance).sum()
        outer = p / 2 * inverse - (weights / variance) @ weights.T / 2
        outer_sum += outer
        single, doubted = np.diag(outer) * doubt**2, outer[:n, :n] * np.outer(doubt[:n], doubt[:n])
        by_noise += noises * [single[:n].sum(), doubted[same].sum(), single[n:].sum()]
    s = _spread_out(_spread_out(outer_sum, n).T, n) * kernel
    by_metric = -2 * points.T @ (s.sum(axis=1)[:, None] * a - s @ a)
    by_scale = -np.diag(by_metric[:, :d] * metric[:, :d])
    return value, np.concatenate([by_scale, by_metric[:, d:].T.ravel(), by_noise])


def _differences(rows, n):
    """(n + r, .) observations and slopes of the values (n + 2 r, .) at the points of `_misfit`."""
    start, end = np.split(rows[n:], 2)
    return np.vstack([rows[:n], (end - start) / NEAR])


def _spread_out(rows, n):
    """Transpose of `_differences`."""
    return np.vstack([rows[:n], -rows[n:] / NEAR, rows[n:] / NEAR])
