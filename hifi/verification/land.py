"""Problem 1 of Land et al. (Proc. R. Soc. A 471, 2015, 20150641): a beam of a fibre-reinforced law under
follower pressure.

10 x 1 x 1 mm, clamped at x = 0, 4 Pa on its lower face (here mm, N, MPa); the deformed height of the point
(10, 0.5, 1) is 4.15 to 4.19 mm in the codes of that paper. An open loaded patch: the tangent is unsymmetric.
"""

from dataclasses import dataclass
from typing import ClassVar

import ufl
from dolfinx.mesh import CellType
from ufl.core.expr import Expr

from pneunet.hifi.body.problem import Support
from pneunet.hifi.fem.loads import Pressure
from pneunet.hifi.verification import bodies
from pneunet.hifi.verification.following import body_system, displacement_at, follow

PRESSURE = 4e-6
RANGE = 4.15, 4.19


@dataclass(frozen=True)
class Fibres:
    """W = C/2 (exp(Q) - 1), Q = bf E11^2 + bt (E22^2 + E33^2 + 2 E23^2) + 2 bfs (E12^2 + E13^2), fibres along
    x; C in MPa."""

    C: float = 2e-3
    bf: float = 8.0
    bt: float = 2.0
    bfs: float = 4.0
    bulk_compliance: float = 0.0
    constants: ClassVar = ("C", "bf", "bt", "bfs")

    def energy_of(self, F: Expr) -> Expr:
        E = (F.T * F - ufl.Identity(3)) / 2
        across = E[1, 1] ** 2 + E[2, 2] ** 2 + 2 * E[1, 2] ** 2
        Q = self.bf * E[0, 0] ** 2 + self.bt * across + 2 * self.bfs * (E[0, 1] ** 2 + E[0, 2] ** 2)
        return self.C / 2 * (ufl.exp(Q) - 1)


def beam(cells: tuple[int, int, int], element: CellType = CellType.tetrahedron) -> tuple[float, int]:
    """(deformed z of the point (10, 0.5, 1) in mm, dofs)."""
    mesh = bodies.box((10.0, 1.0, 1.0), cells, element=element)
    system = body_system(
        mesh, [Support(bodies.PLANE_X)], [Pressure((bodies.PLANE_Z,), closed=False)], Fibres(), spacing=1.0
    )
    [z] = follow(
        system,
        [PRESSURE],
        lambda: 1 + displacement_at(system.problem, (10.0, 0.5, 1.0))[2],
        first=0.1 * PRESSURE,
    )
    dofs = system.problem.dofs
    system.destroy()
    return float(z), dofs
