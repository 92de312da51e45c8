"""Meshes of bodies with known solutions: round ones with second-order geometry, boxes and what a map makes of
them (mm).

Faces are tagged alike: the planes x, y, z = 0, the inner and the outer surface of a round body, the far ends.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext

import gmsh
import numpy as np
from dolfinx.mesh import CellType, Mesh, create_box, locate_entities_boundary, meshtags
from mpi4py import MPI

from pneunet.geometry.cad.body import session
from pneunet.hifi.fem import compat
from pneunet.hifi.verification import round_grids

#: (mesh, cell tags, facet tags)
TaggedMesh = tuple[Mesh, compat.MeshTags, compat.MeshTags]
INNER, PLANE_X, PLANE_Y, PLANE_Z, OUTER, END, END_Y, END_Z = range(1, 9)


def round_body(
    name: str, size: float, solid: int = 1, element: CellType = CellType.tetrahedron
) -> TaggedMesh:
    """(mesh, cell tags, facet tags) of one of `ROUND`, of second-order geometry; edges are `size` times the
    distance from the centre or axis; solid: tag of its cells."""
    comm = MPI.COMM_WORLD
    if element == CellType.hexahedron:
        grid, faces = GRIDS[name]
        return _tagged(compat.curved_mesh(comm, *grid(size)), faces, solid)
    with session(name) if comm.rank == 0 else nullcontext() as model:
        if model:
            _mesh(model, *ROUND[name], size, solid)
        return compat.model_to_mesh(model, comm)


def _mesh(model, draw, classify, radius, size, solid):
    volume = draw(model.occ)
    model.occ.synchronize()
    groups = {}
    for _, face in model.getBoundary([(3, volume)], oriented=False):
        groups.setdefault(classify(model.getBoundingBox(2, face)), []).append(face)
    for tag, faces in groups.items():
        model.addPhysicalGroup(2, faces, tag)
    model.addPhysicalGroup(3, [volume], solid)
    grading = model.mesh.field.add("MathEval")
    model.mesh.field.setString(grading, "F", f"{size}*{radius}")
    model.mesh.field.setAsBackgroundMesh(grading)
    for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    model.mesh.generate(3)
    model.mesh.setOrder(2)


def _octant(occ, solid, length=3.0):
    return occ.intersect(solid, [(3, occ.addBox(0, 0, 0, length, 3, 3))])[0][0][1]


def sphere(occ: type) -> int:
    """An eighth of a sphere with radii 1 and 2."""
    return _octant(occ, occ.cut([(3, occ.addSphere(0, 0, 0, 2))], [(3, occ.addSphere(0, 0, 0, 1))])[0])


#: axial length of the slice of a tube
SLICE = 0.25


def tube(occ: type) -> int:
    """A quarter of a slice of a tube along x with radii 1 and 2."""
    return _octant(
        occ,
        occ.cut(
            [(3, occ.addCylinder(0, 0, 0, SLICE, 0, 0, 2))], [(3, occ.addCylinder(0, 0, 0, SLICE, 0, 0, 1))]
        )[0],
    )


def cylinder(occ: type, layers: int = 4) -> int:
    """Solid cylinder of radius 1 and length 1 along x, its mesh the same on both ends."""
    disk = [(2, occ.addDisk(0, 0, 0, 1, 1))]
    occ.rotate(disk, 0, 0, 0, 0, 1, 0, np.pi / 2)
    return next(tag for dim, tag in occ.extrude(disk, 1, 0, 0, numElements=[layers]) if dim == 3)


def _hollow_faces(box, end=3.0):
    for tag, low in ((PLANE_X, 0), (PLANE_Y, 1), (PLANE_Z, 2)):
        if box[low + 3] < 1e-4:
            return tag
    if box[0] > end - 1e-4:
        return END
    return INNER if max(box[4:]) < 1.5 else OUTER


def _cylinder_faces(box):
    return PLANE_X if box[3] < 1e-4 else END if box[0] > 1 - 1e-4 else OUTER


#: name -> (draws the solid with gmsh.model.occ and returns its volume, tag of a face from its bounding box,
#: what edge lengths go with)
ROUND = {
    "sphere": (sphere, _hollow_faces, "sqrt(x*x+y*y+z*z)"),
    "tube": (tube, lambda box: _hollow_faces(box, SLICE), "sqrt(y*y+z*z)"),
    "cylinder": (cylinder, _cylinder_faces, "1"),
}


def _near(function, value):
    return lambda x: np.isclose(function(x), value)


#: the planes x, y, z = 0
_PLANES = {tag: _near(lambda x, i=i: x[i], 0.0) for i, tag in enumerate((PLANE_X, PLANE_Y, PLANE_Z))}
#: name -> (points and cells at a size, {tag of a face: whether places x (3, n) lie on it})
GRIDS = {
    "sphere": (
        round_grids.sphere,
        {
            **_PLANES,
            **{t: _near(lambda x: np.linalg.norm(x, axis=0), r) for t, r in ((INNER, 1), (OUTER, 2))},
        },
    ),
    "tube": (
        lambda size: round_grids.tube(size, SLICE),
        {
            **_PLANES,
            END: _near(lambda x: x[0], SLICE),
            **{t: _near(lambda x: np.hypot(x[1], x[2]), r) for t, r in ((INNER, 1), (OUTER, 2))},
        },
    ),
    "cylinder": (
        round_grids.cylinder,
        {
            PLANE_X: _PLANES[PLANE_X],
            END: _near(lambda x: x[0], 1.0),
            OUTER: _near(lambda x: np.hypot(x[1], x[2]), 1.0),
        },
    ),
}


def _tagged(mesh, faces, solid):
    """The mesh with its cells' tag and those of its outer facets; faces: {tag: whether places x (3, n) lie
    there}."""
    where = [locate_entities_boundary(mesh, 2, on_it) for on_it in faces.values()]
    tags = np.repeat(np.array(list(faces), np.int32), [len(facets) for facets in where])
    facets = np.concatenate(where)
    order = np.argsort(facets)
    cells = mesh.topology.index_map(3)
    cells = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    return (
        mesh,
        meshtags(mesh, 3, cells, np.full(len(cells), solid, np.int32)),
        meshtags(mesh, 2, facets[order], tags[order]),
    )


def box(
    lengths: Sequence[float],
    counts: Sequence[int],
    move: Callable[[np.ndarray], np.ndarray] | None = None,
    solid: int = 1,
    element: CellType = CellType.tetrahedron,
) -> TaggedMesh:
    """(mesh, cell tags, facet tags) of a box from the origin of (nx, ny, nz) hexahedra, or each of them cut
    into 6 tetrahedra.

    move: X (n, 3) -> (n, 3), where its vertices go; facet tags are those of the box before. solid: tag of its
    cells.
    """
    mesh = create_box(MPI.COMM_WORLD, [[0.0, 0.0, 0.0], list(lengths)], list(counts), element)
    axes = enumerate(((PLANE_X, END), (PLANE_Y, END_Y), (PLANE_Z, END_Z)))
    faces = {
        tag: _near(lambda x, axis=axis: x[axis], place)
        for axis, ends in axes
        for tag, place in zip(ends, (0.0, lengths[axis]))
    }
    tagged = _tagged(mesh, faces, solid)
    if move is not None:
        mesh.geometry.x[:] = move(mesh.geometry.x)
    return tagged


def strip(
    lengths: Sequence[float], counts: Sequence[int], element: CellType = CellType.tetrahedron
) -> TaggedMesh:
    """A box along x whose axis runs through the middle of its section."""
    return box(lengths, counts, lambda X: X - [0.0, lengths[1] / 2, lengths[2] / 2], element=element)
