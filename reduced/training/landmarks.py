"""What makes a law's doubt cheap, found once from its training states: landmarks among the inducing points,
and how much of the variance observations leave besides what the inducing points do.

Landmarks are chosen one after the other, each the one that lowers the variance left at the states most;
states of which little is known count more. (Measured: 350 of 1,600 so chosen show of every one of 3,500
random states in the law's range that it is known.)
"""

from dataclasses import replace

import numpy as np

from pneunet.reduced.trained.free_path import FreePath
from pneunet.reduced.trained.gaussian import JITTER, GaussianProcess, kernel
from pneunet.reduced.trained.unexplained import Unexplained

#: of the inducing points; and states that they are chosen for, drawn at random
LANDMARKS, STATES = 350, 1000
#: of the way from one training state to another, there or away from it
BEYOND = 0.5


def with_cheap_doubt(path: FreePath, x: np.ndarray) -> FreePath:
    """The FreePath with landmarks and remainder from the path_inputs (n, d) of the training states; takes the
    roots of all observations."""
    processes = path.learned.processes
    rest = np.array([remainder(process, x) for process in processes])
    return replace(path, remainder=rest, landmarks=landmarks(processes[0], x))


def remainder(process: GaussianProcess, x: np.ndarray) -> tuple[float, float]:
    """(factor, power) of a GaussianProcess as FreePath has them, fitted between and beyond random pairs of
    inputs x (n, d): what is asked for lies between what was observed."""
    random = np.random.default_rng(0)
    one, other = x[random.integers(len(x), size=(2, STATES))]
    z = one + random.uniform(-BEYOND, BEYOND, (STATES, 1)) * (other - one)
    left = np.maximum(Unexplained(process)(z), JITTER)
    besides = np.maximum(process.deviation(z)[:, 0] ** 2 / process.variance[0] - left, JITTER)
    power, factor = np.polynomial.Polynomial.fit(np.log(left), np.log(besides), 1).convert().coef[::-1]
    return float(np.exp(factor)), max(float(power), 0.0)


def landmarks(process: GaussianProcess, x: np.ndarray) -> np.ndarray:
    """(l,) places of LANDMARKS inducing points, or of all where they are fewer, for inputs x (n, d)."""
    some = np.random.default_rng(0).permutation(len(x))[:STATES]
    states, points = (x[some] - process.shift) @ process.to_kernel, process.points
    # what is left, with those chosen, of: the states' variances, their covariances with all inducing points,
    # and the inducing points' variances; rows: of their root, by the chosen ones
    left, across, own = np.ones(len(states)), kernel(states, points), np.full(len(points), 1 + JITTER)
    rows, chosen = np.zeros((min(LANDMARKS, len(points)), len(points))), np.zeros(0, int)
    for number, row in enumerate(rows):
        gain = left @ across**2 / np.maximum(own, JITTER)
        gain[chosen] = -1
        best = int(gain.argmax())
        row[:] = kernel(points[best : best + 1], points)[0] - rows[:number, best] @ rows[:number]
        row[best] += JITTER
        row /= np.sqrt(row[best])
        told = across[:, best] / row[best]
        left = np.maximum(left - told**2, 0)
        across -= np.outer(told, row)
        own -= row**2
        chosen = np.append(chosen, best)
    return chosen
