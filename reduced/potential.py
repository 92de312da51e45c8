"""The enthalpy around a free state: a quadratic form and a cubic and quartic one that is the same for all designs.

With K = L D L^T the stiffness of the free state (D's first entry D1 belongs to e1) and d = q - q_free,
    psi = D1 (|v|^2 / 2 + sum over monomials m of c_m(c) v^m),   v = sqrt(D/D1) L^T d.
In v the anharmonic part of very different cells is nearly the same. Monomials that the half turns of the body forbid are left
out; those that are odd in the mirror image carry c = cos(angle). Without dimension throughout.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from reduced.law_coordinates import BLOCKS, MIRROR

DEGREES = (3, 4)
#: of the mean square of the regression's columns
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
    """coefficients (m,) of `monomials(kind)`, times cos(angle) where odd in the mirror; reach: largest |v| it was trained on."""

    kind: str
    coefficients: np.ndarray
    reach: float

    def __post_init__(self):
        listed = monomials(self.kind)
        object.__setattr__(self, "powers", np.array([[m.count(i) for i in range(6)] for m in listed]))
        object.__setattr__(self, "parity", np.array([np.prod(MIRROR[list(m)]) for m in listed]))

    def coefficients_at(self, c):
        """(n, m) at cos(angle) (n,)."""
        return self.coefficients * np.where(self.parity < 0, np.asarray(c)[:, None], 1.0)

    def terms(self, v, order):
        """Monomials (n, m), their gradients (n, m, 6) or Hessians (n, m, 6, 6) at v (n, 6), by order 0, 1, 2."""
        table = np.stack([v**k for k in range(max(DEGREES) + 1)], axis=1)  # (n, power, 6)
        return _derivative(table, self.powers, order)

    def value(self, v, c):
        return (self.coefficients_at(c) * self.terms(v, 0)).sum(axis=1)

    def gradient(self, v, c):
        return np.einsum("nm,nmi->ni", self.coefficients_at(c), self.terms(v, 1))

    def hessian(self, v, c):
        return np.einsum("nm,nmij->nij", self.coefficients_at(c), self.terms(v, 2))


def _derivative(table, powers, order):
    def product(powers, factor):
        return factor * np.prod(table[:, np.maximum(powers, 0), np.arange(6)], axis=2)

    if order == 0:
        return product(powers, 1.0)
    unit = np.eye(6, dtype=int)
    if order == 1:
        return np.stack([product(powers - unit[i], powers[:, i]) for i in range(6)], axis=2)
    rows = []
    for i in range(6):
        once = powers - unit[i]
        rows.append(np.stack([product(once - unit[j], powers[:, i] * once[:, j]) for j in range(6)], axis=2))
    return np.stack(rows, axis=2)


def fit_anharmonic(kind, c, K, change, forces, ridge=RIDGE):
    """The Anharmonic whose gradient gives the forces (n, 6) at changes (n, 6) from free states of stiffness K (n, 6, 6).

    Each state weighs the same, whatever its force: errors are relative.
    """
    M, D1 = whitening(kind, K)
    v = np.einsum("nij,nj->ni", M, change)
    wanted = np.linalg.solve(np.swapaxes(M, 1, 2), forces[..., None])[..., 0] / D1[:, None]
    size = np.linalg.norm(wanted, axis=1)[:, None]
    empty = Anharmonic(kind, np.ones(len(monomials(kind))), float(np.linalg.norm(v, axis=1).max()))
    columns = empty.terms(v, 1) * empty.coefficients_at(c)[:, :, None] / size[:, :, None]
    A = np.swapaxes(columns, 1, 2).reshape(-1, columns.shape[1])
    b = ((wanted - v) / size).ravel()
    gram = A.T @ A
    weights = np.linalg.solve(gram + ridge * np.eye(len(gram)), A.T @ b)
    return Anharmonic(kind, weights, empty.reach)
