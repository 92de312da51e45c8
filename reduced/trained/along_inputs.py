"""A Gaussian process along some of its inputs, as a search for a root along them asks for."""

from collections.abc import Sequence

import numpy as np

from pneunet.reduced.trained.gaussian import GaussianProcess


class AlongInputs:
    """The first output of a GaussianProcess and its first and second derivatives by the p of its inputs that
    stand at `places`.

    With a = (inputs in the process's units) metric, b an inducing point and w_i what one more of an input
    adds to a, the derivatives of the kernel k are (b - a).w_i k and ((b - a).w_i (b - a).w_j - w_i.w_j) k:
    sums over the inducing points of k, k b.w_i and k b.w_i b.w_j.
    """

    def __init__(self, process: GaussianProcess, places: Sequence[int]) -> None:
        self._process, m = process, len(process.points)
        self._ways, weights = process.to_kernel[list(places)], process.weights[:m, :1]
        b = process.points @ self._ways.T
        self._weights = np.hstack(
            [weights, weights * b, weights * (b[:, :, None] * b[:, None]).reshape(m, -1)]
        )
        self._square, self._slope = self._ways @ self._ways.T, process.plane[list(places), 0]

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(value (n,), slopes (n, p), second derivatives (n, p, p)) at inputs (n, d)."""
        linear, (p, d) = self._process.linear(x), self._ways.shape
        sums, a = self._process.kernels(linear).dot(self._weights), linear[:, :d].dot(self._ways.T)
        total, by_b, by_both = sums[:, :1], sums[:, 1 : p + 1], sums[:, p + 1 :].reshape(-1, p, p)
        first = by_b - a * total
        second = (
            by_both
            - a[:, :, None] * first[:, None]
            - by_b[:, :, None] * a[:, None]
            - total[:, :, None] * self._square
        )
        return total[:, 0] + linear[:, d + 2], first + self._slope, second
