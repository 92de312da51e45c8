from dataclasses import replace

import numpy as np
import pytest

from pneunet.reduced.trained import gaussian
from pneunet.reduced.trained.along_inputs import AlongInputs
from pneunet.reduced.trained.gaussian import JITTER, TREND
from pneunet.reduced.trained.unexplained import Unexplained
from pneunet.reduced.training.regression import NEAR, FitSettings, Slopes, _misfit, _spread_over, fit


def observed(n, seed=0):
    """Smooth functions of two inputs, in groups of three with a common error."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (n, 2))
    group = np.repeat(np.arange(n // 3), 3)
    y = (
        np.column_stack([np.sin(2 * x[:, 0]) + x[:, 1], x[:, 0] * x[:, 1]])
        + 1e-2 * rng.normal(size=(n // 3, 2))[group]
    )
    return x, y, group


def test_the_likelihood_has_its_gradient():
    x, y, group = observed(30)
    x, same = np.vstack([x, x[:9] - NEAR / 2, x[:9] + NEAR / 2]), group[:, None] == group
    y = np.vstack([y, np.linspace(-1, 2, 18).reshape(9, 2)])
    doubt = np.append(np.linspace(1, 3, 10)[group], np.ones(9))
    data = [(y[:, :1], np.ones(39)), (y[:, 1:], doubt)]
    at, h = np.append(np.log([2.0, 1.0]), [0.3, -0.2, *np.log([1e-2, 5e-2, 3e-2])]), 1e-4
    ends = [[_misfit(at + s * h * e, x, data, same)[0] for s in (1, -1)] for e in np.eye(7)]
    assert [(a - b) / (2 * h) for a, b in ends] == pytest.approx(
        _misfit(at, x, data, same)[1], rel=1e-5, abs=1e-4
    )


def test_with_all_points_it_is_the_textbook_s_process():
    x, y, group = observed(30)
    found = fit(x, y, group)
    process = fit(x, y, group, like=replace(found, metric=np.diag([1.0, 0.5]), noise=1e-3, common_noise=1e-2))
    z = (x - process.shift) / process.width
    new = (np.array([[0.3, -0.4], [2.0, 2.0]]) - process.shift) / process.width

    def prior(a, b):
        return np.exp(-0.5 * (((a[:, None] - b) @ process.metric) ** 2).sum(axis=2)) + TREND * (1 + a @ b.T)

    noise = process.noise * np.eye(30) + process.common_noise * (group[:, None] == group)
    inverse = np.linalg.inv(prior(z, z) + noise)
    mean = y.mean(axis=0) + prior(new, z) @ inverse @ (y - y.mean(axis=0))
    spread = np.diag(prior(new, new) - prior(new, z) @ inverse @ prior(z, new))
    inputs = new * process.width + process.shift
    assert process(inputs) == pytest.approx(mean, rel=1e-3)  # jitter, far outside
    assert process.deviation(inputs) ** 2 / process.variance == pytest.approx(
        np.column_stack([spread, spread]), rel=5e-3, abs=1e-6
    )


def test_the_covariance_is_that_of_the_posterior():
    x, y, group = observed(30)
    found = fit(x, y, group)
    process = fit(x, y, group, like=replace(found, metric=np.diag([1.0, 0.5]), noise=1e-3, common_noise=1e-2))
    more = np.array([[0.3, -0.4], [0.9, 0.9], [-0.2, 0.7]])
    before = process.covariance(more)
    assert np.sqrt(np.diag(before)[:, None] * process.variance) == pytest.approx(
        process.deviation(more), rel=1e-6
    )
    # what is not known after one more observation does not depend on what it says
    after = fit(
        np.vstack([x, more[:1]]), np.vstack([y, [[5.0, -3.0]]]), np.append(group, 99), like=process
    ).covariance(more)
    told = np.outer(before[0], before[0]) / (before[0, 0] + process.noise + process.common_noise)
    assert after == pytest.approx(before - told, rel=1e-3, abs=1e-6)


def test_slopes_are_followed_and_spare_observations():
    x, y, group = observed(12)
    at, ways = np.arange(12), np.random.default_rng(3).normal(size=(12, 2))
    steep = np.column_stack(
        [2 * np.cos(2 * x[:, 0]) * ways[:, 0] + ways[:, 1], x[:, 1] * ways[:, 0] + x[:, 0] * ways[:, 1]]
    )
    process, without = fit(x, y, group, slopes=Slopes(at, ways, steep)), fit(x, y, group)
    _, found = process.with_slopes(x)
    assert np.einsum("npd,nd->np", found, ways) == pytest.approx(steep, abs=0.02)
    new = observed(30, seed=1)[0]
    truth = np.column_stack([np.sin(2 * new[:, 0]) + new[:, 1], new[:, 0] * new[:, 1]])
    errors = [np.sqrt(((p(new) - truth) ** 2).mean()) for p in (process, without)]
    assert errors[0] < 0.3 * errors[1], errors
    assert (process.deviation(new).mean(axis=0) < without.deviation(new).mean(axis=0)).all()


def test_the_deviation_is_what_observations_and_slopes_leave_of_the_weights(monkeypatch):
    """Against the normal equations of the weights, with the slopes' rows from differences."""
    monkeypatch.setattr(gaussian, "MANY_ROWS", 5)
    x, y, _ = observed(12)
    slopes = Slopes(np.arange(12), np.random.default_rng(3).normal(size=(12, 2)), np.ones((12, 2)))
    found = fit(x, y, np.arange(12), slopes=slopes)
    noises = {"noise": 1e-3, "common_noise": 2e-3, "slope_noise": 5e-3}
    process = fit(
        x, y, np.arange(12), slopes=slopes, like=replace(found, metric=np.diag([1.0, 0.5]), **noises)
    )

    def basis(z):
        kernel = np.exp(-0.5 * (((z[:, None] - process.inducing) @ process.metric) ** 2).sum(axis=2))
        return np.hstack([kernel, np.ones((len(z), 1)), z])

    z, h, m = (x - process.shift) / process.width, 1e-5, len(process.inducing)
    steep = (basis(z + h * process.ways) - basis(z - h * process.ways)) / (2 * h)
    prior = np.zeros((m + 3, m + 3))
    prior[:m, :m], prior[m:, m:] = basis(process.inducing)[:, :m] + JITTER * np.eye(m), np.eye(3) / TREND
    told = basis(z).T @ basis(z) / (1e-3 + 2e-3) + steep.T @ steep / 5e-3 + prior
    new = observed(9, seed=1)[0]
    rows = basis((new - process.shift) / process.width)
    missed = 1 - np.einsum("ni,ij,nj->n", rows[:, :m], np.linalg.inv(prior[:m, :m]), rows[:, :m])
    spread = np.einsum("ni,ij,nj->n", rows, np.linalg.inv(told), rows) + missed
    assert process.deviation(new) ** 2 / process.variance == pytest.approx(
        np.column_stack([spread, spread]), rel=1e-3, abs=1e-6
    )


