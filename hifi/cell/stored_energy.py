"""The energy stored in a cell, for the balance with the work of the pressure."""

import ufl
from dolfinx import fem

from pneunet.geometry import tags
from pneunet.geometry.tags import AIR
from pneunet.hifi.cell.problem import AIR_STIFFNESS, DEGREE
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.materials import energy_density


class StoredEnergy:
    """Everything in the cell's potential but -P V: N mm per pitch. Along free states its change is the
    integral of P dV."""

    def __init__(self, problem):
        mesh, material, F = problem.mesh, problem.segment.material, problem.deformation_gradient
        dx = ufl.Measure(
            "dx", domain=mesh, subdomain_data=problem.cell_tags, metadata={"quadrature_degree": DEGREE}
        )
        _, p = ufl.split(problem.state)
        air = AIR_STIFFNESS * material.mu / 2 * (ufl.inner(F, F) - 2 * ufl.det(F))
        self._contact = problem.contact
        self._form = compat.compile_form(energy_density(mesh, material, F, p) * dx(tags.BODY) + air * dx(AIR))

    def value(self):
        return float(fem.assemble_scalar(self._form)) + (self._contact.energy() if self._contact else 0.0)
