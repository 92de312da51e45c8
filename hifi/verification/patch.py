"""Patch tests on distorted meshes: affine isochoric deformations and constant pressures are solutions to
rounding."""

import numpy as np
from dolfinx.mesh import CellType

from pneunet.hifi.body.problem import Support
from pneunet.hifi.fem.loads import Pressure
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.verification import bodies
from pneunet.hifi.verification.following import body_system, follow, largest

SIDES = (bodies.PLANE_X, bodies.END, bodies.PLANE_Y, bodies.END_Y)


def distorted(X: np.ndarray) -> np.ndarray:
    """Vertices (n, 3) of the unit cube, inner ones moved by up to a tenth; faces stay plane."""
    bubble = (4 * X * (1 - X)).prod(axis=1, keepdims=True)
    return (
        X
        + 0.1
        * bubble
        * np.sin(np.array([[13.0, 29.0, 41.0], [37.0, 17.0, 23.0], [19.0, 31.0, 11.0]]) @ X.T).T
    )


def gradient(load: float) -> np.ndarray:
    """F of a plane isochoric stretch and shear in x and y with a stretch in z."""
    a, c, b = 1 + 0.3 * load, 1 - 0.1 * load, 0.4 * load
    return np.array([[a, b, 0.0], [0.0, c, 0.0], [0.0, 0.0, 1 / (a * c)]])


def affine(pressure: float = 0.2, element: CellType = CellType.tetrahedron) -> tuple[float, float]:
    """Largest errors (of u in mm, of p in MPa): four sides held affinely, rollers below, follower pressure on
    top.

    P e3 = mu F e3 + q F^-T e3 must be -pressure F^-T e3, so that q = p - mu I1/3 = -pressure - mu F33^2.
    """

    def motion(X, load):
        return X @ (gradient(load) - np.eye(3)).T

    supports = [
        *(
            Support(side, component, lambda X, load, i=component: motion(X, load)[:, i])
            for side in SIDES
            for component in (0, 1)
        ),
        Support(bodies.PLANE_Z, 2),
    ]
    system = body_system(
        bodies.box((1.0, 1.0, 1.0), (3, 3, 3), distorted, element=element),
        supports,
        [Pressure((bodies.END_Z,), closed=False)],
    )
    problem, P = system.problem, pressure
    system.apply_load = lambda load: setattr(problem.loads[0].value, "value", P * load)
    follow(system, [1.0], lambda: None, first=0.25, options=NewtonOptions(relative_tolerance=1e-13))
    F = gradient(1.0)
    p = -P - F[2, 2] ** 2 + np.sum(F * F) / 3
    errors = (
        largest(problem, problem.displacement() - motion(problem.nodes, 1.0)),
        largest(problem, problem.pressure_field() - p),
    )
    system.destroy()
    return errors


def squeezed(pressure: float = 0.5, element: CellType = CellType.tetrahedron) -> tuple[float, float]:
    """Largest (u in mm, error of p in MPa) of an incompressible cube on three rollers under pressure on its
    other faces."""
    supports = [Support(tag, i) for i, tag in enumerate((bodies.PLANE_X, bodies.PLANE_Y, bodies.PLANE_Z))]
    load = Pressure((bodies.END, bodies.END_Y, bodies.END_Z))
    system = body_system(bodies.box((1.0, 1.0, 1.0), (3, 3, 3), distorted, element=element), supports, [load])
    problem = system.problem
    follow(system, [pressure], lambda: None, first=pressure)
    errors = largest(problem, problem.displacement()), largest(problem, problem.pressure_field() + pressure)
    system.destroy()
    return errors
