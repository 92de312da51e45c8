"""Largest principal stretch of a deformed body.

At re-entrant edges it has no bound: the smaller the elements, the larger. Its mean over the most stretched
part of a stated size has one, and converges with the mesh.
"""

from collections.abc import Sequence

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from pneunet.geometry.hexahedra import gauss
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.mixed_field import MixedField

#: of a solid's volume at rest, over which its largest stretch is averaged
MOST_STRETCHED = 0.01
#: (points, weights) inside the reference cell, since re-entrant edges are singular: the 4-point rule of
#: degree 2 on the tetrahedron; on the hexahedron the 27 Gauss points of the tangent: with 8, large elements
#: would miss what is steep at edges
_A, _B = 0.5854101966249685, 0.1381966011250105
RULES = {
    "tetrahedron": (
        np.array([[_B, _B, _B], [_A, _B, _B], [_B, _A, _B], [_B, _B, _A]]),
        np.full(4, 1 / 24),
    ),
    "hexahedron": gauss(3),
}


class PrincipalStretch:
    """Largest principal stretch at interior points of the cells of `solids`: the cell tags of each."""

    def __init__(self, problem: MixedField, solids: Sequence[Sequence[int]]):
        self.problem, mesh, tagged = problem, problem.mesh, problem.cell_tags
        points, self._weights = RULES[problem.cell_name]
        self._gradient = compat.expression(mesh, problem.deformation_gradient, points)
        self._determinant = compat.expression(mesh, ufl.JacobianDeterminant(mesh), points)
        owned = tagged.indices < mesh.topology.index_map(3).size_local
        of = [tagged.indices[owned & np.isin(tagged.values, tags)] for tags in solids]
        self._cells = np.concatenate(of)
        #: the cells of each solid among all
        self._solids = np.split(np.arange(len(self._cells)), np.cumsum([len(cells) for cells in of])[:-1])
        space = problem.displacement_space
        self._nodes = compat.cell_dofs(space)[self._cells]
        self._sum = fem.Function(space)
        self._count = self._add_up(np.ones(len(self._cells))).copy()

    def cellwise(self) -> np.ndarray:
        """(owned cells, points) largest principal stretches at the current state."""
        F = self._gradient(self._cells).reshape(len(self._cells), len(self._weights), 3, 3)
        return np.sqrt(np.linalg.eigvalsh(np.swapaxes(F, -1, -2) @ F)[..., -1])

    def volumes(self) -> np.ndarray:
        """(owned cells, points) mm3 at rest that each point stands for."""
        return np.abs(self._determinant(self._cells)[..., 0]) * self._weights

    def largest(self) -> float:
        """Mean over the most stretched hundredth (`MOST_STRETCHED`) of a solid's volume at rest, that of the
        solid where it is largest; collective."""
        stretches, volumes = self.cellwise(), self.volumes()
        return max(
            upper_mean(stretches[of].ravel(), volumes[of].ravel(), MOST_STRETCHED, self.problem.mesh.comm)
            for of in self._solids
        )

    def _add_up(self, cell_values):
        """(local P2 nodes,) sum over the cells around each node; carried by the first displacement
        component."""
        self._sum.x.array[:] = 0.0
        nodal = self._sum.x.array.reshape(-1, 3)[:, 0]
        np.add.at(nodal, self._nodes.ravel(), np.repeat(cell_values, self._nodes.shape[1]))
        compat.scatter_add(self._sum)
        return nodal

    def nodal(self) -> np.ndarray:
        """(local P2 nodes,) mean of the cells around each node, for pictures."""
        return self._add_up(self.cellwise() @ self._weights / self._weights.sum()) / self._count


def upper_mean(values: np.ndarray, weights: np.ndarray, fraction: float, comm: MPI.Comm) -> float:
    """Mean of all ranks' `values` (n,) over the part `fraction` of their `weights` (n,) where they are
    largest; collective."""
    part = fraction * comm.allreduce(weights.sum(), op=MPI.SUM)
    found = comm.allgather(_largest(values, weights, part))
    values, weights = _largest(*(np.concatenate(each) for each in zip(*found)), part)
    return float(values @ weights / part)


def _largest(values, weights, part):
    """The largest values and their weights, which are `part` together at most: the last one is cut."""
    order = np.argsort(-values)
    weights = np.diff(np.minimum(np.cumsum(weights[order]), part), prepend=0.0)
    kept = weights > 0
    return values[order][kept], weights[kept]
