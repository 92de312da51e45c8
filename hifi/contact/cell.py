"""Contact of a unit cell's walls: hifi.contact.penalty between the pieces that the cell's cuts leave, moved
by the strains (e, k).

Each gap is seen from the section frame in its middle, in which a wall's node of local position y at the
distance s along the axis lies at exp(s (k, e)) y: linear in y, and its derivatives by the strains are exact
too (base.left_jacobian).

The walls of the whole pitch are images of the mesh's (hifi.cell.symmetry): their nodes move as u = S x, with
signs S of the class of symmetry in which the unknowns x are. Forces are S^T r then and stiffnesses S^T C S, r
and C by the images. Rotations take each side of a gap to another one, so that only one of those that are
images of each other is looked at and stands for all.
"""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from pneunet.base.left_jacobian import LeftJacobian
from pneunet.hifi.contact.gaps import Contact, Side
from pneunet.hifi.contact.penalty import WallPenalty, mean_normal, touching
from pneunet.hifi.contact.walls import IN_CONTACT, CellWalls, WallContact, distances_from
from pneunet.hifi.fem import surface
from pneunet.hifi.fem.mixed_field import MixedField

#: strains (e, k) from twists (k, e)
_ORDER = [3, 4, 5, 0, 1, 2]


class CellContact(Contact):
    """Contact in the gaps of `walls` under a penalty, none without one; unknowns are those of the problem's
    first class of symmetry and the six strains (e, k)."""

    def __init__(self, problem: MixedField, walls: CellWalls, penalty: WallPenalty | None):
        self.problem, gaps = problem, walls.gaps if penalty else []
        pairs = [pair for gap in gaps for pair in (gap, gap[::-1])]
        if pairs:
            pairs = pairs[: 2 * len(problem.segment.sides) // len(problem.turns)]
            self.law = penalty.on(problem.segment.material.mu, problem.segment.gap)
        images = [wall.images.ravel() for gap in gaps for wall in gap]
        #: (m,) the walls' nodes, each in the images in which it is there: rotation and node in one number
        self._images = np.unique(np.concatenate([*images, np.zeros(0, int)]))
        size = 3 * len(self._images) + 6
        super().__init__(MPI.COMM_SELF, size, slice(0, size))
        self.gaps = len(gaps)
        self._signs = [self._signs_of(each) for each in problem.classes]
        self._stiffness = sp.csr_matrix((size, size))
        self._walls = []
        for pair in pairs:
            middle = np.mean([wall.along.mean() for wall in pair])
            first, second = (mean_normal(problem.nodes[wall.facets] * wall.turn) for wall in pair)
            normal = first - second
            sheets = [_Sheet(wall, self._places(wall), middle) for wall in pair]
            self._walls.append((sheets, normal / np.linalg.norm(normal)))

    def _places(self, wall):
        """(n, k, 3) of the nodes' displacements among those of the images."""
        return 3 * np.searchsorted(self._images, wall.images)[..., None] + np.arange(3)

    def _signs_of(self, each):
        """S, sparse (images' displacements and twist (k, e), unknowns and (e, k)), of a class of symmetry."""
        number, node = np.divmod(self._images, len(self.problem.nodes))
        dofs = self.problem.displacement_dofs[node]
        signs = each.chi[number, None] * self.problem.turns[number] * each.signs[dofs]
        columns = np.append(each.reduced[dofs], each.unknowns + np.array(_ORDER))
        values = np.append(signs, each.strains[_ORDER])
        rows = np.flatnonzero(columns >= 0)
        entries = values[rows], (rows, columns[rows])
        return sp.coo_matrix(entries, shape=(len(columns), each.unknowns + 6)).tocsr()

    def sides(self) -> list[Side]:
        problem, found = self.problem, []
        e, k = np.split(problem.strains.value, 2)
        for number, (sheets, direction) in enumerate(self._walls):
            positions = [sheet.positions(np.concatenate([k, e])) for sheet in sheets]
            t = touching(
                positions[0], sheets[0].areas, positions[1], direction, self.law, len(problem.turns) / 2
            )
            if t is not None:
                found.append(_Side(problem, number, self.law, t, sheets, positions, self._size))
        return found

    def residual(self) -> np.ndarray:
        return self._signs[0].T @ super().residual()

    def tangent(self) -> sp.csr_matrix:
        self._stiffness = super().tangent()
        return self.tangent_of(0)

    def tangent_of(self, number: int) -> sp.csr_matrix:
        """Sparse (unknowns + 6,) * 2 of a class of symmetry, at the state of the last tangent."""
        signs = self._signs[number]
        return (signs.T @ self._stiffness @ signs).tocsr()

    def gradients(self, points: list) -> np.ndarray:
        return super().gradients(points) @ self._signs[0]

    def forces(self) -> np.ndarray:
        # of the rotations those that keep a gap; they exchange its walls with the direction of the axis
        kept = self.problem.turns[self.problem.turns[:, 2] > 0]
        share = kept / len(self.problem.turns)
        return super().forces() * (share * kept[:, :1]).sum(axis=0)

    def measure(self, pressure: float) -> WallContact:
        """WallContact at the last residual of the gap with the largest force, `pressure` (MPa) being that of
        the air."""
        gaps = [WallContact() for _ in range(self.gaps)]
        alike = len(self.problem.segment.sides) / self.gaps  # gaps that each stands for
        for side in self._now:
            t, gap = side.touching, side.number // 2
            pushing = t.pressure > IN_CONTACT * pressure
            if pushing.any():
                d = distances_from(side.positions[1], t.position[pushing])
                c = gaps[gap]
                gaps[gap] = WallContact(
                    0.0,
                    c.area + t.area[pushing].sum() / alike,
                    np.fmin(c.nearest, d.min()),
                    np.fmax(c.farthest, d.max()),
                )
        forces = np.linalg.norm(self.forces(), axis=1)
        return replace(gaps[forces.argmax()], force=float(forces.max()))


class _Sheet:
    """A wall: places (n, k, 3) of its nodes' displacements among the images', s (n, k) their distances from
    the middle of the gap along the axis (mm), areas (n, p) of its Gauss points in mm2."""

    def __init__(self, wall, places, middle):
        self._wall, self.places, self.s = wall, places, wall.along - middle
        self.areas = surface.reference_areas(wall.problem, wall.facets)
        self._stations, self._inverse = np.unique(self.s.round(9), return_inverse=True)

    def positions(self, twist):
        """(n, k, 3) where the nodes are now, seen from the middle of the gap."""
        pose = LeftJacobian(self._stations[:, None] * twist).pose[self._inverse.reshape(self.s.shape)]
        return np.einsum("...ij,...j->...i", pose[..., :3, :3], self._wall.local()) + pose[..., :3, 3]


class _Side(Side):
    """Its columns (n, 3 k + 6) are the displacements of the images of k nodes, and behind all of them the
    strains' twist (k, e)."""

    def __init__(self, problem, number, law, t, sheets, positions, size):
        own, other = sheets
        self.s = np.concatenate([own.s[t.facet], other.s[t.other]], axis=1)
        self.x = np.concatenate([positions[0][t.facet], positions[1][t.other]], axis=1)
        columns = np.concatenate([own.places[t.facet], other.places[t.other]], axis=1)
        strains = np.broadcast_to(np.arange(size - 6, size), (len(self.s), 6))
        super().__init__(number, law, t, np.hstack([columns.reshape(len(self.s), -1), strains]), size)
        self.positions = positions
        e, k = np.split(problem.strains.value, 2)
        self._jacobian = LeftJacobian(self.s.reshape(-1, 1) * np.concatenate([k, e]))
        #: twists (n, k, 6, 6) by the strains' twist (k, e)
        self._rates = self.s[..., None, None] * self._jacobian.matrix.reshape(*self.s.shape, 6, 6)
        self.rotation = self._jacobian.pose[:, :3, :3].reshape(*self.s.shape, 3, 3)

    def _motion(self):
        """(n, k, 3, 6): dx by the strains (k, e)."""
        spin, shift = self._rates[..., :3, :], self._rates[..., 3:, :]
        return np.cross(spin, self.x[..., None], axisa=-2, axisb=-2, axisc=-2) + shift

    def chained(self, by_position: np.ndarray) -> np.ndarray:
        local = np.einsum("...ji,...j->...i", self.rotation, by_position).reshape(len(by_position), -1)
        return np.hstack([local, np.einsum("cnis,cni->cs", self._motion(), by_position)])

    def bend(self) -> np.ndarray:
        t, D = self.touching, self._motion()
        pairs, k = self.s.shape
        f, H = t.forces, -t.push[:, None, None] * t.bend
        HD = (H @ D.reshape(pairs, 3 * k, 6)).reshape(pairs, k, 3, 6)
        H = H.reshape(pairs, k, 3, k, 3)
        local = np.einsum("caji,cajbk,cbkl->caibl", self.rotation, H, self.rotation, optimize=True).reshape(
            pairs, 3 * k, 3 * k
        )
        # the wall turns under a force that stands still: d(R^T f) = R^T (f x spin)
        turned = np.cross(f[..., None], self._rates[..., :3, :], axisa=-2, axisb=-2, axisc=-2)
        coupling = np.einsum("caji,cajs->cais", self.rotation, HD + turned).reshape(pairs, 3 * k, 6)
        own = np.einsum("cais,cait->cst", D, HD)
        wrench = np.concatenate([np.cross(self.x, f), f], axis=-1)
        own += np.einsum(
            "ca,cast->cst",
            self.s**2,
            self._jacobian.slope(wrench.reshape(-1, 6)).reshape(*self.s.shape, 6, 6),
        )
        by_place = np.cross(D, f[..., None], axisa=-2, axisb=-2, axisc=-2)  # d(x x f)
        own += np.einsum("cais,cait->cst", self._rates[..., :3, :], by_place)
        return np.concatenate(
            [np.concatenate([local, coupling], 2), np.concatenate([np.swapaxes(coupling, 1, 2), own], 2)], 1
        )
