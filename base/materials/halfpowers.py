"""Ogden's law as a series in half powers of the principal stretches: smooth where stretches coincide.

Derivatives of principal stretches are singular at repeated ones, F = I among them, but sum_i f(l_i) is not.
With f(l) = sum_n w_n l^(n/2) over whole n from -ORDER to ORDER the sums are traces of whole powers of the
square root of the stretch tensor; those are polynomials of its invariants, and no principal stretch is ever
needed. Exact when 2 alpha is whole, else an interpolation with the relative error that `weights` bounds for
stretches 1/RANGE..RANGE.
"""

from typing import Any

import numpy as np

from pneunet.base.errors import InputError

ORDER = 20
RANGE = 10.0
TOLERANCE = 1e-6


def weights(terms: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Weights (MPa) of l^(n/2), n = 1..ORDER, and then of l^(-n/2), shape (2 ORDER,), for terms ((mu_p,
    alpha_p), ...).

    Least squares for the slope l df/dl and its own slope (stress and tangent), relative to the terms' sizes.
    InputError where that is not enough.
    """
    logarithm = np.log(RANGE) * np.cos(np.pi * (np.arange(400) + 0.5) / 400)
    n = np.arange(1, ORDER + 1)
    half = np.concatenate([n, -n]) / 2
    powers = np.exp(np.outer(logarithm, half))
    wanted = [(2 * m / a * np.exp(a * logarithm), 2 * m * np.exp(a * logarithm)) for m, a in terms]
    slope, tangent = (sum(part) for part in zip(*wanted))
    size = sum(np.abs(t) for _, t in wanted)
    matrix = np.concatenate([powers * half / size[:, None], powers * half**2 / size[:, None]])
    right = np.concatenate([slope / size, tangent / size])
    scale = np.linalg.norm(matrix, axis=0)
    solution = np.linalg.lstsq(matrix / scale, right, rcond=1e-15)[0] / scale
    error = np.abs(matrix @ solution - right).max()
    if error > TOLERANCE:
        raise InputError(
            f"law = 'Ogden': exponents {', '.join(f'{a:g}' for _, a in terms)} are too large for finite"
            " elements"
        )
    return solution


def _root(invariants, sqrt):
    """Invariants (a, b) of the square root of a tensor with invariants (I1, I2, 1): a^2 - 2b = I1, b^2 - 2a =
    I2.

    Newton from a guess that is exact at the identity and off by a few percent at tenfold stretch; its matrix,
    4 (a b - 1) >= 32, is regular at repeated stretches and everywhere else, and so are the derivatives of all
    its steps.
    """
    I1, I2 = invariants
    b = sqrt(I2 + 2 * sqrt(I1 + 6))
    a = sqrt(I1 + 2 * b)
    for _ in range(3):
        r, s = I1 - a * a + 2 * b, I2 - b * b + 2 * a
        determinant = 2 * (a * b - 1)
        a, b = a + (b * r + s) / determinant, b + (r + a * s) / determinant
    return a, b


def energy(weights: Any, I1: Any, I2: Any, operators: Any) -> Any:
    """Sum of the weighted traces (less 3) of the powers -ORDER..ORDER of the fourth root of a tensor with
    these invariants; arrays or symbols with their `operators` (base.materials.laws)."""
    a, b = _root(_root((I1, I2), operators.sqrt), operators.sqrt)
    total = 0
    for offset, first, second in ((0, a, b), (ORDER, b, a)):  # powers and inverse powers
        traces = [3, first, first * first - 2 * second]
        for n in range(3, ORDER + 1):
            traces.append(first * traces[n - 1] - second * traces[n - 2] + traces[n - 3])
        total += sum(weights[offset + n - 1] * (traces[n] - 3) for n in range(1, ORDER + 1))
    return total
