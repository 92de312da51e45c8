"""The enthalpy around a free state: a quadratic form and a cubic and quartic one that is the same for all designs.

With K = L D L^T the stiffness of the free state (D's first entry D1 belongs to e1) and d = q - q_free,
    psi = D1 (|v|^2 / 2 + sum over monomials m of c_m(c) v^m),   v = sqrt(D/D1) L^T d.
In v the anharmonic part of very different cells is nearly the same. Monomials that the half turns of the body forbid are left
out; those that are odd in the mirror image carry c = cos(angle). Without dimension throughout.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement, permutations

import numpy as np

from reduced.law_coordinates import BLOCKS, MIRROR

DEGREES = (3, 4)
#: added to the normal equations of relative forces: keeps coefficients that nothing determines small
RIDGE = 1e-4


def monomials(kind):
    """[(indices, ...)] of the degrees, only those that every half turn leaves alone: even in each block but the first."""
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
    """coefficients (m,) of `monomials(kind)`, times cos(angle) where odd in the mirror; reach: largest |v| it was trained on.

    Kept as symmetric tensors of the second derivatives: that of a form of degree n is its Hessian, twice contracted n (n - 1)
    times its value.
    """

    kind: str
    coefficients: np.ndarray
    reach: float

    def __post_init__(self):
        tensors = []
        for parity in (1, -1):
            cubic, quartic = np.zeros((6,) * 3), np.zeros((6,) * 4)
            for m, value in zip(monomials(self.kind), self.coefficients):
                if np.prod(MIRROR[list(m)]) == parity:
                    orders = set(permutations(m))
                    for order in orders:
                        (cubic if len(m) == 3 else quartic)[order] = value / len(orders)
            tensors.append((6 * cubic.reshape(6, 36), 12 * quartic.reshape(36, 36)))
        object.__setattr__(self, "_tensors", tensors)

    def _hessians(self, v, c):
        """Hessians (n, 6, 6) of the cubic and of the quartic part."""
        c = np.asarray(c)[:, None]
        (cubic, quartic), (odd_cubic, odd_quartic) = self._tensors
        squares = (v[:, :, None] * v[:, None, :]).reshape(-1, 36)
        parts = v @ cubic + c * (v @ odd_cubic), squares @ quartic + c * (squares @ odd_quartic)
        return [part.reshape(-1, 6, 6) for part in parts]

    def value(self, v, c):
        """(n,) at v (n, 6) and cos(angle) (n,)."""
        cubic, quartic = self._hessians(v, c)
        return (v[:, None, :] @ (cubic / 6 + quartic / 12) @ v[:, :, None])[:, 0, 0]

    def gradient(self, v, c):
        """(n, 6)."""
        cubic, quartic = self._hessians(v, c)
        return ((cubic / 2 + quartic / 3) @ v[:, :, None])[:, :, 0]

    def hessian(self, v, c):
        """(n, 6, 6)."""
        return sum(self._hessians(v, c))


def _gradients(kind, v, c):
    """(n, m, 6) gradients of the monomials, times cos(angle) where odd."""
    listed = monomials(kind)
    powers = np.array([[m.count(i) for i in range(6)] for m in listed])
    parity = np.array([np.prod(MIRROR[list(m)]) for m in listed])
    out = np.stack(
        [powers[:, i] * np.prod(v[:, None, :] ** np.maximum(powers - np.eye(6, dtype=int)[i], 0), axis=2) for i in range(6)], axis=2
    )
    return out * np.where(parity < 0, c[:, None], 1.0)[:, :, None]


def fit_anharmonic(kind, c, K, change, forces, ridge=RIDGE):
    """The Anharmonic whose gradient gives the forces (n, 6) at changes (n, 6) from free states of stiffness K (n, 6, 6).

    Each state weighs the same, whatever its force: errors are relative.
    """
    M, D1 = whitening(kind, K)
    v = np.einsum("nij,nj->ni", M, change)
    wanted = np.linalg.solve(np.swapaxes(M, 1, 2), forces[..., None])[..., 0] / D1[:, None]
    size = np.linalg.norm(wanted, axis=1)[:, None]
    columns = _gradients(kind, v, c) / size[:, :, None]
    A = np.swapaxes(columns, 1, 2).reshape(-1, columns.shape[1])
    b = ((wanted - v) / size).ravel()
    gram = A.T @ A
    weights = np.linalg.solve(gram + ridge * np.eye(len(gram)), A.T @ b)
    return Anharmonic(kind, weights, float(np.linalg.norm(v, axis=1).max()))