def test_what_inducing_points_leave_open_is_no_less_for_some_of_them_and_has_its_slopes():
    x, y, group = observed(60)
    process, new, h = fit(x, y, group), 1.2 * observed(30, seed=1)[0], 1e-5
    z = (np.vstack([process.inducing, (new - process.shift) / process.width])) @ process.metric
    prior = np.exp(-0.5 * ((z[:, None] - z) ** 2).sum(axis=2))
    K, k = prior[:60, :60] + JITTER * np.eye(60), prior[:60, 60:]
    left, some = Unexplained(process), Unexplained(process, np.arange(0, 60, 4))
    assert left(new) == pytest.approx(1 - (k * np.linalg.solve(K, k)).sum(axis=0), abs=1e-7)
    assert (some(new) >= left(new) - 1e-9).all() and some(new).max() > 2 * left(new).max()
    value, slopes = some.with_slopes(new)
    assert (value == some(new)).all() and some(new[:1]) == pytest.approx(value[:1], rel=1e-6)
    for i in range(2):
        step = h * np.eye(2)[i]
        assert (some(new + step) - some(new - step)) / (2 * h) == pytest.approx(
            slopes[:, i], rel=1e-4, abs=1e-7
        )


def test_few_inducing_points_serve_many_observations_and_slopes_are_exact():
    x, y, group = observed(300)
    process, new, h = (
        fit(x, y, group, settings=FitSettings(most=100, inducing=60)),
        observed(30, seed=1)[0],
        1e-6,
    )
    truth = np.column_stack([np.sin(2 * new[:, 0]) + new[:, 1], new[:, 0] * new[:, 1]])
    assert process(new) == pytest.approx(truth, abs=0.02)
    value, slopes = process.with_slopes(new)
    assert (value == process(new)).all()
    for i in range(2):
        step = h * np.eye(2)[i]
        assert (process(new + step) - process(new - step)) / (2 * h) == pytest.approx(
            slopes[:, :, i], abs=1e-5
        )


def test_along_some_inputs_it_is_the_same_process_with_second_derivatives():
    x, y, group = observed(60)
    process, new, h = fit(x, y, group), observed(30, seed=1)[0], 1e-5
    along = AlongInputs(process, [1, 0])
    value, slopes, second = along.at(new)
    known, gradient = process.with_slopes(new)
    assert value == pytest.approx(known[:, 0], abs=1e-9) and slopes == pytest.approx(
        gradient[:, 0, ::-1], abs=1e-8
    )
    for place, column in ((1, 0), (0, 1)):
        step = h * np.eye(2)[place]
        ends = [along.at(new + sign * step)[1] for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(second[:, column], abs=1e-4)


def test_the_metric_is_found_on_one_state_of_each_path_first():
    groups = np.array([7, 7, 7, 7, 2, 2, 5, 7, 2, 7])
    rows = _spread_over(groups, np.random.default_rng(0))
    assert sorted(rows) == list(range(10))
    assert [sorted(groups[rows[i:j]]) for i, j in ((0, 3), (3, 5), (5, 7), (7, 10))] == [
        [2, 5, 7],
        [2, 7],
        [2, 7],
        [7, 7, 7],
    ]
