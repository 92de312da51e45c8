"""Parametric CAD of a manipulator in gmsh's OpenCASCADE kernel.

Recipe: chambers are parallelogram prisms from plan polygons, turned by the segment's roll; core and channel
are polyhedra (geometry.ends), so that the body is the one of the grids. The outer solids of each segment
fused; all cavities of a pressure group fused with their channel; everything fragmented, so that the boundary
of the cavity volumes is the exact cavity surface. The cavities are then removed and the faces tagged.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.system.interrupts import at_once, kept
from pneunet.geometry import tags
from pneunet.geometry.cad.polyhedra import bar_solid, channel_solid
from pneunet.geometry.ends import Bar, PlacedSegment, placed
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.geometry.sections import chamber_plan, rotation
from pneunet.geometry.snapping import snapped

_TOLERANCE = 1e-6  # mm; OpenCASCADE pads bounding boxes by 1e-7


@contextmanager
def session(name: str = "pneunet") -> Iterator[Any]:
    """A gmsh session with one empty model; quiet, and closed whatever happens."""
    with kept():
        gmsh.initialize(readConfigFiles=False)  # no options from the working directory or home
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add(name)
        with at_once():
            yield gmsh.model
    finally:
        gmsh.finalize()


def prism(corners: np.ndarray, z0: float, z1: float) -> int:
    """Volume tag of a prism over the plan polygon `corners` (n, 2) between heights z0 and z1 (mm)."""
    occ = gmsh.model.occ
    points = [occ.addPoint(x, y, z0) for x, y in corners]
    lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1])]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    return next(tag for dim, tag in occ.extrude([(2, face)], 0, 0, z1 - z0) if dim == 3)


def box(x0: float, x1: float, half_width: float, z0: float, z1: float) -> int:
    """Volume tag of a box that lies evenly about y = 0 (mm)."""
    return gmsh.model.occ.addBox(x0, -half_width, z0, x1 - x0, 2 * half_width, z1 - z0)


def chamber_block(
    segment: Segment, x: float, side: int, thickness: float, half_width: float, z0: float, z1: float
) -> int:
    """Volume tag of a slanted block centred at x: z0 to z1 above the axis, below it on side -1 (mm)."""
    low, high = sorted((side * z0, side * z1))
    return prism(chamber_plan(segment, x, thickness, half_width, side), low, high)


def fuse(tags: list[int], unify: bool) -> list[tuple[int, int]]:
    """[(3, tag)] of volumes made one; unify: faces in one plane become one."""
    gmsh.option.setNumber("Geometry.OCCUnionUnify", int(unify))
    if len(tags) == 1:
        return [(3, tags[0])]
    return gmsh.model.occ.fuse([(3, tags[0])], [(3, t) for t in tags[1:]])[0]


def outer_body(part: PlacedSegment) -> list[tuple[int, int]]:
    """[(3, tag)] of one segment without its void: feet and tops of chambers' walls are rounded."""
    s, solid = part.segment, fuse(outer_solids(part), unify=True)
    half = s.chamber_thickness / 2 / s.sin
    own = [
        [x + end, 0.0, side * z]
        for x in part.positions
        for side in s.sides
        for z in (s.core_top, s.chamber_top)
        for end in (-half, half)
    ]
    middles = np.array(own) @ rotation(s).T if s.fillet else None
    return rounded(solid, s.fillet, lambda middle: np.abs(middles - middle).max(axis=1).min() < _TOLERANCE)


def rounded(
    solid: list[tuple[int, int]], radius: float, chosen: Callable[[np.ndarray], bool]
) -> list[tuple[int, int]]:
    """Volumes with the edges rounded whose middles (3,) are chosen; as they are where the radius (mm) is 0.
    InputError where OpenCASCADE cannot do it."""
    if not radius:
        return solid
    gmsh.model.occ.synchronize()
    edges = {abs(e) for _, e in gmsh.model.getBoundary(_faces_of(solid), combined=False, oriented=False)}
    found = sorted(e for e in edges if chosen(np.array(gmsh.model.occ.getCenterOfMass(1, e))))
    try:
        made = gmsh.model.occ.fillet([tag for _, tag in solid], found, [radius])
    except Exception:  # gmsh raises plain Exception with its own text
        made = []
    if not made:
        raise InputError(f"fillet_mm = {radius:g} cannot be built on this body: take a smaller one")
    return [each for each in made if each[0] == 3]


def _faces_of(solid):
    return gmsh.model.getBoundary(solid, combined=False, oriented=False)


def outer_solids(part: PlacedSegment) -> list[int]:
    """Volume tags of one segment's core and chamber blocks, not yet fused."""
    s = part.segment
    # from the channel axis upwards: well inside the core, so that only the sides are coplanar
    blocks = [
        chamber_block(s, x, side, s.chamber_thickness, s.width / 2, 0.0, s.chamber_top)
        for x in part.positions
        for side in s.sides
    ]
    return [bar_solid(part.core), *_rolled(s, blocks)]


def cavity_solids(part: PlacedSegment) -> list[int]:
    """Volume tags of one segment's channel and chamber cavities, not yet fused."""
    s = part.segment
    cavities = [_rounded_cavity(s, x, side) for x in part.positions for side in s.sides]
    return [channel_solid(part), *_rolled(s, cavities)]


def _rounded_cavity(s, x, side):
    """Before it is turned by the roll: all its edges are rounded but those of its floor."""
    block = chamber_block(s, x, side, s.cavity_thickness, s.cavity_width / 2, s.cavity_floor, s.cavity_top)
    floor = side * s.cavity_floor
    return rounded([(3, block)], s.fillet, lambda middle: abs(middle[2] - floor) > _TOLERANCE)[0][1]


