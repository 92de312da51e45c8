"""From real numbers to what can be cast: whole chambers, and dimensions on a grid.

Both ask the linearised problem first: what the other variables can make up for costs nothing.
"""

from dataclasses import replace
from itertools import islice, product

import numpy as np

from pneunet.design.search.least_squares import Optimum, bounded_least_squares, bounded_step
from pneunet.design.search.problem import Evaluation, Problem
from pneunet.design.search.space import Variable

#: numbers of chambers that are tried beyond the most promising ones, and the cost over that of real-valued
#: ones at which the search for others stops
TRIED, GOOD_ENOUGH = 3, 1.2
#: evaluations from real-valued optima on, which are near
STEPS = 12
#: whole numbers of chambers that are looked at
MOST_COMBINATIONS = 4096
#: rounded first, while all others are still free to make up for it
FIRST = ("angle", "wall", "base_thickness", "roof")
#: of the others' steps while variables are rounded one by one: with less they leave where the linearised
#: problem is true
DAMPING = 1e-3

Found = tuple[Problem, Optimum[Evaluation]]


def optimised(problem: Problem, floor: float, steps: int = 30) -> Found | None:
    """The Problem around its local optimum, with that; None where it cannot be evaluated."""
    found = bounded_least_squares(problem.evaluate, problem.x, *problem.bounds, floor, steps)
    return None if found is None else (replace(problem, body=found.at.body), found)


def with_whole_chambers(
    problem: Problem, optimum: Optimum[Evaluation], floor: float, tried: int = TRIED
) -> list[Found]:
    """The Problem with whole numbers of chambers that are no variables any more, optimised, best first; from
    a real-valued optimum of it."""
    of_chambers = [j for j, v in enumerate(problem.variables) if v.name == "chambers"]
    variables = tuple(v for v in problem.variables if v.name != "chambers")
    free = [j for j in range(len(problem.x)) if j not in of_chambers]
    x, J, r = optimum.x, optimum.at.jacobian, optimum.at.residual
    if not of_chambers:
        found = optimised(replace(problem, variables=variables), floor)
        return [found] if found else []
    span = np.linalg.qr(J[:, free])[0]
    left, slopes = r - span @ (span.T @ r), J[:, of_chambers] - span @ (span.T @ J[:, of_chambers])
    around = []
    for value in x[of_chambers].tolist():
        nearest = max(1, round(value))
        other = max(1, int(np.floor(value)) + int(np.ceil(value)) - nearest)
        around.append([nearest] if other == nearest else [nearest, other])
    combinations = np.array(list(islice(product(*around), MOST_COMBINATIONS)), float)
    promised = np.sum((left[:, None] + slopes @ (combinations - x[of_chambers]).T) ** 2, axis=0)
    done: list[Found] = []
    for counts in combinations[np.argsort(promised, kind="stable")[:tried]]:
        body = replace(problem.body, counts=problem.body.counts.copy())
        for j, n in zip(of_chambers, counts):
            body.counts[list(problem.variables[j].segments)] = n
        found = optimised(replace(problem, variables=variables, body=body), floor, STEPS)
        if found:
            done.append(found)
            if found[1].cost <= max(GOOD_ENOUGH * optimum.cost, floor):
                break
    return sorted(done, key=lambda f: f[1].cost)


def on_grid(found: Found, grid: dict[str, float], floor: float) -> Found:
    """With every variable whose name has a `grid` on it, and no variable any more; the others optimised
    again."""
    problem, optimum = found
    for names in (FIRST, tuple(grid)):
        chosen = [v for v in problem.variables if v.name in names and v.name in grid]
        problem, optimum = _rounded(problem, optimum, chosen, grid, floor) or (problem, optimum)
    return problem, optimum


def _rounded(problem, optimum, chosen, grid, floor):
    """Chosen variables one by one on their grid, those whose rounding costs most first, each time with the
    best that the others can then do in the linearised problem."""
    x, (low, high, scale) = optimum.x.copy(), problem.bounds
    J, start = optimum.at.jacobian, optimum.at.residual
    places = {v: j for j, v in enumerate(problem.variables)}
    order = sorted(chosen, key=lambda v: -np.linalg.norm(J[:, places[v]]) * grid[v.name])
    for variable in order:
        j = places[variable]
        x[j] = low[j] = high[j] = rounded(variable, float(x[j]), grid[variable.name])
        free = low < high
        there = _Linear(start + J @ (x - optimum.x), J[:, free])
        step, _ = bounded_step(there, x[free], low[free], high[free], scale[free], DAMPING)
        x[free] = np.clip(x[free] + step, low[free], high[free])
    values = [x[places[v]] for v in chosen]
    body = problem.body.changed(chosen, np.array(values))
    kept = tuple(v for v in problem.variables if v not in chosen)
    return optimised(replace(problem, variables=kept, body=body), floor, STEPS)


class _Linear:
    def __init__(self, residual, jacobian):
        self.residual, self.jacobian = residual, jacobian


def rounded(variable: Variable, value: float, step: float) -> float:
    """The nearest multiple of `step` within a variable's range; the value itself where there is none."""
    least, most = np.ceil(variable.low / step - 1e-9), np.floor(variable.high / step + 1e-9)
    if least > most:
        return value
    return round(float(np.clip(round(value / step), least, most)) * step, 6)
