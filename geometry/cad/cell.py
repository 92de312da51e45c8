"""One pitch of a uniform segment between two plane cuts, with matching faces on the cuts.

Body and air are both meshed, and on demand the gaps between neighbouring chambers, the medium of
hifi.contact.medium.
"""

from pathlib import Path

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry import tags
from pneunet.geometry.cad import body as cad
from pneunet.geometry.cad.meshing import refuse_absurd, save, tetrahedral_mesh
from pneunet.geometry.ends import Bar
from pneunet.geometry.fillets import NO_CELL, refuse_fillets
from pneunet.geometry.parameters import Segment
from pneunet.geometry.sections import channel_section
from pneunet.geometry.tags import AIR, GAP


def mesh_cell(
    segment: Segment,
    mesh_size: float,
    path: str | Path,
    cut: float = 0.0,
    gaps: bool = False,
    edge_size: float | None = None,
) -> dict[str, float]:
    """Write the cell's mesh to `path`, an .npz, and beside it gmsh's .msh; returns {"body_mm3", "air_mm3",
    "cells"}.

    x runs from -pitch/2 to +pitch/2; a chamber is centred at x = cut (mm). `gaps`: mesh the space between the
    chambers too. edge_size (mm): size at the body's edges, where stresses are singular; it grows from there
    to mesh_size; None = one size everywhere. InputError when there would be too many elements, the faces on
    the two cuts do not match or the mesh fails.
    """
    refuse_fillets([segment], NO_CELL)
    half = segment.pitch / 2
    refuse_absurd(mesh_size, [(segment, segment.pitch, 1)])
    with cad.session("cell"):
        try:
            body, air = _build(segment, half, cut, gaps)
            gmsh.option.setNumber("Mesh.MeshSizeMax", mesh_size)
            gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.option.setNumber("Mesh.RandomSeed", 1)
            if edge_size is not None:
                _grade(half, edge_size, mesh_size)
            gmsh.model.mesh.generate(3)
        except InputError:
            raise
        except Exception as error:  # gmsh raises plain Exception with its own text
            raise InputError(f"gmsh could not mesh this cell: {error}; try another mesh_size_mm") from None
        mesh = tetrahedral_mesh()
        facts = {
            "body_mm3": sum(gmsh.model.occ.getMass(3, v) for v in body),
            "air_mm3": sum(gmsh.model.occ.getMass(3, v) for v in air),
            "cells": len(mesh.cells),
        }
        save(Path(path), mesh, facts)
    return facts


def _build(segment, half, cut, gaps):
    """Volume tags (body, air) of the cell; faces and volumes tagged, cuts made periodic."""
    occ, s = gmsh.model.occ, segment
    reach = half + s.width / 2 * abs(s.cot) + s.pitch
    count = int(np.ceil(reach / s.pitch))
    centres = cut + s.pitch * np.arange(-count, count + 1)
    outer = [cad.box(-reach, reach, s.width / 2, s.core_bottom, s.core_top)]
    inner = [cad.box(-reach, reach, s.channel_width / 2, -s.channel_height / 2, s.channel_height / 2)]
    for x in centres:
        for side in s.sides:
            outer.append(cad.chamber_block(s, x, side, s.chamber_thickness, s.width / 2, 0.0, s.chamber_top))
            inner.append(
                cad.chamber_block(
                    s, x, side, s.cavity_thickness, s.cavity_width / 2, s.cavity_floor, s.cavity_top
                )
            )
    solids = []
    for blocks, unify in ((outer, True), (inner, False)):
        solids.append(occ.intersect(cad.fuse(blocks, unify), [_slab(s, half)])[0])
    layer = []
    if s.layer_thickness:
        layer.append((3, cad.box(-half, half, s.width / 2, s.core_bottom, s.layer_top)))
    medium = _gap_solids(s, half, centres[:-1] + s.pitch / 2) if gaps else []
    _, parents = occ.fragment(solids[0], solids[1] + layer + medium)
    occ.synchronize()
    ends = np.cumsum([len(solids[0]), len(solids[1]), len(layer), len(medium)])
    air, layer, medium = ([t for _, t in sorted(cad.pieces(parents[a:b]))] for a, b in zip(ends, ends[1:]))
    body = sorted({t for _, t in cad.pieces(parents[: len(solids[0])])} - set(air))
    gmsh.model.addPhysicalGroup(3, sorted(set(body) - set(layer)), tags.BODY)
    if layer:
        gmsh.model.addPhysicalGroup(3, layer, tags.LAYER)
    gmsh.model.addPhysicalGroup(3, air, AIR)
    if medium:
        gmsh.model.addPhysicalGroup(3, medium, GAP)
    _make_periodic(half, s.pitch)
    interface = _boundary(body) & _boundary(air)
    wall = Bar(np.array([-half, half]), np.array([channel_section(s)] * 2))
    channel = [f for f in interface if cad.in_channel(wall, f)]
    gmsh.model.addPhysicalGroup(2, sorted(channel), tags.CHANNEL)
    gmsh.model.addPhysicalGroup(2, sorted(interface - set(channel)), tags.CAVITY)
    outer = [f for f in _boundary(body) - interface if not _on_cut(f, half)]
    gmsh.model.addPhysicalGroup(2, sorted(outer), tags.OUTER)
    return body, air


