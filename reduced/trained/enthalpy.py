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

from pneunet.base.strains import MIRROR
from pneunet.reduced.trained.coordinates import BLOCKS, odd

DEGREES = (3, 4)
#: second derivatives of the cubic (n, 6, 36) and of the quartic form (n, 36, 36)
Tensors = tuple[np.ndarray, np.ndarray]
#: standard deviations of the inputs beyond which coefficients stay as they are
FURTHEST = 2.0


def monomials(kind: str) -> list[tuple[int, ...]]:
    """[(indices, ...)] of the degrees, only those that every half turn leaves alone: even in each block but
    the first."""
    out = []
    for degree in DEGREES:
        for m in combinations_with_replacement(range(6), degree):
            if all(sum(i in block for i in m) % 2 == 0 for block in BLOCKS[kind][1:]):
                out.append(m)
    return out


def symmetric(K: np.ndarray) -> np.ndarray:
    """The symmetric parts of matrices (n, 6, 6)."""
    return (K + np.swapaxes(K, 1, 2)) / 2


def whitening(kind: str, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
    `width`, times cos(angle) where odd in the mirror.

    Evaluated as symmetric tensors of second derivatives: that of a form of degree n is its Hessian, twice
    contracted n (n - 1) times its value.
    """

    kind: str
    coefficients: np.ndarray
    centre: np.ndarray
    width: np.ndarray

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

    def at(self, x: np.ndarray, c: np.ndarray) -> Tensors:
        """Of free states with inputs x (n, f) and cos(angle)
        (n,)."""
        by_state = features(x, self.centre, self.width) @ self.coefficients.T * odd(parity(self.kind), c)
        cubic, quartic = self._tensors
        parts = by_state[:, : len(cubic)] @ cubic, by_state[:, len(cubic) :] @ quartic
        return parts[0].reshape(-1, 6, 36), parts[1].reshape(-1, 36, 36)


def features(x: np.ndarray, centre: np.ndarray, width: np.ndarray) -> np.ndarray:
    """(n, 1 + f) of inputs (n, f): 1, and what coefficients are linear in."""
    return np.column_stack([np.ones(len(x)), np.clip((x - centre) / width, -FURTHEST, FURTHEST)])


def _hessians(v, tensors):
    """Hessians (n, 6, 6) of the cubic and of the quartic part at v (n, 6); tensors: of `Anharmonic.at`, for
    each or for all."""
    squares = (v[:, :, None] * v[:, None, :]).reshape(-1, 36)
    return [(a[:, None, :] @ tensor)[:, 0].reshape(-1, 6, 6) for a, tensor in zip((v, squares), tensors)]


def anharmonic_value(v: np.ndarray, tensors: Tensors) -> np.ndarray:
    """(n,) of the cubic and quartic form."""
    cubic, quartic = _hessians(v, tensors)
    return (v[:, None, :] @ (cubic / 6 + quartic / 12) @ v[:, :, None])[:, 0, 0]


def anharmonic_gradient(v: np.ndarray, tensors: Tensors) -> np.ndarray:
    """(n, 6) of its derivatives by v."""
    cubic, quartic = _hessians(v, tensors)
    return ((cubic / 2 + quartic / 3) @ v[:, :, None])[:, :, 0]


def anharmonic_hessian(v: np.ndarray, tensors: Tensors) -> np.ndarray:
    """(n, 6, 6) of its second derivatives."""
    cubic, quartic = _hessians(v, tensors)
    return cubic + quartic


def parity(kind: str) -> np.ndarray:
    """(m,) -1 for monomials that are odd in the mirror image."""
    return np.array([np.prod(MIRROR[list(m)]) for m in monomials(kind)])
