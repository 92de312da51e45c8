"""Will neighbouring chambers touch? A plate estimate of how far their walls bulge into the gap.

A chamber's wall is taken as a rectangular plate, clamped on all edges, of the cavity's height and slanted
length and of thickness `wall`, under the pressure P. Central deflection w from Roark's Formulas for Stress
and Strain (7th ed., Table 11.12, edges held), fitted by P a^4/(E t^4) = w/(alpha t) + MEMBRANE (w/t)^3 with a
the shorter side, E = 3 mu and alpha(b/a) Timoshenko's small-deflection coefficient. Against the FE of
twist-w12 and one-sided-w10 at 50 kPa it closes the gap 1.2 to 1.4 times too far: real edges turn, but gaps
also open as the segment bends. It is a design rule; only the FE says whether walls touch.
"""

import numpy as np

from pneunet.geometry.parameters import Segment

#: Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, Table 35 (nu = 0.3), times 12 (1 - nu^2)
SIDE_RATIOS = np.array([1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 1e9])
ALPHA = np.array([0.00126, 0.00172, 0.00207, 0.00230, 0.00245, 0.00254, 0.00260]) * 12 * 0.91
MEMBRANE = 30.0


def wall_bulge(segment: Segment, pressure: float) -> float:
    """Central deflection (mm) of one chamber wall at `pressure` (MPa)."""
    height, length = segment.chamber_height, segment.cavity_width / segment.sin
    short, long = min(height, length), max(height, length)
    t = segment.wall
    load = pressure * short**4 / (3 * segment.material.mu * t**4)
    stiffness = 1 / np.interp(np.log(long / short), np.log(SIDE_RATIOS), ALPHA)
    # the one real root of MEMBRANE x^3 + stiffness x = load (Cardano, with hyperbolic functions)
    q = 1.5 * load / stiffness * np.sqrt(3 * MEMBRANE / stiffness)
    x = 2 * np.sqrt(stiffness / (3 * MEMBRANE)) * np.sinh(np.arcsinh(q) / 3)
    return float(x * t)


def gap_left(segment: Segment, pressure: float) -> float:
    """Estimated distance (mm) left between facing walls; negative where they are expected to touch."""
    return segment.gap - 2 * wall_bulge(segment, pressure)
