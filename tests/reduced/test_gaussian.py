import numpy as np
import pytest

from reduced.gaussian import TREND, _misfit, fit


def observed(n, seed=0):
    """Smooth functions of two inputs, in groups of three with a common error."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (n, 2))
    group = np.repeat(np.arange(n // 3), 3)
    y = np.column_stack([np.sin(2 * x[:, 0]) + x[:, 1], x[:, 0] * x[:, 1]]) + 1e-2 * rng.normal(size=(n // 3, 2))[group]
    return x, y, group


def test_the_likelihood_has_its_gradient():
    x, y, group = observed(30)
    doubt = np.linspace(1, 3, 10)[group]
    data, same = [(y[:, :1], np.ones(30)), (y[:, 1:], doubt)], group[:, None] == group
    at, h = np.log([2.0, 1.0, 1e-2, 5e-2]), 1e-5
    ends = [[_misfit(at + s * h * e, x, data, same)[0] for s in (1, -1)] for e in np.eye(4)]
    assert [(a - b) / (2 * h) for a, b in ends] == pytest.approx(_misfit(at, x, data, same)[1], rel=1e-5, abs=1e-4)


def test_with_all_points_it_is_the_textbook_s_process():
    x, y, group = observed(30)
    process = fit(x, y, group)
    z = (x - process.shift) / process.width
    new = (np.array([[0.3, -0.4], [2.0, 2.0]]) - process.shift) / process.width

    def prior(a, b):
        return np.exp(-0.5 * (((a[:, None] - b) / process.scales) ** 2).sum(axis=2)) + TREND * (1 + a @ b.T)

    noise = process.noise * np.eye(30) + process.common_noise * (group[:, None] == group)
    inverse = np.linalg.inv(prior(z, z) + noise)
    mean = y.mean(axis=0) + prior(new, z) @ inverse @ (y - y.mean(axis=0))
    spread = np.diag(prior(new, new) - prior(new, z) @ inverse @ prior(z, new))
    inputs = new * process.width + process.shift
    assert process(inputs) == pytest.approx(mean, rel=1e-3)  # jitter, far outside
    assert process.deviation(inputs) ** 2 / process.variance == pytest.approx(np.column_stack([spread, spread]), rel=5e-3, abs=1e-6)


def test_few_inducing_points_serve_many_observations_and_slopes_are_exact():
    x, y, group = observed(300)
    process, new, h = fit(x, y, group, most=100, inducing=60), observed(30, seed=1)[0], 1e-6
    truth = np.column_stack([np.sin(2 * new[:, 0]) + new[:, 1], new[:, 0] * new[:, 1]])
    assert process(new) == pytest.approx(truth, abs=0.02)
    value, slopes = process(new, derivative=True)
    assert (value == process(new)).all()
    for i in range(2):
        step = h * np.eye(2)[i]
        assert (process(new + step) - process(new - step)) / (2 * h) == pytest.approx(slopes[:, :, i], abs=1e-5)
