"""The only place that knows the difference between dolfinx 0.5 (Debian 12) and 0.9 (Debian 13)."""

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import dolfinx
import dolfinx.fem.petsc
import ffcx
import ffcx.codegeneration.jit
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from mpi4py import MPI
from ufl.core.expr import Expr

from pneunet.base.system.interrupts import kept
from pneunet.geometry import meshfile
from pneunet.hifi.fem.agreement import on_rank_0
from pneunet.hifi.fem.form_cache import form_cache, lock_module, make_form_cache

with kept():
    from dolfinx.io import gmshio  # which loads gmsh

OLD = tuple(int(p) for p in dolfinx.__version__.split(".")[:2]) < (0, 7)
#: MUMPS's ordering: METIS, which Debian 12's has not. There it is PORD, which needs a third fewer operations
#: than AMF, its own choice below 10,000 unknowns
ORDERING = 4 if OLD else 5
#: sums may be reordered and pow need not set errno, so that loops over quadrature points vectorise: residuals
#: take a third of the time, tangents 0.8 (infinities and NaN keep their meaning: they tell Newton's method
#: that a step went too far). Debian 13's gcc 14 needs minutes for the largest forms at -O2, and seconds for
#: code that is as fast without
_FLAGS = [
    *(["-O2"] if OLD else ["-O1", "-ftree-vectorize"]),
    "-march=native",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fassociative-math",
    "-fno-signed-zeros",
]
MeshTags = dolfinx.mesh.MeshTagsMetaClass if OLD else dolfinx.mesh.MeshTags
Form = fem.FormMetaClass if OLD else fem.Form


# options come from here alone, not from JSON files in the working directory or at home
_LOADER, _FFCX = ("_load_parameters", ffcx.parameters) if OLD else ("_load_options", ffcx.options)
setattr(_FFCX, _LOADER, lambda: ({}, {}))
setattr(dolfinx.jit, _LOADER, lambda: ({"cache_dir": form_cache(), "cffi_extra_compile_args": _FLAGS}, {}))


def _with_locks(find, make):
    """ffcx's functions that find a compiled module and make it, its lock held from the one to the other."""
    held = {}

    def find_locked(name, *rest):
        with ExitStack() as lock:
            lock.callback(os.close, lock_module(name))
            found = find(name, *rest)
            if found[0] is None:  # to be made
                held[name] = lock.pop_all()
        return found

    def make_locked(declarations, objects, names, name, *rest, **more):
        with held.pop(name):
            return make(declarations, objects, names, name, *rest, **more)

    return find_locked, make_locked


_jit = ffcx.codegeneration.jit
_jit.get_cached_module, _jit._compile_objects = _with_locks(_jit.get_cached_module, _jit._compile_objects)


@contextmanager
def _compiler(comm: MPI.Comm) -> Iterator[None]:
    """Where forms are compiled. It logs every gcc line at level INFO, and ffcx has the root logger print that
    to standard error."""
    before = logging.root.manager.disable
    make_form_cache(comm)
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


def _name_spacing(domain):
    """Say of a mesh that its nodes are equally spaced, as gmsh's are said to be. ffcx does so when it has
    compiled a form, and from then on all forms of the mesh have other names and would be compiled again."""
    element = domain.ufl_coordinate_element()
    if element.sub_elements()[0].variant() is None:
        node = ufl.FiniteElement(element.family(), element.cell(), element.degree(), variant="equispaced")
        domain._ufl_coordinate_element = ufl.VectorElement(node)


def mixed_space(mesh: Mesh, degree: int = 2) -> fem.FunctionSpace:
    """Taylor-Hood space: vector P(degree) displacement times P(degree-1) pressure; on hexahedra
    Q."""
    with _compiler(mesh.comm):
        if OLD:
            _name_spacing(mesh.ufl_domain())
            u = ufl.VectorElement("CG", mesh.ufl_cell(), degree)
            p = ufl.FiniteElement("CG", mesh.ufl_cell(), degree - 1)
            return fem.FunctionSpace(mesh, ufl.MixedElement([u, p]))
        import basix.ufl

        cell = mesh.basix_cell()
        u = basix.ufl.element("Lagrange", cell, degree, shape=(mesh.geometry.dim,))
        p = basix.ufl.element("Lagrange", cell, degree - 1)
        return fem.functionspace(mesh, basix.ufl.mixed_element([u, p]))


