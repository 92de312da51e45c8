"""Contact in the gaps of a problem: the energy in overlaps of walls as a function of the problem's unknowns.

What bodies and cells have in common. Where their walls are, and how these move with the unknowns, they know
themselves (hifi.contact.body, hifi.contact.cell).
"""

from functools import cached_property, reduce

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from pneunet.hifi.contact.correction import Name, WallPoints
from pneunet.hifi.contact.penalty import DEEPEST, PenaltyLaw, Touching

#: of the gap: points that are nearer are looked at, since a correction may bring them into touch
REACH = 0.3


class Side:
    """One wall of a gap where it pushes at the other.

    number: 2 g and 2 g + 1 are the sides of gap g. columns (pairs, 3 k): places of the displacements of the
    Touching's k nodes among `size` unknowns, -1 where held.
    """

    def __init__(self, number: int, law: PenaltyLaw, touching: Touching, columns: np.ndarray, size: int):
        self.number, self.touching, self._columns, self._size = number, touching, columns, size
        self._law = law
        self._kept = columns >= 0
        #: deepest overlap over the gap at rest, above 0 from where the pressure begins
        self.depth = max(touching.overlap.max() + law.onset, 0.0) / law.gap

    @property
    def resultant(self) -> np.ndarray:
        """(3,) N: of the gap's first wall on the second."""
        t = self.touching
        return (-1) ** self.number * (t.area * t.pressure) @ t.normal

    @cached_property
    def points(self) -> WallPoints:
        """All of them."""
        t, one = self.touching, np.ones(len(self.touching.area))
        names = [(self.number, *name) for name in t.name.tolist()]
        return WallPoints(names, t.area, t.overlap, self._law.stiffness * one, self._law.onset * one)

    def rows(self, values: np.ndarray, places: np.ndarray, count: int) -> sp.csr_matrix:
        """Sparse (count, size) of derivatives by the nodes' positions, values (pairs, k, 3) in rows
        (pairs,)."""
        values = values.reshape(self._columns.shape)[self._kept]
        at = np.broadcast_to(places[:, None], self._kept.shape)[self._kept], self._columns[self._kept]
        return sp.coo_matrix((values, at), shape=(count, self._size)).tocsr()

    def forces(self) -> np.ndarray:
        """(size,) first derivatives of the energy."""
        values = self.touching.forces.reshape(self._columns.shape)[self._kept]
        return np.bincount(self._columns[self._kept], values, self._size)

    @cached_property
    def gap_gradients(self) -> sp.csr_matrix:
        """Sparse (points, size): first derivatives of the gaps."""
        return self.rows(self.touching.gradient, self.touching.point, len(self.touching.area))

    def tangent(self) -> sp.csr_matrix:
        """Sparse (size, size): second derivatives of the energy, at fixed derivatives of the positions."""
        t, pairs = self.touching, len(self._columns)
        # the pairs of a point share its gap and the sum of its weights
        shared = sp.diags(t.area * t.slope / 2) @ self.gap_gradients
        shared += sp.diags(t.area * t.pressure) @ self.rows(t.turn, t.point, len(t.area))
        left, right = [shared], [self.gap_gradients]
        for a in range(2):
            left.append(self.rows(-t.push[:, None, None] * t.bend[:, a], np.arange(pairs), pairs))
            right.append(self.rows(t.shift[:, a], np.arange(pairs), pairs))
        half = sp.vstack(left).T @ sp.vstack(right)
        return (half + half.T).tocsr()


class Contact:
    """No gaps, so that nothing touches; what derives from it has some, and says with `sides` what does.

    size: unknowns of all ranks; owned: this rank's of them.
    """

    gaps = 0

    def __init__(self, comm: MPI.Comm, size: int, owned: slice):
        self.comm, self._size, self._owned = comm, size, owned
        #: sides within REACH at the last residual, and those that push at the last tangent
        self._now, self._then = [], []
        #: deepest overlap at the last residual, over DEEPEST of the gap; 0 where nothing comes closer than
        #: the penalty's onset (hifi.path.newton)
        self.overreach = 0.0

    def sides(self, reach: float = 0.0) -> list[Side]:
        """What pushes now, or is within `reach` of the gap of that, in the gaps that this rank computes."""
        return []

    def energy(self) -> float:
        """N mm stored in overlaps."""
        touching = [side.touching for side in self.sides()]
        return float(self.comm.allreduce(sum((t.area * t.energy).sum() for t in touching)))

    def residual(self) -> np.ndarray:
        """(owned,) how the energy changes with the unknowns."""
        self._now = self.sides(REACH)
        deepest = self.comm.allreduce(max((side.depth for side in self._now), default=0.0), op=MPI.MAX)
        self.overreach = deepest / DEEPEST
        own, total = sum((side.forces() for side in self._now), np.zeros(self._size)), np.zeros(self._size)
        for places, values in self.comm.allgather((np.flatnonzero(own), own[own != 0])):
            total[places] += values
        return total[self._owned]

    def tangent(self) -> sp.csr_matrix:
        """Sparse (owned, size): second derivatives of the energy."""
        self._then, self._now = self.sides(), self.sides(REACH)
        own = sum((side.tangent() for side in self._then), sp.csr_matrix((self._size, self._size)))
        return sum(self.comm.allgather(own))[self._owned]

    def points(self, factorised: bool = False) -> WallPoints:
        """Of all ranks: those that touch or nearly do now, or those that pushed at the last tangent."""
        sides = self._then if factorised else self._now
        parts = self.comm.allgather([side.points for side in sides])
        return reduce(WallPoints.joined, [points for part in parts for points in part], WallPoints())

    def gradients(self, names: list[Name]) -> sp.csr_matrix:
        """Sparse (m, owned): how the gaps of points change; of points that are far apart now, as at the last
        tangent."""
        left, own = {name: i for i, name in enumerate(names)}, sp.csr_matrix((len(names), self._size))
        for side in [*self._now, *self._then]:
            found = [(left.pop(name), row) for row, name in enumerate(side.points.names) if name in left]
            if found:
                to, of = np.array(found).T
                places = sp.coo_matrix((np.ones(len(to)), (to, of)), (len(names), len(side.points.names)))
                own = own + places.tocsr() @ side.gap_gradients
        return sum(self.comm.allgather(own)).tocsr()[:, self._owned]

    def forces(self) -> np.ndarray:
        """(gaps, 3) N at the last residual: of each gap's first wall on the second."""
        rows = np.zeros((self.gaps, 3))
        for side in self._now:
            rows[side.number // 2] += side.resultant
        return self.comm.allreduce(rows)
