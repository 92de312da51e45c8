"""What is compared: the load ramp and its strategies, written once for all codes. Needs numpy alone.

A code is a `Body`: arrays in, arrays out, whatever it keeps behind them. The strategies are "same": the steps
2.5, 5, 10 .. 50 kPa, quadratic Lagrange extrapolation of the state in the load, and a Jacobian that is
factorised again only when an iteration has lowered the residual by less than 3.3 times (the first with the
tangent at u = 0 and P = 0: with pressure but without membrane stress it is useless); "stock": Newton's method
from the last state, a factorisation an iteration, no predictor; in steps of 2.5 kPa, the largest with which
it arrives (5 kPa fail from the second step on; halving on failure costs 40 % more).
"""

import time
from contextlib import contextmanager

import numpy as np

MPA = 1e-3  # MPa per kPa
MU = 0.317  # MPa, case twist-w12
MILESTONES = tuple(5.0 * i for i in range(1, 11))  # kPa
SAME_LOADS = (2.5, *MILESTONES)
STOCK_LOADS = tuple(2.5 * i for i in range(1, 21))
RELATIVE_TOLERANCE = 1e-8
LEAST_REDUCTION = 3.3
MAXIMUM_ITERATIONS = 40


class Body:
    """One code's discrete body. Arrays are over all its dofs, in whatever order it likes.

    state: (dofs,) displacements in mm and multipliers in MPa, zero where supported. forces() -> (internal
    force, load per unit of pressure) at the state; factorise(pressure) assembles and factorises the tangent
    there; solve(right) -> K^-1 right; fixed: indices of supported dofs; dofs: how many; displacements() ->
    points and displacements (n, 3) in mm.
    """

    speaks = True

    def __init__(self):
        self.seconds = {"residual": 0.0, "tangent": 0.0, "factorise": 0.0, "solve": 0.0}
        self.factorisations = 0

    def warm_up(self):
        """Everything compiled and made that is made once, but no factorisation."""
        self.balance(0.0)
        self.seconds = dict.fromkeys(self.seconds, 0.0)

    @contextmanager
    def timed(self, name):
        start = time.perf_counter()
        yield
        self.seconds[name] += time.perf_counter() - start

    def balance(self, pressure):
        """(residual, zero at supports; its norm; the norm of what it balances: pressure load or support
        reaction)."""
        with self.timed("residual"):
            internal, load = self.forces()
            reaction = np.linalg.norm(internal[self.fixed])
            load[self.fixed] = 0.0
            residual = internal + pressure * load
            residual[self.fixed] = 0.0
            return residual, np.linalg.norm(residual), max(pressure * np.linalg.norm(load), reaction)

    def newton(self, pressure, tolerance, lagged):
        """Iterate to equilibrium; number of iterations. `lagged`: begin with the factorisation at hand."""
        residual, norm, scale = self.balance(pressure)
        before = np.inf
        for iteration in range(MAXIMUM_ITERATIONS):
            if norm <= tolerance * scale:
                return iteration
            if not (lagged and norm < before / LEAST_REDUCTION):
                self.factorise(pressure)
                self.factorisations += 1
            self.state = self.state - self.solve(residual)
            before = norm
            residual, norm, scale = self.balance(pressure)
            if not norm < 1e8 * scale:
                break
        raise RuntimeError(
            f"{pressure / MPA:g} kPa: no convergence, residual {norm:.1e} N after {iteration + 1} iterations"
        )


def extrapolate(known, load):
    """Lagrange polynomial through the last three (load, state) at `load`."""
    known = known[-3:]
    state = 0.0
    for i, (a, value) in enumerate(known):
        weight = np.prod([(load - b) / (a - b) for j, (b, _) in enumerate(known) if j != i])
        state = state + weight * value
    return state


def same(body, tolerance, loads=SAME_LOADS):
    """Ramp with predictor and lagged Jacobian."""
    steps, known = [], [(0.0, body.state)]
    body.factorise(0.0)
    body.factorisations += 1
    for load in loads:
        count = body.factorisations
        if len(known) > 1:
            body.state = extrapolate(known, load)
        iterations = body.newton(load * MPA, tolerance, lagged=True)
        known.append((load, body.state))
        steps.append((load, iterations, body.factorisations - count))
    return summary(body, steps)


def stock(body, tolerance):
    """Ramp with full Newton from the last state."""
    steps = []
    for load in STOCK_LOADS:
        iterations = body.newton(load * MPA, tolerance, lagged=False)
        steps.append((load, iterations, iterations))
    return summary(body, steps)


def best(body, tolerance):
    """pneunet's own stepping."""
    return summary(body, body.ramp(tolerance))


def begin(body, tolerance):
    """The first two steps of "same": for what takes long."""
    return same(body, tolerance, SAME_LOADS[:2])


def summary(body, steps):
    """What a ramp took; steps: [(kPa, iterations, factorisations)]."""
    counts = {"iterations": sum(s[1] for s in steps), "factorisations": body.factorisations}
    return counts | {"steps": steps, "parts": body.seconds}


def operations(body, tolerance, repeats=5):
    """Least seconds of each operation, the second and later factorisations (same pattern); "analyse": what
    the first adds."""
    pressure = SAME_LOADS[0] * MPA
    body.factorise(0.0)
    first, taken = body.seconds["factorise"], []
    for _ in range(repeats):
        body.seconds = dict.fromkeys(body.seconds, 0.0)
        right, *_ = body.balance(pressure)
        body.factorise(0.0)
        body.solve(right)
        taken.append(body.seconds)
    least = {name: min(t[name] for t in taken) for name in body.seconds}
    return least | {"analyse": first - least["factorise"]}


TASKS = {task.__name__: task for task in (same, stock, best, begin, operations)}
