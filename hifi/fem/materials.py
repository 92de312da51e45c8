"""Materials as energies of the deformation gradient; stresses and tangents are derived by UFL.

Every law of base.materials.laws is a function of the invariants of the isochoric part of C = F^T F,
    I1 = J^(-2/3) tr C,  I2 = J^(-4/3) (tr(C)^2 - tr(C^2))/2.
The J^(-2/3) form stays convex enough on thin walls where mu/2 (tr C - 3) with a shifted multiplier stalls.
"""

from collections.abc import Callable, Hashable
from typing import Protocol

import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from petsc4py import PETSc
from ufl.algorithms import extract_coefficients
from ufl.algorithms.transformer import strip_variables
from ufl.core.expr import Expr

from pneunet.base.materials.laws import Hyperelastic, unchecked


class Anisotropic(Protocol):
    """A material that is no law of base.materials.laws: an energy of the deformation gradient itself."""

    constants: tuple[str, ...]
    bulk_compliance: float

    def energy_of(self, F: Expr) -> Expr:
        """W in MPa, the `constants` of self being UFL's."""


Material = Hyperelastic | Anisotropic
#: {cell tag: material}, or one material for all cells
Materials = dict[int, Material] | Material


def groups(materials: Materials, of: Callable[[Material], Hashable] = lambda material: material) -> dict:
    """{what `of` says of a material: cell tags}; no tags, which means all cells, of one material."""
    if not isinstance(materials, dict):
        return {of(materials): ()}
    found = {}
    for tag, material in materials.items():
        found.setdefault(of(material), []).append(tag)
    return found


def invariants(F: Expr) -> tuple[Expr, Expr]:
    """(I1, I2) of the isochoric part of F^T F."""
    C, J = F.T * F, ufl.det(F)
    trace = ufl.tr(C)
    return J ** (-2.0 / 3.0) * trace, J ** (-4.0 / 3.0) * (trace**2 - ufl.inner(C, C)) / 2


def _frozen(F):
    """F of functions that share their values with F's and are others to UFL: of the same value, with no
    derivative."""
    functions = {f: fem.Function(f.function_space, f.x) for f in extract_coefficients(F)}
    return ufl.replace(strip_variables(F), functions)


def _expanded(law, F):
    """Its energy as its own Taylor polynomial in (I1, I2) about the current state.

    Differentiating a long series twice by the displacement takes the form compiler minutes. Value, stress and
    tangent of the polynomial are exact at the current state, and its coefficients are plain numbers to the
    second derivative.
    """
    here = [ufl.variable(x) for x in invariants(_frozen(F))]
    energy = law.energy(*here, ufl)
    slopes = [ufl.diff(energy, x) for x in here]
    change = [x - x0 for x, x0 in zip(invariants(F), here)]
    for i, slope in enumerate(slopes):
        energy += slope * change[i]
        energy += sum(ufl.diff(slope, x) * change[i] * change[j] / 2 for j, x in enumerate(here))
    return energy


def constants_of(mesh: Mesh, material: Material) -> dict[str, fem.Constant]:
    """{name: constant of `mesh`} of the law's parameters and 1/K, 0 for an incompressible material: all
    materials of a law share what is compiled."""
    names = (*material.constants, "bulk_compliance")
    return {name: fem.Constant(mesh, PETSc.ScalarType(getattr(material, name))) for name in names}


def energy_density(
    mesh: Mesh, material: Material, F: Expr, p: Expr, constants: dict[str, fem.Constant] | None = None
) -> Expr:
    """W(F) + p (J - 1) - p^2/(2K) in MPa: stationary at J - 1 = p/K, stored energy at equilibrium.

    constants: `constants_of` the material, for who wants to change them.
    """
    constants = constants or constants_of(mesh, material)
    law = unchecked(type(material), **constants)
    if hasattr(law, "energy_of"):
        energy = law.energy_of(F)
    else:
        energy = _expanded(law, F) if law.long else law.energy(*invariants(F), ufl)
    return energy + p * (ufl.det(F) - 1) - constants["bulk_compliance"] * p**2 / 2
