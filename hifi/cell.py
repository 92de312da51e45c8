"""The unit cell of a long uniform segment: one pitch under screw periodicity.

A long segment deforms as x(X) = c(s) + Q(s) y(X), s = X1, with c' = Q e, Q' = Q hat(k) and y periodic over one pitch.
With y = (0, X2, X3) + u the deformation gradient is, but for the rotation Q,
    F = grad u + diag(0, 1, 1) + (e + k x y) (x) E1,
so the energy of a pitch is a function of the periodic u, the pressure field and the six numbers (e, k). The gauge, mean
displacement and mean rotation of the channel's wall zero, makes (e, k) the strains of the section frame on the channel
axis. The air is meshed too: its energy -P J carries wall pressure, cap thrust and end moments in one bulk term; a little
stiffness keeps its inner nodes in place. Serial: designs are spread over ranks, not cells.
"""

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from geometry import cad
from geometry.cell import AIR
from hifi import compat, surface
from hifi.materials import energy_density
from hifi.stretch import PrincipalStretch

AIR_STIFFNESS = 1e-4  # of mu; stress-free at rest, objective
DEGREE = 4
#: rows of the gauge that see e2 and e3: a sideways displacement X1 e turns about z and y
_SIDEWAYS = np.zeros((6, 6))
_SIDEWAYS[4, 2], _SIDEWAYS[5, 1] = -1, 1


