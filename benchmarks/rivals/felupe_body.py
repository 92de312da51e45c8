"""The ramp's body in FElupe, with MKL PARDISO through pypardiso: FElupe's regions, fields, solid body and
pressure.

FElupe takes any quadrature rule, so it integrates with ours; what its library lacks (tetrahedra's faces as a
boundary region, this energy) is added the way its documentation shows. Everything that does not change is
made once: the pattern of the matrix, and where each block's entries go in its upper triangle.
"""

import felupe as fem
import numpy as np
from pypardiso import PyPardisoSolver
from ramp import MU, Body
from scipy.sparse import csr_matrix

#: edges of FElupe's quadratic tetrahedron, in the order of its mid-edge points
EDGES = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
ANALYSE, FACTORISE, SOLVE = 11, 22, 33  # PARDISO's phases
SYMMETRIC_INDEFINITE = -2
#: own settings, METIS, pivots perturbed at 1e-8, Bunch-Kaufman, two-level factorisation: the fastest of ten
#: tried; the default spends two thirds of a solution on iterative refinement, which Newton's method does not
#: need
IPARM = {1: 1, 2: 2, 10: 8, 21: 1, 24: 1}


class Incompressible(fem.ConstitutiveMaterial):
    """psi = mu/2 (J^(-2/3) I1 - 3) + p (J - 1)."""

    def __init__(self, mu):
        self.mu = mu
        self.x = [np.eye(3), np.ones(1), np.zeros(0)]

    def _common(self, F, p):
        J = fem.math.det(F)
        G = fem.math.transpose(fem.math.inv(F, J))
        return J, G, self.mu * J ** (-2 / 3), np.einsum("ij...,ij...->...", F, F), p[0] * J

    def _gradient(self, x):
        F, p, statevars = x
        J, G, m, I1, pJ = self._common(F, p)
        return [m * F + (pJ - m * I1 / 3) * G, (J - 1)[None], statevars]

    def _hessian(self, x):
        F, p = x[:2]
        J, G, m, I1, pJ = self._common(F, p)
        cross = -2 / 3 * m * F
        A = np.multiply(G[:, :, None, None], ((2 / 9 * m * I1 + pJ) * G + cross)[None, None])
        A += cross[:, :, None, None] * G[None, None]
        A += ((m * I1 / 3 - pJ) * G)[:, None, None, :] * G.transpose(1, 0, 2, 3)[None, :, :, None]
        for i in range(3):
            for j in range(3):
                A[i, j, i, j] += m
        return [A, (J * G)[:, :, None], None]


class TetraFaces(fem.Region):
    """Faces 0, 1, 2 of quadratic tetrahedra as a boundary region with outward normals."""

    def __init__(self, mesh, points, weights):
        on_face = fem.quadrature.Scheme(np.column_stack([points, np.zeros(len(points))]), weights)
        super().__init__(mesh, fem.QuadraticTetra(), on_face)
        normal = -np.cross(self.dXdr[:, 0], self.dXdr[:, 1], axis=0)  # vertex 3 lies on the other side
        length = np.linalg.norm(normal, axis=0)
        self.normals = normal / length
        self.dV = length * weights[:, None]


class Quadratic:
    """Quadratic tetrahedra of linear ones: points (vertices, then mid-edge points) and the cells of any of
    its tets."""

    def __init__(self, points, tets):
        self.vertices = len(points)
        self.keys, first = np.unique(self._keys(tets).ravel(), return_index=True)
        edges = tets[:, EDGES].reshape(-1, 2)[first]
        self.points = np.vstack([points, points[edges].mean(axis=1)])

    def _keys(self, tets):
        return np.sort(tets[:, EDGES], axis=2) @ np.array([self.vertices, 1])

    def cells(self, tets):
        """(m, 10) point numbers."""
        return np.hstack([tets, self.vertices + np.searchsorted(self.keys, self._keys(tets))])


