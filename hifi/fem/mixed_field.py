"""Displacement and pressure on a tagged mesh: the unknowns of every problem, and where their values are."""

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh, meshtags
from mpi4py import MPI
from petsc4py import PETSc

from pneunet.hifi.fem import compat

#: of quadrature on cells and facets: exact for pressure on facets of straight-sided cells, so that the
#: tangent of the pressure in a closed cavity is symmetric; on hexahedra 27 and 9 Gauss points
DEGREE = 4


class MixedField:
    """Taylor-Hood: quadratic displacement u, and at the vertices the pressure p that keeps the volume; on
    hexahedra triquadratic and trilinear.

    mesh, cell_tags, facet_tags: as dolfinx gives them. `state` is the present value, `test` what forms are
    tested with; arrays of the state hold owned and ghost dofs, assembled ones the owned.
    """

    def __init__(self, mesh: Mesh, cell_tags: compat.MeshTags, facet_tags: compat.MeshTags):
        self.mesh, self.cell_tags, self.facet_tags = mesh, cell_tags, facet_tags
        #: "tetrahedron" or "hexahedron"
        self.cell_name = mesh.ufl_cell().cellname()
        self.space = compat.mixed_space(mesh)
        self.state = fem.Function(self.space)
        self.u, self.p = ufl.split(self.state)
        self.test = ufl.TestFunction(self.space)
        self.displacement_space, to_mixed = self.space.sub(0).collapse()
        #: (nodes, 3) index into the mixed vector of each displacement component of each P2 node, ghosts
        #: included
        self.displacement_dofs = np.asarray(to_mixed).reshape(-1, 3)
        self.owned_nodes = self.displacement_space.dofmap.index_map.size_local
        self.pressure_space, to_mixed = self.space.sub(1).collapse()
        self.pressure_dofs = np.asarray(to_mixed)
        #: number of incompressibility multipliers of all ranks: so many negative pivots has a stable tangent
        self.constraints = self.pressure_space.dofmap.index_map.size_global
        dofs, block = self.space.dofmap.index_map, self.space.dofmap.index_map_bs
        self.owned, self.dofs = dofs.size_local * block, dofs.size_global * block
        #: of all ranks' dofs
        self.owned_range = slice(*(block * i for i in dofs.local_range))
        self.nodes = self.node_positions()
        self._vector = None

    def node_positions(self) -> np.ndarray:
        """(nodes, 3) of the displacement nodes this rank sees, mm, as the mesh lies now."""
        return self.displacement_space.tabulate_dof_coordinates()[: len(self.displacement_dofs)].copy()

    # ---- the state as one array
    @property
    def array(self) -> np.ndarray:
        return self.state.x.array

    def set_array(self, values: np.ndarray) -> None:
        self.state.x.array[:] = values
        self.state.x.scatter_forward()

    def displacement(self, array: np.ndarray | None = None) -> np.ndarray:
        """(nodes, 3) displacement u in mm of the P2 nodes this rank sees."""
        return (self.array if array is None else array)[self.displacement_dofs]

    def pressure_field(self, array: np.ndarray | None = None) -> np.ndarray:
        """(vertices,) multiplier p in MPa at the vertices this rank sees."""
        return (self.array if array is None else array)[self.pressure_dofs]

    # ---- parts of the mesh
    def cells(self, *tags: int, degree: int = DEGREE) -> ufl.Measure:
        """dx over the cells with these tags, over all without."""
        return self._measure("dx", self.cell_tags, tags, degree)

    def facets(self, *tags: int, degree: int = DEGREE) -> ufl.Measure:
        """ds over the outer facets with these tags."""
        return self._measure("ds", self.facet_tags, tags, degree)

    def _measure(self, kind, tagged, tags, degree):
        # under one number whatever the tags, so that forms alike are compiled once
        chosen = tagged.indices[np.isin(tagged.values, tags)] if tags else tagged.indices
        marked = meshtags(self.mesh, tagged.dim, chosen, np.ones(len(chosen), np.int32))
        return ufl.Measure(
            kind,
            domain=self.mesh,
            subdomain_data=marked,
            subdomain_id=1,
            metadata={"quadrature_degree": degree},
        )

    # ---- sums of compiled forms
    def vector(self, forms: list) -> np.ndarray:
        """(owned dofs,) sum of linear forms."""
        if not forms:
            return np.zeros(self.owned)
        self._vector = self._vector or fem.petsc.create_vector(forms[0])
        with self._vector.localForm() as local:
            local.set(0.0)
        for form in forms:
            fem.petsc.assemble_vector(self._vector, form)
        self._vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return self._vector.array.copy()

    def create_matrix(self) -> PETSc.Mat:
        """A matrix with the pattern of any sum of bilinear forms on cells."""
        everywhere = ufl.inner(ufl.TrialFunction(self.space), self.test) * self.cells(degree=0)
        return fem.petsc.create_matrix(compat.compile_form(everywhere))

    def assemble(self, matrix: PETSc.Mat, forms: list, bcs: list = ()) -> None:
        """Make `matrix` the sum of bilinear forms."""
        matrix.zeroEntries()
        for form in forms:
            fem.petsc.assemble_matrix(matrix, form, bcs=list(bcs))
            matrix.assemble(PETSc.Mat.AssemblyType.FLUSH)
        matrix.assemble()

    def integral(self, forms: list) -> float:
        """Sum of functionals over all ranks."""
        return float(self.total(sum(fem.assemble_scalar(form) for form in forms)))

    def total(self, value: float | np.ndarray) -> float | np.ndarray:
        """Sum over all ranks."""
        return self.mesh.comm.allreduce(value, op=MPI.SUM)

    def destroy(self) -> None:
        if self._vector is not None:
            self._vector.destroy()
            self._vector = None
