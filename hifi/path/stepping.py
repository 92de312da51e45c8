"""Adaptive load steps along an equilibrium path. Knows nothing of the physics it steps.

The stepper asks its `path` object to predict and to correct at a load, and is told how many iterations that
took.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from pneunet.base.errors import ConvergenceError
from pneunet.hifi.fem.solver import NotConverged, PredictorTooFar


@dataclass
class StepSize:
    """Growth and cut-back of the load step (FESTIM's vocabulary)."""

    first: float
    smallest: float
    largest: float = float("inf")
    growth_factor: float = 2.0
    cutback_factor: float = 0.4
    target_iterations: int = 10
    milestones: tuple = ()


@dataclass(frozen=True)
class Step:
    """One accepted step; next_size is what the stepper tries after it."""

    number: int
    load: float
    iterations: int
    factorisations: int
    residual: float
    seconds: float
    next_size: float


@dataclass
class StepResult:
    """Accepted steps, failed attempts (load, why), why it ended, and what the path says about that (its
    diagnosis)."""

    steps: list = field(default_factory=list)
    failures: list = field(default_factory=list)
    reason: str = ""
    diagnosis: str = ""


def lagrange_coefficients(known: Sequence[float], wanted: float) -> list[float]:
    """Weights (m,) of values at loads `known` (m,) that extrapolate them to `wanted`."""
    weights = []
    for i, a in enumerate(known):
        w = 1.0
        for j, b in enumerate(known):
            if i != j:
                w *= (wanted - b) / (a - b)
        weights.append(w)
    return weights


class LoadPath(Protocol):
    """What is stepped along, by a parameter."""

    parameter: float

    def advance(self, parameter: float) -> tuple[int, int, float]:
        """(iterations, factorisations, residual) there; NotConverged with the last accepted state
        restored."""

    def told(self, parameter: float) -> str:
        """A parameter in words, with its unit."""

    def diagnosis(self) -> str:
        """Words on why it cannot go on."""


def run_steps(
    path: LoadPath,
    target: float,
    size: StepSize,
    on_step: Callable[[Step], None] = lambda step: None,
    before: Step | None = None,
) -> StepResult:
    """Drive `path` from its current load to `target`; return a StepResult.

    `on_step(step)` is called after each accepted step (hooks write results there). `before`: the last Step of
    a run that this one continues; its numbers, seconds and step size go on. Raises ConvergenceError, with the
    StepResult as its `result`, when steps fall below size.smallest.
    """
    result = StepResult()
    milestones = sorted({m for m in size.milestones if path.parameter < m < target} | {target})
    step, number, started = size.first, 0, time.perf_counter()
    if before:
        step, number, started = before.next_size, before.number, started - before.seconds
    while milestones:
        remaining = milestones[0] - path.parameter
        step = min(step, size.largest)  # which on_step may have changed
        # hit the milestone exactly, and never leave a sliver of a step before it
        load = (
            milestones[0]
            if step > 0.999 * remaining
            else path.parameter + (step if step < 0.6 * remaining else remaining / 2)
        )
        attempted = load - path.parameter
        try:
            iterations, factorisations, residual = path.advance(load)
        except NotConverged as error:
            too_far = isinstance(error, PredictorTooFar)  # nothing but a residual was spent
            step = attempted * (0.75 if too_far else size.cutback_factor)
            if not too_far:
                result.failures.append((load, str(error)))
            if step < size.smallest:
                result.reason, result.diagnosis = str(error), path.diagnosis()
                why = (
                    result.diagnosis
                    or "a limit point (ballooning), touching walls or a coarse mesh are the usual causes"
                )
                failure = ConvergenceError(
                    f"stopped at {path.told(path.parameter)}: the next step, to {path.told(load)}, did not"
                    f" converge ({error}); results up to there are kept; {why}"
                )
                failure.result = result
                raise failure from None
            continue
        if load == milestones[0]:
            milestones.pop(0)
        if iterations <= size.target_iterations:
            step = max(step, attempted) * size.growth_factor
        elif iterations > 2 * size.target_iterations:
            step = max(attempted * 0.7, size.smallest)
        number += 1
        accepted = Step(
            number, load, iterations, factorisations, residual, time.perf_counter() - started, step
        )
        result.steps.append(accepted)
        on_step(accepted)
    return result
