import numpy as np
import pytest


def _assert_derivatives(function, x, step=1e-6, tolerance=1e-7):
    """function(x) -> (value, gradient, Hessian) at x (n,): both derivatives agree with central
    differences."""
    _, gradient, hessian = function(x)
    pairs = [(function(x + d), function(x - d)) for d in step * np.eye(len(x))]
    slope = np.array([(a[0] - b[0]) / (2 * step) for a, b in pairs])
    curve = np.array([(a[1] - b[1]) / (2 * step) for a, b in pairs])
    np.testing.assert_allclose(gradient, slope, atol=tolerance * (1 + abs(gradient).max()))
    np.testing.assert_allclose(hessian, curve, atol=tolerance * (1 + abs(hessian).max()))


@pytest.fixture
def assert_derivatives():
    return _assert_derivatives
