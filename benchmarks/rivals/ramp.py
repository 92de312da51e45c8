"""What is compared: the load ramp and its strategies, written once for all codes. Needs numpy alone.

A code is a `Body`: arrays in, arrays out, whatever it keeps behind them. The strategies are
"same": the steps 1, 5, 10 .. 50 kPa, quadratic Lagrange extrapolation of the state in the load, and a Jacobian that is
factorised again only when an iteration has lowered the residual by less than 3.3 times (the first with the tangent at
u = 0 and P = 0: with pressure but without membrane stress it is useless);
"stock": Newton's method from the last state, a factorisation an iteration, no predictor.
"""

import time
from contextlib import contextmanager

import numpy as np

MPA = 1e-3  # MPa per kPa
MU = 0.317  # MPa, case twist-w12
LOADS = {
    "same": (2.5, *(5.0 * i for i in range(1, 11))),  # kPa
    "stock": (1.0, *(5.0 * i for i in range(1, 11))),
}
RELATIVE_TOLERANCE = 1e-8
LEAST_REDUCTION = 3.3
MAXIMUM_ITERATIONS = 40


class Body:
    """One code's discrete body. Arrays are over all its dofs, in whatever order it likes.

    state: (dofs,) displacements in mm and multipliers in MPa, zero where supported. forces(pressure) -> (residual of
    internal force plus pressure load, load alone, internal force alone) at the state; factorise(pressure) assembles and
    factorises the tangent there; solve(right) -> K^-1 right; fixed: indices of supported dofs; dofs: how many.
    """

    def __init__(self):
        self.seconds = {"residual": 0.0, "tangent": 0.0, "factorise": 0.0, "solve": 0.0}
        self.factorisations = 0

    @contextmanager
    def timed(self, name):
        start = time.perf_counter()
        yield
        self.seconds[name] += time.perf_counter() - start

    def balance(self, pressure):
        """(residual, zero at supports; its norm; the norm of what it balances: pressure load or support reaction)."""
        with self.timed("residual"):
            internal, load = self.forces()
            reaction = np.linalg.norm(internal[self.fixed])
            load[self.fixed] = 0.0
            residual = internal + pressure * load
            residual[self.fixed] = 0.0
            return residual, np.linalg.norm(residual), max(pressure * np.linalg.norm(load), reaction)

    def newton(self, pressure, tolerance, lagged, factorised=True):
        """Iterate to equilibrium; (iterations, norm, scale). `factorised`: a first factorisation is at hand."""
        residual, norm, scale = self.balance(pressure)
        before = np.inf
        for iteration in range(MAXIMUM_ITERATIONS):
            if norm <= tolerance * scale:
                return iteration, norm, scale
            if not (lagged and factorised and norm < before / LEAST_REDUCTION):
                self.factorise(pressure)
                self.factorisations += 1
                factorised = True
            self.state = self.state - self.solve(residual)
            before = norm
            residual, norm, scale = self.balance(pressure)
            if not norm < 1e8 * scale:
                break
        raise RuntimeError(f"{pressure / MPA:g} kPa: no convergence, residual {norm:.1e} N after {iteration + 1} iterations")


def extrapolate(known, load):
    """Lagrange polynomial through the last three (load, state) at `load`."""
    known = known[-3:]
    state = 0.0
    for i, (a, value) in enumerate(known):
        weight = np.prod([(load - b) / (a - b) for j, (b, _) in enumerate(known) if j != i])
        state = state + weight * value
    return state


def same(body, tolerance):
    """Ramp with predictor and lagged Jacobian; [(kPa, iterations, factorisations)]."""
    steps, known = [], [(0.0, body.state)]
    body.factorise(0.0)
    body.factorisations += 1
    for load in LOADS["same"]:
        count = body.factorisations
        if len(known) > 1:
            body.state = extrapolate(known, load)
        iterations, *_ = body.newton(load * MPA, tolerance, lagged=True)
        known.append((load, body.state))
        steps.append((load, iterations, body.factorisations - count))
    return steps


def stock(body, tolerance):
    """Ramp with full Newton from the last state."""
    steps = []
    for load in LOADS["stock"]:
        count = body.factorisations
        iterations, *_ = body.newton(load * MPA, tolerance, lagged=False)
        steps.append((load, iterations, body.factorisations - count))
    return steps


STRATEGIES = {"same": same, "stock": stock}
