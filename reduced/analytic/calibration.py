"""Fit the analytic models' constants to free states, as the paper fitted E_t to its experiments (Sec. III).

`calibrate_tube`: E_t of the twisting tube, with the radii if wanted; fit each fibre convention and compare. A
tube here is turned like a segment: tau > 0 for chambers of less than 90 degrees, its fibres at -angle.
`calibrate_softness`: a factor on the pressure of the one-sided cell, which is one on 1/mu, and its growth
with the slant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares, minimize

from pneunet.base.errors import ConvergenceError
from pneunet.geometry.parameters import Segment
from pneunet.reduced.analytic.equilibrium import states
from pneunet.reduced.analytic.helical import HelicalCell
from pneunet.reduced.analytic.twisting import TubePotential, TwistingTube

Floats = Sequence[float] | np.ndarray
#: where the search for the best tube begins: E_t/mu and Ri/Ro
MODULI, RATIOS = np.geomspace(0.03, 30, 10), np.linspace(0.2, 0.9, 8)


@dataclass(frozen=True)
class TwistCurves:
    """angles (n,) in degrees, pressures (m,) in MPa, increasing; tau in rad per mm of deformed length and
    stretch (n, m).

    nan: no state. tau > 0 for chambers of less than 90 degrees.
    """

    angles: np.ndarray
    pressures: np.ndarray
    tau: np.ndarray
    stretch: np.ndarray


@dataclass(frozen=True)
class Calibration:
    """tube: the TwistingTube found. tau_error, stretch_error: root mean squares of the errors of tau and of
    stretch - 1 over the root mean squares of what was fitted; states that the tube does not have count as 1.
    """

    tube: TwistingTube
    tau_error: float
    stretch_error: float


def tube_curves(tube: TwistingTube, angles: Floats, pressures: Floats) -> TwistCurves:
    """TwistCurves of a tube: nan beyond its limit load."""
    tau, stretch = np.full((2, len(angles), len(pressures)), np.nan)
    for i, angle in enumerate(angles):
        try:
            for j, x in enumerate(states(TubePotential(tube, angle), pressures)):
                tau[i, j], stretch[i, j] = -x[2] / (tube.outer_radius * x[1]), x[1]
        except ConvergenceError:
            pass
    return TwistCurves(np.asarray(angles, float), np.asarray(pressures, float), tau, stretch)


def calibrate_tube(curves: TwistCurves, start: TwistingTube, radii: bool = True) -> Calibration:
    """The Calibration of the tube nearest to `curves`; `start` gives mu, fractions, fibre convention and,
    without `radii`, those.

    What is least is the sum of the squares of the two errors. tau of similar tubes goes with 1/size, so the
    size that serves tau best is known in closed form for each E_t and Ri/Ro, and only those two are searched:
    on a grid, then by Nelder-Mead, which does not mind the jumps where states are lost to a limit load.
    """

    def candidate(x):
        modulus, ratio = start.mu * np.exp(x[0]), x[1] if radii else start.inner_radius / start.outer_radius
        if not 0.01 < ratio < 0.99:
            return None
        tube = replace(start, inner_radius=ratio * start.outer_radius, fibre_modulus=float(modulus))
        found = tube_curves(tube, curves.angles, curves.pressures)
        tau, stretch = np.nan_to_num(found.tau), np.where(np.isnan(found.stretch), 1.0, found.stretch)
        overlap = (tau * curves.tau).sum()
        size = (tau**2).sum() / overlap if radii and overlap > 0 else 1.0
        tube = replace(
            tube, inner_radius=float(size * tube.inner_radius), outer_radius=float(size * tube.outer_radius)
        )
        errors = (tau / size - curves.tau, curves.tau), (stretch - curves.stretch, curves.stretch - 1)
        return Calibration(
            tube, *(float(np.linalg.norm(error) / np.linalg.norm(wanted)) for error, wanted in errors)
        )

    def cost(x):
        found = candidate(x)
        return np.inf if found is None else found.tau_error**2 + found.stretch_error**2

    moduli = np.log(MODULI) if radii else np.linspace(np.log(MODULI[0]), np.log(MODULI[-1]), 30)
    grid = [np.array(x) for x in product(moduli, *([RATIOS] if radii else []))]
    best = minimize(
        cost, min(grid, key=cost), method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-8, "maxfev": 150}
    )
    return candidate(best.x)


def softened_curvature(
    segment: Segment, pressures: Floats, softness: float, slant: float = 0.0
) -> np.ndarray:
    """|k| (n,) in 1/mm of the one-sided cell at `softness` sin(angle)^-slant times the pressures (n,) in MPa;
    nan: no state."""
    cell, curvature = HelicalCell(segment), np.full(len(pressures), np.nan)
    try:
        for j, x in enumerate(states(cell, softness * segment.sin**-slant * np.asarray(pressures))):
            curvature[j] = np.linalg.norm(cell.rod_strains(x[None]).k)
    except ConvergenceError:
        pass
    return curvature


def calibrate_softness(
    segments: Sequence[Segment], pressures: Floats, curvature: np.ndarray, slanted: bool = True
) -> tuple[float, float]:
    """(softness, slant) for which `softened_curvature` is nearest to `curvature` (segments, pressures), in
    1/mm.

    Relative errors in the least-squares sense, 1 where the cell has no state; slant 0 unless `slanted`.
    """

    def errors(x):
        found = [softened_curvature(s, pressures, np.exp(x[0]), *x[1:]) for s in segments]
        return (np.nan_to_num(np.array(found)) / curvature - 1).ravel()

    x = least_squares(errors, [0.0, 0.0][: 1 + slanted], diff_step=1e-3, x_scale=0.1, xtol=1e-5, ftol=1e-8).x
    return float(np.exp(x[0])), float(x[1]) if slanted else 0.0
