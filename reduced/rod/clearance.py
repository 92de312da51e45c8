"""Will neighbouring chambers touch, will their walls tear? A plate estimate of how far walls bulge.

A chamber's wall is taken as a rectangular plate, clamped on all edges, of the cavity's height and slanted
length and of thickness `wall`, under the pressure P. Central deflection w from Roark's Formulas for Stress
and Strain (7th ed., Table 11.12, edges held), fitted by P a^4/(E t^4) = w/(alpha t) + MEMBRANE (w/t)^3 with a
the shorter side, E = 3 mu and alpha(b/a) Timoshenko's small-deflection coefficient. Against the FE of
twist-w12 and one-sided-w10 at 50 kPa it closes the gap 1.2 to 1.4 times too far: real edges turn, but gaps
also open as the segment bends. It is a design rule; only the FE says whether walls touch.

A bulging wall is an arc over its shorter side: its mean stretch is the arc's length over the side's.
"""

import numpy as np

from pneunet.geometry.parameters import Segment
from pneunet.geometry.shape_numbers import SHAPE

#: Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, Table 35 (nu = 0.3), times 12 (1 - nu^2)
SIDE_RATIOS = np.array([1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 1e9])
ALPHA = np.array([0.00126, 0.00172, 0.00207, 0.00230, 0.00245, 0.00254, 0.00260]) * 12 * 0.91
MEMBRANE = 30.0
#: of the strain at break: what walls may come to, since bubbles and bonds tear before
SAFE = 0.5
#: bulge over half of the shorter side, below which an arc's stretch is taken as a parabola's
FLAT = 1e-4


def wall_bulge(segment: Segment, pressure: float) -> float:
    """Central deflection (mm) of one chamber wall at `pressure` (MPa)."""
    return _bulge(segment, pressure)[0]


def _bulge(segment, pressure):
    """(deflection, its derivatives by the cavity's height, its slanted length, the wall and the pressure)."""
    height, length = _sides(segment)
    short, long = min(height, length), max(height, length)
    t, mu = segment.wall, segment.material.mu
    load = pressure * short**4 / (3 * mu * t**4)
    ratio = np.log(long / short)
    alpha = np.interp(ratio, np.log(SIDE_RATIOS), ALPHA)
    stiffness = 1 / alpha
    # the one real root of MEMBRANE x^3 + stiffness x = load (Cardano, with hyperbolic functions)
    q = 1.5 * load / stiffness * np.sqrt(3 * MEMBRANE / stiffness)
    x = 2 * np.sqrt(stiffness / (3 * MEMBRANE)) * np.sinh(np.arcsinh(q) / 3)
    i = min(int(np.searchsorted(np.log(SIDE_RATIOS), ratio, side="right")), len(ALPHA) - 1)
    rise = (ALPHA[i] - ALPHA[i - 1]) / np.log(SIDE_RATIOS[i] / SIDE_RATIOS[i - 1])
    # load = load(short, t, P) and stiffness = stiffness(long/short)
    steep = 3 * MEMBRANE * x**2 + stiffness
    by_ratio = x * rise / alpha**2 / steep * t
    by_long, by_short = by_ratio / long, (4 * load / steep * t - by_ratio) / short
    by_height, by_length = (by_short, by_long) if height <= length else (by_long, by_short)
    return float(x * t), by_height, by_length, x - 4 * load / steep, load / steep * t / max(pressure, 1e-12)


def gap_left(segment: Segment, pressure: float) -> float:
    """Estimated distance (mm) left between facing walls; negative where they are expected to touch."""
    return segment.gap - 2 * wall_bulge(segment, pressure)


def closed_and_slopes(segment: Segment, pressure: float) -> tuple[float, np.ndarray]:
    """(part of the gap that facing walls are estimated to have closed, they touch from 1 on; its derivatives
    (15,) by geometry.shape_numbers.SHAPE, in degrees and mm, and by the pressure and the modulus in MPa)."""
    bulge, *by = _bulge(segment, pressure)
    slopes = 2 * _by_variables(segment, pressure, *by) / segment.gap
    slopes[SHAPE.index("gap")] -= 2 * bulge / segment.gap**2
    return 2 * bulge / segment.gap, slopes


def wall_stretch(segment: Segment, pressure: float) -> float:
    """Estimated mean stretch of a chamber's wall at `pressure` (MPa): an arc over the wall's shorter side."""
    return _arc(2 * wall_bulge(segment, pressure) / min(_sides(segment)))[0]


def allowed_stretch(segment: Segment) -> float:
    """Of a wall: SAFE of the silicone's elongation at break; inf where that is not known."""
    return 1 + SAFE * segment.material.elongation_at_break


def wall_stretch_and_slopes(segment: Segment, pressure: float) -> tuple[float, np.ndarray]:
    """(`wall_stretch`, its derivatives (15,) as in `closed_and_slopes`)."""
    bulge, by_height, by_length, *by_others = _bulge(segment, pressure)
    height, length = _sides(segment)
    short = min(height, length)
    ratio = 2 * bulge / short
    stretch, by_ratio = _arc(ratio)
    by_height -= ratio / 2 * (height <= length)  # 2 bulge/short changes with the short side, too
    by_length -= ratio / 2 * (height > length)
    slopes = _by_variables(segment, pressure, by_height, by_length, *by_others)
    return stretch, by_ratio * 2 / short * slopes


def _arc(ratio):
    """(length of an arc over its chord's, derivative) by its height over half of the chord."""
    if ratio < FLAT:
        return 1 + 2 * ratio**2 / 3, 4 * ratio / 3
    half_angle = float(np.arctan(ratio))
    return half_angle * (1 + ratio**2) / ratio, 1 / ratio + half_angle * (1 - 1 / ratio**2)


def _sides(segment):
    """A wall's height and slanted length, mm."""
    return segment.chamber_height, segment.cavity_width / segment.sin


def _by_variables(segment, pressure, by_height, by_length, by_wall, by_pressure):
    """(15,) derivatives by SHAPE, pressure and modulus of what has these by what `_bulge` depends on."""
    by_mu = -pressure / segment.material.mu * by_pressure  # the load is their ratio
    by_angle = -by_length * segment.cavity_width * segment.cot / segment.sin * np.radians(1.0)
    by = {"chamber_height": by_height, "wall": by_wall, "angle": by_angle}
    by |= {"width": by_length / segment.sin, "side_wall": -2 * by_length / segment.sin}
    return np.array([by.get(name, 0.0) for name in SHAPE] + [by_pressure, by_mu])
