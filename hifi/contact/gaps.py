"""Contact in the gaps of a problem: the energy in overlaps of walls as a function of the problem's unknowns.

What bodies and cells have in common. Where their walls are, and how these move with the unknowns, they know
themselves (hifi.contact.body, hifi.contact.cell).
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from pneunet.hifi.contact.penalty import DEEPEST, PenaltyLaw, Touching
from pneunet.hifi.path.low_rank import Stiffnesses


class Side:
    """One wall of a gap where it pushes at the other.

    number: 2 g and 2 g + 1 are the sides of gap g. columns (pairs, 3 k): places of the displacements of the
    Touching's k nodes among `size` unknowns, -1 where held.
    """

    def __init__(self, number: int, law: PenaltyLaw, touching: Touching, columns: np.ndarray, size: int):
        self.number, self.touching, self._columns, self._size = number, touching, columns, size
        self._kept = columns >= 0
        #: deepest overlap over the gap at rest, above 0 from where the pressure begins
        self.depth = (touching.overlap.max() + law.onset) / law.gap

    @property
    def resultant(self) -> np.ndarray:
        """(3,) N: of the gap's first wall on the second."""
        t = self.touching
        return (-1) ** self.number * (t.area * t.pressure) @ t.normal

    @property
    def stiffnesses(self) -> Stiffnesses:
        """{point: N/mm}, in the order of the points."""
        t = self.touching
        return {(self.number, *name): k for name, k in zip(t.name.tolist(), t.area * t.slope)}

    def rows(self, values: np.ndarray, places: np.ndarray, count: int) -> sp.csr_matrix:
        """Sparse (count, size) of derivatives by the nodes' positions, values (pairs, k, 3) in rows
        (pairs,)."""
        values = values.reshape(self._columns.shape)[self._kept]
        at = np.broadcast_to(places[:, None], self._kept.shape)[self._kept], self._columns[self._kept]
        return sp.coo_matrix((values, at), shape=(count, self._size)).tocsr()

    def forces(self) -> sp.csr_matrix:
        """Sparse (size, 1): first derivatives of the energy."""
        return self.rows(self.touching.forces, np.zeros(len(self._columns), int), 1).T.tocsr()

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
        #: sides that push at the last residual, and at the last tangent
        self._now, self._then = [], []
        #: deepest overlap at the last residual, over DEEPEST of the gap; 0 where nothing comes closer than
        #: the penalty's onset (hifi.path.newton)
        self.overreach = 0.0

    def sides(self) -> list[Side]:
        """What pushes now in the gaps that this rank computes."""
        return []

    def _sum(self, parts, columns):
        """This rank's rows of the sum of all ranks' sparse matrices (size, columns)."""
        if not self.comm.allreduce(len(parts)):
            return sp.csr_matrix((self._owned.stop - self._owned.start, columns))
        total = sum(parts, sp.csr_matrix((self._size, columns)))
        return sum(self.comm.allgather(total))[self._owned]

    def energy(self) -> float:
        """N mm stored in overlaps."""
        touching = [side.touching for side in self.sides()]
        return float(self.comm.allreduce(sum((t.area * t.energy).sum() for t in touching)))

    def residual(self) -> np.ndarray:
        """(owned,) how the energy changes with the unknowns."""
        self._now = self.sides()
        deepest = self.comm.allreduce(max((side.depth for side in self._now), default=0.0), op=MPI.MAX)
        self.overreach = deepest / DEEPEST
        return self._sum([side.forces() for side in self._now], 1).toarray()[:, 0]

    def tangent(self) -> sp.csr_matrix:
        """Sparse (owned, size): second derivatives of the energy."""
        self._then = self.sides()
        return self._sum([side.tangent() for side in self._then], self._size)

    def stiffnesses(self, factorised: bool = False) -> Stiffnesses:
        """{point: N/mm} of all ranks, at the last residual or at the last tangent."""
        sides = self._then if factorised else self._now
        parts = self.comm.allgather([side.stiffnesses for side in sides])
        return {point: value for part in parts for side in part for point, value in side.items()}

    def gradients(self, points: list) -> np.ndarray:
        """(m, owned): how the gaps of points change; zero for those that push at no side."""
        places, rows = {p: i for i, p in enumerate(points)}, {}
        for side in [*self._now, *self._then]:  # what is taken away was put in as it was then
            chosen = [(places[p], row) for row, p in enumerate(side.stiffnesses) if p in places]
            if chosen:
                to, of = np.array(chosen).T
                rows |= dict(zip(to.tolist(), side.gap_gradients[of]))
        nothing = sp.csr_matrix((1, self._size))
        own = sp.vstack([rows.get(i, nothing) for i in range(len(points))]).tocsr()
        return sum(self.comm.allgather(own))[:, self._owned].toarray()

    def forces(self) -> np.ndarray:
        """(gaps, 3) N at the last residual: of each gap's first wall on the second."""
        rows = np.zeros((self.gaps, 3))
        for side in self._now:
            rows[side.number // 2] += side.resultant
        return self.comm.allreduce(rows)
