"""Where a curve begins and ends that its noisy points lie along.

The first point's foot is off by its noise. But the points after it tell as well where it should be: steps
between neighbours scatter about their mean. So the true places s of the feet f are those that make
sum (f_i - s_i)^2/noise^2 + sum (s_(i+1) - s_i - mean)^2/spread^2 least: one tridiagonal system.
"""

import numpy as np
from scipy.linalg import solveh_banded

#: of the mean step: a smaller spread of the steps is not believed. It is a difference of large numbers where
#: noise is larger than the steps, and one that is too small puts the ends where even steps would.
EVEN = 0.5


def ends(feet: np.ndarray, noise: float) -> tuple[float, float]:
    """(first, last) of the true places along a rod, mm, of points with feet (n,) there and a noise (standard
    deviation of a coordinate) in mm."""
    steps, n = np.diff(feet), len(feet)
    mean = float(steps.mean())
    # of what steps scatter by, the noise of both their ends is a part
    spread = np.sqrt(max(float(steps.var()) - 2 * noise**2, (EVEN * mean) ** 2))
    share = (noise / spread) ** 2
    band = np.zeros((2, n))
    band[0, 1:] = -share
    band[1] = 1 + 2 * share
    band[1, [0, -1]] = 1 + share
    right = feet.astype(float).copy()
    right[:-1] -= share * mean
    right[1:] += share * mean
    places = solveh_banded(band, right)
    return float(places[0]), float(places[-1])
