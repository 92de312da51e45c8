"""Newton's method with a lagged tangent and secant acceleration, for any system and any control.

Between factorisations, steps are corrected by the secants seen so far (Anderson 1965; multisecant
quasi-Newton of type II, Fang & Saad, Numer. Linear Algebra Appl. 16, 2009): the residual that the past
increments explain is removed before the lagged tangent sees the rest. One solve and one residual an
iteration. On slender bodies a lagged tangent is no help once walls have bulged, however small the step. What
it makes worse is taken back, which costs a solve, and the tangent is factorised where the correction started:
steps can be many times longer. Where walls touch, corrections follow the contact law (System.correction),
and are shortened where they drive walls far into each other, or go further than forces do work along them.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from pneunet.hifi.fem.solver import NotConverged
from pneunet.hifi.path.system import PathControl, System

#: how often a correction is shortened at most
SHORTENINGS = 4
#: what a new tangent, and an updated one, must make of the residual where walls touch for the tangent to be
#: updated further
TANGENT_GAIN, UPDATE_GAIN = 0.2, 0.5
#: tangents factorised for one step, after which it should have come closer: beyond a limit point there is
#: nothing to come to
MOST_TANGENTS = 6
#: those where walls touch and the residual has grown: a smaller step is cheaper
MOST_TOUCHING = 2
#: of the work that forces do along a correction at its start: what they may still do at its end; residuals
#: for that
STILL, SEARCHES = 0.3, 6


@dataclass
class NewtonOptions:
    """relative_tolerance: of the norm of the forces balanced (absolute_tolerance in N, for no load at all).

    patience: a new tangent is factorised when the lagged one would need more than this many iterations to
    finish, at the rate of the last two. A factorisation costs 10 to 20 iterations at 30k to 150k dofs, and
    secants make the rate better than it looks at first. secants: how many are kept.
    """

    relative_tolerance: float = 1e-8
    absolute_tolerance: float = 1e-11
    patience: float = 12.0
    maximum_iterations: int = 60
    growth_limit: float = 1e4
    secants: int = 8


@dataclass
class NewtonResult:
    iterations: int
    residuals: list = field(default_factory=list)


class Newton:
    """Iterates a system to equilibrium at a value of its control's parameter."""

    def __init__(self, system: System, control: PathControl, options: NewtonOptions | None = None):
        self.system, self.control = system, control
        self.options = options or NewtonOptions()
        self.current = False  # whether there is a factorisation to lag
        self.factorised_at = None  # (state, load) of that factorisation
        #: called before every iteration, on all ranks at the same; what it raises ends the way
        self.between: Callable[[], object] = lambda: None
        self.timings = {"residual": 0.0, "factorise": 0.0, "renew": 0.0, "solve": 0.0}

    def timed(self, name: str, function: Callable, *arguments: Any) -> Any:
        start = perf_counter()
        try:
            return function(*arguments)
        finally:
            self.timings[name] += perf_counter() - start

    def factorise(self) -> None:
        self.timed("factorise", self.system.factorise)
        self.current, self.factorised_at = True, (self.system.state.copy(), self.system.load)

    def residual(self) -> tuple[np.ndarray, float, float]:
        """(residual, its norm, norm of the forces it balances)."""
        r, scale = self.timed("residual", self.system.residual)
        return r, np.sqrt(self.system.dot(r, r)), scale

    def solve(self, parameter: float) -> NewtonResult:
        """Iterate from the current state to equilibrium at the control's `parameter`; NotConverged
        otherwise."""
        o, system, control = self.options, self.system, self.control
        r, norm, scale = self.residual()
        history, secants = [norm], Secants(system, o.secants)
        # residuals that the lagged tangent has left; whether it is of the present state
        since, fresh = [norm], False
        factorised, due = 0, False  # tangents so far; whether walls that touch ask for the next
        for iteration in range(o.maximum_iterations + 1):
            self.between()
            tolerance = o.relative_tolerance * scale + o.absolute_tolerance
            if norm <= tolerance and control.satisfied(system, parameter):
                return NewtonResult(iteration, history)
            renewed = self.current and not due and self.timed("renew", system.renew)
            if not self.current or due or renewed is None or iterations_left(since, tolerance) > o.patience:
                factorised += 1
                worse = system.overreach > 0 and norm > max(history[:2])
                if factorised > (MOST_TOUCHING if worse else MOST_TANGENTS) and norm > 0.1 * history[0]:
                    raise NotConverged(
                        f"residual {norm:.1e} N after {factorised - 1} tangents, none of which helps"
                    )
                self.factorise()
                renewed, fresh = True, True
            if renewed:
                secants.forget()
                since = []
            state, load = system.state.copy(), system.load
            step, load_step = self.timed("solve", self._correction, r, parameter, secants)
            system.state = system.moved(state, step)
            system.load += load_step
            before = system.overreach
            new, new_norm, new_scale = self.residual()
            deepest = max(1.0, before)
            for _ in range(SHORTENINGS):
                if system.overreach <= deepest and np.isfinite(new_norm):
                    break
                fraction = (deepest - before) / (system.overreach - before) if np.isfinite(new_norm) else 0.3
                fraction = min(max(fraction, 0.1), 0.7)
                step, load_step = fraction * step, fraction * load_step
                system.state, system.load = system.moved(state, step), load + load_step
                new, new_norm, new_scale = self.residual()
            shorter = None
            if system.overreach > 0 and load_step == 0 and not new_norm < UPDATE_GAIN * norm:
                shorter = self._shortened(state, step, r, new)
            if shorter:
                step, new, new_norm, new_scale = shorter
            history.append(new_norm)
            if not fresh and not shorter and not new_norm < norm:
                # worse by a lagged tangent: take the correction back and factorise where it started
                system.state, system.load, self.current = state, load, False
                continue
            # what touches changes by much: iterate on it with new tangents until they reduce the residual
            due = (
                system.overreach > 0
                and bool(renewed)
                and not new_norm < (TANGENT_GAIN if fresh else UPDATE_GAIN) * norm
            )
            secants.add(step, load_step, new - r)
            r, norm, scale, fresh = new, new_norm, new_scale, False
            since.append(norm)
            if not np.isfinite(norm) or norm > o.growth_limit * max(history[0], scale):
                raise NotConverged(f"residual grew to {norm:.1e} N")
        raise NotConverged(
            f"residual {norm:.1e} N after {o.maximum_iterations} iterations (tolerance {tolerance:.1e} N)"
        )

    def _shortened(self, state, step, r, new):
        """(step, residual, its norm, the norm of what it balances) of that part of a correction from `state`
        at whose end forces do no more work along it, nearly, by regula falsi; None where the whole does not
        go further than that. r, new: residuals at its ends. (Matthies & Strang, Int. J. Numer. Methods Eng.
        14, 1979.)"""
        system = self.system
        low, high = (0.0, system.dot(step, r)), (1.0, system.dot(step, new))
        enough = STILL * abs(low[1])
        if abs(high[1]) < enough or low[1] * high[1] > 0:
            return None
        for _ in range(SEARCHES):
            (s, a), (t, b) = low, high
            part = s + (t - s) * min(max(a / (a - b), 0.1), 0.9)
            system.state = system.moved(state, part * step)
            found, norm, scale = self.residual()
            work = system.dot(step, found) if np.isfinite(norm) else -a
            if abs(work) < enough:
                break
            if work * a > 0:
                low, high = (part, work), (t, b / 2)
            else:
                low, high = (s, a / 2), (part, work)
        return part * step, found, norm, scale

    def _correction(self, r, parameter, secants):
        """(increment, load increment) of one iteration."""
        rest, known, known_load = secants.explain(r)
        step, load_step = self.system.correction(rest) - known, -known_load
        return self.control.close(self.system, parameter, step, load_step)


