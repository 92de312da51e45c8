"""Contact of the walls that face each other across the gaps of a manipulator: hifi.contact.penalty on a
distributed body.

Wall nodes are few: every rank knows where they all are, and each computes its share of the gaps. Gaps are
seen along the mean normal of their walls, whose own motion is left out of the forces: it moves them by the
overlap, microns, over the walls' size.
"""

import numpy as np

from pneunet.hifi.contact.gaps import Contact, Side
from pneunet.hifi.contact.penalty import PenaltyLaw, mean_normal, touching
from pneunet.hifi.contact.walls import WallDistances
from pneunet.hifi.fem import surface
from pneunet.hifi.fem.mixed_field import MixedField


class BodyContact(Contact):
    """Contact in the gaps of `walls`, a PenaltyLaw for each of them."""

    def __init__(self, problem: MixedField, walls: WallDistances, laws: list[PenaltyLaw]):
        super().__init__(problem.mesh.comm, problem.dofs, problem.owned_range)
        self.problem, self._facets, self._laws, self.gaps = problem, walls.facets, laws, len(laws)
        index_map, size = problem.space.dofmap.index_map, problem.space.dofmap.index_map_bs
        local = problem.displacement_dofs[self._facets].reshape(-1)
        dofs = (
            np.asarray(index_map.local_to_global((local // size).astype(np.int32)), np.int64) * size
            + local % size
        )
        dofs[np.isin(local, problem.fixed_dofs)] = -1
        wall = self._all(walls.wall_of_facet)
        self._dofs = self._all(dofs.reshape(len(self._facets), 3 * self._facets.shape[1]))
        self._areas = self._all(surface.reference_areas(problem, self._facets))
        # a gap is computed by one rank
        self._mine = [
            (2 * gap + i, np.flatnonzero(wall == 2 * gap + i), np.flatnonzero(wall == 2 * gap + 1 - i))
            for gap in range(self.comm.rank, self.gaps, self.comm.size)
            for i in (0, 1)
        ]

    def _all(self, rows):
        return np.concatenate(self.comm.allgather(rows))

    def sides(self, reach: float = 0.0) -> list[Side]:
        x = self._all((self.problem.nodes + self.problem.displacement())[self._facets])
        found = []
        for number, own, other in self._mine:
            law, direction = self._laws[number // 2], mean_normal(x[own]) - mean_normal(x[other])
            direction /= np.linalg.norm(direction)
            t = touching(x[own], self._areas[own], x[other], direction, law, reach=reach * law.gap)
            if t is not None:
                dofs = np.hstack([self._dofs[own[t.facet]], self._dofs[other[t.other]]])
                found.append(Side(number, law, t, dofs, self._size))
        return found