class CellProblem:
    """Unknowns, residual and tangent of the cell of `segment` meshed at `path` (geometry.cell.mesh_cell).

    Any pitch of the periodic body will do, whatever its cut's place or shape. gauge: tags of the facets whose rigid fit is
    the section frame; centre: X1 (mm) where that frame sits, in the middle of the pitch over which it is fitted.
    """

    def __init__(self, segment, path, gauge=(cad.CHANNEL,), centre=0.0):
        self.segment, comm = segment, MPI.COMM_SELF
        self.mesh, self.cell_tags, self.facet_tags = compat.read_mesh(path, comm)
        mesh = self.mesh
        self.space = compat.mixed_space(mesh)
        self.state = fem.Function(self.space)
        self.displacement_space, to_mixed = self.space.sub(0).collapse()
        self.pressure_space, to_mixed_p = self.space.sub(1).collapse()
        self.displacement_dofs = np.asarray(to_mixed).reshape(-1, 3)
        self.pressure_dofs = np.asarray(to_mixed_p)
        self.nodes = self.displacement_space.tabulate_dof_coordinates()
        self.strains = fem.Constant(mesh, PETSc.ScalarType(np.eye(6)[0]))
        self.pressure = fem.Constant(mesh, PETSc.ScalarType(0.0))
        self._left = fem.Constant(mesh, PETSc.ScalarType(np.zeros(6)))
        self._right = fem.Constant(mesh, PETSc.ScalarType(np.zeros(6)))
        self._define_forms()
        self._reduce()
        self._define_gauge(gauge, centre)
        self.stretch = PrincipalStretch(self, self.cell_tags.indices[np.isin(self.cell_tags.values, (cad.BODY, cad.LAYER))])

    def _define_forms(self):
        mesh, material = self.mesh, self.segment.material
        dx = ufl.Measure("dx", domain=mesh, subdomain_data=self.cell_tags, metadata={"quadrature_degree": DEGREE})
        solid, air = dx(cad.BODY), dx(AIR)
        q = ufl.variable(self.strains)
        u, p = ufl.split(self.state)
        v = ufl.TestFunction(self.space)
        X = ufl.SpatialCoordinate(mesh)
        y = ufl.as_vector((0, X[1], X[2])) + u
        stretch = ufl.as_vector([q[i] for i in range(3)]) + ufl.cross(ufl.as_vector([q[i] for i in range(3, 6)]), y)
        F = ufl.grad(u) + ufl.as_matrix([[0, 0, 0], [0, 1, 0], [0, 0, 1]]) + ufl.outer(stretch, ufl.unit_vector(0, 3))
        self.deformation_gradient = F
        J = ufl.det(F)
        energies = (
            (energy_density(mesh, material, F, p), solid),
            *((energy_density(mesh, m, F, p), dx(cad.LAYER)) for m in [self.segment.layer_material] if m is not None),
            (-self.pressure * J + AIR_STIFFNESS * material.mu / 2 * (ufl.inner(F, F) - 2 * J), air),
        )
        residual = sum(ufl.derivative(w * d, self.state, v) for w, d in energies)
        slope = sum(ufl.inner(ufl.diff(w, q), self._left) * d for w, d in energies)
        curvature = sum(ufl.inner(ufl.diff(ufl.inner(ufl.diff(w, q), self._left), q), self._right) * d for w, d in energies)
        self._residual = compat.compile_form(residual)
        self._tangent = compat.compile_form(ufl.derivative(residual, self.state))
        self._slope = compat.compile_form(slope)
        self._mixed = compat.compile_form(ufl.derivative(slope, self.state, v))
        self._curvature = compat.compile_form(curvature)
        self._volume = compat.compile_form(J * air)
        self._matrix = fem.petsc.create_matrix(self._tangent)
        self._vector = fem.petsc.create_vector(self._residual)

    def _reduce(self):
        """reduced (dofs,): index of each mixed dof among the unknowns; slaves share their master's, air's p has -1."""
        pitch, n = self.segment.pitch, len(self.state.x.array)
        master = np.arange(n)
        points = self.pressure_space.tabulate_dof_coordinates()
        for coordinates, dofs in ((self.nodes, self.displacement_dofs), (points, self.pressure_dofs[:, None])):
            first = _same_modulo(coordinates, pitch)
            master[dofs] = dofs[first]
        solid = self.cell_tags.indices[self.cell_tags.values != AIR]
        used = np.zeros(n, bool)
        used[self.displacement_dofs] = True
        used[self.pressure_dofs[compat.cell_dofs(self.pressure_space)[solid]]] = True
        kept = np.unique(master[used])
        self.reduced = np.full(n, -1)
        self.reduced[kept] = np.arange(len(kept))
        self.reduced = np.where(used, self.reduced[master], -1)
        self.unknowns = len(kept)
        #: number of incompressibility multipliers: so many negative pivots has a stable tangent
        self.constraints = int(np.count_nonzero(np.isin(kept, self.pressure_dofs)))

    def _define_gauge(self, tags, centre):
        """gauge (unknowns, 6) and gauge_strains (6, 6): the section frame's conditions are linear in u and (e, k).

        Mean displacement (3) and mean rotation (3) of the tagged facets over the pitch around `centre` are zero. Their
        points also lie along X1, where the shears e2 and e3 displace them sideways by X1 e: a frame fitted over a pitch
        follows mostly the tangent, and so must the gauge.
        """
        facets, pitch = surface.facet_nodes(self, *tags), self.segment.pitch
        # the periodic surface in the window: what is in it of this pitch and of its neighbours
        windows = [(i * pitch, surface.SlabIntegral(self, facets, *(centre + pitch * (np.array([-0.5, 0.5]) - i)))) for i in (-1, 0, 1)]
        area, size = sum(w.area for _, w in windows), self.segment.width
        self.gauge_strains = np.zeros((6, 6))
        gauge = sp.csr_matrix((self.unknowns, 6))
        for shift, integral in windows:
            w, first = integral.weights / area, integral.first / area
            first[:, 0] += (shift - centre) * w
            rows = np.zeros((6, len(w), 3))
            rows[[0, 1, 2], :, [0, 1, 2]] = w
            for i, (a, b) in enumerate(((1, 2), (2, 0), (0, 1)), start=3):  # (X x u)_i = X_a u_b - X_b u_a
                rows[i, :, b], rows[i, :, a] = first[:, a] / size, -first[:, b] / size
            along = ((self.nodes[integral.nodes, 0] + shift - centre) @ first[:, 0]) / size  # X1^2
            self.gauge_strains += along * _SIDEWAYS
            columns = self.reduced[self.displacement_dofs[integral.nodes]]
            for i, row in enumerate(rows):
                gauge += sp.coo_matrix((row.ravel(), (columns.ravel(), np.full(row.size, i))), shape=gauge.shape).tocsr()
        self.gauge = gauge

    def expand(self, values):
        """State array of the mixed space from the unknowns (unknowns,)."""
        return np.where(self.reduced >= 0, values[self.reduced], 0.0)

    def _vector_of(self, form):
        with self._vector.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self._vector, form)
        keep = self.reduced >= 0
        return np.bincount(self.reduced[keep], self._vector.array[keep], minlength=self.unknowns)

    def residual(self):
        """(dPi/du,p (unknowns,), dPi/d(e,k) (6,)) at the current state, strains and pressure."""
        slope = np.empty(6)
        for i in range(6):
            self._left.value[:] = np.eye(6)[i]
            slope[i] = fem.assemble_scalar(self._slope)
        return self._vector_of(self._residual), slope

    def tangent(self):
        """(bordered matrix as CSR, d2Pi/du d(e,k) (unknowns, 6), d2Pi/d(e,k)2 (6, 6))."""
        self._matrix.zeroEntries()
        fem.petsc.assemble_matrix(self._matrix, self._tangent)
        self._matrix.assemble()
        indptr, indices, data = self._matrix.getValuesCSR()
        rows = self.reduced[np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))]
        columns = self.reduced[indices]
        keep = (rows >= 0) & (columns >= 0)
        n = self.unknowns
        K = sp.coo_matrix((data[keep], (rows[keep], columns[keep])), shape=(n, n)).tocsr()
        matrix = sp.bmat([[K, self.gauge], [self.gauge.T, sp.csr_matrix(np.zeros((6, 6)))]], format="csr")
        mixed, curvature = np.empty((n, 6)), np.empty((6, 6))
        for i in range(6):
            self._left.value[:] = np.eye(6)[i]
            mixed[:, i] = self._vector_of(self._mixed)
            for j in range(i + 1):
                self._right.value[:] = np.eye(6)[j]
                curvature[i, j] = curvature[j, i] = fem.assemble_scalar(self._curvature)
        return matrix, mixed, curvature

    def air_volume(self):
        """Volume (mm3) of the air in one pitch."""
        return float(fem.assemble_scalar(self._volume))


def _same_modulo(points, pitch, tolerance=1e-5):
    """(n,) index of the first of those points (n, 3) that coincide when X1 is taken modulo the pitch; tolerance in mm."""
    wrapped = points.copy()
    wrapped[:, 0] = np.mod(points[:, 0], pitch)
    wrapped[wrapped[:, 0] >= pitch, 0] = 0.0
    far = 2 * np.ptp(points, axis=0) + 1.0
    wrapped[:, 1:] -= wrapped[:, 1:].min(axis=0)  # the tree's box starts at zero
    pairs = cKDTree(wrapped, boxsize=[pitch, *(2 * far[1:])]).query_pairs(tolerance, output_type="ndarray")
    graph = sp.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
    _, labels = csgraph.connected_components(graph, directed=False)
    first = np.full(labels.max() + 1, len(points))
    np.minimum.at(first, labels, np.arange(len(points)))
    return first[labels]
