"""A manufactured solution: incompressible finite strain chosen first, the forces it needs derived by hand.

Two shears, each of a coordinate by the two others, make a deformation with det F = 1; with q = p - mu I1/3
the first Piola-Kirchhoff stress of the neo-Hookean body is P = mu F + q F^-T there, and since the columns of
F^-T have no divergence, the body force is -(mu lap u + F^-T grad q). A unit cube, held at its exact
displacement but for x = 1, where the traction P N acts.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from dolfinx.mesh import CellType

from pneunet.hifi.body.problem import Support
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.loads import AppliedLoad
from pneunet.hifi.fem.mixed_field import MixedField
from pneunet.hifi.verification import bodies
from pneunet.hifi.verification.following import body_system, solve_from

AMPLITUDE = 0.15


def displacement(X: Any, sin: Callable, cos: Callable) -> tuple:
    """Components of u at X, for arrays or symbols."""
    x = X[0] + AMPLITUDE * sin(2 * X[1] + X[2])
    return x - X[0], 0 * X[1], AMPLITUDE * cos(2 * x + X[1])


def shifted_pressure(X: Any, sin: Callable, cos: Callable) -> Any:
    """q = p - mu I1/3 at X."""
    return sin(2 * X[0] + X[2]) * cos(2 * X[1])


def exact(X: ufl.core.expr.Expr) -> tuple:
    """(u, F, q, p) as functions of the symbol X."""
    u = ufl.as_vector(displacement(X, ufl.sin, ufl.cos))
    F, q = ufl.Identity(3) + ufl.grad(u), shifted_pressure(X, ufl.sin, ufl.cos)
    return u, F, q, q + ufl.inner(F, F) / 3


class Exact(AppliedLoad):
    """The force in the body and the traction on its face x = 1 that the exact deformation needs."""

    def parts(self, field: MixedField, v: ufl.core.expr.Expr) -> list[ufl.Form]:
        X, N = ufl.SpatialCoordinate(field.mesh), ufl.FacetNormal(field.mesh)
        u, F, q, _ = exact(X)
        force = ufl.div(ufl.grad(u)) + ufl.inv(F).T * ufl.grad(q)
        traction = F * N + q * ufl.inv(F).T * N
        return [
            ufl.inner(force, v) * field.cells(),
            -ufl.inner(traction, v) * field.facets(bodies.END, degree=6),
        ]


def motion(X: np.ndarray, load: float = 1.0) -> np.ndarray:
    return np.stack(displacement(X.T, np.sin, np.cos), axis=1)


def errors(cells: int, element: CellType = CellType.tetrahedron) -> tuple[float, float, int]:
    """(L2 error of u in mm^(5/2), of p in MPa mm^(3/2), dofs) on cells^3 bricks, starting from the
    interpolant."""
    faces = (bodies.PLANE_X, bodies.PLANE_Y, bodies.END_Y, bodies.PLANE_Z, bodies.END_Z)
    mesh = bodies.box((1.0, 1.0, 1.0), (cells,) * 3, element=element)
    system = body_system(mesh, [Support(tag, None, motion) for tag in faces], [Exact()])
    problem = system.problem
    solve_from(system, 1.0, motion, lambda X: shifted_pressure(X.T, np.sin, np.cos))
    u_exact, _, _, p_exact = exact(ufl.SpatialCoordinate(problem.mesh))
    found = []
    for difference in (problem.u - u_exact, problem.p - p_exact):
        square = compat.compile_form(ufl.inner(difference, difference) * problem.cells(degree=6))
        found.append(float(np.sqrt(problem.integral([square]))))
    dofs = problem.dofs
    system.destroy()
    return *found, dofs


def orders(coarse: tuple, fine: tuple, ratio: float = 2.0) -> tuple[float, ...]:
    """Observed orders of u and p between two results of `errors`."""
    return tuple(float(np.log(a / b) / np.log(ratio)) for a, b in zip(coarse[:2], fine[:2]))
