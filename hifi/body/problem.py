"""The boundary value problem of a body: unknowns, residual, tangent.

psi = W(F) + p (J - 1) - p^2/(2K) with Taylor-Hood P2/P1, plus the loads' residuals (hifi.fem.loads).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from petsc4py import PETSc

from pneunet.hifi.contact.gaps import Contact
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.loads import AppliedLoad, Pressure
from pneunet.hifi.fem.materials import Materials, energy_density, groups
from pneunet.hifi.fem.mixed_field import MixedField
from pneunet.hifi.fem.potential import PotentialEnergy, Term


@dataclass(frozen=True)
class Support:
    """Prescribed displacement on tagged facets.

    component: 0..2, or None for all three. motion(X (n, 3), load) -> (n,) or (n, 3) in mm; None keeps it at
    zero.
    """

    tag: int
    component: int | None = None
    motion: Callable | None = None


class BodyProblem(MixedField):
    """A body, its materials, its clamps and its loads.

    mesh, cell_tags, facet_tags: as dolfinx gives them. materials: {cell tag: base.materials.laws law}, or one
    law. supports: list of `Support`. loads: list of hifi.fem.loads objects; each `Pressure` has a cavity
    whose volume is measured.
    """

    def __init__(
        self,
        mesh: Mesh,
        cell_tags: compat.MeshTags,
        facet_tags: compat.MeshTags,
        materials: Materials,
        supports: list[Support],
        loads: Sequence[AppliedLoad] = (),
    ):
        super().__init__(mesh, cell_tags, facet_tags)
        self.supports = list(supports)
        self.bcs = [self._support_condition(support) for support in self.supports]
        #: supported dofs of the mixed vector: those this rank sees, and those it owns
        self.fixed_dofs = np.unique(
            np.concatenate([bc.dof_indices()[0] for bc in self.bcs] + [np.zeros(0, np.int32)])
        )
        self._fixed_owned = self.fixed_dofs[self.fixed_dofs < self.owned]
        self.loads = list(loads)
        #: what holds walls apart: nothing, or a hifi.contact.body.BodyContact
        self.contact = Contact(mesh.comm, self.dofs, self.owned_range)
        self.symmetric = all(load.closed for load in self.loads)
        self.deformation_gradient = F = ufl.Identity(3) + ufl.grad(self.u)
        self._potential = PotentialEnergy(
            self,
            [
                Term(energy_density(mesh, material, F, self.p), self.cells(*tags))
                for material, tags in groups(materials).items()
            ],
        )
        external = [(load, part) for load in self.loads for part in load.on(self)]
        self._external = [compat.compile_form(part) for _, part in external]
        self._tangents = self._potential.tangents + [
            compat.compile_form(ufl.derivative(part, self.state))
            for load, part in external
            if load.has_tangent
        ]
        #: (share, form) of each cavity's volume
        self._volumes = [
            (load.share, compat.compile_form(load.volume_form))
            for load in self.loads
            if isinstance(load, Pressure)
        ]

    def _support_condition(self, support):
        facets = self.facet_tags.find(support.tag)
        where = self.space.sub(0) if support.component is None else self.space.sub(0).sub(support.component)
        collapsed, _ = where.collapse()
        dofs = fem.locate_dofs_topological((where, collapsed), self.mesh.topology.dim - 1, facets)
        value = fem.Function(collapsed)
        return fem.dirichletbc(value, dofs, where)

    def supported(self, array: np.ndarray, load: float) -> np.ndarray:
        """`array` with the supported displacements set to their values at this load."""
        for support, bc in zip(self.supports, self.bcs):
            dofs = bc.dof_indices()[0]
            if support.motion is None:
                array[dofs] = 0.0
                continue
            chosen = np.isin(self.displacement_dofs, dofs)
            moved = np.zeros(self.displacement_dofs.shape)
            motion = support.motion(self.nodes, load)
            if support.component is None:
                moved[:] = motion
            else:
                moved[:, support.component] = motion
            array[self.displacement_dofs[chosen]] = moved[chosen]
        return array

    # ---- residual and tangent
    def external_force(self) -> np.ndarray:
        """(owned dofs,) minus the forces of all loads (N) at the current state and values; supports
        included."""
        for load in self.loads:
            load.update(self)
        return self.vector(self._external)

    def residual(self) -> tuple[np.ndarray, float]:
        """((owned dofs,) residual in N and mm3, norm of what it balances in N) at the current state and load
        values.

        The scale is the larger of the loads' and the support reactions' norm; supported entries are zero.
        """
        r, external = self.vector(self._potential.residuals), self.external_force()
        r += self.contact.residual()
        scale = self.total(external @ external)
        r += external
        reactions = r[self._fixed_owned]
        scale = max(scale, self.total(reactions @ reactions))
        r[self._fixed_owned] = 0.0
        return r, np.sqrt(scale)

    def unsupported(self, vector: np.ndarray) -> np.ndarray:
        """`vector` (owned dofs,) with zeros at the supports."""
        vector[self._fixed_owned] = 0.0
        return vector

    def reaction(self, tag: int, point: Sequence[float] = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
        """(force (3,) in N, moment (3,) in N mm about `point`) with which the tagged support holds the
        body."""
        r = self.vector(self._potential.residuals) + self.external_force()
        nodes = fem.locate_dofs_topological(self.displacement_space, 2, self.facet_tags.find(tag))
        nodes = nodes[nodes < self.owned_nodes]
        force = r[self.displacement_dofs[nodes]]
        arm = self.nodes[nodes] + self.displacement()[nodes] - np.asarray(point)
        return self.total(force.sum(axis=0)), self.total(np.cross(arm, force).sum(axis=0))

    def create_tangent(self) -> PETSc.Mat:
        A = self.create_matrix()
        A.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
        return A

    def assemble_tangent(self, A: PETSc.Mat) -> PETSc.Mat:
        """Assemble the tangent at the current state and load values into A."""
        self.assemble(A, self._tangents, self.bcs)
        self._add_contact(A)
        A.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
        return A

    def _add_contact(self, A):
        """Where walls touch the pattern grows."""
        rows = self.contact.tangent()
        if self.total(rows.nnz):
            both = ((self.owned, self.dofs),) * 2
            added = PETSc.Mat().createAIJ(
                both, csr=(rows.indptr, rows.indices, rows.data), comm=self.mesh.comm
            )
            A.axpy(1.0, added, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
            added.destroy()

    def cavity_volume(self) -> float:
        """Volume (mm3) of the closed cavity, 0 without one. Each of several counts with its share of the
        pressure: the body's pressure does its work on this sum."""
        return sum(share * self.integral([volume]) for share, volume in self._volumes)

    def stored_energy(self) -> float:
        """N mm, in the material and in the overlaps of walls."""
        return self._potential.stored_energy() + self.contact.energy()
