"""The twisting tube: the paper's Sec. II.A (Eqs 1-21) in a consistent form.

A tube of isotropic neo-Hookean matrix and one family of fibres along the chambers, capped and inflated:
  r^2 = ri^2 + (R^2 - Ri^2)/lambda,  psi = Psi + k Z,  z = lambda Z,   k = tau lambda,
  W = c1 mu/2 (I1 - 3) + c2 E_t/2 (sqrt(I4) - 1)^2.                                       (paper, Eqs 2-4)
The three balances of Eqs 19-21 (radial equilibrium, capped ends, no torque) are the stationarity of
  Pi(ri, lambda, k) = 2 pi int W R dR - P pi (ri^2 lambda - Ri^2)
per undeformed length. The paper's own form, which has no solution, is in reduced/analytic/printed.py.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError
from pneunet.reduced.analytic.energies import Derivatives
from pneunet.reduced.analytic.equilibrium import follow

#: Components of the fibre A(angle) on the axis Z and the hoop Psi. `axial`: the text below Eq. 3, angle
#: measured from the axis, which is what a chamber does; `hoop`: Eqs 11-12, cos on the hoop direction.
FIBRE_CONVENTIONS: dict[str, tuple[np.ufunc, np.ufunc]] = {
    "axial": (np.cos, np.sin),
    "hoop": (np.sin, np.cos),
}

#: The paper's constants for its twisting theory: Eq. 2, below Eq. 1, Sec. III.
PAPER_MU, PAPER_FIBRE_MODULUS, PAPER_ISOTROPIC_FRACTION, PAPER_ANISOTROPIC_FRACTION = 0.317, 0.008, 0.27, 0.73

GAUSS_POINTS = 12


@dataclass(frozen=True)
class TwistingTube:
    """inner_radius, outer_radius: Ri, Ro in mm; mu, fibre_modulus: shear modulus and E_t in MPa; fractions
    c1, c2.

    fibre_convention: 'axial' (A = (cos, sin) on (Z, Psi)) or 'hoop' (A = (sin, cos)).
    """

    inner_radius: float
    outer_radius: float
    mu: float
    fibre_modulus: float
    isotropic_fraction: float = PAPER_ISOTROPIC_FRACTION
    anisotropic_fraction: float = PAPER_ANISOTROPIC_FRACTION
    fibre_convention: str = "axial"

    def __post_init__(self) -> None:
        if not 0 < self.inner_radius < self.outer_radius:
            raise InputError(
                f"inner_radius = {self.inner_radius:g} must lie between 0 and outer_radius ="
                f" {self.outer_radius:g} mm"
            )
        for name in ("mu", "fibre_modulus", "isotropic_fraction", "anisotropic_fraction"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} = {getattr(self, name):g} must be larger than 0")
        if self.fibre_convention not in FIBRE_CONVENTIONS:
            raise InputError(
                f"fibre_convention = '{self.fibre_convention}' is not known: write 'axial' or 'hoop'"
            )

    def solve(self, angle: float, pressure: float | ArrayLike) -> tuple[float | np.ndarray, ...]:
        """(ri, lambda_z, tau): inner radius in mm, stretch, rad per mm of deformed length; each shaped as
        pressure.

        angle in degrees; pressure in MPa, a number or an array. ConvergenceError beyond the limit load.
        """
        pressure = np.asarray(pressure, float)
        if not (np.isfinite(pressure).all() and (pressure >= 0).all()):
            raise InputError("pressure: give finite values >= 0 in MPa")
        levels, where = np.unique(pressure, return_inverse=True)
        x = follow(TubePotential(self, angle), levels)[where.ravel()]
        ri, stretch = self.inner_radius * x[:, 0], x[:, 1]
        tau = x[:, 2] / (self.outer_radius * stretch)
        return tuple(a.reshape(pressure.shape) if pressure.ndim else float(a[0]) for a in (ri, stretch, tau))


class TubePotential:
    """Energy and cavity volume per undeformed length; unknowns x = (ri/Ri, lambda, k Ro)."""

    name = "twisting tube"
    start = np.array([1.0, 1.0, 0.0])

    def __init__(self, tube: TwistingTube, angle: float) -> None:
        self.tube = tube
        on_axis, on_hoop = FIBRE_CONVENTIONS[tube.fibre_convention]
        self.axial, self.hoop = on_axis(np.radians(angle)), on_hoop(np.radians(angle))
        Ri, Ro = tube.inner_radius, tube.outer_radius
        points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        self.R = (Ro + Ri) / 2 + (Ro - Ri) / 2 * points
        self.weights = np.pi * (Ro - Ri) * weights * self.R
        self.scale = tube.mu * np.pi * (Ro**2 - Ri**2)

    def admissible(self, x: np.ndarray) -> bool:
        """Whether nothing is squeezed to a tenth."""
        return bool((x[:2] > 0.1).all())

    def volume(self, x: np.ndarray) -> Derivatives:
        """pi ri^2 lambda and its derivatives."""
        a, lz, _ = x
        c = np.pi * self.tube.inner_radius**2
        return (
            c * a * a * lz,
            c * np.array([2 * a * lz, a * a, 0]),
            c * np.array([[2 * lz, 2 * a, 0], [2 * a, 0, 0], [0, 0, 0]]),
        )

    def energy(self, x: np.ndarray) -> Derivatives:
        """Value, gradient (3,) and Hessian (3, 3): by (rho = r^2, lambda, k) first, with rho of (a,
        lambda)."""
        t, R2 = self.tube, self.R**2
        Ri2, Ro = t.inner_radius**2, t.outer_radius
        a, lz, k = x[0], x[1], x[2] / Ro
        b = R2 - Ri2
        rho = Ri2 * a * a + b / lz
        one, zero = np.ones_like(R2), np.zeros_like(R2)
        # derivatives of rho by (a, lambda, k)
        d_rho = np.array([2 * Ri2 * a * one, -b / lz**2, zero])
        dd_rho = np.zeros((3, 3) + R2.shape)
        dd_rho[0, 0], dd_rho[1, 1] = 2 * Ri2, 2 * b / lz**3
        # I1 and I4 by q = (rho, lambda, k), then by x: q depends on x through rho alone
        to_q = np.array([d_rho, [zero, one, zero], [zero, zero, one]])
        radial = R2 / (rho * lz * lz)
        I1 = radial + rho / R2 + rho * k * k + lz * lz
        g1 = np.array([-radial / rho + 1 / R2 + k * k, -2 * radial / lz + 2 * lz, 2 * rho * k])
        h1 = np.array(
            [
                [2 * radial / rho**2, 2 * radial / (rho * lz), 2 * k * one],
                [2 * radial / (rho * lz), 6 * radial / lz**2 + 2, zero],
                [2 * k * one, zero, 2 * rho],
            ]
        )
        # fibre: I4 = rho (hoop/R + k axial)^2 + (lambda axial)^2
        s, c = self.hoop / self.R, self.axial
        m = s + k * c
        I4 = rho * m * m + (lz * c) ** 2
        g4 = np.array([m * m, 2 * lz * c * c * one, 2 * rho * m * c])
        h4 = np.array(
            [[zero, zero, 2 * m * c], [zero, 2 * c * c * one, zero], [2 * m * c, zero, 2 * rho * c * c]]
        )
        root = np.sqrt(I4)
        iso, fibre = t.isotropic_fraction * t.mu / 2, t.anisotropic_fraction * t.fibre_modulus / 2
        # W = iso (I1 - 3) + fibre (root - 1)^2; dW/dI4 = fibre (1 - 1/root), d2W/dI4^2 = fibre/(2 root^3)
        w4, w44 = fibre * (1 - 1 / root), fibre / (2 * root**3)
        gq = iso * g1 + w4 * g4
        hq = iso * h1 + w4 * h4 + w44 * g4[:, None] * g4[None]
        value = self.weights @ (iso * (I1 - 3) + fibre * (root - 1) ** 2)
        gradient = np.einsum("ain,an,n->i", to_q, gq, self.weights)
        hessian = np.einsum("ain,abn,bjn,n->ij", to_q, hq, to_q, self.weights) + dd_rho @ (
            gq[0] * self.weights
        )
        unit = np.array([1, 1, 1 / Ro])
        return value, gradient * unit, hessian * unit * unit[:, None]
