"""Energies of thin walls and volumes, with exact first and second derivatives.

Each density takes rows of arguments (n, m) and returns its Derivatives.
Energies are of the incompressible neo-Hookean solid in plane stress, per volume and in units of mu/2.
"""

import numpy as np

#: value (n,), gradient (n, m) and Hessian (n, m, m)
Derivatives = tuple[np.ndarray, np.ndarray, np.ndarray]


def membrane(a: np.ndarray) -> Derivatives:
    """Core strip under the in-plane deformation gradient a = (F11, F21, F12, F22): F:F + 1/det(F)^2 - 3."""
    f11, f21, f12, f22 = a.T
    det = f11 * f22 - f12 * f21
    d_det = np.stack([f22, -f12, -f21, f11], axis=1)
    dd_det = np.array([[0.0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]])
    value = (a**2).sum(axis=1) + det**-2 - 3
    gradient = 2 * a - (2 * det**-3)[:, None] * d_det
    bend = (6 * det**-4)[:, None, None] * d_det[:, :, None] * d_det[:, None, :]
    return value, gradient, 2 * np.eye(4) - (2 * det**-3)[:, None, None] * dd_det + bend


def panel(a: np.ndarray) -> Derivatives:
    """Wall stretched to the vector (a1, a2) along one edge and by a3 along the other, without shear.

    g2 + a3^2 + 1/(g2 a3^2) - 3 with g2 = a1^2 + a2^2.
    """
    a1, a2, a3 = a.T
    g2, h2 = a1**2 + a2**2, a3**2
    # by (g2, h2), then by a
    f = 1 / (g2 * h2)
    by_g, by_h = 1 - f / g2, 1 - f / h2
    d_g = np.stack([2 * a1, 2 * a2, 0 * a1], axis=1)
    d_h = np.stack([0 * a1, 0 * a1, 2 * a3], axis=1)
    outer_gg, outer_hh = d_g[:, :, None] * d_g[:, None, :], d_h[:, :, None] * d_h[:, None, :]
    outer_gh = d_g[:, :, None] * d_h[:, None, :]
    hessian = (
        by_g[:, None, None] * np.diag([2.0, 2, 0])
        + by_h[:, None, None] * np.diag([0, 0, 2.0])
        + (2 * f / g2**2)[:, None, None] * outer_gg
        + (2 * f / h2**2)[:, None, None] * outer_hh
        + (f / (g2 * h2))[:, None, None] * (outer_gh + np.swapaxes(outer_gh, 1, 2))
    )
    return g2 + h2 + f - 3, by_g[:, None] * d_g + by_h[:, None] * d_h, hessian


def bulged_wall(a: np.ndarray) -> Derivatives:
    """Wall stretched by a1 and a2 along its edges and bulging out of its plane with slopes a3 and a4 along
    them.

    tr C + 1/det C - 3 with C = [[a1^2 + a3^2, a3 a4], [a3 a4, a2^2 + a4^2]].
    """
    a1, a2, a3, a4 = a.T
    det = (a1 * a2) ** 2 + (a1 * a4) ** 2 + (a2 * a3) ** 2
    d_det = 2 * np.stack([a1 * (a2**2 + a4**2), a2 * (a1**2 + a3**2), a3 * a2**2, a4 * a1**2], axis=1)
    zero = np.zeros_like(a1)
    dd_det = np.array(
        [
            [2 * (a2**2 + a4**2), 4 * a1 * a2, zero, 4 * a1 * a4],
            [4 * a1 * a2, 2 * (a1**2 + a3**2), 4 * a2 * a3, zero],
            [zero, 4 * a2 * a3, 2 * a2**2, zero],
            [4 * a1 * a4, zero, zero, 2 * a1**2],
        ]
    )
    value = (a**2).sum(axis=1) + 1 / det - 3
    outer = d_det[:, :, None] * d_det[:, None, :]
    hessian = 2 * np.eye(4) - np.moveaxis(dd_det / det**2, 2, 0) + (2 / det**3)[:, None, None] * outer
    return value, 2 * a - d_det / det[:, None] ** 2, hessian


def product(a: np.ndarray) -> Derivatives:
    """a1 a2 a3: a volume element."""
    a1, a2, a3 = a.T
    zero = np.zeros_like(a1)
    gradient = np.stack([a2 * a3, a1 * a3, a1 * a2], axis=1)
    hessian = np.array([[zero, a3, a2], [a3, zero, a1], [a2, a1, zero]])
    return a1 * a2 * a3, gradient, np.moveaxis(hessian, 2, 0)
