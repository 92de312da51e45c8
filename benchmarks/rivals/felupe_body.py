"""The ramp's body in FElupe, with MKL PARDISO through pypardiso: FElupe's regions, fields, solid body and
pressure.

FElupe takes any quadrature rule, so it integrates with ours; what its library lacks (a boundary region with
that rule, this energy) is added the way its documentation shows. Everything that does not change is made
once: the pattern of the matrix, and where each block's entries go in its upper triangle.
"""

import felupe as fem
import numpy as np
from pypardiso import PyPardisoSolver
from ramp import MU, Body
from scipy.sparse import csr_matrix

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


def rule(points, weights):
    """FElupe's scheme of a rule on the unit square or cube: its own elements lie between -1 and 1."""
    return fem.quadrature.Scheme(2 * points - 1, 2 ** points.shape[1] * weights)


class Bottoms(fem.Region):
    """The bottoms of hexahedra as a boundary region with outward normals; a rule on the unit square."""

    def __init__(self, mesh, points, weights):
        on_face = rule(np.column_stack([points, np.zeros(len(points))]), weights / 2)
        super().__init__(mesh, fem.TriQuadraticHexahedron(), on_face)
        normal = -np.cross(self.dXdr[:, 0], self.dXdr[:, 1], axis=0)  # the top lies on the other side
        length = np.linalg.norm(normal, axis=0)
        self.normals = normal / length
        self.dV = length * on_face.weights[:, None]


class Triquadratic:
    """Triquadratic hexahedra of trilinear ones: points (vertices first) and the cells of any of its
    hexahedra."""

    def __init__(self, points, cells):
        trilinear = fem.Hexahedron()
        #: (27, 8) of a cell's points, their weights of its vertices
        self.weights = np.array([trilinear.function(r) for r in fem.TriQuadraticHexahedron().points])
        # a point is known by its vertices: the sum of random numbers of theirs
        self._random = np.random.default_rng(1).integers(2**58, size=len(points))
        vertices = 8 * self._random
        others, first = np.unique(self._keys(cells)[:, 8:].ravel(), return_index=True)
        self._known = np.concatenate([vertices, others])
        places = np.einsum("qa,mai->mqi", self.weights[8:], points[cells]).reshape(-1, 3)
        self.points = np.vstack([points, places[first]])
        self._order = np.argsort(self._known)

    def _keys(self, cells):
        return self._random[cells] @ np.rint(8 * self.weights.T).astype(int)

    def cells(self, cells):
        """(m, 27) point numbers."""
        keys = self._keys(cells)
        return self._order[np.searchsorted(self._known, keys, sorter=self._order)]


class FElupeBody(Body):
    name = "felupe"

    def __init__(self, mesh):
        super().__init__()
        points, cells = mesh["points"], mesh["cells"]
        made = Triquadratic(points, cells)
        self.nodes = made.points
        inside = rule(mesh["volume_points"], mesh["volume_weights"])
        region = fem.Region(
            fem.Mesh(self.nodes, made.cells(cells), "hexahedron27"),
            fem.TriQuadraticHexahedron(),
            inside,
        )
        region_p = fem.Region(fem.Mesh(points, cells, "hexahedron"), fem.Hexahedron(), inside)
        self.field = fem.FieldContainer([fem.Field(region, dim=3), fem.Field(region_p, dim=1)])
        self.solid = fem.SolidBody(Incompressible(MU), self.field, block=False)
        walls = np.vstack([mesh["cavity"], mesh["channel"]])
        walls = fem.Mesh(self.nodes, made.cells(walls), "hexahedron27")
        surface = Bottoms(walls, mesh["facet_points"], mesh["facet_weights"])
        self.pressure = fem.SolidBodyPressure(fem.FieldContainer([fem.Field(surface, dim=3)]), pressure=1.0)
        self.count_u, self.dofs = 3 * len(self.nodes), 3 * len(self.nodes) + len(points)
        below = fem.TriQuadraticHexahedron().points[:, 2] == -1
        clamped = np.unique(made.cells(mesh["base"])[:, below])
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
        """(points (n, 3), displacements (n, 3)) at all points, in mm."""
        return self.nodes, self.state[: self.count_u].reshape(-1, 3)