class Secants:
    """Pairs of increments and residual changes since the last factorisation."""

    def __init__(self, system: System, most: int):
        self.system, self.most = system, most
        self.forget()

    def forget(self) -> None:
        self._steps, self._loads, self._changes = [], [], []

    def add(self, step: np.ndarray, load_step: float, change: np.ndarray) -> None:
        for rows, row in ((self._steps, step), (self._loads, load_step), (self._changes, change)):
            rows.append(row)
            del rows[: max(0, len(rows) - self.most)]

    def explain(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray | float, float]:
        """(the rest of r, increment, load increment) that past changes explain in the least-squares sense."""
        if not self._changes:
            return r, 0.0, 0.0
        gram = np.array([[self.system.dot(a, b) for b in self._changes] for a in self._changes])
        right = np.array([self.system.dot(a, r) for a in self._changes])
        weights = np.linalg.lstsq(gram, right, rcond=1e-12)[0]
        return (
            r - sum(w * c for w, c in zip(weights, self._changes)),
            sum(w * s for w, s in zip(weights, self._steps)),
            sum(w * q for w, q in zip(weights, self._loads)),
        )


def iterations_left(history: list[float], tolerance: float) -> float:
    """Iterations to `tolerance` at the mean rate of the last two corrections; 0 when there is no rate yet."""
    if len(history) < 2:
        return 0.0
    back = min(2, len(history) - 1)
    rate = (history[-1] / history[-1 - back]) ** (1 / back)
    return np.inf if rate >= 1 else np.log(tolerance / history[-1]) / np.log(rate)
