"""Equilibria of a pressurised body with few unknowns: minima of U(x) - P V(x), followed from P = 0.

Both analytic laws are such a potential; U is the elastic energy and V the volume of the closed cavity, so the
load is a true follower pressure with its thrust on the ends. A minimum is a stable equilibrium under
prescribed pressure; where the branch of minima from P = 0 ends there is a limit load.
"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import ConvergenceError
from pneunet.base.units import KPA_PER_MPA
from pneunet.reduced.analytic.energies import Derivatives

TOLERANCE = 1e-11  # of the gradient, against the potential's scale
SMALLEST_STEP = 1e-4  # of the pressure asked for
LARGEST_UPDATE = 0.5  # of a scaled unknown in one Newton step


class Potential(Protocol):
    """What is minimised, in unknowns x (m,) of order 1. name: for messages; start: the unloaded state; scale:
    size of the energy."""

    name: str
    start: np.ndarray
    scale: float

    def admissible(self, x: np.ndarray) -> bool:
        """Whether x is a body at all."""

    def energy(self, x: np.ndarray) -> Derivatives:
        """The elastic energy U."""

    def volume(self, x: np.ndarray) -> Derivatives:
        """The cavity's volume V."""


def _minimise(potential, x, pressure, iterations=30):
    """The minimum near x by Newton's method, or None. Unknowns are scaled to order 1 by the potential."""
    for _ in range(iterations):
        U, V = potential.energy(x), potential.volume(x)
        gradient, hessian = U[1] - pressure * V[1], U[2] - pressure * V[2]
        if not np.isfinite(hessian).all():
            return None
        converged = abs(gradient).max() <= TOLERANCE * potential.scale
        try:
            np.linalg.cholesky(hessian)
        except np.linalg.LinAlgError:
            return None
        if converged:
            return x
        step = -np.linalg.solve(hessian, gradient)
        if abs(step).max() > LARGEST_UPDATE:
            return None
        x = x + step
        if not potential.admissible(x):
            return None
    return None


def states(potential: Potential, pressures: ArrayLike) -> Iterator[np.ndarray]:
    """Yield the state (unknowns,) at each of the increasing `pressures` (n,) >= 0 in MPa, reached from the
    one before.

    A step in pressure that finds no minimum close by is halved; ConvergenceError names the pressure reached
    when the branch of minima ends.
    """
    x, reached, step = potential.start, 0.0, np.inf
    for pressure in np.asarray(pressures, float):
        while reached < pressure:
            trial = min(pressure, reached + step)
            found = _minimise(potential, x, trial)
            if found is not None:
                step = 2 * (trial - reached) if trial < pressure else max(step, trial - reached)
                x, reached = found, trial
                continue
            step = (trial - reached) / 2
            if step < SMALLEST_STEP * pressure:
                raise ConvergenceError(
                    f"{potential.name}: no stable equilibrium beyond {reached * KPA_PER_MPA:.4g} kPa "
                    f"(asked for {pressure * KPA_PER_MPA:.4g} kPa): a limit load of this "
                    "model; lower the pressure or make the walls thicker"
                )
        yield x


def follow(potential: Potential, pressures: ArrayLike) -> np.ndarray:
    """All of `states` as an array (n, unknowns)."""
    found = list(states(potential, pressures))
    return np.array(found).reshape(len(found), potential.start.size)
