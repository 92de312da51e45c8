"""The enthalpy around a free state: a quadratic form, and a cubic and quartic one that varies little between
designs.

With K = L D L^T the stiffness of the free state (D's first entry D1 belongs to e1) and d = q - q_free,
    psi = D1 (|v|^2 / 2 + sum over monomials m of c_m(c) v^m),   v = sqrt(D/D1) L^T d.
In v the anharmonic part of very different cells is nearly the same; its coefficients are linear in what the
stiffness is learned from (measured: a third off the error of forces in one-sided segments). Monomials that
the half turns of the body forbid are left out; those that are odd in the mirror image carry c = cos(angle).
Without dimension throughout.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, permutations

import numpy as np

from pneunet.reduced.trained.coordinates import BLOCKS, MIRROR, odd

DEGREES = (3, 4)
#: added to the normal equations of relative forces, for constant parts and for slopes: keeps what nothing
#: determines small
RIDGE = 1e-4, 1e-2
#: standard deviations of the inputs beyond which coefficients stay as they are
FURTHEST = 2.0


def monomials(kind):
    """[(indices, ...)] of the degrees, only those that every half turn leaves alone: even in each block but
    the first."""
    out = []
    for degree in DEGREES:
        for m in combinations_with_replacement(range(6), degree):
            if all(sum(i in block for i in m) % 2 == 0 for block in BLOCKS[kind][1:]):
                out.append(m)
    return out


def whitening(kind, K):
    """(M (n, 6, 6), D1 (n,)) with v = M d, of stiffnesses (n, 6, 6)."""
    M = np.zeros(K.shape)
    for block in BLOCKS[kind]:
        ix = np.ix_(range(len(K)), block, block)
        M[ix] = np.swapaxes(np.linalg.cholesky(K[ix]), 1, 2)
    D1 = K[:, 0, 0]
    return M / np.sqrt(D1)[:, None, None], D1


@dataclass(frozen=True)
class Anharmonic:
    """coefficients (m, 1 + f) of `monomials(kind)`, constant and by inputs x (f,) from `centre` in units of
    `width`, times cos(angle) where odd in the mirror; reach: largest |v| it was trained on.

    Evaluated as symmetric tensors of second derivatives: that of a form of degree n is its Hessian, twice
    contracted n (n - 1) times its value.
    """

    kind: str
    coefficients: np.ndarray
    centre: np.ndarray
    width: np.ndarray
    reach: float

    @cached_property
    def _tensors(self):
        """((cubic monomials, 216), (quartic ones, 1296)): second derivatives of each monomial."""
        out = []
        for degree, factor in zip(DEGREES, (6, 12)):
            rows = [m for m in monomials(self.kind) if len(m) == degree]
            tensors = np.zeros((len(rows), *(6,) * degree))
            for tensor, m in zip(tensors, rows):
                orders = set(permutations(m))
                for order in orders:
                    tensor[order] = factor / len(orders)
            out.append(tensors.reshape(len(rows), -1))
        return out

    def at(self, x, c):
        """Tensors (cubic (n, 6, 36), quartic (n, 36, 36)) of free states with inputs x (n, f) and cos(angle)
        (n,)."""
        by_state = features(x, self.centre, self.width) @ self.coefficients.T * odd(_parity(self.kind), c)
        cubic, quartic = self._tensors
        parts = by_state[:, : len(cubic)] @ cubic, by_state[:, len(cubic) :] @ quartic
        return parts[0].reshape(-1, 6, 36), parts[1].reshape(-1, 36, 36)


def features(x, centre, width):
    """(n, 1 + f)"""
    return np.column_stack([np.ones(len(x)), np.clip((x - centre) / width, -FURTHEST, FURTHEST)])


def _hessians(v, tensors):
    """Hessians (n, 6, 6) of the cubic and of the quartic part at v (n, 6); tensors: of `Anharmonic.at`, for
    each or for all."""
    squares = (v[:, :, None] * v[:, None, :]).reshape(-1, 36)
    return [(a[:, None, :] @ tensor)[:, 0].reshape(-1, 6, 6) for a, tensor in zip((v, squares), tensors)]


def anharmonic_value(v, tensors):
    """(n,) of the cubic and quartic form."""
    cubic, quartic = _hessians(v, tensors)
    return (v[:, None, :] @ (cubic / 6 + quartic / 12) @ v[:, :, None])[:, 0, 0]


def anharmonic_gradient(v, tensors):
    """(n, 6)"""
    cubic, quartic = _hessians(v, tensors)
    return ((cubic / 2 + quartic / 3) @ v[:, :, None])[:, :, 0]


def anharmonic_hessian(v, tensors):
    """(n, 6, 6)"""
    return sum(_hessians(v, tensors))


def _parity(kind):
    """(m,) -1 for monomials that are odd in the mirror image."""
    return np.array([np.prod(MIRROR[list(m)]) for m in monomials(kind)])


def _gradients(kind, v, c):
    """(n, m, 6) gradients of the monomials, times cos(angle) where odd."""
    listed = monomials(kind)
    powers = np.array([[m.count(i) for i in range(6)] for m in listed])
    out = np.stack(
        [
            powers[:, i] * np.prod(v[:, None, :] ** np.maximum(powers - np.eye(6, dtype=int)[i], 0), axis=2)
            for i in range(6)
        ],
        axis=2,
    )
    return out * odd(_parity(kind), c)[:, :, None]


def fit_anharmonic(kind, x, c, K, change, forces, ridge=RIDGE):
    """The Anharmonic whose gradient gives the forces (n, 6) at changes (n, 6) from free states of inputs x
    (n, f), cos(angle) c (n,) and stiffness K (n, 6, 6).

    Each state weighs the same, whatever its force: errors are relative.
    """
    M, D1 = whitening(kind, K)
    v = np.einsum("nij,nj->ni", M, change)
    wanted = np.linalg.solve(np.swapaxes(M, 1, 2), forces[..., None])[..., 0] / D1[:, None]
    size = np.linalg.norm(wanted, axis=1)[:, None]
    centre, width = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-12)
    columns = _gradients(kind, v, c) / size[:, :, None]
    columns = (columns[:, :, None, :] * features(x, centre, width)[:, None, :, None]).reshape(len(x), -1, 6)
    A = np.swapaxes(columns, 1, 2).reshape(-1, columns.shape[1])
    b = ((wanted - v) / size).ravel()
    gram, own = A.T @ A, np.tile(np.repeat(ridge, [1, x.shape[1]]), len(monomials(kind)))
    weights = np.linalg.solve(gram + np.diag(own), A.T @ b)
    return Anharmonic(
        kind, weights.reshape(len(monomials(kind)), -1), centre, width, float(np.linalg.norm(v, axis=1).max())
    )
