"""What a Gaussian process's inducing points leave open: the part of its prior variance that their values do
not explain.

Of how little a process knows of an input, nearly everything is this part (measured in the shipped law's
range: 90 to 99 %), and it takes the root of the kernels among the inducing points alone, a tenth of a second,
where all observations take ten. Of some of the points it is a bound from above of what all of them leave.
"""

import numpy as np

from pneunet.reduced.trained.gaussian import (
    ROWS,
    GaussianProcess,
    columns_of,
    kernel_root,
    kernels_at,
    solved,
)


class Unexplained:
    """That part over the prior variance, of the inducing points `chosen` (a slice or their places); 1 far
    from all of them."""

    def __init__(self, process: GaussianProcess, chosen: slice | np.ndarray = slice(None)) -> None:
        self._process, self._points = process, process.points[chosen]
        self._columns, self._root = columns_of(self._points), kernel_root(self._points)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """(n,) at inputs x (n, d)."""
        if len(x) > ROWS:
            return np.concatenate([self(x[i : i + ROWS]) for i in range(0, len(x), ROWS)])
        explained = solved(self._root, kernels_at(self._process.linear(x), self._columns).T)
        return _rest(explained)

    def with_slopes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(the same, derivatives by the inputs (n, d))."""
        if len(x) > ROWS:
            parts = [self.with_slopes(x[i : i + ROWS]) for i in range(0, len(x), ROWS)]
            left, slopes = map(np.concatenate, zip(*parts))
            return left, slopes
        linear, d = self._process.linear(x), len(self._process.to_kernel)
        kernels = kernels_at(linear, self._columns)
        explained = solved(self._root, kernels.T)
        weighed = solved(self._root, explained, transposed=True).T * kernels
        # the derivative of k(a, b) by a is k (b - a)
        by_a = weighed @ self._points - weighed.sum(axis=1)[:, None] * linear[:, :d]
        return _rest(explained), -2 * by_a @ self._process.to_kernel.T


def _rest(explained):
    return np.maximum(1 - np.einsum("mn,mn->n", explained, explained), 0)
