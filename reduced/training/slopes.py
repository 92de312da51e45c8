"""Derivatives of free states along directions of shape and stiffening, turned into those of what is
learned."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pneunet.reduced.trained.coordinates import cosine
from pneunet.reduced.training.regression import Slopes
from pneunet.reduced.training.states import States

#: what a process is given, or gives, of each state
OfStates = Callable[[States], np.ndarray]

#: step of central differences along directions (degrees, normal pitches, stiffening): the transformations
#: are smooth there
STEP = 1e-4
#: of the angle, below which derivatives along it are not used
SMALLEST_COSINE = 0.2


def stepped(states: States, way: np.ndarray, step: float) -> States:
    """States (n,) a step along the direction `way` (n,) of each, as far as their slopes tell."""
    rows = np.arange(len(way))
    change = {"numbers": states.directions[way], "pressure": states.pressure_slopes[rows, way]}
    change |= {"strains": states.strain_slopes[rows, way], "matrices": states.matrix_slopes[rows, way]}
    return replace(states, **{name: getattr(states, name) + step * by for name, by in change.items()})


def along(states: States, way: np.ndarray, of: OfStates) -> np.ndarray:
    """(n, ...) derivative of what `of` gives of each state along its direction `way` (n,)."""
    low, high = (of(stepped(states, way, step)) for step in (-STEP, STEP))
    return (high - low) / (2 * STEP)


def known_slopes(slopes: np.ndarray) -> np.ndarray:
    """(n, s) bool: which of slopes (n, s, ...) are known."""
    return np.isfinite(slopes).all(axis=tuple(range(2, slopes.ndim)))


def along_all(states: States, known: np.ndarray, of: OfStates) -> np.ndarray:
    """(n, s, ...) derivatives of what `of` gives along every direction; nan where they are not `known` (n,
    s)."""
    at, way = np.nonzero(known)
    found = along(states.of(at), way, of)
    out = np.full((*known.shape, *found.shape[1:]), np.nan)
    out[at, way] = found
    return out


def slopes_of(
    states: States, known: np.ndarray, inputs: OfStates, outputs: OfStates, some: np.ndarray
) -> Slopes:
    """Slopes of the states where they are `known` (n, s), among those that are `some` (n,), in the order of
    np.nonzero.

    inputs, outputs: what the process sees.
    """
    at, way = np.nonzero(known & some[:, None])
    s = states.of(at)
    return Slopes((np.cumsum(some) - 1)[at], along(s, way, inputs), along(s, way, outputs))


def in_deviations(slopes: Slopes, inputs: np.ndarray) -> np.ndarray:
    """(r, p) Slopes over a standard deviation of the inputs (n, d)."""
    return slopes.in_units(np.maximum(inputs.std(axis=0), 1e-12)).values


def told_by_angle(states: States) -> np.ndarray:
    """(n, s) bool: not along the angle near 90 degrees, where what is odd in its cosine is divided by it."""
    return (np.abs(cosine(states.numbers)) > SMALLEST_COSINE)[:, None] | (states.directions[:, 0] == 0)
