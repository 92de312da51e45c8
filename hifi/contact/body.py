"""Contact of the walls that face each other across the gaps of a manipulator: hifi.contact.penalty on a
distributed body.

Wall nodes are few: every rank knows where they all are, and each computes its share of the gaps. Gaps are
seen along the mean normal of their walls, whose own motion is left out of the forces: it moves them by the
overlap, microns, over the walls' size.
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from pneunet.hifi.contact.penalty import DEEPEST, mean_normal, touching
from pneunet.hifi.fem import surface
from pneunet.hifi.path.low_rank import TouchingSides


class BodyContact:
    """Contact in the gaps of `walls` (hifi.contact.walls.WallDistances); laws, gaps: for each of them its
    PenaltyLaw and width at rest (mm)."""

    def __init__(self, problem, walls, laws, gaps):
        self.problem, self.comm, self._facets = problem, problem.mesh.comm, walls.facets
        self._laws, self._gaps = laws, gaps
        index_map, size = problem.space.dofmap.index_map, problem.space.dofmap.index_map_bs
        local = problem.displacement_dofs[self._facets].reshape(-1)
        dofs = (
            np.asarray(index_map.local_to_global((local // size).astype(np.int32)), np.int64) * size
            + local % size
        )
        dofs[np.isin(local, problem.fixed_dofs)] = -1
        first, last = (size * i for i in index_map.local_range)
        self._owned, self._size = slice(first, last), size * index_map.size_global
        wall = self._all(walls.wall_of_facet)
        self._dofs = self._all(dofs.reshape(-1, 6, 3))
        self._areas = self._all(surface.reference_areas(problem, self._facets))
        # a gap is computed by one rank
        mine = range(self.comm.rank, len(laws), self.comm.size)
        self._sides = [
            (2 * g + i, np.flatnonzero(wall == 2 * g + i), np.flatnonzero(wall == 2 * g + 1 - i))
            for g in mine
            for i in (0, 1)
        ]
        self._sides_in_touch = TouchingSides()
        #: see hifi.path.newton
        self.overreach = 0.0

    def _all(self, rows):
        return np.concatenate(self.comm.allgather(rows))

    def _touching(self):
        """[_Side] of this rank's gaps."""
        x = self._all((self.problem.nodes + self.problem.displacement())[self._facets])
        found = []
        for number, own, other in self._sides:
            direction = mean_normal(x[own]) - mean_normal(x[other])
            t = touching(
                x[own],
                self._areas[own],
                x[other],
                direction / np.linalg.norm(direction),
                self._laws[number // 2],
            )
            if t is not None:
                dofs = np.concatenate([self._dofs[own[t.facet]], self._dofs[other[t.other]]], axis=1).reshape(
                    -1, 36
                )
                found.append(_Side(number, t, dofs, self._size))
        return found

    def _sum(self, parts):
        """This rank's rows of the sum of all ranks' sparse matrices `parts` with rows for the dofs."""
        total = sum(parts[1:], parts[0]).tocsr()
        return sum(self.comm.allgather(total))[self._owned]

    def residual(self):
        """(owned dofs,) how the energy stored in overlaps changes with the dofs."""
        self._sides_in_touch.now, zero = self._touching(), sp.csr_matrix((self._size, 1))
        deep = [
            (s.touching.overlap.max() + self._laws[s.number // 2].onset) / self._gaps[s.number // 2]
            for s in self._sides_in_touch.now
        ]
        self.overreach = self.comm.allreduce(max(deep, default=0.0), op=MPI.MAX) / DEEPEST
        if not self.overreach:
            return np.zeros(self._owned.stop - self._owned.start)
        return self._sum([zero, *(s.forces() for s in self._sides_in_touch.now)]).toarray()[:, 0]

    def add_tangent(self, matrix):
        """Add the second derivatives of the energy to a PETSc matrix of the mixed space, whose pattern grows;
        collective."""
        self._sides_in_touch.then = self._touching()
        if not self.comm.allreduce(len(self._sides_in_touch.then)):
            return
        rows = self._sum(
            [sp.csr_matrix((self._size, self._size)), *(s.tangent() for s in self._sides_in_touch.then)]
        )
        owned = self._owned.stop - self._owned.start
        both = ((owned, self._size), (owned, self._size))
        contact = PETSc.Mat().createAIJ(both, csr=(rows.indptr, rows.indices, rows.data), comm=self.comm)
        matrix.axpy(1.0, contact, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        contact.destroy()

    def stiffnesses(self, factorised=False):
        """{point: N/mm} at the last residual, or at the last tangent, of all ranks."""
        parts = self.comm.allgather(self._sides_in_touch.stiffnesses(factorised))
        return {point: value for part in parts for point, value in part.items()}

    def gradients(self, points):
        """(m, owned dofs): how the gaps of points change."""
        return sum(self.comm.allgather(self._sides_in_touch.gap_gradients(points, self._size)))[
            :, self._owned
        ].toarray()

    def forces(self):
        """(gaps, 3) N at the last residual, on all ranks: of each gap's first wall on the second."""
        rows = np.zeros((len(self._laws), 3))
        for side in self._sides_in_touch.now:
            t = side.touching
            rows[side.number // 2] += (-1) ** side.number * (t.area * t.pressure) @ t.normal
        return self.comm.allreduce(rows)


class _Side:
    """One side of a gap in touch; dofs (pairs, 36): global, -1 at supports."""

    def __init__(self, number, t, dofs, size):
        self.number, self.touching, self._dofs, self._size = number, t, dofs, size
        self._kept = dofs >= 0

    def forces(self):
        """Sparse (dofs, 1)."""
        f, dofs = self.touching.forces.reshape(-1, 36)[self._kept], self._dofs[self._kept]
        return sp.coo_matrix((f, (dofs, 0 * dofs)), shape=(self._size, 1)).tocsr()

    @cached_property
    def gap_gradients(self):
        """Sparse (points, dofs): first derivatives of the gaps."""
        t, dofs = self.touching, self._dofs[self._kept]
        points = np.broadcast_to(t.point[:, None], self._dofs.shape)[self._kept]
        return sp.coo_matrix(
            (t.gradient.reshape(-1, 36)[self._kept], (points, dofs)), shape=(len(t.area), self._size)
        ).tocsr()

    def tangent(self):
        """Sparse (dofs, dofs)."""
        t, both = self.touching, self._kept[:, :, None] & self._kept[:, None, :]
        bend = -t.push[:, None, None] * t.bend
        places = [
            np.broadcast_to(d, both.shape)[both] for d in (self._dofs[:, :, None], self._dofs[:, None, :])
        ]
        bend = sp.coo_matrix((bend[both], places), shape=(self._size, self._size)).tocsr()
        gradient = self.gap_gradients
        return bend + gradient.T @ sp.diags(t.area * t.slope) @ gradient
