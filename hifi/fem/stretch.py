"""Largest principal stretch of a deformed body."""

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from pneunet.geometry.hexahedra import gauss
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.mixed_field import MixedField

#: the 4-point rule of degree 2 on the reference tetrahedron (inside the cell: vertices of re-entrant corners
#: are singular), the 8-point Gauss rule on the hexahedron
_A, _B = 0.5854101966249685, 0.1381966011250105
POINTS = {
    "tetrahedron": np.array([[_B, _B, _B], [_A, _B, _B], [_B, _A, _B], [_B, _B, _A]]),
    "hexahedron": gauss(2)[0],
}


class PrincipalStretch:
    """Largest principal stretch at interior points of every cell, or of these local `cells`."""

    def __init__(self, problem: MixedField, cells: np.ndarray | None = None):
        self.problem, mesh = problem, problem.mesh
        self._points = POINTS[problem.cell_name]
        self._gradient = compat.expression(mesh, problem.deformation_gradient, self._points)
        self._cells = (
            np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32) if cells is None else cells
        )
        space = problem.displacement_space
        self._nodes = compat.cell_dofs(space)[self._cells]
        self._sum = fem.Function(space)
        self._count = self._add_up(np.ones(len(self._cells))).copy()

    def cellwise(self) -> np.ndarray:
        """(owned cells, points) largest principal stretches at the current state."""
        F = self._gradient(self._cells).reshape(len(self._cells), len(self._points), 3, 3)
        return np.sqrt(np.linalg.eigvalsh(np.swapaxes(F, -1, -2) @ F)[..., -1])

    def largest(self) -> float:
        values = self.cellwise()
        return float(self.problem.mesh.comm.allreduce(values.max(initial=0.0), op=MPI.MAX))

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
        return self._add_up(self.cellwise().mean(axis=1)) / self._count
