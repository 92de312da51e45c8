"""A Gaussian process along one of its inputs, as cheaply as a search for a root along it asks for."""

import numpy as np


class AlongInput:
    """The first output of a GaussianProcess at inputs of which one, that at `place`, changes: what is left to do for each change is an
    exponential for each inducing point. With a = (inputs in the process's units) metric and b an inducing point, the kernel after a change
    t along the way w is exp(-|a + t w - b|^2/2) = kernel(t = 0) exp(t b.w) exp(-t (2 a.w + t w.w)/2)."""

    def __init__(self, process, place):
        self._process, m = process, len(process.points)
        way, weights = process.to_kernel[place], process.weights[:m, 0]
        self._way, self._b, self._square = way, process.points @ way, way @ way
        self._weights = np.stack([weights, weights * self._b, weights * self._b**2], axis=1)
        self._constant, self._slopes, self._slope = process.weights[m, 0], process.plane[:, 0], process.plane[place, 0]

    def start(self, x):
        """What `at` asks for, of inputs x (n, d): exponents (n, m), places along the way (n,) and the plane (n,)."""
        z = x - self._process.shift
        a = z @ self._process.to_kernel
        return self._process.exponent(a), a @ self._way, self._constant + z @ self._slopes

    def at(self, start, change):
        """(value, slope, curvature), each (n,), after a change (n,) of the input."""
        fixed, a, plane = start
        exponent = np.multiply.outer(change, self._b)
        exponent += fixed
        sums = np.exp(exponent, out=exponent) @ self._weights
        at = a + change * self._square
        sums *= np.exp(-change * (a + at) / 2)[:, None]
        value = sums[:, 0] + plane + self._slope * change
        slope = sums[:, 1] - at * sums[:, 0] + self._slope
        return value, slope, sums[:, 2] - 2 * at * sums[:, 1] + (at**2 - self._square) * sums[:, 0]
