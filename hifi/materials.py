"""Materials as energies; stresses and tangents are derived by UFL."""

import ufl


def neo_hookean(mu, F):
    """Deviatoric neo-Hookean energy density (MPa), mu/2 (J^(-2/3) I1 - 3).

    The J^(-2/3) form stays convex enough on thin walls where mu/2 (I1 - 3) with a shifted multiplier stalls.
    """
    J = ufl.det(F)
    return mu / 2 * (J ** (-2.0 / 3.0) * ufl.inner(F, F) - 3)


#: law name -> energy(material parameters as constants, deformation gradient)
ENERGIES = {"neo-Hookean": lambda constants, F: neo_hookean(constants["mu"], F)}
PARAMETERS = {"neo-Hookean": ("mu",)}