class FElupeBody(Body):
    name = "felupe"

    def __init__(self, mesh):
        super().__init__()
        points, tets = mesh["points"], mesh["tets"]
        quadratic = Quadratic(points, tets)
        self.nodes = quadratic.points
        rule = fem.quadrature.Scheme(mesh["volume_points"], mesh["volume_weights"])
        region = fem.Region(
            fem.Mesh(self.nodes, quadratic.cells(tets), "tetra10"), fem.QuadraticTetra(), rule
        )
        region_p = fem.Region(fem.Mesh(points, tets, "tetra"), fem.Tetra(), rule)
        self.field = fem.FieldContainer([fem.Field(region, dim=3), fem.Field(region_p, dim=1)])
        self.solid = fem.SolidBody(Incompressible(MU), self.field, block=False)
        walls = fem.Mesh(self.nodes, quadratic.cells(np.vstack([mesh["cavity"], mesh["channel"]])), "tetra10")
        surface = TetraFaces(walls, mesh["facet_points"], mesh["facet_weights"])
        self.pressure = fem.SolidBodyPressure(fem.FieldContainer([fem.Field(surface, dim=3)]), pressure=1.0)
        self.count_u, self.dofs = 3 * len(self.nodes), 3 * len(self.nodes) + len(points)
        clamped = np.unique(quadratic.cells(mesh["base"])[:, [0, 1, 2, 4, 5, 6]])
        self.fixed = (3 * clamped[:, None] + np.arange(3)).ravel()
        self.state = np.zeros(self.dofs)
        self._prepare_matrix()

    def _set_fields(self):
        self.field[0].values = self.state[: self.count_u].reshape(-1, 3)
        self.field[1].values = self.state[self.count_u :].reshape(-1, 1)
        self.pressure.field[0].values = self.field[0].values

    def forces(self):
        self._set_fields()
        ru, rp = self.solid.assemble.vector(self.field)
        load = np.zeros(self.dofs)
        force = self.pressure.assemble.vector(self.field, pressure=1.0).toarray()[: self.count_u, 0]
        load[: self.count_u] = self.pressure.assemble.multiplier * force
        return np.concatenate([ru.toarray()[:, 0], rp.toarray()[:, 0]]), load

    def _blocks(self, pressure):
        """[(matrix, first column)]: K_uu and K_up of the solid, and the pressure's K_uu."""
        self._set_fields()
        uu, up = self.solid.assemble.matrix(self.field)[:2]
        load = self.pressure.assemble.matrix(
            self.field, pressure=self.pressure.assemble.multiplier * pressure
        )
        return [(uu, 0), (up, self.count_u), (load, 0)]

    def _prepare_matrix(self):
        """Upper triangle without supported dofs, and for every block which entries go where."""
        free = np.setdiff1d(np.arange(self.dofs), self.fixed)
        self.free = free
        new = np.full(self.dofs, -1)
        new[free] = np.arange(len(free))
        chosen, rows, columns = [], [], []
        for block, first in self._blocks(1.0):
            i = new[np.repeat(np.arange(block.shape[0]), np.diff(block.indptr))]
            j = new[block.indices + first]
            keep = (i >= 0) & (j >= i)
            chosen.append(np.flatnonzero(keep))
            rows.append(i[keep])
            columns.append(j[keep])
        n = len(free)
        keys = [i.astype(np.int64) * n + j for i, j in zip(rows, columns)]
        diagonal = np.arange(n, dtype=np.int64) * (n + 1)  # PARDISO wants it whole, the zeros of K_pp too
        pattern = np.unique(np.concatenate([*keys, diagonal]))
        self._places = [(c, np.searchsorted(pattern, k)) for c, k in zip(chosen, keys)]
        indptr = np.concatenate([[0], np.cumsum(np.bincount(pattern // n, minlength=n))])
        self.matrix = csr_matrix(
            (np.zeros(len(pattern)), (pattern % n).astype(np.int32), indptr.astype(np.int32)), shape=(n, n)
        )
        self.solver = PyPardisoSolver(mtype=SYMMETRIC_INDEFINITE)
        for i, value in IPARM.items():
            self.solver.set_iparm(i, value)
        self.analysed = False

    def _pardiso(self, phase, right):
        self.solver.set_phase(phase)
        return self.solver._call_pardiso(self.matrix, right)

    def factorise(self, pressure):
        with self.timed("tangent"):
            data = self.matrix.data
            data[:] = 0.0
            for (block, _), (chosen, places) in zip(self._blocks(pressure), self._places):
                data[places] += block.data[chosen]
        with self.timed("factorise"):
            nothing = np.zeros((len(self.free), 1))
            if not self.analysed:
                self._pardiso(ANALYSE, nothing)
                self.analysed = True
            self._pardiso(FACTORISE, nothing)

    def solve(self, right):
        with self.timed("solve"):
            solution = np.zeros(self.dofs)
            solution[self.free] = self._pardiso(SOLVE, right[self.free])
            return solution

    def displacements(self):
        """(points (n, 3), displacements (n, 3)) at vertices and mid-edge points, in mm."""
        return self.nodes, self.state[: self.count_u].reshape(-1, 3)
