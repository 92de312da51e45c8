"""The unit cell of a long uniform segment: one pitch under screw periodicity.

A long segment deforms as x(X) = c(s) + Q(s) y(X), s = X1, with c' = Q e, Q' = Q hat(k) and y periodic over
one pitch. With y = (0, X2, X3) + u the deformation gradient is, but for the rotation Q,
    F = grad u + diag(0, 1, 1) + (e + k x y) (x) E1,
so the energy of a pitch is a function of the periodic u, the pressure field and the six numbers (e, k). The
gauge, mean displacement and mean rotation of the channel's wall zero, makes (e, k) the strains of the section
frame on the channel axis. The air is meshed too: its energy -P J carries wall pressure, cap thrust and end
moments in one bulk term; a little stiffness keeps its inner nodes in place. Serial: designs are spread over
ranks, not cells.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pneunet.geometry import tags
from pneunet.geometry.parameters import Segment
from pneunet.hifi.contact.cell import CellContact
from pneunet.hifi.contact.gaps import Contact
from pneunet.hifi.contact.medium import ThirdMedium
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.contact.walls import CellWalls, WallContact
from pneunet.hifi.fem import compat, surface
from pneunet.hifi.fem.compat import compile_form
from pneunet.hifi.fem.materials import energy_density
from pneunet.hifi.fem.mixed_field import MixedField
from pneunet.hifi.fem.potential import PotentialEnergy, Term
from pneunet.hifi.fem.stretch import PrincipalStretch

AIR_STIFFNESS = 1e-4  # of mu; stress-free at rest, objective
#: rows of the gauge that see e2 and e3: a sideways displacement X1 e turns about z and y
_SIDEWAYS = np.zeros((6, 6))
_SIDEWAYS[4, 2], _SIDEWAYS[5, 1] = -1, 1
#: attributes that depend on where the nodes are
_PLACED = ("segment", "nodes", "gauge", "gauge_strains", "walls", "contact", "_bordered")


class CellProblem(MixedField):
    """Unknowns, residual and tangent of the cell of `segment`; mesh: path of geometry.cad.cell.mesh_cell's,
    or the mesh and its tags.

    Any pitch of the periodic body will do, whatever its cut's place or shape, and any object with a pitch, a
    width, a material and a layer_material serves as segment. gauge: tags of the facets whose rigid fit is the
    section frame; centre: X1 (mm) where that frame sits, in the middle of the pitch over which it is fitted.
    rollers: {facet tag: component of u that is zero}. contact: the hifi.contact.penalty.WallPenalty between
    the walls of the gaps. medium: or a hifi.contact.medium.ThirdMedium that fills the gaps, which must be
    meshed then; without it, meshed gaps are void.
    """

    def __init__(
        self,
        segment: Segment,
        mesh: Path | tuple,
        gauge: Sequence[int] = (tags.CHANNEL,),
        centre: float = 0.0,
        rollers: dict[int, int] | None = None,
        medium: ThirdMedium | None = None,
        contact: WallPenalty | None = None,
    ):
        super().__init__(*(mesh if isinstance(mesh, tuple) else compat.read_mesh(mesh, MPI.COMM_SELF)))
        self.segment, self._gauge_of, self._penalty = segment, (gauge, centre), contact
        self.medium = medium.on(self.mesh) if medium else None
        self.strains = fem.Constant(self.mesh, PETSc.ScalarType(np.eye(6)[0]))
        self.pressure = fem.Constant(self.mesh, PETSc.ScalarType(0.0))
        self._direction = fem.Constant(self.mesh, PETSc.ScalarType(np.zeros(6)))
        self._define_forms()
        self._reduce(rollers or {})
        self._place()
        solid = np.isin(self.cell_tags.values, (tags.BODY, tags.LAYER))
        self.stretch = PrincipalStretch(self, self.cell_tags.indices[solid])

    def _place(self):
        """What depends on where the nodes are."""
        self.nodes = self.node_positions()
        self._define_gauge(*self._gauge_of)
        self.walls = CellWalls(self)
        self.contact = (
            CellContact(self, self.walls, self._penalty)
            if self._penalty
            else Contact(MPI.COMM_SELF, self.unknowns + 6, slice(0, self.unknowns + 6))
        )
        self._bordered = None

    def move(self, segment: Segment, vertices: np.ndarray) -> None:
        """Make this the cell of another segment, on the same mesh with its vertices (n, 3) elsewhere."""
        self.segment, self.mesh.geometry.x[:] = segment, vertices
        self._place()

    @property
    def placement(self) -> tuple[np.ndarray, dict]:
        """All that `move` changes; assigned, it brings the cell back."""
        return self.mesh.geometry.x.copy(), {name: getattr(self, name) for name in _PLACED}

    @placement.setter
    def placement(self, kept: tuple[np.ndarray, dict]) -> None:
        self.mesh.geometry.x[:], placed = kept
        vars(self).update(placed)

    def _define_forms(self):
        segment, u, q = self.segment, self.u, ufl.variable(self.strains)
        X = ufl.SpatialCoordinate(self.mesh)
        y = ufl.as_vector((0, X[1], X[2])) + u
        e, k = (ufl.as_vector([q[i] for i in part]) for part in (range(3), range(3, 6)))
        grad_y = ufl.grad(u) + ufl.as_matrix([[0, 0, 0], [0, 1, 0], [0, 0, 1]])
        E1 = ufl.unit_vector(0, 3)
        self.deformation_gradient = F = grad_y + ufl.outer(e + ufl.cross(k, y), E1)
        J, air = ufl.det(F), self.cells(tags.AIR)
        mu = fem.Constant(self.mesh, PETSc.ScalarType(segment.material.mu))
        solids = ((tags.BODY, segment.material), (tags.LAYER, segment.layer_material))
        terms = [
            Term(energy_density(self.mesh, material, F, self.p), self.cells(tag))
            for tag, material in solids
            if material is not None
        ]
        terms.append(Term(AIR_STIFFNESS * mu / 2 * (ufl.inner(F, F) - 2 * J), air, self.pressure * J))
        if self.medium:
            # d(Q F)/dX, rotated back: F's own gradient, and along X1 that of the screw
            spin = ufl.as_matrix([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
            a, b, c = ufl.indices(3)
            kF, ky = spin * F, spin * grad_y
            second = ufl.as_tensor(
                ufl.grad(ufl.grad(u))[a, b, c] + ky[a, c] * E1[b] + kF[a, b] * E1[c], (a, b, c)
            )
            terms.append(Term(self.medium.density(F, second, mu), self.cells(tags.GAP)))
        self._potential = PotentialEnergy(self, terms)
        t = ufl.TestFunction(compat.cell_vectors(self.mesh, 6))
        slopes = [(ufl.diff(term.density, q), term.measure) for term in terms]
        along = [(ufl.inner(slope, self._direction), d) for slope, d in slopes]
        self._slope = [compile_form(ufl.inner(slope, t) * d) for slope, d in slopes]
        self._mixed = [compile_form(ufl.derivative(w * d, self.state, self.test)) for w, d in along]
        self._curvature = [compile_form(ufl.inner(ufl.diff(w, q), t) * d) for w, d in along]
        self._volume = [compile_form(J * air)]
        self._matrix = self.create_matrix()

    def _reduce(self, rollers):
        """reduced (dofs,): index of each mixed dof among the unknowns; slaves share their master's, air's p
        has -1."""
        pitch, n = self.segment.pitch, len(self.state.x.array)
        master = np.arange(n)
        points = self.pressure_space.tabulate_dof_coordinates()
        for coordinates, dofs in (
            (self.nodes, self.displacement_dofs),
            (points, self.pressure_dofs[:, None]),
        ):
            first = _same_modulo(coordinates, pitch)
            master[dofs] = dofs[first]
        solid = self.cell_tags.indices[~np.isin(self.cell_tags.values, (tags.AIR, tags.GAP))]
        used = np.zeros(n, bool)
        there = self.cell_tags.indices[(self.cell_tags.values != tags.GAP) | (self.medium is not None)]
        used[self.displacement_dofs[compat.cell_dofs(self.displacement_space)[there]]] = True
        used[self.pressure_dofs[compat.cell_dofs(self.pressure_space)[solid]]] = True
        held = np.zeros(n, bool)
        for tag, component in rollers.items():
            held[master[self.displacement_dofs[np.unique(surface.facet_nodes(self, tag)), component]]] = True
        used &= ~held[master]
        kept = np.unique(master[used])
        self.reduced = np.full(n, -1)
        self.reduced[kept] = np.arange(len(kept))
        self.reduced = np.where(used, self.reduced[master], -1)
        self.unknowns = len(kept)
        #: number of incompressibility multipliers: so many negative pivots has a stable tangent
        self.constraints = int(np.count_nonzero(np.isin(kept, self.pressure_dofs)))

    def _define_gauge(self, tags, centre):
        """gauge (unknowns, 6) and gauge_strains (6, 6): the section frame's conditions are linear in u and
        (e, k).

        Mean displacement (3) and mean rotation (3) of the tagged facets over the pitch around `centre` are
        zero. Their points also lie along X1, where the shears e2 and e3 displace them sideways by X1 e: a
        frame fitted over a pitch follows mostly the tangent, and so must the gauge.
        """
        facets, pitch = surface.facet_nodes(self, *tags), self.segment.pitch
        # the periodic surface in the window: what is in it of this pitch and of its neighbours
        windows = [
            (i * pitch, surface.SlabIntegral(self, facets, *(centre + pitch * (np.array([-0.5, 0.5]) - i))))
            for i in (-1, 0, 1)
        ]
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
            moving = columns >= 0
            for i, row in enumerate(rows):
                gauge += sp.coo_matrix(
                    (row[moving], (columns[moving], np.full(moving.sum(), i))), shape=gauge.shape
                ).tocsr()
        self.gauge = gauge

    def expand(self, values: np.ndarray) -> np.ndarray:
        """State array of the mixed space from the unknowns (unknowns,)."""
        return np.where(self.reduced >= 0, values[self.reduced], 0.0)

    def _unknowns_of(self, forms):
        """(unknowns,) sum of linear forms."""
        keep = self.reduced >= 0
        return np.bincount(self.reduced[keep], self.vector(forms)[keep], minlength=self.unknowns)

    def _strains_of(self, forms):
        """(6,) integrals of forms with one component for each of (e, k)."""
        return sum(fem.assemble_vector(form).array.reshape(-1, 6).sum(axis=0) for form in forms)

    def residual(self) -> tuple[np.ndarray, np.ndarray]:
        """(dPi/du,p (unknowns,), dPi/d(e,k) (6,)) at the current state, strains and pressure."""
        forces, slope = self._unknowns_of(self._potential.residuals), self._strains_of(self._slope)
        pushing = self.contact.residual()
        return forces + pushing[:-6], slope + pushing[-6:]

    def tangent(self) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
        """(bordered matrix as CSR, d2Pi/du d(e,k) (unknowns, 6), d2Pi/d(e,k)2 (6, 6))."""
        self.assemble(self._matrix, self._potential.tangents)
        if self._bordered is None:
            self._bordered = _BorderedPattern(self._matrix, self.reduced, self.gauge)
        _, _, data = self._matrix.getValuesCSR()
        n, touching = self.unknowns, self.contact.tangent()
        inner = touching[:n, :n].tocoo()
        matrix = self._bordered.filled(data, inner.row, inner.col, inner.data)
        mixed, curvature = np.empty((n, 6)), np.empty((6, 6))
        for i in range(6):
            self._direction.value[:] = np.eye(6)[i]
            mixed[:, i], curvature[:, i] = self._unknowns_of(self._mixed), self._strains_of(self._curvature)
        return matrix, mixed + touching[:n, n:].toarray(), curvature + touching[n:, n:].toarray()

    def medium_forces(self) -> np.ndarray:
        """(nodes, 3) forces (N) with which the medium pushes at the nodes, in the rotating frame of their
        X1."""
        return -self.vector(self._potential.residuals[-1:])[self.displacement_dofs]

    def measure_contact(self) -> WallContact | None:
        """That of the gap with the largest force, at the last residual; None without contact."""
        pressure = float(self.pressure.value)
        if self._penalty:
            return self.contact.measure(pressure)
        return self.walls.contact(pressure) if self.medium else None

    def air_volume(self) -> float:
        """Volume (mm3) of the air in one pitch."""
        return self.integral(self._volume)

    def stored_energy(self) -> float:
        """N mm in one pitch: all of the potential but the air's -P V. Along free states its change is the
        integral of P dV."""
        return self._potential.stored_energy() + self.contact.energy()


class _BorderedPattern:
    """Where the entries of a matrix of the mixed space go in that of the unknowns, bordered by the gauge.

    It grows by the entries of walls that touch, and keeps them when they part: a new pattern costs a new
    analysis.
    """

    def __init__(self, matrix, reduced, gauge):
        indptr, indices, _ = matrix.getValuesCSR()
        rows, columns = reduced[np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))], reduced[indices]
        self._keep = np.flatnonzero((rows >= 0) & (columns >= 0))
        border, self._size = gauge.tocoo(), sum(gauge.shape)
        i, j, corner = (
            border.row.astype(np.int64),
            border.col + gauge.shape[0],
            np.arange(gauge.shape[0], self._size),
        )
        self._border = np.concatenate([border.data, border.data, np.zeros(len(corner))])
        rows = np.concatenate([rows[self._keep], i, j, corner])
        self._known = self._key(rows, np.concatenate([columns[self._keep], j, i, corner]))
        self._arrange(self._known)

    def _key(self, rows, columns):
        return rows * np.int64(self._size) + columns

    def _arrange(self, key):
        self._keys = np.unique(key)
        self._place = np.searchsorted(self._keys, self._known)
        self._indices = (self._keys % self._size).astype(np.int32)
        self._indptr = np.searchsorted(self._keys, self._size * np.arange(self._size + 1)).astype(np.int32)

    def filled(self, data, rows=(), columns=(), values=()):
        """CSR matrix of the values `data` of the mixed space's matrix and of entries (row, column, value) of
        the unknowns.

        Its `indices` are the same array until the pattern grows.
        """
        key = self._key(np.asarray(rows, np.int64), np.asarray(columns, np.int64))
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        if (self._keys[place] != key).any():
            self._arrange(np.concatenate([self._keys, key]))
            place = np.searchsorted(self._keys, key)
        entries = np.concatenate([data[self._keep], self._border, values])
        summed = np.bincount(np.concatenate([self._place, place]), entries, len(self._keys))
        return sp.csr_matrix((summed, self._indices, self._indptr), shape=(self._size, self._size))


def _same_modulo(points, pitch, tolerance=1e-5):
    """(n,) index of the first of those points (n, 3) that coincide when X1 is taken modulo the pitch;
    tolerance in mm."""
    wrapped = points.copy()
    wrapped[:, 0] = np.mod(points[:, 0], pitch)
    wrapped[wrapped[:, 0] >= pitch, 0] = 0.0
    far = 2 * np.ptp(points, axis=0) + 1.0
    wrapped[:, 1:] -= wrapped[:, 1:].min(axis=0)  # the tree's box starts at zero
    pairs = cKDTree(wrapped, boxsize=[pitch, *(2 * far[1:])]).query_pairs(tolerance, output_type="ndarray")
    graph = sp.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
    _, labels = connected_components(graph, directed=False)
    first = np.full(labels.max() + 1, len(points))
    np.minimum.at(first, labels, np.arange(len(points)))
    return first[labels]
