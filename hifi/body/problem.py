"""The mixed u-p boundary value problem: unknowns, residual, tangent.

psi = W(F) + p (J - 1) - p^2/(2K) with Taylor-Hood P2/P1, plus the loads' terms (hifi.fem.loads). Volume forms
are integrated with degree 4 and pressure facets with degree 4, which is exact for the latter on
straight-sided cells, so that the tangent of the pressure in a closed cavity is symmetric.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from pneunet.hifi.fem import compat
from pneunet.hifi.fem.materials import energy_density

VOLUME_DEGREE = 4


@dataclass(frozen=True)
class Support:
    """Prescribed displacement on tagged facets.

    component: 0..2, or None for all three. motion(X (n, 3), load) -> (n,) or (n, 3) in mm; None keeps it at
    zero.
    """

    tag: int
    component: int | None = None
    motion: Callable | None = None


class MixedProblem:
    """A body, its materials, its clamps and its loads.

    mesh, cell_tags, facet_tags: as dolfinx gives them. materials: {cell tag: base.materials.laws law}, or one
    law. supports: list of `Support`. loads: list of hifi.fem.loads objects; the first closed `Pressure` is
    the cavity whose volume is measured. body_force(X) -> UFL vector in N/mm3, for manufactured solutions.
    """

    def __init__(self, mesh, cell_tags, facet_tags, materials, supports, loads=(), body_force=None):
        self.mesh, self.cell_tags, self.facet_tags = mesh, cell_tags, facet_tags
        self.space = compat.mixed_space(mesh)
        self.state = fem.Function(self.space)
        displacement_space, to_mixed = self.space.sub(0).collapse()
        self.displacement_space = displacement_space
        #: (nodes, 3) index into the mixed vector of each displacement component of each P2 node, ghosts
        #: included
        self.displacement_dofs = np.asarray(to_mixed).reshape(-1, 3)
        self.owned_nodes = displacement_space.dofmap.index_map.size_local
        self.nodes = displacement_space.tabulate_dof_coordinates()[: len(self.displacement_dofs)].copy()
        pressure_space, to_mixed_p = self.space.sub(1).collapse()
        self.pressure_space, self.pressure_dofs = pressure_space, np.asarray(to_mixed_p)
        #: number of incompressibility multipliers of all ranks: so many negative pivots has a stable tangent
        self.constraints = pressure_space.dofmap.index_map.size_global
        self.owned = self.space.dofmap.index_map.size_local * self.space.dofmap.index_map_bs
        self.supports = list(supports)
        self.bcs = [self._support_condition(support) for support in self.supports]
        #: supported dofs of the mixed vector: those this rank sees, and those it owns
        self.fixed_dofs = np.unique(
            np.concatenate([bc.dof_indices()[0] for bc in self.bcs] + [np.zeros(0, np.int32)])
        )
        self._fixed_owned = self.fixed_dofs[self.fixed_dofs < self.owned]
        self.loads = list(loads)
        #: hifi.contact.body.BodyContact, where walls are held apart
        self.contact = None
        self.symmetric = all(load.closed for load in self.loads)

        u, p = ufl.split(self.state)
        v, _ = ufl.split(ufl.TestFunction(self.space))
        F = ufl.Identity(3) + ufl.grad(u)
        dx = ufl.Measure(
            "dx", domain=mesh, subdomain_data=cell_tags, metadata={"quadrature_degree": VOLUME_DEGREE}
        )
        stored = self._stored_energy(F, p, cell_tags, materials, dx)
        internal = ufl.derivative(stored, self.state, ufl.TestFunction(self.space))
        terms = [(load, load.term(self, u, v)) for load in self.loads]
        external = [term for _, term in terms]
        if body_force is not None:
            external.append(-ufl.inner(body_force(ufl.SpatialCoordinate(mesh)), v) * dx)
        stiff = [term for load, term in terms if load.has_tangent]
        self._internal = compat.compile_form(internal)
        self._external = compat.compile_form(sum(external)) if external else None
        self._tangent = compat.compile_form(
            ufl.derivative(internal + sum(stiff) if stiff else internal, self.state)
        )
        self._cavity = next((load for load in self.loads if hasattr(load, "volume_form")), None)
        self._volume = compat.compile_form(self._cavity.volume_form) if self._cavity else None
        self._energy = compat.compile_form(stored)
        self.deformation_gradient = F
        self._vectors = {}

    def _stored_energy(self, F, p, cell_tags, materials, dx):
        if not isinstance(materials, dict):
            return energy_density(self.mesh, materials, F, p) * dx
        groups = {}
        for tag, material in materials.items():
            groups.setdefault(material, []).append(tag)
        if len(groups) == 1:
            return energy_density(self.mesh, next(iter(groups)), F, p) * dx
        return sum(energy_density(self.mesh, m, F, p) * dx(tuple(tags)) for m, tags in groups.items())

    def _support_condition(self, support):
        facets = self.facet_tags.find(support.tag)
        where = self.space.sub(0) if support.component is None else self.space.sub(0).sub(support.component)
        collapsed, _ = where.collapse()
        dofs = fem.locate_dofs_topological((where, collapsed), self.mesh.topology.dim - 1, facets)
        value = fem.Function(collapsed)
        return fem.dirichletbc(value, dofs, where)

    def supported(self, array, load):
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

    # ---- state as one array (owned and ghost dofs of the mixed space)
    @property
    def array(self):
        return self.state.x.array

    def set_array(self, values):
        self.state.x.array[:] = values
        self.state.x.scatter_forward()

    def displacement(self, array=None):
        """(nodes, 3) displacement in mm of the P2 nodes this rank sees."""
        return (self.array if array is None else array)[self.displacement_dofs]

    def pressure_field(self, array=None):
        """(vertices,) multiplier p in MPa at the vertices this rank sees."""
        return (self.array if array is None else array)[self.pressure_dofs]

    @property
    def dofs(self):
        return self.space.dofmap.index_map.size_global * self.space.dofmap.index_map_bs

    # ---- residual pieces
    def _assemble(self, form):
        if form not in self._vectors:
            self._vectors[form] = fem.petsc.create_vector(form)
        b = self._vectors[form]
        with b.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(b, form)
        b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return b.array.copy()

    def external_force(self):
        """(owned dofs,) minus the forces of all loads (N) at the current state and values; supports
        included."""
        if self._external is None:
            return np.zeros(self.owned)
        for load in self.loads:
            load.update(self)
        return self._assemble(self._external)

    def residual(self):
        """((owned dofs,) residual in N and mm3, norm of what it balances in N) at the current state and load
        values.

        The scale is the larger of the loads' and the support reactions' norm; supported entries are zero.
        """
        r, external = self._assemble(self._internal), self.external_force()
        if self.contact:
            r += self.contact.residual()
        scale = self._sum(external @ external)
        r += external
        reactions = r[self._fixed_owned]
        scale = max(scale, self._sum(reactions @ reactions))
        r[self._fixed_owned] = 0.0
        return r, np.sqrt(scale)

    def unsupported(self, vector):
        """`vector` (owned dofs,) with zeros at the supports."""
        vector[self._fixed_owned] = 0.0
        return vector

    def reaction(self, tag, point=(0.0, 0.0, 0.0)):
        """(force (3,) in N, moment (3,) in N mm about `point`) with which the tagged support holds the
        body."""
        r = self._assemble(self._internal) + self.external_force()
        nodes = fem.locate_dofs_topological(self.displacement_space, 2, self.facet_tags.find(tag))
        nodes = nodes[nodes < self.owned_nodes]
        force = r[self.displacement_dofs[nodes]]
        arm = self.nodes[nodes] + self.displacement()[nodes] - np.asarray(point)
        return self._sum(force.sum(axis=0)), self._sum(np.cross(arm, force).sum(axis=0))

    def create_tangent(self):
        A = fem.petsc.create_matrix(self._tangent)
        A.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
        return A

    def assemble_tangent(self, A):
        """Assemble the tangent at the current state and load values into A."""
        A.zeroEntries()
        fem.petsc.assemble_matrix(A, self._tangent, bcs=self.bcs)
        A.assemble()
        if self.contact:
            self.contact.add_tangent(A)
            A.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
        return A

    def _sum(self, value):
        return self.mesh.comm.allreduce(value, op=MPI.SUM)

    def cavity_volume(self):
        """Volume (mm3) of the closed cavity; 0 without one."""
        if self._volume is None:
            return 0.0
        return float(self._sum(fem.assemble_scalar(self._volume)))

    def stored_energy(self):
        """Elastic energy (N mm)."""
        return float(self._sum(fem.assemble_scalar(self._energy)))

    def destroy(self):
        for vector in self._vectors.values():
            vector.destroy()
        self._vectors = {}
