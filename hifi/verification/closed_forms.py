"""Exact solutions for incompressible neo-Hookean bodies (mu = 1 MPa) and for the elastica. Round ones: radii
1 and 2 mm."""

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq, fsolve

#: where the sphere's pressure is largest: inner radius, pressure
SPHERE_LIMIT = 1.828147, 0.81642365


def sphere_pressure(a: float) -> float:
    """Pressure of the inflated sphere at inner radius a."""

    def f(stretch):
        return 2 / stretch + 1 / (2 * stretch**4)

    return f((a**3 + 7) ** (1 / 3) / 2) - f(a)


def sphere_radius(P: float) -> float:
    """Inner radius below the limit point."""
    return brentq(lambda a: sphere_pressure(a) - P, 1.0, SPHERE_LIMIT[0], xtol=1e-12)


def tube_pressure(a: float) -> float:
    """Pressure of the tube held at its length, at inner radius a."""
    b = np.sqrt(a * a + 3)
    return np.log(2 * a / b) + (a * a - 1) / 2 * (1 / a**2 - 1 / b**2)


def tube_radius(P: float) -> float:
    """Inner radius of the tube held at its length."""
    return brentq(lambda a: tube_pressure(a) - P, 1.0, 10.0, xtol=1e-12)


def capped_tube(P: float) -> np.ndarray:
    """(inner radius, axial stretch) of the infinite capped tube: radial equilibrium and thrust P pi a^2."""
    r, w = np.polynomial.legendre.leggauss(40)

    def residual(x):
        a, stretch = x
        b = np.sqrt(a * a + 3 / stretch)
        radius = (b - a) / 2 * r + (a + b) / 2
        weight = (b - a) / 2 * w
        R = np.sqrt(1 + stretch * (radius**2 - a**2))
        srr, spp, szz = (R / (radius * stretch)) ** 2, (radius / R) ** 2, stretch**2
        return [np.sum(weight * (spp - srr) / radius) - P, np.sum(weight * (2 * szz - srr - spp) * radius)]

    return fsolve(residual, [1 + P / 2, 1.0], xtol=1e-12)


def torsion(stretch: float, twist: float) -> tuple[float, float]:
    """(torque, axial force) of a solid cylinder of radius 1 at this stretch and twist per undeformed
    length."""
    a2 = 1 / stretch
    return np.pi * twist / (2 * stretch), np.pi * a2 * (
        stretch**2 - 1 / stretch
    ) - np.pi * twist**2 * a2**2 / 4


def flexure_radii(k: float) -> tuple[float, float]:
    """(inner, outer) radius of a block of height 1 bent to the angle k per undeformed length, in plane
    strain."""
    inner = np.sqrt(np.sqrt(1 / k**2 + 1 / k**4) - 1 / k)
    return inner, 1 / (k * k * inner)


def flexure_moment(k: float) -> float:
    """Moment per thickness of that block: -int r s_rr dr with s_rr = w(r) - w(r1), w = (k^2 r^2 + 1/(k^2
    r^2))/2."""
    r1, r2 = flexure_radii(k)

    def integral(r):  # of r w(r)
        return k**2 * r**4 / 8 + np.log(r) / (2 * k**2)

    return (k**2 * r1**2 + 1 / (k**2 * r1**2)) / 2 * (r2**2 - r1**2) / 2 - integral(r2) + integral(r1)


def flexure_pressure(k: float, r: float | np.ndarray) -> float | np.ndarray:
    """Multiplier p of mu/2 (J^(-2/3) I1 - 3) + p (J - 1) in that block: s_rr = 1/(k r)^2 - I1/3 + p."""
    r1 = flexure_radii(k)[0]
    hoop, radial, inner = (k * r) ** 2, 1 / (k * r) ** 2, (k * r1) ** 2
    return (hoop + radial - inner - 1 / inner) / 2 - radial + (hoop + radial + 1) / 3


def elastica(EI: float, length: float, force: float, weight: float, moment: float) -> tuple[float, float]:
    """Tip (x, z) of an inextensible elastica clamped along x under a downward tip force (N), weight per
    length and tip moment."""

    # angle, its derivative; EI angle'' = (force + weight (L - s)) cos(angle), downwards positive
    def slope(s, y):
        return np.vstack(
            [y[1], -(force + weight * (length - s)) * np.cos(y[0]) / EI, np.cos(y[0]), np.sin(y[0])]
        )

    def ends(a, b):
        return np.array([a[0], b[1] - moment / EI, a[2], a[3]])

    s = np.linspace(0, length, 201)
    found = solve_bvp(slope, ends, s, np.vstack([0 * s, 0 * s, s, 0 * s]), tol=1e-8)
    assert found.success
    return found.y[2, -1], -found.y[3, -1]
