"""Cook's membrane in plane strain, nearly incompressible: a tapered panel, clamped at x = 0, sheared at x =
48.

48 mm long, 44 and 16 mm high, G = 80.1938 and K = 400942 MPa, 100 N in all per mm of thickness; of interest
is how far the upper corner (48, 60) rises: 6.89 mm with F-bar elements, 30 a side (de Souza Neto et al., Int.
J. Solids Struct. 33, 1996).
"""

import numpy as np
from dolfinx.mesh import CellType

from pneunet.base.materials.laws import NeoHookean
from pneunet.hifi.body.problem import Support
from pneunet.hifi.fem.loads import EndLoad
from pneunet.hifi.verification import bodies
from pneunet.hifi.verification.following import body_system, displacement_at, follow

PUBLISHED = 6.89


def panel(X: np.ndarray) -> np.ndarray:
    """Where the vertices (n, 3) of the box 48 x 1 go: bricks grow from the clamped end and from both
    edges."""
    x, s, z = 48 * (X[:, 0] / 48) ** 1.5, 0.3 * X[:, 1] + 0.35 * (1 - np.cos(np.pi * X[:, 1])), X[:, 2]
    return np.stack([x, 44 * x / 48 + s * (44 - 28 * x / 48), z], axis=1)


def rise(cells: int, element: CellType = CellType.tetrahedron) -> tuple[float, int]:
    """(rise of the upper corner in mm, dofs) of a layer of cells x cells x 1 bricks, each a
    hexahedron or six tetrahedra, between two frictionless
    planes."""
    thickness = 48 / cells
    mesh = bodies.box((48.0, 1.0, thickness), (cells, cells, 1), panel, element=element)
    supports = [Support(bodies.PLANE_X), Support(bodies.PLANE_Z, 2), Support(bodies.END_Z, 2)]
    load = EndLoad(bodies.END, force=(0.0, 100 * thickness, 0.0))
    system = body_system(mesh, supports, [load], NeoHookean(80.1938, bulk_modulus=400942.0))
    [u] = follow(system, [1.0], lambda: displacement_at(system.problem, (48.0, 60.0, 0.0)), first=0.25)
    dofs = system.problem.dofs
    system.destroy()
    return float(u[1]), dofs


def converged(coarse: float, middle: float, fine: float) -> float:
    """Limit of a sequence of values on meshes halved twice, at the order they show themselves
    (Richardson)."""
    ratio = (middle - coarse) / (fine - middle)
    return fine + (fine - middle) / (ratio - 1)
