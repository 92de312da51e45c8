"""Materials as energies; stresses and tangents are derived by UFL.

Every law is a function of the invariants of the isochoric part of C = F^T F,
    I1 = J^(-2/3) tr C,  I2 = J^(-4/3) (tr(C)^2 - tr(C^2))/2.
The J^(-2/3) form stays convex enough on thin walls where mu/2 (tr C - 3) with a shifted multiplier stalls.
"""

import ufl
from dolfinx import fem
from petsc4py import PETSc
from ufl.algorithms import extract_coefficients
from ufl.algorithms.transformer import strip_variables


def invariants(F):
    """(I1, I2) of the isochoric part of F^T F."""
    C, J = F.T * F, ufl.det(F)
    trace = ufl.tr(C)
    return J ** (-2.0 / 3.0) * trace, J ** (-4.0 / 3.0) * (trace**2 - ufl.inner(C, C)) / 2


def neo_hookean(c, F):
    return c["mu"] / 2 * (invariants(F)[0] - 3)


def mooney_rivlin(c, F):
    I1, I2 = invariants(F)
    return c["c10"] * (I1 - 3) + c["c01"] * (I2 - 3)


def yeoh(c, F):
    x = invariants(F)[0] - 3
    return c["c10"] * x + c["c20"] * x**2 + c["c30"] * x**3


def gent(c, F):
    """-mu jm/2 ln(1 - x), x = (I1 - 3)/jm, written with the root of 1 - x.

    The logarithm is gone from its derivative, and 1/(1 - x) beyond the limit x = 1 is a finite stress of
    wrong sign on which Newton's method could settle. The root makes stress and tangent nan there, so that a
    step which leaves the admissible range is recognised and cut back, and every accepted state is Gent's.
    """
    x = (invariants(F)[0] - 3) / c["jm"]
    return -c["mu"] * c["jm"] * ufl.ln(ufl.sqrt(1 - x))


def _root(I1, I2):
    """Invariants (a, b) of the square root of a tensor with invariants (I1, I2, 1): a^2 - 2b = I1, b^2 - 2a =
    I2.

    Newton from a guess that is exact at the identity and off by a few percent at tenfold stretch; its matrix,
    4 (a b - 1) >= 32, is regular at repeated stretches and everywhere else, and so are the derivatives of all
    its steps.
    """
    b = ufl.sqrt(I2 + 2 * ufl.sqrt(I1 + 6))
    a = ufl.sqrt(I1 + 2 * b)
    for _ in range(3):
        r, s = I1 - a * a + 2 * b, I2 - b * b + 2 * a
        determinant = 2 * (a * b - 1)
        a, b = a + (b * r + s) / determinant, b + (r + a * s) / determinant
    return a, b


def _half_powers(weights, I1, I2):
    """Sum of the weighted traces (less 3) of the powers -n..n of the fourth root of a tensor with these
    invariants."""
    a, b = _root(*_root(I1, I2))
    order = weights.ufl_shape[0] // 2
    energy = 0
    for offset, first, second in ((0, a, b), (order, b, a)):  # powers and inverse powers
        traces = [3, first, first * first - 2 * second]
        for n in range(3, order + 1):
            traces.append(first * traces[n - 1] - second * traces[n - 2] + traces[n - 3])
        energy += sum(weights[offset + n - 1] * (traces[n] - 3) for n in range(1, order + 1))
    return energy


def _frozen(F):
    """F of functions that share their values with F's and are others to UFL: of the same value, with no
    derivative."""
    functions = {f: fem.Function(f.function_space, f.x) for f in extract_coefficients(F)}
    return ufl.replace(strip_variables(F), functions)


def ogden(c, F):
    """Series in half powers of the principal stretches (base.materials.halfpowers).

    Differentiating a long series twice by the displacement takes the form compiler minutes. The energy is
    therefore written as its own Taylor polynomial in (I1, I2) about the current state: value, stress and
    tangent are exact there, and the coefficients are plain numbers to the second derivative.
    """
    here = [ufl.variable(x) for x in invariants(_frozen(F))]
    energy = _half_powers(c["half_power_weights"], *here)
    slopes = [ufl.diff(energy, x) for x in here]
    change = [x - x0 for x, x0 in zip(invariants(F), here)]
    for i, slope in enumerate(slopes):
        energy += slope * change[i]
        energy += sum(ufl.diff(slope, x) * change[i] * change[j] / 2 for j, x in enumerate(here))
    return energy


#: law name -> energy density W(parameters as constants, deformation gradient) in MPa, without the volumetric
#: part
ENERGIES = {
    "neo-Hookean": neo_hookean,
    "Mooney-Rivlin": mooney_rivlin,
    "Yeoh": yeoh,
    "Gent": gent,
    "Ogden": ogden,
}
#: law name -> names of what its energy takes as constants, where these are not the law's own parameters
CONSTANTS = {"Ogden": ("half_power_weights",)}


def volumetric(c, J, p):
    """p (J - 1) - p^2/(2K), stationary at J - 1 = p/K; 1/K is 0 for an incompressible material."""
    return p * (J - 1) - c["bulk_compliance"] * p**2 / 2


def energy_density(mesh, material, F, p):
    """W(F) + p (J - 1) - p^2/(2K) in MPa, the law's parameters as constants of `mesh`. Stored energy at
    equilibrium.

    material: a law of base.materials.laws, or any other that brings its own `energy(c, F)` in MPa beside what
    those have: `law`, `parameters` (names of its constants c) and `bulk_compliance`.
    """
    energy = getattr(material, "energy", None) or ENERGIES[material.law]
    names = (*CONSTANTS.get(material.law, material.parameters), "bulk_compliance")
    c = {name: fem.Constant(mesh, PETSc.ScalarType(getattr(material, name))) for name in names}
    return energy(c, F) + volumetric(c, ufl.det(F), p)
