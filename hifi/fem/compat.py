"""The only place that knows the difference between dolfinx 0.5 (Debian 12) and 0.9 (Debian 13)."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.io import gmshio
from dolfinx.mesh import Mesh
from mpi4py import MPI
from ufl.core.expr import Expr

from pneunet.base.errors import InputError

OLD = tuple(int(p) for p in dolfinx.__version__.split(".")[:2]) < (0, 7)
#: sums may be reordered and pow need not set errno, so that loops over quadrature points vectorise: residuals
#: take a third of the time, tangents 0.8 (infinities and NaN keep their meaning: they tell Newton's method
#: that a step went too far)
_FLAGS = [
    "-O2",
    "-march=native",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fassociative-math",
    "-fno-signed-zeros",
]
#: timeout in s: another run may be compiling the same form into the same cache just now
COMPILER = {"cffi_extra_compile_args": _FLAGS, "timeout": 60}
VERSION = dolfinx.__version__
MeshTags = dolfinx.mesh.MeshTagsMetaClass if OLD else dolfinx.mesh.MeshTags
Form = fem.FormMetaClass if OLD else fem.Form


@contextmanager
def quiet_compiler() -> Iterator[None]:
    """Compiling logs every gcc line at level INFO, and ffcx has the root logger print that to standard
    error."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


@quiet_compiler()
def mixed_space(mesh: Mesh, degree: int = 2) -> fem.FunctionSpace:
    """Taylor-Hood space: vector P(degree) displacement times P(degree-1) pressure on tetrahedra."""
    if OLD:
        u = ufl.VectorElement("CG", mesh.ufl_cell(), degree)
        p = ufl.FiniteElement("CG", mesh.ufl_cell(), degree - 1)
        return fem.FunctionSpace(mesh, ufl.MixedElement([u, p]))
    import basix.ufl

    cell = mesh.basix_cell()
    u = basix.ufl.element("Lagrange", cell, degree, shape=(mesh.geometry.dim,))
    p = basix.ufl.element("Lagrange", cell, degree - 1)
    return fem.functionspace(mesh, basix.ufl.mixed_element([u, p]))


@quiet_compiler()
def cell_vectors(mesh: Mesh, size: int) -> fem.FunctionSpace:
    """Space of one vector of `size` numbers a cell: tested with it, a form with free components is assembled
    in one pass."""
    if OLD:
        return fem.VectorFunctionSpace(mesh, ("DG", 0), dim=size)
    return fem.functionspace(mesh, ("DG", 0, (size,)))


@quiet_compiler()
def compile_form(form: ufl.Form) -> Form:
    """A compiled form with the project's compiler arguments."""
    return fem.form(form, **({"jit_params": COMPILER} if OLD else {"jit_options": COMPILER}))


@quiet_compiler()
def expression(mesh: Mesh, ufl_expression: Expr, points: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Callable: local cells (n,) -> values (n, points, components) of a UFL expression at reference
    points."""
    compiled = fem.Expression(
        ufl_expression, points, **({"jit_params": COMPILER} if OLD else {"jit_options": COMPILER})
    )

    def evaluate(cells):
        values = compiled.eval(cells) if OLD else compiled.eval(mesh, cells)
        return np.asarray(values).reshape(len(cells), len(points), -1)

    return evaluate


def scatter_add(function: fem.Function) -> None:
    """Add ghost contributions onto owners and copy them back."""
    from dolfinx import la

    mode = la.ScatterMode.add if OLD else la.InsertMode.add
    function.x.scatter_reverse(mode)
    function.x.scatter_forward()


def read_mesh(path: Path | str, comm: MPI.Comm) -> tuple[Mesh, MeshTags, MeshTags]:
    """(mesh, cell tags, facet tags) of a gmsh file, read on rank 0 and distributed."""
    # gmshio.read_from_msh of 0.5 fails by itself, and a failure on rank 0 alone would leave the others
    # waiting
    import gmsh

    error = None
    if comm.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        try:
            gmsh.open(str(path))
        except Exception as problem:
            error = f"{path}: gmsh cannot read this mesh ({problem})"
    try:
        error = comm.bcast(error, root=0)
        if error:
            raise InputError(error)
        return gmshio.model_to_mesh(gmsh.model, comm, 0, gdim=3)[:3]
    finally:
        if comm.rank == 0:
            gmsh.finalize()


def cell_dofs(space: fem.FunctionSpace) -> np.ndarray:
    """(local cells, dofs per cell) blocked dofs of a space."""
    cells = space.mesh.topology.index_map(space.mesh.topology.dim)
    return np.array([space.dofmap.cell_dofs(c) for c in range(cells.size_local + cells.num_ghosts)])
