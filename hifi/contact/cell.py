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
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from pneunet.base.left_jacobian import LeftJacobian
from pneunet.hifi.contact.correction import Name
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
        self._law = penalty and penalty.on(problem.segment.material.mu, problem.segment.gap)
        along = [np.mean([wall.along.mean() for wall in gap]) for gap in gaps]
        own = [wall for gap in gaps for wall in gap]
        images = np.concatenate([wall.images.ravel() for wall in own] or [np.zeros(0, int)])
        stations = np.concatenate(
            [(wall.along - along[i // 2]).ravel() for i, wall in enumerate(own)] or [[]]
        )
        #: (m,) the walls' nodes in the images in which they are there, rotation and node in one number
        self._images, first = np.unique(images, return_index=True)
        number, self._nodes = np.divmod(self._images, len(problem.nodes))
        self._turns = problem.turns[number]
        #: where each stands along the axis, from the middle of its gap (mm)
        self._stations, self._standing = np.unique(stations[first].round(9), return_inverse=True)
        size = 3 * len(self._images) + 6
        super().__init__(MPI.COMM_SELF, size, slice(0, size))
        self.gaps, self._stiffness = len(gaps), sp.csr_matrix((size, size))
        self._signs = [self._signs_of(each, number) for each in problem.classes]
        self._pairs = []
        for pair in [pair for gap in gaps for pair in (gap, gap[::-1])]:
            first, second = (mean_normal(problem.nodes[wall.facets] * wall.turn) for wall in pair)
            facets = [np.searchsorted(self._images, wall.images) for wall in pair]
            areas = surface.reference_areas(problem, pair[0].facets)
            self._pairs.append((*facets, areas, (first - second) / np.linalg.norm(first - second)))
        # rotations take the sides of gaps to each other: that many stand for all
        self._pairs = self._pairs[: 2 * len(problem.segment.sides) // len(problem.turns)] if gaps else []

    def _signs_of(self, each, number):
        """S, sparse (images' displacements and twist (k, e), unknowns and (e, k)), of a class of symmetry."""
        dofs = self.problem.displacement_dofs[self._nodes]
        signs = each.chi[number, None] * self._turns * each.signs[dofs]
        columns = np.append(each.reduced[dofs], each.unknowns + np.array(_ORDER))
        rows = np.flatnonzero(columns >= 0)
        values = np.append(signs, each.strains[_ORDER])[rows]
        return sp.coo_matrix((values, (rows, columns[rows])), (self._size, each.unknowns + 6)).tocsr()

    def sides(self, reach: float = 0.0) -> list[Side]:
        problem, found = self.problem, []
        y = problem.nodes[self._nodes] * [0, 1, 1] + problem.displacement()[self._nodes]
        screw = _Screw(problem.strains.value, self._stations, self._standing, y * self._turns)
        x = screw.positions
        for number, (own, other, areas, direction) in enumerate(self._pairs):
            t = touching(
                x[own], areas, x[other], direction, self._law, len(problem.turns) / 2, reach * self._law.gap
            )
            if t is not None:
                nodes = np.concatenate([own[t.facet], other[t.other]], axis=1)
                found.append(_Side(number, self._law, t, nodes, screw, x[other]))
        return found

    def residual(self) -> np.ndarray:
        return self._signs[0].T @ super().residual()

    def tangent(self) -> sp.csr_matrix:
        self._stiffness = super().tangent()
        return self.tangent_of(0)

    def tangent_of(self, number: int) -> sp.csr_matrix:
        """Sparse (unknowns + 6, unknowns + 6) of a class of symmetry, at the state of the last tangent."""
        signs = self._signs[number]
        return (signs.T @ self._stiffness @ signs).tocsr()

    def gradients(self, names: list[Name]) -> sp.csr_matrix:
        return super().gradients(names) @ self._signs[0]

    def forces(self) -> np.ndarray:
        # of the rotations those that keep a gap; they exchange its walls with the direction of the axis
        kept = self.problem.turns[self.problem.turns[:, 2] > 0]
        share = kept * kept[:, :1] / len(self.problem.turns)
        return super().forces() * share.sum(axis=0)

    def measure(self, pressure: float) -> WallContact:
        """WallContact at the last residual of the gap with the largest force, `pressure` (MPa) being that of
        the air."""
        gaps = [WallContact() for _ in range(self.gaps)]
        alike = len(self.problem.segment.sides) / self.gaps  # gaps that each stands for
        for side in self._now:
            t, gap = side.touching, side.number // 2
            pushing = t.pressure > IN_CONTACT * pressure
            if pushing.any():
                d = distances_from(side.wall, t.position[pushing])
                c = gaps[gap]
                gaps[gap] = WallContact(
                    0.0,
                    c.area + t.area[pushing].sum() / alike,
                    np.fmin(c.nearest, d.min()),
                    np.fmax(c.farthest, d.max()),
                )
        forces = np.linalg.norm(self.forces(), axis=1)
        return replace(gaps[forces.argmax()], force=float(forces.max()))


class _Screw:
    """Where the strains (e, k) take points of local positions y (m, 3), mm, that stand along the axis at
    stations[standing]."""

    def __init__(self, strains, stations, standing, y):
        e, k = np.split(strains, 2)
        self._stations, self._standing = stations, standing
        self._jacobian = LeftJacobian(stations[:, None] * np.concatenate([k, e]))
        pose = self._jacobian.pose[standing]
        self._rotation = pose[:, :3, :3]
        self.positions = np.einsum("nij,nj->ni", self._rotation, y) + pose[:, :3, 3]

    @cached_property
    def _rates(self):
        """(m, 6, 6): twists by the strains' twist (k, e)."""
        return (self._stations[:, None, None] * self._jacobian.matrix)[self._standing]

    @cached_property
    def _by_twist(self):
        """(m, 3, 6): dx by the strains' twist."""
        x = self.positions[..., None]
        return np.cross(self._rates[:, :3], x, axisa=1, axisb=1, axisc=1) + self._rates[:, 3:]

    @cached_property
    def chain(self) -> sp.csr_matrix:
        """Sparse (3 m, 3 m + 6): dx by the local positions and the strains' twist."""
        m = len(self.positions)
        turned = sp.bsr_matrix((self._rotation, np.arange(m), np.arange(m + 1)), shape=(3 * m, 3 * m))
        return sp.hstack([turned, self._by_twist.reshape(3 * m, 6)]).tocsr()

    def bend(self, f: np.ndarray) -> sp.csr_matrix:
        """Sparse (3 m + 6, 3 m + 6): second derivatives of f . x for forces f (m, 3) that stand still."""
        spin, D = self._rates[:, :3], self._by_twist
        # the local frame turns under the force: d(R^T f) = R^T (f x spin)
        turned = np.cross(f[..., None], spin, axisa=1, axisb=1, axisc=1)
        coupling = sp.csr_matrix(np.einsum("nji,njs->nis", self._rotation, turned).reshape(-1, 6))
        wrench = np.zeros((len(self._stations), 6))
        np.add.at(wrench, self._standing, np.hstack([np.cross(self.positions, f), f]))
        own = (self._stations[:, None, None] ** 2 * self._jacobian.slope(wrench)).sum(axis=0)
        by_place = np.cross(D, f[..., None], axisa=1, axisb=1, axisc=1)  # d(x x f)
        own += np.einsum("nis,nit->st", spin, by_place)
        return sp.bmat([[None, coupling], [coupling.T, own]], format="csr")


class _Side(Side):
    """By the images' displacements and, behind all of them, the strains' twist (k, e). nodes (pairs, k): of
    `screw`; wall (n, k, 3): the one that it pushes at, mm."""

    def __init__(self, number, law, t, nodes, screw, wall):
        columns = 3 * nodes[..., None] + np.arange(3)
        super().__init__(number, law, t, columns.reshape(len(nodes), -1), screw.positions.size)
        self._screw, self.wall = screw, wall

    def rows(self, values: np.ndarray, places: np.ndarray, count: int) -> sp.csr_matrix:
        return super().rows(values, places, count) @ self._screw.chain

    def forces(self) -> np.ndarray:
        return self._screw.chain.T @ super().forces()

    def tangent(self) -> sp.csr_matrix:
        return super().tangent() + self._screw.bend(super().forces().reshape(-1, 3))
