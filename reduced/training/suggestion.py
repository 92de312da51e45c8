"""Which designs would teach a law most, before they are computed: those that lower what it does not know,
over all that are on offer.

A Gaussian process's variance after an observation does not depend on what is observed (Rasmussen & Williams
2006, ch. 2.2). So designs are chosen one after the other, each lowering the mean variance over the offered
ones most, weighed by what it was: a law is judged by where it is furthest off. (Krause, Singh & Guestrin, J.
Mach. Learn. Res. 9, 2008, for sensors.)
"""

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from pneunet.base.errors import InputError
from pneunet.base.system.progress import progress
from pneunet.reduced.trained.gaussian import GaussianProcess
from pneunet.reduced.trained.law import KindLaw

#: free states of a design that may have walls in touch, at equal pressures up to its top one
LEVELS = 8
TOO_FEW = "{} designs are asked for, {} are on offer: offer more"


def most_telling(
    law: KindLaw,
    shape: np.ndarray,
    count: int,
    top_pressure: float,
    limit_share: float,
    touching: bool = False,
) -> np.ndarray:
    """(count,) rows of shape numbers (n, 13) whose designs a KindLaw would learn most from, the most telling
    first.

    By the leading free strain at the top P/mu, or at `limit_share` of the limit load where that is less;
    touching: by what contact adds to the bending stiffness, from designs whose walls touch up to there.
    InputError where fewer are on offer.
    """
    if len(shape) < count:
        raise InputError(TOO_FEW.format(count, len(shape)))
    pressure = np.full(len(shape), top_pressure)
    _, beyond, _ = law.path.at(shape, pressure, 0)
    pressure *= np.where(beyond > 0, limit_share * np.exp(-beyond), 1.0)
    if touching:
        if law.stiffness.contact is None:
            raise InputError("the law has seen too few designs whose walls touch: leave out --touching")
        process = law.stiffness.contact.processes[0]
        design, inputs = _touching(law, shape, pressure)
    else:
        process, design = law.path.learned.processes[0], np.arange(len(shape))
        inputs = law.path.at(shape, pressure, 0)[-1]
    blocks = [np.flatnonzero(design == number) for number in np.unique(design)]
    if len(blocks) < count:
        raise InputError(TOO_FEW.format(count, f"{len(blocks)} whose walls touch"))
    return np.unique(design)[greedy(process, inputs, blocks, count)]


def _touching(law, shape, top):
    """(design (m,), contact_inputs (m, d)) of the states at LEVELS pressures up to `top` (n,) where walls
    touch."""
    design = np.repeat(np.arange(len(shape)), LEVELS)
    shape, pressure = shape[design], top[design] * np.tile(np.arange(1, LEVELS + 1) / LEVELS, len(shape))
    strains = law.path.strains(shape, pressure, 0)
    closed = law.closed(shape, pressure, strains)
    met = closed > 1
    return design[met], law.coordinates.contact_inputs(shape[met], strains[met], closed[met])


def greedy(process: GaussianProcess, inputs: np.ndarray, blocks: list[np.ndarray], count: int) -> list[int]:
    """`count` of the blocks (lists of rows of inputs), each the one that lowers the process's weighed
    variance most."""
    unknown = process.covariance(inputs)
    weight = np.diag(unknown).copy()
    for block in blocks:
        weight[block] /= len(block)  # every design counts alike
    chosen: list[int] = []
    left = dict(enumerate(blocks))
    for _ in progress(range(count), "designs"):
        gains = {
            number: (weight * (_whitened(process, unknown, block) ** 2).sum(axis=0)).sum()
            for number, block in left.items()
        }
        best = max(gains, key=lambda number: gains[number])
        told = _whitened(process, unknown, left.pop(best))
        unknown -= told.T @ told
        chosen.append(best)
    return chosen


def _whitened(process, unknown, block):
    """(b, n) what observing the rows of a block tells of all: its square is what it takes off the
    covariance."""
    own = unknown[np.ix_(block, block)] + process.noise * np.eye(len(block)) + process.common_noise
    return solve_triangular(cholesky(own, lower=True), unknown[block], lower=True)
