"""The energy of RodElements and its derivatives, dense, to judge Newton's step by."""

import numpy as np

from pneunet.base.left_jacobian import LeftJacobian, adjoint
from pneunet.reduced.rod.elements import _outward, _turned


def energy(elements, x, loads):
    """Enthalpy of the sections less the work of the forces, N mm; moments fixed in space have no energy."""
    work = np.trace(_turned(elements.poses(x)[1:], loads), axis1=1, axis2=2).sum()
    return elements.lengths @ elements._by_law("psi", x, ()) - work


def gradient(elements, x, loads):
    """(n, 6) generalised forces that balance to zero: the energy's gradient by x, moments' work included."""
    poses = elements.poses(x)
    outward = _outward(poses[1:], loads)[0]
    work = np.einsum("nij,ni->nj", carriers(elements, x, poses), outward)
    return elements.lengths[:, None] * elements.wrenches(x) - work


def hessian(elements, x, loads):
    """(n, 6, n, 6) derivative of `gradient` by x, dense; symmetric for conservative loads."""
    n, (diagonal, lower, upper) = len(x), elements._linearised(x, loads)[1]
    matrix, i = np.zeros((n, 6, n, 6)), np.arange(n)
    matrix[i, :, i], matrix[i[1:], :, i[:-1]], matrix[i[:-1], :, i[1:]] = diagonal, lower, upper
    nodes = np.einsum("ij,jab->iajb", np.tril(np.ones((n, n))), carriers(elements, x, elements.poses(x)))
    nodes = nodes.reshape(6 * n, 6 * n)
    return (nodes.T @ matrix.reshape(6 * n, 6 * n) @ nodes).reshape(n, 6, n, 6)


def carriers(elements, x, poses):
    """A (n, 6, 6): the spatial twist of all nodes behind an element per change of its x."""
    h = elements.lengths[:, None]
    return h[..., None] * (adjoint(poses[:-1]) @ LeftJacobian(x * h).matrix)
