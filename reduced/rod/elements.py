"""A rod of elements with constant strains: its energy, the balance of its nodes, and Newton's step, exact and
in O(n).

Unknown are the elements' twists x = (k, e) per undeformed length; element i moves the frame by exp(h x), so a
change dx moves all behind it by the spatial twist A_i dx_i, A_i = h Ad(g_{i-1}) J(h x_i)
(base.left_jacobian). In the nodes' spatial twists V_j, the sums of these, Newton's matrix is block
tridiagonal: the step for x is found through them with one banded factorisation.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cholesky_banded
from scipy.linalg.lapack import dgbsv

from pneunet.base import se3
from pneunet.base.left_jacobian import LeftJacobian, adjoint, wrench_commutator
from pneunet.reduced.rod.laws import SectionLaw

if TYPE_CHECKING:
    from pneunet.reduced.rod.rod import RodPiece

#: e and k of a law's strains in the order of a twist, and back
TWIST_ORDER = np.array([3, 4, 5, 0, 1, 2])
_BAND = 11  # block tridiagonal, blocks of 6


class NodalLoads:
    """Dead loads at the nodes 1..n, fixed in space: forces (n, 3) in N; spreads (n, 3, 3), the sum of r (x) f
    over the forces f that act at points r (mm) of a node's section frame; moments (n, 3) in N mm."""

    def __init__(self, count: int) -> None:
        self.forces, self.moments = np.zeros((2, count, 3))
        self.spreads = np.zeros((count, 3, 3))

    def add(self, node: int | slice, force: np.ndarray, point: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Forces (m, 3) at points (m, 3) of the frames of distinct nodes (m,)."""
        self.forces[node] += force
        self.spreads[node] += np.einsum("...i,...j->...ij", np.asarray(point, float), force)

    @property
    def conservative(self) -> bool:
        """Whether the loads have an energy."""
        return not self.moments.any()

    def scaled(self, factor: float) -> "NodalLoads":
        """`factor` times the loads."""
        out = NodalLoads(0)
        out.forces, out.spreads, out.moments = (factor * a for a in (self.forces, self.spreads, self.moments))
        return out


class RodElements:
    """lengths (n,) in mm; pieces: of each element; base_pose (4, 4)."""

    def __init__(self, lengths: np.ndarray, pieces: "Sequence[RodPiece]", base_pose: np.ndarray) -> None:
        self.lengths, self.base_pose = np.asarray(lengths, float), base_pose
        self._h = self.lengths[:, None, None]
        groups: dict[tuple[int, float], tuple[SectionLaw, float, list[int]]] = {}
        for i, piece in enumerate(pieces):
            groups.setdefault((id(piece.law), piece.pressure), (piece.law, piece.pressure, []))[2].append(i)
        self._groups = [(law, P, np.array(index)) for law, P, index in groups.values()]

    def _by_law(self, method, x, shape):
        q, out = x[:, TWIST_ORDER], np.empty((len(x), *shape))
        for law, P, index in self._groups:
            out[index] = getattr(law, method)(q[index], P)
        return out

    def free(self) -> np.ndarray:
        """(n, 6) twists of the free state."""
        out = np.empty((len(self.lengths), 6))
        for law, P, index in self._groups:
            out[index] = law.free_strains(P)
        return out[:, TWIST_ORDER]

    def wrenches(self, x: np.ndarray) -> np.ndarray:
        """(n, 6) section moments (N mm) and forces (N) in the section frames."""
        return self._by_law("force", x, (6,))[:, TWIST_ORDER]

    def stiffnesses(self, x: np.ndarray) -> np.ndarray:
        """(n, 6, 6) tangent stiffness of the sections, moments and forces by (k, e)."""
        return self._by_law("stiffness", x, (6, 6))[:, TWIST_ORDER[:, None], TWIST_ORDER]

    def poses(self, x: np.ndarray) -> np.ndarray:
        """(n + 1, 4, 4) frames of the nodes."""
        return self._chained(se3.exp_pose(x * self.lengths[:, None]))

    def _chained(self, steps):
        out = np.empty((len(steps) + 1, 4, 4))
        out[0] = self.base_pose
        for before, step, after in zip(out, steps, out[1:]):
            before.dot(step, after)
        return out

    def _linearised(self, x, loads):
        """(inverses of A, the tangent's blocks (diagonal, lower, upper) and the imbalance (n, 6) in the
        nodes' spatial twists)."""
        J = LeftJacobian(x * self.lengths[:, None])
        poses = self._chained(J.pose)
        Ad = adjoint(poses[:-1])
        inverse = np.linalg.inv(self._h * (Ad @ J.matrix))
        outward, turned, forces = _outward(poses[1:], loads)
        local = (_transposed(Ad) @ outward[..., None])[..., 0]
        material = self.stiffnesses(x)
        own = self._h * (material - self._h * J.slope(local))
        M = _transposed(inverse) @ own @ inverse
        inward = (_transposed(inverse) @ (self.lengths[:, None] * self.wrenches(x))[..., None])[..., 0]
        C = wrench_commutator(outward)
        diagonal = M.copy()
        diagonal[:-1] += M[1:] + C[1:]
        diagonal[:, :3, :3] -= turned - np.trace(turned, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        diagonal[:, :3, 3:] += se3.hat(forces)
        imbalance = inward - outward
        imbalance[:-1] -= imbalance[1:].copy()
        return inverse, (diagonal, -(M + C)[1:], -M[1:]), imbalance

    def newton_step(self, x: np.ndarray, loads: NodalLoads) -> tuple[np.ndarray | None, np.ndarray]:
        """(step (n, 6) for x, banded matrix in LAPACK's storage for `is_minimum`); None instead of the step
        when singular."""
        inverse, blocks, imbalance = self._linearised(x, loads)
        band = _banded(blocks)
        kept = band[:, 2 * _BAND :].copy()
        _, _, V, info = dgbsv(_BAND, _BAND, band.T, -imbalance.ravel(), overwrite_ab=True)
        if info:
            return None, kept
        V = V.reshape(len(x), 6)
        V[1:] -= V[:-1].copy()
        return (inverse @ V[..., None])[..., 0], kept

    def responses(
        self, x: np.ndarray, loads: NodalLoads, wrenches: np.ndarray, loading: np.ndarray
    ) -> np.ndarray | None:
        """(n, 6, c): how an equilibrium's twists over whole elements, lengths times x (n, 6), answer to c
        changes, by the implicit function theorem; None where the tangent is singular.

        wrenches (n, 6, c): changes of the section wrenches at unchanged twists over whole elements; loading
        (n, 6, c): of the loads' wrenches about the origin of space at the nodes.
        """
        inverse, blocks, _ = self._linearised(x, loads)
        n, c = len(x), wrenches.shape[2]
        inward = _transposed(inverse) @ (self._h * wrenches)
        inward[:-1] -= inward[1:].copy()
        _, _, V, info = dgbsv(_BAND, _BAND, _banded(blocks).T, (loading - inward).reshape(6 * n, c))
        if info:
            return None
        V = V.reshape(n, 6, c)
        V[1:] -= V[:-1].copy()
        return self._h * (inverse @ V)


def _banded(blocks):
    """LAPACK's banded storage, transposed, of block tridiagonal `blocks` (diagonal, lower, upper)."""
    n = len(blocks[0])
    # LAPACK's columns are these rows: entry (r, c) at [c, 2 _BAND + r - c]
    band = np.zeros((6 * n, 3 * _BAND + 1))
    size, width = band.itemsize, band.shape[1]
    for block, first in zip(blocks, (2 * _BAND, 2 * _BAND + 6, 6 * width + 2 * _BAND - 6)):
        as_strided(band.ravel()[first:], (len(block), 6, 6), (6 * width * size, size, (width - 1) * size))[
            ...
        ] = block
    return band


def is_minimum(band: np.ndarray) -> bool:
    """Whether the tangent of `newton_step` is positive definite: the equilibrium is stable at these
    (conservative) loads."""
    try:
        cholesky_banded(band.T, lower=True, check_finite=False)
    except LinAlgError:
        return False
    return True


def _transposed(a):
    return np.swapaxes(a, -1, -2)


def _turned(poses, loads):
    """(n, 3, 3): sum of x (x) f over the forces at each node, x from the origin of space."""
    return poses[:, :3, 3, None] * loads.forces[:, None] + poses[:, :3, :3] @ loads.spreads


def _outward(poses, loads):
    """(wrench (n, 6) about the origin of all loads from each element's end on, x (x) f, forces)."""
    turned = _turned(poses, loads)
    wrench = np.empty((len(poses), 6))
    wrench[:, 0], wrench[:, 1] = turned[:, 1, 2] - turned[:, 2, 1], turned[:, 2, 0] - turned[:, 0, 2]
    wrench[:, 2], wrench[:, 3:] = turned[:, 0, 1] - turned[:, 1, 0], loads.forces
    wrench[:, :3] += loads.moments
    return np.cumsum(wrench[::-1], axis=0)[::-1], turned, loads.forces
