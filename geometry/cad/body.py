"""Parametric CAD of a manipulator in gmsh's OpenCASCADE kernel.

Recipe: parallelogram prisms from plan polygons, turned by the segment's roll; the outer solids of each
segment fused; all cavities of a pressure group fused with their channel; everything fragmented, so that the
boundary of the cavity volumes is the exact cavity surface. The cavities are then removed and the faces
tagged.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.system.interrupts import at_once, kept
from pneunet.geometry import tags
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.geometry.sections import channel_section

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


def slanted_plan(x: float, thickness: float, half_width: float, segment: Segment, side: int) -> np.ndarray:
    """Plan corners (4, 2) of a chamber centred at x: `thickness` normal, between y = -half_width and
    +half_width."""
    half = thickness / segment.sin / 2
    slant = segment.cot * half_width * side
    return np.array(
        [
            [x - slant - half, -half_width],
            [x - slant + half, -half_width],
            [x + slant + half, half_width],
            [x + slant - half, half_width],
        ]
    )


def box(x0: float, x1: float, half_width: float, z0: float, z1: float) -> int:
    """Volume tag of a box that lies evenly about y = 0 (mm)."""
    return gmsh.model.occ.addBox(x0, -half_width, z0, x1 - x0, 2 * half_width, z1 - z0)


def chamber_block(
    segment: Segment, x: float, side: int, thickness: float, half_width: float, z0: float, z1: float
) -> int:
    """Volume tag of a slanted block centred at x: z0 to z1 above the axis, below it on side -1 (mm)."""
    low, high = sorted((side * z0, side * z1))
    return prism(slanted_plan(x, thickness, half_width, segment, side), low, high)


def fuse(tags: list[int], unify: bool) -> list[tuple[int, int]]:
    """[(3, tag)] of volumes made one; unify: faces in one plane become one."""
    gmsh.option.setNumber("Geometry.OCCUnionUnify", int(unify))
    if len(tags) == 1:
        return [(3, tags[0])]
    return gmsh.model.occ.fuse([(3, tags[0])], [(3, t) for t in tags[1:]])[0]


def outer_solids(segment: Segment, start: float) -> list[int]:
    """Volume tags of one segment's core and chamber blocks, not yet fused; x begins at `start` (mm)."""
    s = segment
    tags = [box(start, start + s.length, s.width / 2, s.core_bottom, s.core_top)]
    for x in start + s.chamber_positions:
        for side in s.sides:
            # from the channel axis upwards: well inside the core, so that only the sides are coplanar
            tags.append(chamber_block(s, x, side, s.chamber_thickness, s.width / 2, 0.0, s.chamber_top))
    return _rolled(s, tags)


def cavity_solids(segment: Segment, start: float, channel_from: float, channel_to: float) -> list[int]:
    """Volume tags of one segment's chamber cavities and its stretch of channel (clipped to the given x
    range)."""
    s = segment
    tags = []
    x0, x1 = max(start, channel_from), min(start + s.length, channel_to)
    if x1 > x0:
        tags.append(box(x0, x1, s.channel_width / 2, -s.channel_height / 2, s.channel_height / 2))
    for x in start + s.chamber_positions:
        for side in s.sides:
            tags.append(
                chamber_block(
                    s, x, side, s.cavity_thickness, s.cavity_width / 2, s.cavity_floor, s.cavity_top
                )
            )
    return _rolled(s, tags)


def layer_solid(segment: Segment, start: float, stop: float) -> list[int]:
    """[volume tag] of the bottom layer between two x (mm); empty when the segment has none."""
    if not segment.layer_thickness:
        return []
    solid = box(start, stop, segment.width / 2, segment.core_bottom, segment.layer_top)
    return _rolled(segment, [solid])


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
    bodies, cavities, layers, number = [], [], [], []
    for segment, start in zip(manipulator.segments, manipulator.starts):
        bodies += fuse(outer_solids(segment, start), unify=True)
        layers += [(3, tag) for tag in layer_solid(segment, start, start + segment.length)]
    for group, start_stop in zip(manipulator.groups, manipulator.channels):
        own = [
            t
            for i in group
            for t in cavity_solids(manipulator.segments[i], manipulator.starts[i], *start_stop)
        ]
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
    _tag_faces(manipulator, body_faces, {f: group_of_face[f] for f in cavity_faces})
    occ.remove(cavity_volumes)
    occ.synchronize()
    return volumes


def in_channel(segment: Segment, box: tuple[float, ...]) -> bool:
    """Whether a cavity face with this bounding box (6 numbers) is a piece of the channel's wall (its ends are
    not)."""
    x0, y0, z0, x1, y1, z1 = box
    (low_y, high_y), (low_z, high_z) = channel_section(segment) + [-_TOLERANCE, _TOLERANCE]
    in_y, in_z = low_y < y0 and y1 < high_y, low_z < z0 and z1 < high_z
    return in_y and in_z and x1 - x0 > 10 * _TOLERANCE


def _tag_volumes(first, name, segments, volumes):
    """Tag first + i for each segment index i; the volumes are told apart by their order along x."""
    order = sorted(volumes, key=lambda v: gmsh.model.occ.getCenterOfMass(*v)[0])
    for i, (_, tag) in zip(segments, order):
        gmsh.model.addPhysicalGroup(3, [tag], first + i)
        gmsh.model.setPhysicalName(3, first + i, f"{name} {i + 1}")


def _tag_faces(manipulator, body_faces, group_of_face):
    """group_of_face: pressure group of each face of a cavity."""
    names = tags.face_names(len(manipulator.groups))
    groups = {tag: [] for tag in names}
    for face in sorted(body_faces):
        x0, y0, z0, x1, y1, z1 = gmsh.model.getBoundingBox(2, face)
        if face in group_of_face:
            i = int(np.clip(np.searchsorted(manipulator.starts, (x0 + x1) / 2) - 1, 0, None))
            s = manipulator.segments[i]
            cavity, channel = tags.cavity_tags(group_of_face[face])
            groups[channel if in_channel(s, (x0, y0, z0, x1, y1, z1)) else cavity].append(face)
        elif x1 < _TOLERANCE:
            groups[tags.BASE].append(face)
        elif x0 > manipulator.length - _TOLERANCE:
            groups[tags.TIP].append(face)
        else:
            groups[tags.OUTER].append(face)
    for tag, faces in groups.items():
        gmsh.model.addPhysicalGroup(2, faces, tag)
        gmsh.model.setPhysicalName(2, tag, names[tag])