def cell_vectors(mesh: Mesh, size: int) -> fem.FunctionSpace:
    """Space of one vector of `size` numbers a cell: tested with it, a form with free components is assembled
    in one pass."""
    with _compiler(mesh.comm):
        if OLD:
            return fem.VectorFunctionSpace(mesh, ("DG", 0), dim=size)
        return fem.functionspace(mesh, ("DG", 0, (size,)))


def compile_form(form: ufl.Form) -> Form:
    """A compiled form with the project's compiler arguments."""
    with _compiler(form.ufl_domain().ufl_cargo().comm):
        return fem.form(form)


def expression(mesh: Mesh, ufl_expression: Expr, points: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Callable: local cells (n,) -> values (n, points, components) of a UFL expression at reference
    points."""
    with _compiler(mesh.comm):
        compiled = fem.Expression(ufl_expression, points)

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


class _Gmsh:
    """What gmshio asks of a gmsh model, answered from a VolumeMesh: each tag a group with one part."""

    #: gmsh's number, name and corners of cells and facets
    _KINDS = {
        "tetrahedra": {3: (4, "Tetrahedron 4", 4), 2: (2, "Triangle 3", 3)},
        "hexahedra": {3: (5, "Hexahedron 8", 8), 2: (3, "Quadrilateral 4", 4)},
    }

    def __init__(self, content: meshfile.VolumeMesh):
        self.content, self.mesh = content, self
        self.kinds = self._KINDS[content.element]
        self.groups = {
            3: (content.cells, content.cell_tags),
            2: (content.facets, content.facet_tags),
        }

    def getPhysicalGroups(self):
        return [(dim, tag) for dim in (2, 3) for tag in np.unique(self.groups[dim][1])]

    def getPhysicalName(self, dim, tag):
        return f"{dim} {tag}"

    def getEntitiesForPhysicalGroup(self, dim, tag):
        return [tag]

    def getNodes(self):
        return np.arange(1, len(self.content.points) + 1), self.content.points.ravel(), []

    def getElements(self, dim, tag):
        rows, tags = self.groups[dim]
        rows = rows[tags == tag] + 1
        return [self.kinds[dim][0]], [np.zeros(len(rows), np.int64)], [rows.ravel()]

    def getElementProperties(self, kind):
        dim, (_, name, corners) = next(item for item in self.kinds.items() if item[1][0] == kind)
        return name, dim, 1, corners, [], corners


def read_mesh(path: Path | str, comm: MPI.Comm) -> tuple[Mesh, MeshTags, MeshTags]:
    """(mesh, cell tags, facet tags) of an .npz, read on rank 0 and distributed; InputError on all ranks."""
    read: list[meshfile.VolumeMesh] = []
    on_rank_0(comm, lambda: read.append(meshfile.read_mesh(path)[0]))
    return model_to_mesh(_Gmsh(*read) if read else None, comm)


def curved_mesh(comm: MPI.Comm, points: np.ndarray, cells: np.ndarray) -> Mesh:
    """Mesh of hexahedra with triquadratic geometry: points (n, 3), cells (m, 27) in dolfinx's order, of rank
    0."""
    points, cells = (points, cells) if comm.rank == 0 else (points[:0], cells[:0])
    with _compiler(comm):
        if OLD:
            node = ufl.VectorElement("Lagrange", "hexahedron", 2, variant="equispaced")
            return dolfinx.mesh.create_mesh(comm, cells, points, ufl.Mesh(node))
        import basix
        import basix.ufl

        node = basix.ufl.element("Lagrange", "hexahedron", 2, basix.LagrangeVariant.equispaced, shape=(3,))
        return dolfinx.mesh.create_mesh(comm, cells, points, node)


def model_to_mesh(model: object, comm: MPI.Comm) -> tuple[Mesh, MeshTags, MeshTags]:
    """(mesh, cell tags, facet tags) of what rank 0 has meshed in gmsh; collective."""
    return gmshio.model_to_mesh(model, comm, 0, gdim=3)[:3]


def cell_dofs(space: fem.FunctionSpace) -> np.ndarray:
    """(local cells, dofs per cell) blocked dofs of a space."""
    cells = space.mesh.topology.index_map(space.mesh.topology.dim)
    return np.array([space.dofmap.cell_dofs(c) for c in range(cells.size_local + cells.num_ghosts)])
