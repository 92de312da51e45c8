"""Round bodies with exact solutions, meshed with second-order geometry: inner radius 1, outer 2 (mm)."""

import gmsh
from mpi4py import MPI

from hifi import compat

INNER, PLANE_X, PLANE_Y, PLANE_Z, OUTER, END = 1, 2, 3, 4, 5, 6


def _mesh(path, size, volume, classify):
    """Tag the faces of `volume` by their bounding boxes, mesh with 10-node tetrahedra, write on rank 0, read on all."""
    groups = {}
    for _, face in gmsh.model.getBoundary([(3, volume)], oriented=False):
        groups.setdefault(classify(gmsh.model.getBoundingBox(2, face)), []).append(face)
    for tag, faces in groups.items():
        gmsh.model.addPhysicalGroup(2, faces, tag)
    gmsh.model.addPhysicalGroup(3, [volume], 1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.write(str(path))


def build(directory, name, size, draw, classify):
    """(mesh, cell tags, facet tags) of the solid that `draw()` makes (it returns a volume tag)."""
    comm = MPI.COMM_WORLD
    path = directory / f"{name}.msh"
    if comm.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        volume = draw()
        gmsh.model.occ.synchronize()
        _mesh(path, size, volume, classify)
        gmsh.finalize()
    comm.barrier()
    return compat.read_mesh(path, comm)


def _planes(box):
    for tag, low in ((PLANE_X, 0), (PLANE_Y, 1), (PLANE_Z, 2)):
        if box[low + 3] < 1e-4:
            return tag
    return None


def sphere_octant():
    occ = gmsh.model.occ
    octant = occ.addBox(0, 0, 0, 3, 3, 3)
    shell, _ = occ.cut([(3, occ.addSphere(0, 0, 0, 2))], [(3, occ.addSphere(0, 0, 0, 1))])
    return occ.intersect(shell, [(3, octant)])[0][0][1]


def sphere_faces(box):
    return _planes(box) or (INNER if max(box[3:]) < 1.5 else OUTER)


def capsule_octant(half_length=7.0):
    """Straight tube of half length `half_length` along x, closed by a hemispherical cap."""
    occ = gmsh.model.occ

    def capsule(radius):
        cylinder = occ.addCylinder(0, 0, 0, half_length, 0, 0, radius)
        return occ.fuse([(3, cylinder)], [(3, occ.addSphere(half_length, 0, 0, radius))])[0]

    shell, _ = occ.cut(capsule(2), capsule(1))
    octant = occ.addBox(0, 0, 0, half_length + 3, 3, 3)
    return occ.intersect(shell, [(3, octant)])[0][0][1]


def capsule_faces(box):
    return _planes(box) or (INNER if max(box[4:]) < 1.5 else OUTER)


def cylinder():
    """Solid cylinder of radius 1 and length 2 along x."""
    return gmsh.model.occ.addCylinder(0, 0, 0, 2, 0, 0, 1)


def cylinder_faces(box):
    if box[3] < 1e-4:
        return PLANE_X
    return END if box[0] > 2 - 1e-4 else OUTER


def strip(length, width, height):
    """Straight strip along x, its axis in the middle of its section."""
    return gmsh.model.occ.addBox(0, -width / 2, -height / 2, length, width, height)


def strip_faces(box, length):
    if box[3] < 1e-4:
        return PLANE_X
    return END if box[0] > length - 1e-4 else OUTER