def _gap_solids(segment, half, centres):
    """(dim, tag) of the space between neighbouring chambers, above the core and as wide as they are, between
    the cuts."""
    s = segment
    solids = [
        (3, cad.chamber_block(s, x, side, s.gap, s.width / 2, s.core_top, s.chamber_top))
        for x in centres
        for side in s.sides
    ]
    return gmsh.model.occ.intersect(solids, [_slab(s, half)])[0]


def _slab(segment, half):
    """(3, tag) of all that lies between the cuts, wider and higher than the body."""
    top = 2 * segment.chamber_top
    return 3, cad.box(-half, half, segment.width, min(-top, 2 * segment.core_bottom), top)


def _on_cut(face, half):
    x0, _, _, x1, _, _ = gmsh.model.getBoundingBox(2, face)
    return x1 - x0 < 1e-5 and abs(abs(x0) - half) < 1e-5


def _grade(half, near, far, slope=0.7):
    """Sizes from `near` at every edge but those that only the cuts make, growing by `slope` per mm of
    distance up to `far`."""
    starts, along = [], []
    for _, curve in gmsh.model.getEntities(1):
        points = gmsh.model.getBoundary([(1, curve)], oriented=False)
        a, b = (np.array(gmsh.model.getValue(0, point, [])) for _, point in points)
        if abs(abs(a[0]) - half) > 1e-6 or abs(b[0] - a[0]) > 1e-6:
            starts.append(a)
            along.append(b - a)
    starts, along = np.array(starts), np.array(along)
    squares = (along**2).sum(axis=1)

    def size(*arguments: float) -> float:  # (dim, tag, x, y, z), and in newer versions the size so far
        offset = np.array(arguments[2:5]) - starts
        nearest = offset - np.clip((offset * along).sum(axis=1) / squares, 0, 1)[:, None] * along
        return float(min(far, near + slope * np.sqrt((nearest**2).sum(axis=1).min())))

    # gmsh counts the arguments of what it is given: a function that takes any number
    gmsh.model.mesh.setSizeCallback(lambda *arguments: size(*arguments))


def _boundary(volumes):
    return {
        abs(t) for _, t in gmsh.model.getBoundary([(3, v) for v in volumes], combined=True, oriented=True)
    }


def _make_periodic(half, pitch):
    """Match every face on x = +half with its image on x = -half."""
    tolerance = 1e-5
    left, right = [], []
    for _, face in gmsh.model.getEntities(2):
        box = np.array(gmsh.model.getBoundingBox(2, face))
        if abs(box[0] + half) < tolerance and abs(box[3] + half) < tolerance:
            left.append((face, box))
        elif abs(box[0] - half) < tolerance and abs(box[3] - half) < tolerance:
            right.append((face, box))
    shift = [1, 0, 0, pitch, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    for face, box in right:
        area = gmsh.model.occ.getMass(2, face)
        images = [
            f
            for f, b in left
            if np.abs(b[[1, 2, 4, 5]] - box[[1, 2, 4, 5]]).max() < tolerance
            and abs(gmsh.model.occ.getMass(2, f) - area) < tolerance
        ]
        if len(images) != 1 or len(left) != len(right):
            raise InputError("cell: the faces on its two cuts do not match; move the cut")
        gmsh.model.mesh.setPeriodic(2, [face], images, shift)