def _rolled(segment: Segment, solids: list[int]) -> list[int]:
    """The volumes, turned from the segment's own axes to the body's."""
    if segment.roll:
        gmsh.model.occ.rotate([(3, t) for t in solids], 0, 0, 0, 1, 0, 0, np.radians(segment.roll))
    return solids


def pieces(children: Iterable[list[tuple[int, int]]]) -> set[tuple[int, int]]:
    """Volumes among the children that OpenCASCADE's fragment reports of some of its arguments."""
    return {v for family in children for v in family if v[0] == 3}


def build(manipulator: Manipulator) -> dict[str, float]:
    """Build the manipulator in the current gmsh model: one body volume per segment (two with a bottom layer),
    tagged faces, a closed cavity for each pressure group.

    Returns the CAD volumes {"body_mm3", "cavity_mm3"}, the latter of all cavities. Raises InputError when a
    segment falls apart or a cavity breaks through.
    """
    occ = gmsh.model.occ
    parts = placed([snapped(s) for s in manipulator.segments])
    bodies, cavities, number = [], [], []
    for part in parts:
        bodies += outer_body(part)
    layers = [(3, bar_solid(part.layer)) for part in parts if part.layer]
    for group in manipulator.groups:
        own = [t for i in group for t in cavity_solids(parts[i])]
        # seams are kept: they separate the channel's wall from the chambers'
        cavities += (solids := fuse(own, unify=False))
        number += [len(set(number)) + 1] * len(solids)
    _, parents = occ.fragment(bodies, cavities + layers)
    occ.synchronize()
    inner = len(bodies) + len(cavities)
    cavity_volumes, layer_volumes = (
        sorted(pieces(parents[len(bodies) : inner])),
        sorted(pieces(parents[inner:])),
    )
    body_volumes = sorted(pieces(parents[: len(bodies)]) - set(cavity_volumes))
    volumes = {
        "body_mm3": sum(occ.getMass(*v) for v in body_volumes),
        "cavity_mm3": sum(occ.getMass(*v) for v in cavity_volumes),
    }
    if len(body_volumes) != len(manipulator.segments) + len(layers):
        raise InputError(
            f"segment: the body falls into {len(body_volumes)} pieces instead of"
            f" {len(manipulator.segments) + len(layers)}: a wall is cut through by a cavity; check the wall"
            " and roof thicknesses"
        )
    cavity_faces = {abs(t) for _, t in gmsh.model.getBoundary(cavity_volumes, combined=True, oriented=True)}
    body_faces = {abs(t) for _, t in gmsh.model.getBoundary(body_volumes, combined=True, oriented=True)}
    if not cavity_faces <= body_faces:
        raise InputError(
            "segment: the cavity breaks through the outer surface: check side_wall, top_wall and"
            " base_thickness"
        )
    _tag_volumes(
        tags.BODY, "segment", range(len(manipulator.segments)), set(body_volumes) - set(layer_volumes)
    )
    _tag_volumes(
        tags.LAYER,
        "layer of segment",
        [i for i, s in enumerate(manipulator.segments) if s.layer_thickness],
        layer_volumes,
    )
    group_of_face = {
        abs(t): group
        for group, family in zip(number, parents[len(bodies) : inner])
        for _, t in gmsh.model.getBoundary(sorted(pieces([family])), combined=True, oriented=True)
    }
    _tag_faces(parts, body_faces, {f: group_of_face[f] for f in cavity_faces})
    occ.remove(cavity_volumes)
    occ.synchronize()
    return volumes


def in_channel(channel: Bar, face: int) -> bool:
    """Whether a face of a cavity is a piece of the channel's wall (its ends are not): then its centre lies on
    the sides of the section there."""
    x, *place = gmsh.model.occ.getCenterOfMass(2, face)
    inwards = np.array([[1], [-1]]) * (place - channel.at(x).T)
    return bool(abs(inwards.min()) < _TOLERANCE)


def _tag_volumes(first, name, segments, volumes):
    """Tag first + i for each segment index i; the volumes are told apart by their order along x."""
    order = sorted(volumes, key=lambda v: gmsh.model.occ.getCenterOfMass(*v)[0])
    for i, (_, tag) in zip(segments, order):
        gmsh.model.addPhysicalGroup(3, [tag], first + i)
        gmsh.model.setPhysicalName(3, first + i, f"{name} {i + 1}")


def _tag_faces(parts, body_faces, group_of_face):
    """group_of_face: pressure group of each face of a cavity."""
    names = tags.face_names(parts[-1].segment.group)
    groups = {tag: [] for tag in names}
    starts = [part.start for part in parts]
    for face in sorted(body_faces):
        x0, _, _, x1, _, _ = gmsh.model.getBoundingBox(2, face)
        if face in group_of_face:
            i = int(np.clip(np.searchsorted(starts, (x0 + x1) / 2) - 1, 0, None))
            cavity, channel = tags.cavity_tags(group_of_face[face])
            groups[channel if in_channel(parts[i].channel, face) else cavity].append(face)
        elif x1 < _TOLERANCE:
            groups[tags.BASE].append(face)
        elif x0 > parts[-1].stop - _TOLERANCE:
            groups[tags.TIP].append(face)
        else:
            groups[tags.OUTER].append(face)
    for tag, faces in groups.items():
        gmsh.model.addPhysicalGroup(2, faces, tag)
        gmsh.model.setPhysicalName(2, tag, names[tag])
