"""The paper's twisting equations as printed (Eqs 5-21), and what its printed constants give.

`python -m pneunet.reduced.analytic.printed` prints both. The equations have no solution: with uniform
lambda_psi = lambda_z^-1/2 and a constant multiplier the three conditions contradict one another, and without
c1 mu lambda_psi^2 in Eq. 11 not even P = 0 leaves the tube at rest. The consistent form is
reduced/analytic/twisting.py.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.reduced.analytic import twisting
from pneunet.reduced.analytic.twisting import GAUSS_POINTS, TwistingTube

MULTIPLIERS = ("unknown", "pressure")


@dataclass(frozen=True)
class PrintedResult:
    """Best attempt at the printed equations; residual of Eqs 19, 20, 21 relative to P, P pi Ri^2, P pi
    Ri^3."""

    solved: bool
    unknowns: dict[str, float]
    residual: np.ndarray
    starts: int

    def __str__(self) -> str:
        state = ", ".join(f"{k} = {v:.4g}" for k, v in self.unknowns.items())
        head = (
            "solution"
            if self.solved
            else f"no solution in the physical range ({self.starts} starts); least residual"
        )
        return f"{head}: |residual| = {np.linalg.norm(self.residual):.3g} at {state}"


def printed_residual(
    tube: TwistingTube, angle: float, pressure: float, tau: float, stretch: float, multiplier: float
) -> np.ndarray:
    """Eqs 19-21 as printed (3,): lambda_psi = lambda_z^-1/2, Eq. 11 without c1 mu lambda_psi^2, cos on the
    hoop.

    `multiplier` stands where Eqs 10-12 print P.
    """
    hoop_stretch = stretch**-0.5
    ri, ro = tube.inner_radius * hoop_stretch, tube.outer_radius * hoop_stretch
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    r, w = (ro + ri) / 2 + (ro - ri) / 2 * points, (ro - ri) / 2 * weights
    c1mu, c2E = tube.isotropic_fraction * tube.mu, tube.anisotropic_fraction * tube.fibre_modulus
    sin, cos = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    shear = tau * r * stretch
    along = hoop_stretch * cos + shear * sin
    fibre = c2E * (1 - 1 / np.sqrt(along**2 + (stretch * sin) ** 2))
    s_rr = -multiplier + c1mu / (stretch * hoop_stretch) ** 2
    s_pp = -multiplier + c1mu * shear**2 + fibre * along**2
    s_zz = -multiplier + c1mu * stretch**2 + fibre * (stretch * sin) ** 2
    s_pz = stretch * (c1mu * shear + fibre * sin * along)
    Ri, thrust = tube.inner_radius, pressure * np.pi * tube.inner_radius**2
    return np.array(
        [
            (w @ ((s_pp - s_rr) / r) - pressure) / pressure,
            (2 * np.pi * w @ (s_zz * r) - pressure * np.pi * ri**2) / thrust,
            2 * np.pi * w @ (s_pz * r**2) / (thrust * Ri),
        ]
    )


def printed_equations(
    tube: TwistingTube, angle: float, pressure: float, multiplier: str = "unknown", seed: int = 0
) -> PrintedResult:
    """Try to solve the paper's printed Eqs 5-21 and report; pressure > 0 in MPa, angle in degrees.

    multiplier: 'unknown' takes the letter P in Eqs 10-12 for the constant multiplier p, one of the paper's
    three unknowns; 'pressure' takes it literally. Least squares from many starting points over the physical
    range (|tau| <= 0.2 rad/mm, 0.5 <= lambda <= 2.5, |p| <= 2 MPa).
    """
    if not pressure > 0:
        raise InputError(f"pressure = {pressure:g} MPa must be larger than 0")
    if multiplier not in MULTIPLIERS:
        raise InputError(f"multiplier = '{multiplier}' is not known: write 'unknown' or 'pressure'")
    low, high = np.array([-0.2, 0.5, -2.0]), np.array([0.2, 2.5, 2.0])
    free = 3 if multiplier == "unknown" else 2
    starts = low[:free] + (high - low)[:free] * np.random.default_rng(seed).random((60, free))

    def residual(x):
        return printed_residual(tube, angle, pressure, x[0], x[1], x[2] if free == 3 else pressure)

    fits = [
        least_squares(
            residual,
            x,
            bounds=(low[:free], high[:free]),
            x_scale=(high - low)[:free],
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        )
        for x in starts
    ]
    best = min(fits, key=lambda fit: fit.cost)
    names = ("tau", "lambda_z", "p")[:free]
    solved = bool(np.linalg.norm(best.fun) < 1e-8)
    return PrintedResult(solved, dict(zip(names, best.x.tolist())), best.fun, len(starts))


def largest_twist(
    tube: TwistingTube, angles: Iterable[float] = range(30, 90, 5), step: float = 1e-3, highest: float = 0.2
) -> tuple[float, float, float]:
    """(tau, angle, pressure) of the largest |tau| that the consistent form reaches below its limit load,
    rad/mm."""
    best = (0.0, 0.0, 0.0)
    for angle in angles:
        for pressure in np.arange(step, highest, step):
            try:
                tau = tube.solve(angle, pressure)[2]
            except ConvergenceError:
                break
            best = max(best, (float(np.abs(tau)), float(angle), float(pressure)))
    return best


def main() -> None:
    """What the module is for, printed."""
    for fibre_modulus in (twisting.PAPER_FIBRE_MODULUS, 100 * twisting.PAPER_FIBRE_MODULUS):
        tube = TwistingTube(3.0, 7.0, twisting.PAPER_MU, fibre_modulus)
        tau, angle, pressure = largest_twist(tube, range(30, 90, 10), 2e-3)
        print(f"Ri = 3 mm, Ro = 7 mm, mu = {tube.mu} MPa, E_t = {fibre_modulus:g} MPa")
        kPa = f"{pressure * KPA_PER_MPA:.0f} kPa"
        print(f"  consistent form: largest |tau| {tau:.5f} rad/mm (angle {angle:g} deg, {kPa})")
        for multiplier in MULTIPLIERS:
            result = printed_equations(tube, 60.0, 0.02, multiplier)
            print(f"  printed equations, 60 deg, 20 kPa, P in Eqs 10-12 = {multiplier}: {result}")


if __name__ == "__main__":
    main()
