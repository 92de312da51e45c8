"""What a clamp takes from the compliance of the rod behind it.

A clamp holds its section's shape too. A section that is stretched, bent or twisted would contract, curve
across or warp. Over about a depth the body is therefore stiffer than its section, and what is missing in
compliance is that of a length, the held one. Polynomials in the ratio of the sides give it for incompressible
rectangles; `python -m benchmarks --only clamp` has finite elements beside them (docs/theory-reduced.md).
"""

import numpy as np
from numpy.polynomial import polynomial

#: lengths over the side in the bending's plane, by the side across over it
BENDING = (0.0271, 0.0336, 0.0085)
#: over the shorter side, by the longer over it
STRETCHING = (0.056, 0.038)
#: over the longer side, by the shorter over it
TWISTING = (0.376, -0.666, 0.310)
#: of a piece, at most: what would be held beyond its end is left out
LARGEST_SHARE = 0.9


def held_lengths(width: float, height: float) -> np.ndarray:
    """(6,) lengths (mm) that a clamp holds of a rectangle, width along y, one of each of the strains (e, k);
    0 of shear, which a clamp hardly hinders. Its sides are in ratios of 1/4 to 4."""
    short, long = sorted((width, height))
    out = np.zeros(6)
    out[0] = short * polynomial.polyval(long / short, STRETCHING)
    out[3] = long * polynomial.polyval(short / long, TWISTING)
    out[4] = height * polynomial.polyval(width / height, BENDING)
    out[5] = width * polynomial.polyval(height / width, BENDING)
    return out


def stiffening(width: float, height: float, length: float) -> np.ndarray:
    """(6,) factors by which a piece of `length` mm (or infinite) behind a clamp is stiffer in (e, k) than its
    section; sides in mm."""
    return 1 / (1 - np.minimum(held_lengths(width, height) / length, LARGEST_SHARE))
