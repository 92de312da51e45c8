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
from copy import copy
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from pneunet.geometry import tags
from pneunet.geometry.meshfile import read_mesh
from pneunet.geometry.parameters import Segment
from pneunet.hifi.cell.symmetry import Orbits, SymmetryClass, characters, group, windows
from pneunet.hifi.contact.cell import CellContact
from pneunet.hifi.contact.medium import ThirdMedium
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.contact.walls import CellWalls, WallContact
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.compat import compile_form
from pneunet.hifi.fem.materials import constants_of, energy_density
from pneunet.hifi.fem.mixed_field import MixedField
from pneunet.hifi.fem.potential import PotentialEnergy, Term
from pneunet.hifi.fem.stretch import PrincipalStretch

AIR_STIFFNESS = 1e-4  # of mu; stress-free at rest, objective
#: of quadrature in the air: exact for its volume, which then depends on the air's walls alone. With fewer
#: points the pressure pushes at inner nodes too, and air as soft as this buckles
AIR_DEGREE = {"tetrahedron": 4, "hexahedron": 6}
#: attributes that depend on where the nodes are
_PLACED = ("segment", "nodes", "classes", "walls", "contact")


class CellProblem(MixedField):
    """Unknowns, residual and tangent of the cell of `segment`; mesh: path of geometry.cad.cell.mesh_cell's,
    or the mesh and its tags.

    Any pitch of the periodic body will do, whatever its cut's place or shape, and any object with a pitch, a
    width, a material and a layer_material serves as segment. gauge: tags of the facets whose rigid fit is the
    section frame; centre: X1 (mm) where that frame sits, in the middle of the pitch over which it is fitted.
    rollers: {facet tag: component of u that is zero}. contact: the hifi.contact.penalty.WallPenalty between
    the walls of the gaps. medium: or a hifi.contact.medium.ThirdMedium that fills the gaps, which must be
    meshed then; without it, meshed gaps are void. Where the mesh is a part of the cell from which half turns
    make the rest (geometry.grids.cell), states have this symmetry.
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
        part = not isinstance(mesh, tuple) and bool(read_mesh(mesh)[1].get("part"))
        super().__init__(*(mesh if isinstance(mesh, tuple) else compat.read_mesh(mesh, MPI.COMM_SELF)))
        self.segment, self._gauge_of, self._penalty = segment, (gauge, centre), contact
        #: (g, 3) diagonals of the rotations that make the cell of the mesh
        self.turns = group(segment.kind if part else None)
        self.medium = medium.on(self.mesh) if medium else None
        self.strains = fem.Constant(self.mesh, PETSc.ScalarType(np.eye(6)[0]))
        self.pressure = fem.Constant(self.mesh, PETSc.ScalarType(0.0))
        self._direction = fem.Constant(self.mesh, PETSc.ScalarType(np.zeros(6)))
        self._define_forms()
        places = (self.nodes, self.pressure_space.tabulate_dof_coordinates())
        #: of the displacement's and of the pressure's nodes
        self.orbits = [Orbits(points, segment.pitch, self.turns) for points in places]
        used = self._used()
        #: hifi.cell.symmetry.SymmetryClass: that of the free state, then the others
        self.classes = [SymmetryClass(self, chi, rollers or {}, used) for chi in characters(self.turns)]
        self._place()
        self.stretch = PrincipalStretch(self, [(tags.BODY, tags.LAYER)])

    def _place(self):
        """What depends on where the nodes are."""
        self.nodes = self.node_positions()
        self.classes, over = [copy(each) for each in self.classes], windows(self, *self._gauge_of)
        for each in self.classes:
            each.define_gauge(over, self._gauge_of[1])
        self.walls = CellWalls(self)
        self.contact = CellContact(self, self.walls, self._penalty)

    # ---- the class in which states are
    @property
    def unknowns(self) -> int:
        return self.classes[0].unknowns

    @property
    def reduced(self) -> np.ndarray:
        """(dofs,) index of each mixed dof among the unknowns, -1 where it is zero or not there."""
        return self.classes[0].reduced

    @property
    def gauge(self) -> sp.csr_matrix:
        """(unknowns, m): the conditions on u that make (e, k) the strains of the section frame."""
        return self.classes[0].gauge

    @property
    def gauge_strains(self) -> np.ndarray:
        """(m, 6): the same conditions' parts of (e, k)."""
        return self.classes[0].gauge_strains

    def expand(self, values: np.ndarray) -> np.ndarray:
        """State array of the mixed space from the unknowns (unknowns,)."""
        return self.classes[0].expand(values)

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
        J, air = ufl.det(F), self.cells(tags.AIR, degree=AIR_DEGREE[self.cell_name])
        # energies are those of the whole pitch
        whole = fem.Constant(self.mesh, PETSc.ScalarType(float(len(self.turns))))
        mu = fem.Constant(self.mesh, PETSc.ScalarType(segment.material.mu))
        solids = ((tags.BODY, segment.material), (tags.LAYER, segment.layer_material))
        #: {cell tag: {name: fem.Constant}} of the solids' laws
        self.constants = {tag: constants_of(self.mesh, m) for tag, m in solids if m is not None}
        terms = [
            Term(whole * energy_density(self.mesh, m, F, self.p, self.constants[tag]), self.cells(tag))
            for tag, m in solids
            if m is not None
        ]
        resting = AIR_STIFFNESS * mu / 2 * (ufl.inner(F, F) - 2 * J)
        terms.append(Term(whole * resting, air, whole * self.pressure * J))
        if self.medium:
            # d(Q F)/dX, rotated back: F's own gradient, and along X1 that of the screw
            spin = ufl.as_matrix([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
            a, b, c = ufl.indices(3)
            kF, ky = spin * F, spin * grad_y
            second = ufl.as_tensor(
                ufl.grad(ufl.grad(u))[a, b, c] + ky[a, c] * E1[b] + kF[a, b] * E1[c], (a, b, c)
            )
            terms.append(Term(whole * self.medium.density(F, second, mu), self.cells(tags.GAP)))
        self._potential = PotentialEnergy(self, terms)
        t = ufl.TestFunction(compat.cell_vectors(self.mesh, 6))
        slopes = [(ufl.diff(term.density, q), term.measure) for term in terms]
        along = [(ufl.inner(slope, self._direction), d) for slope, d in slopes]
        self._slope = [compile_form(ufl.inner(slope, t) * d) for slope, d in slopes]
        self._mixed = [compile_form(ufl.derivative(w * d, self.state, self.test)) for w, d in along]
        self._curvature = [compile_form(ufl.inner(ufl.diff(w, q), t) * d) for w, d in along]
        self._volume = [compile_form(whole * J * air)]
        self._matrix = self.create_matrix()

    def _used(self):
        """(dofs,) bool: u where there is body, air or a medium, p where there is body."""
        solid = self.cell_tags.indices[~np.isin(self.cell_tags.values, (tags.AIR, tags.GAP))]
        there = self.cell_tags.indices[(self.cell_tags.values != tags.GAP) | (self.medium is not None)]
        used = np.zeros(len(self.state.x.array), bool)
        used[self.displacement_dofs[compat.cell_dofs(self.displacement_space)[there]]] = True
        used[self.pressure_dofs[compat.cell_dofs(self.pressure_space)[solid]]] = True
        return used

    def _strains_of(self, forms):
        """(6,) integrals of forms with one component for each of (e, k)."""
        return sum(fem.assemble_vector(form).array.reshape(-1, 6).sum(axis=0) for form in forms)

    def residual(self) -> tuple[np.ndarray, np.ndarray]:
        """(dPi/du,p (unknowns,), dPi/d(e,k) (6,)) at the current state, strains and pressure."""
        forces = self.classes[0].collected(self.vector(self._potential.residuals))
        slope = self._strains_of(self._slope) * self.classes[0].strains
        pushing = self.contact.residual()
        return forces + pushing[:-6], slope + pushing[-6:]

    def tangent(self) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
        """(bordered matrix as CSR, d2Pi/du d(e,k) (unknowns, 6), d2Pi/d(e,k)2 (6, 6)); rows and columns of
        strains of other classes are zero."""
        self.assemble(self._matrix, self._potential.tangents)
        return self._second_derivatives(self.classes[0], self.contact.tangent())

    def tangent_of(self, number: int) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
        """What `tangent` gives, of another class at the state of the last tangent."""
        return self._second_derivatives(self.classes[number], self.contact.tangent_of(number))

    def _second_derivatives(self, each, touching):
        """Those of a class, to which walls that touch add theirs."""
        n, inner = each.unknowns, touching[: each.unknowns, : each.unknowns].tocoo()
        matrix = each.bordered(self._matrix, inner.row, inner.col, inner.data)
        mixed, curvature = self._by_strains(each)
        return matrix, mixed + touching[:n, n:].toarray(), curvature + touching[n:, n:].toarray()

    def second_derivative(self, ways: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """(r, r) sum over the classes of Z^T d2Pi Z at the current state, Z = (unknowns, r), (6, r) of each
        of `ways`."""
        self.assemble(self._matrix, self._potential.tangents)
        indptr, indices, values = self._matrix.getValuesCSR()
        matrix, total = sp.csr_matrix((values, indices, indptr)), 0.0
        self.contact.tangent()
        for number, (each, (unknowns, strains)) in enumerate(zip(self.classes, ways)):
            both = np.vstack([unknowns, strains])
            total += both.T @ (self.contact.tangent_of(number) @ both)
            spread = np.where(each.reduced >= 0, each.signs, 0.0)[:, None] * unknowns[each.reduced]
            mixed, curvature = self._by_strains(each)
            crossed = unknowns.T @ mixed @ strains
            total += spread.T @ (matrix @ spread) + crossed + crossed.T + strains.T @ curvature @ strains
        return total

    def _by_strains(self, each):
        """(d2Pi/du d(e,k) (unknowns, 6), d2Pi/d(e,k)2 (6, 6)) in a class."""
        mixed, curvature = np.zeros((each.unknowns, 6)), np.zeros((6, 6))
        for i in np.flatnonzero(each.strains):
            self._direction.value[:] = np.eye(6)[i]
            mixed[:, i] = each.collected(self.vector(self._mixed))
            curvature[:, i] = self._strains_of(self._curvature) * each.strains
        return mixed, curvature

    def medium_forces(self) -> np.ndarray:
        """(nodes, 3) forces (N) with which the mesh's medium pushes at the nodes, in the rotating frame of
        their X1."""
        forces = -self.vector(self._potential.residuals[-1:])[self.displacement_dofs]
        return forces / len(self.turns)

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
