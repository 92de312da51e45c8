"""The anharmonic part of the enthalpy from forces at prescribed strains."""

import numpy as np

from pneunet.reduced.trained.coordinates import odd
from pneunet.reduced.trained.enthalpy import Anharmonic, features, monomials, parity, whitening

#: added to the normal equations of relative forces, for constant parts and for slopes: keeps what nothing
#: determines small
RIDGE = 1e-4, 1e-2


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
    return out * odd(parity(kind), c)[:, :, None]


def fit_anharmonic(
    kind: str, x: np.ndarray, c: np.ndarray, K: np.ndarray, change: np.ndarray, forces: np.ndarray
) -> Anharmonic:
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
    gram, own = A.T @ A, np.tile(np.repeat(RIDGE, [1, x.shape[1]]), len(monomials(kind)))
    weights = np.linalg.solve(gram + np.diag(own), A.T @ b)
    return Anharmonic(kind, weights.reshape(len(monomials(kind)), -1), centre, width)
