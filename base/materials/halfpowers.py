"""Ogden's law as a series in half powers of the principal stretches: smooth where stretches coincide.

Derivatives of principal stretches are singular at repeated ones, F = I among them, but sum_i f(l_i) is not.
With f(l) = sum_n w_n l^(n/2) over whole n from -ORDER to ORDER the sums are traces of whole powers of the
square root of the stretch tensor; those are polynomials of its invariants, and no principal stretch is ever
needed. Exact when 2 alpha is whole, else an interpolation with the relative error that `weights` bounds for
stretches 1/RANGE..RANGE.
"""

import numpy as np

from pneunet.base.errors import InputError

ORDER = 20
RANGE = 10.0
TOLERANCE = 1e-6


def weights(terms):
    """Weights (MPa) of l^(n/2), n = 1..ORDER, and then of l^(-n/2), shape (2 ORDER,), for terms ((mu_p,
    alpha_p), ...).

    Least squares for the slope l df/dl and its own slope (stress and tangent), relative to the terms' sizes.
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
