"""The mixed u-p boundary value problem: unknowns, residual, tangent.

psi = W(F) + p (J - 1) with Taylor-Hood P2/P1, plus -P V for the pressure in a closed cavity, whose variation is the
follower load P inner(J inv(F).T N, v) on the cavity surface. Volume forms are integrated with degree 4 and pressure
facets with degree 4, which is exact for the latter on straight-sided cells, so that the load tangent is symmetric.
"""

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from hifi import compat
from hifi.materials import ENERGIES, PARAMETERS

VOLUME_DEGREE = 4
PRESSURE_DEGREE = 4


class MixedProblem:
    """A body, its materials, its clamps and one follower pressure.

    mesh, cell_tags, facet_tags: as dolfinx gives them. materials: {cell tag: base.materials law}, or one law.
    pressure_tags: facet tags of the loaded surface. fixed: list of (facet tag, component 0..2 or None for all).
    """

    def __init__(self, mesh, cell_tags, facet_tags, materials, pressure_tags, fixed):
        self.mesh, self.facet_tags = mesh, facet_tags
        self.space = compat.mixed_space(mesh)
        self.state = fem.Function(self.space)
        displacement_space, to_mixed = self.space.sub(0).collapse()
        self.displacement_space = displacement_space
        #: (nodes, 3) index into the mixed vector of each displacement component of each P2 node, ghosts included
        self.displacement_dofs = np.asarray(to_mixed).reshape(-1, 3)
        self.owned_nodes = displacement_space.dofmap.index_map.size_local
        self.nodes = displacement_space.tabulate_dof_coordinates()[: len(self.displacement_dofs)].copy()
        pressure_space, to_mixed_p = self.space.sub(1).collapse()
        self.pressure_space, self.pressure_dofs = pressure_space, np.asarray(to_mixed_p)
        self.bcs = [self._clamp(tag, component) for tag, component in fixed]
        self.pressure = fem.Constant(mesh, PETSc.ScalarType(0.0))

        u, p = ufl.split(self.state)
        v = ufl.TestFunction(self.space)
        F = ufl.Identity(3) + ufl.grad(u)
        J = ufl.det(F)
        dx = ufl.Measure("dx", domain=mesh, subdomain_data=cell_tags, metadata={"quadrature_degree": VOLUME_DEGREE})
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=facet_tags, metadata={"quadrature_degree": PRESSURE_DEGREE})
        cavity = ds(tuple(pressure_tags))
        N = ufl.FacetNormal(mesh)
        stored = self._stored_energy(F, cell_tags, materials, dx)
        internal = ufl.derivative(stored + p * (J - 1) * dx, self.state, v)
        # d(-V)/du: the load per unit of pressure
        load = ufl.inner(J * ufl.inv(F).T * N, ufl.split(v)[0]) * cavity
        X = ufl.SpatialCoordinate(mesh)
        self._internal = compat.compile_form(internal)
        self._load = compat.compile_form(load)
        self._tangent = compat.compile_form(ufl.derivative(internal + self.pressure * load, self.state))
        self._volume = compat.compile_form(-ufl.inner(X + u, J * ufl.inv(F).T * N) / 3 * cavity)
        self._energy = compat.compile_form(stored)
        self.deformation_gradient = F
        self._vectors = {}

    def _stored_energy(self, F, cell_tags, materials, dx):
        if not isinstance(materials, dict):
            return self._energy_density(materials, F) * dx
        groups = {}
        for tag, material in materials.items():
            groups.setdefault(material, []).append(tag)
        if len(groups) == 1:
            return self._energy_density(next(iter(groups)), F) * dx
        return sum(self._energy_density(m, F) * dx(tuple(tags)) for m, tags in groups.items())

    def _energy_density(self, material, F):
        constants = {n: fem.Constant(self.mesh, PETSc.ScalarType(getattr(material, n))) for n in PARAMETERS[material.law]}
        return ENERGIES[material.law](constants, F)

    def _clamp(self, tag, component):
        facets = self.facet_tags.find(tag)
        where = self.space.sub(0) if component is None else self.space.sub(0).sub(component)
        collapsed, _ = where.collapse()
        zero = fem.Function(collapsed)
        zero.x.array[:] = 0.0
        dofs = fem.locate_dofs_topological((where, collapsed), self.mesh.topology.dim - 1, facets)
        return fem.dirichletbc(zero, dofs, where)

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
    def _assemble(self, name, form):
        if name not in self._vectors:
            self._vectors[name] = fem.petsc.create_vector(form)
        b = self._vectors[name]
        with b.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(b, form)
        b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        # fixed values are zero and stay zero: the residual there is zero too
        fem.petsc.set_bc(b, self.bcs, scale=0.0)
        return b

    def internal_force(self):
        """PETSc vector (N): internal force and incompressibility defect (mm3) at the current state."""
        return self._assemble("internal", self._internal)

    def load_force(self):
        """PETSc vector (mm2): residual per unit of cavity pressure at the current state, -dV/du."""
        return self._assemble("load", self._load)

    def create_tangent(self):
        A = fem.petsc.create_matrix(self._tangent)
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return A

    def assemble_tangent(self, A, pressure):
        """Assemble the tangent at the current state and the given pressure (MPa) into A."""
        self.pressure.value = pressure
        A.zeroEntries()
        fem.petsc.assemble_matrix(A, self._tangent, bcs=self.bcs)
        A.assemble()
        return A

    def _scalar(self, form):
        from mpi4py import MPI

        return self.mesh.comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM)

    def cavity_volume(self):
        """Volume (mm3) of the closed cavity."""
        return float(self._scalar(self._volume))

    def stored_energy(self):
        """Elastic energy (N mm)."""
        return float(self._scalar(self._energy))

    def destroy(self):
        for vector in self._vectors.values():
            vector.destroy()
        self._vectors = {}
