"""Bounded least squares by Levenberg and Marquardt's method: each step is the best one within the bounds.

A bound is met exactly and left again as soon as that helps, so what an optimum's bounds cost is known from
the gradient there. (Interior methods crawl along bounds; measured: three times the evaluations.)
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy.linalg import qr
from scipy.optimize import lsq_linear

#: damping of scaled steps at the start, relative to the Jacobian's; the range it is kept in
DAMPING, LEAST, MOST = 1e-3, 1e-7, 1e6
#: the search ends when a step promises less than these shares of the cost
ENOUGH = 1e-3


class Linearised(Protocol):
    """What a residual is near x: residual (m,), jacobian (m, n)."""

    @property
    def residual(self) -> np.ndarray: ...

    @property
    def jacobian(self) -> np.ndarray: ...


L = TypeVar("L", bound=Linearised)


@dataclass(frozen=True, eq=False)
class Optimum(Generic[L]):
    """x (n,), what was found there, its cost |residual|^2, and the evaluations that it took."""

    x: np.ndarray
    at: L
    cost: float
    evaluations: int


def bounded_least_squares(
    evaluate: Callable[[np.ndarray], L | None],
    x: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    scale: np.ndarray,
    floor: float = 0.0,
    steps: int = 30,
) -> Optimum[L] | None:
    """The local `Optimum` from x (n,) on within low..high; None where x cannot be evaluated.

    scale (n,): large changes of x; floor: cost below which nothing more is asked for.
    """
    x = np.clip(x, low, high)
    at = evaluate(x)
    if at is None:
        return None
    cost, damping, count = float(at.residual @ at.residual), DAMPING, 1
    while count < steps and cost > floor:  # ends: either count grows, or the damping falls
        step, promised = bounded_step(at, x, low, high, scale, damping)
        if promised < ENOUGH * cost:
            if damping <= LEAST:
                break
            damping = max(0.01 * damping, LEAST)
            continue
        there = np.clip(x + step, low, high)
        trial = evaluate(there)
        count += 1
        gain = -1.0
        if trial is not None:
            gain = (cost - float(trial.residual @ trial.residual)) / promised
        if gain > 1e-3:
            assert trial is not None
            x, at, cost = there, trial, float(trial.residual @ trial.residual)
        damping *= 4.0 if gain < 0.25 else 0.1 if gain > 0.75 else 1.0
        damping = max(damping, LEAST)
        if damping > MOST:
            break
    return Optimum(x, at, cost, count)


def bounded_step(
    at: Linearised, x: np.ndarray, low: np.ndarray, high: np.ndarray, scale: np.ndarray, damping: float
) -> tuple[np.ndarray, float]:
    """(the step (n,) with the least linearised cost within the bounds, by how much that falls); damping of
    steps over `scale`, relative to the largest column."""
    n = len(x)
    if not n:
        return x, 0.0
    A = at.jacobian * scale
    triangle = qr(np.column_stack([A, at.residual]), mode="r", overwrite_a=True, check_finite=False)[0]
    R, c = triangle[:n, :n], triangle[:n, n]
    weight = np.sqrt(damping) * max(np.linalg.norm(R, axis=0).max(), 1e-30)
    rows, wanted = np.vstack([R, weight * np.eye(n)]), np.concatenate([-c, np.zeros(n)])
    step = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    bounds = (low - x) / scale, (high - x) / scale
    if ((step < bounds[0]) | (step > bounds[1])).any():
        step = lsq_linear(rows, wanted, bounds, method="bvls", max_iter=5 * n).x
        step = np.clip(step, *bounds)
    fall = float(c @ c - np.sum((R @ step + c) ** 2))
    return step * scale, fall
