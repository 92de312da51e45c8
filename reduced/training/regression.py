"""Gaussian processes through observations and slopes: their metric and noises, then their weights.

Noise on the observations, and noise that those of a group (the states of one mesh) have in common. Slopes are
observed too: directional derivatives, with a noise of their own. Metric and noises are shared by the outputs
and maximise the likelihood, with each output's variance profiled out (Rasmussen & Williams 2006, ch. 2, 5 and
9.4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, lapack, qr, solve_triangular
from scipy.optimize import minimize

from pneunet.reduced.trained.gaussian import (
    TREND,
    GaussianProcess,
    kernel,
    kernel_root,
    slope_rows,
    value_rows,
    whitener,
)
from pneunet.reduced.trained.side_by_side import SideBySide

#: noises of observations, groups and slopes over the prior variance. What a mesh adds, measured by remeshing,
#: is about a percent of how designs differ: without that bound the likelihood may take for noise what designs
#: do near their limit loads
LOG_NOISES = tuple((np.log(1e-6), np.log(most)) for most in (1e-4, 1e-5, 1.0))
LOG_SCALE = (np.log(0.3), np.log(100.0))
#: of an output, which may be constant
LEAST_VARIANCE = 1e-20
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

    def of(self, chosen: np.ndarray) -> "Slopes":
        """Those that are chosen."""
        return Slopes(self.at[chosen], self.ways[chosen], self.values[chosen])

    def columns(self, chosen: slice) -> "Slopes":
        """Those of the outputs that are chosen."""
        return Slopes(self.at, self.ways, self.values[:, chosen])

    def in_units(self, width: np.ndarray) -> "Slopes":
        """With inputs in units of width (d,) and every way of length 1."""
        ways = self.ways / width
        size = np.maximum(np.linalg.norm(ways, axis=1), 1e-12)[:, None]
        return Slopes(self.at, ways / size, self.values / size)


def no_slopes(inputs: int, outputs: int) -> Slopes:
    """None at all, of so many inputs and outputs."""
    return Slopes(np.zeros(0, int), np.zeros((0, inputs)), np.zeros((0, outputs)))


@dataclass(frozen=True)
class FitSettings:
    """Metric and noise are found on at most `most` of the observations, spread over the groups, and as many
    slopes; noises: bounds of their logarithms, like LOG_NOISES; inducing: points at most. again: look for
    metric and noise once more, from those of another process."""

    most: int = 400
    inducing: int = 1500
    again: bool = False
    noises: tuple[tuple[float, float], ...] = LOG_NOISES


def fit(
    x: np.ndarray,
    y: np.ndarray,
    group: np.ndarray,
    trust: np.ndarray | None = None,
    slopes: Slopes | None = None,
    like: GaussianProcess | None = None,
    settings: FitSettings = FitSettings(),
) -> GaussianProcess:
    """The GaussianProcess through y (n, p) at x (n, d) and Slopes there.

    like: another one whose metric and noise are taken, or where the search for them starts. group (n,): equal
    where noise is common. trust (n, p), the same within a group: what noises are divided by, for outputs that
    are quotients by something small.
    """
    trust, slopes = np.ones(y.shape) if trust is None else trust, slopes or no_slopes(x.shape[1], y.shape[1])
    random = np.random.default_rng(0)
    shift, width = (like.shift, like.width) if like else (x.mean(axis=0), np.maximum(x.std(axis=0), 1e-12))
    z, steep = (x - shift) / width, slopes.in_units(width)
    spots = np.vstack([z, z[steep.at] + AWAY * steep.ways])
    if len(spots) > settings.inducing:
        spots = spots[random.permutation(len(spots))[: settings.inducing]]
    if like:
        metric, found = like.metric, (like.noise, like.common_noise, like.slope_noise)
    if settings.again or not like:
        some, steepest = _spread_over(group, random), random.permutation(len(steep.at))
        extra = EXTRA if len(steep.at) else 0
        starts = [_logarithms(metric, found)] if like else [_start(z.shape[1], extra, *s) for s in STARTS]
        data = z, y, group, trust, some[: settings.most], steep.of(steepest[: settings.most])
        metric, found = _most_likely(*data, starts, MORE_STEPS if like else MOST_STEPS, settings.noises)
    return _condition(z, y, group, trust, spots, steep, shift, width, metric, found)


def fit_side_by_side(
    x: np.ndarray,
    y: np.ndarray,
    group: np.ndarray,
    trust: np.ndarray,
    widths: Sequence[int],
    slopes: Slopes | None = None,
    like: SideBySide | None = None,
    settings: FitSettings = FitSettings(),
) -> SideBySide:
    """SideBySide processes of `widths` outputs each; the rest as for `fit`."""
    ends = np.cumsum([0, *widths])
    likes = like.processes if like else [None] * len(widths)
    slopes = slopes or no_slopes(x.shape[1], y.shape[1])
    parts = [slice(*both) for both in zip(ends, ends[1:])]
    found = [
        fit(x, y[:, c], group, trust[:, c], slopes.columns(c), known, settings)
        for c, known in zip(parts, likes)
    ]
    return SideBySide(tuple(found))


def _most_likely(z, y, group, trust, some, slopes, starts, steps, noises):
    """(metric, (noise, common noise, noise of slopes)) by the observations `some` and all slopes."""
    d = z.shape[1]
    half = NEAR / 2 * slopes.ways
    points = np.vstack([z[some], z[slopes.at] - half, z[slopes.at] + half])
    data = []
    for columns in _alike(trust):
        t, v = trust[some, columns[0]], y[np.ix_(some, columns)]
        centred = v - (t[:, None] ** 2 * v).sum(axis=0) / (t**2).sum()
        doubt = 1 / np.append(t, trust[slopes.at, columns[0]])
        data.append((np.vstack([centred, slopes.values[:, columns]]), doubt))
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
    groups: dict[bytes, list[int]] = {}
    for j, column in enumerate(trust.T):
        groups.setdefault(column.tobytes(), []).append(j)
    return list(groups.values())


class _System:
    """Least-squares rows of observations at z (n, d), of slopes there, and of the prior, by weights of
    kernels at spots (m, d)."""

    def __init__(self, z, group, at, ways, spots, metric, noises):
        noise, common_noise, slope_noise = noises
        self._values, self._slopes = value_rows(z, spots, metric), slope_rows(z[at], ways, spots, metric)
        self._at, self._weight = at, np.sqrt(noise / slope_noise)
        self.prior = block_diag(kernel_root(spots @ metric).T, np.eye(1 + z.shape[1]) / np.sqrt(TREND))
        self._white, self._noise = whitener(group, common_noise / noise), noise

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
        rows = np.hstack([system.rows(t), right])
        r = qr(rows, mode="r", overwrite_a=True, check_finite=False)[0][: size + k]
        w = solve_triangular(r[:size, :size], r[:size, size:])
        variance[columns] = (r[size:, size:] ** 2).sum(axis=0) / noises[0] / (len(z) + len(at))
        w[m] += shifted
        weights[:, columns] = w
    return GaussianProcess(
        shift, width, spots, z, group, trust[:, 0], at, slopes.ways, metric, weights, variance, *noises
    )


def _misfit(log, points, data, same):
    """Minus the log likelihood, each output's variance profiled out, and its gradient by `_logarithms`.

    points: of the observations, then both ends of the slopes; data: [(y, doubt)] of observations and slopes.
    """
    n, r = len(same), (len(points) - len(same)) // 2
    d, noises = points.shape[1], np.exp(log[-3:])
    metric = _metric(log, d)
    a = points @ metric
    kernels = kernel(a, a)
    plane = _differences(np.hstack([np.ones((len(points), 1)), points]), n)
    prior = _differences(_differences(kernels, n).T, n) + TREND * plane @ plane.T
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
    s = _spread_out(_spread_out(outer_sum, n).T, n) * kernels
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
