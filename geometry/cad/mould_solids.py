"""Solids of moulds in gmsh's OpenCASCADE: trays, plates with cores, frames, jigs; the body with its ports.

Blocks reach beyond the planes at which they are cut, so that no faces of the operands coincide where that can
be helped.
"""

from dataclasses import dataclass

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry.cad import body as cad
from pneunet.geometry.moulds.layers import Run
from pneunet.geometry.moulds.parameters import Moulds
from pneunet.geometry.parameters import Manipulator

#: chords of a quarter of a rounded edge
CHORDS = 4
#: mm: dowels in trays; from a cut to the next upright dowel
DEPTH, BESIDE_A_CUT = 5.0, 16.0
#: mm: least material around a dowel
COVER = 0.8
#: of the silicone's width that a vent may take
VENT_SHARE = 0.7
#: hole over tube
TIGHT = 0.9


@dataclass(frozen=True)
class MouldPiece:
    """A run's mould between two x (mm); free ends, a flange beyond the run, are not cut."""

    run: Run
    start: float
    stop: float
    moulds: Moulds
    half_width: float | None = None  # of the body there; by default the run's

    @property
    def ends(self) -> tuple[bool, bool]:
        """Whether it is cut at its start, at its stop."""
        flange = self.moulds.flange
        return self.start > self.run.start - flange + 1e-9, self.stop < self.run.stop + flange - 1e-9

    @property
    def half(self) -> float:
        """Half of its width, flanges included."""
        return (self.half_width or self.run.half_width) + self.moulds.flange

    def bounds(self, z0: float, z1: float) -> tuple[np.ndarray, np.ndarray]:
        """Lowest corner (3,) and size (3,) between two heights."""
        low = np.array([self.start, -self.half, z0])
        return low, np.array([self.stop, self.half, z1]) - low

    def silicone(self, z0: float, z1: float) -> np.ndarray:
        """(2, 3) corners of the box that the body takes of it between two heights."""
        x0, x1 = max(self.start, self.run.start), min(self.stop, self.run.stop)
        return np.array([[x0, -self.run.half_width, z0], [x1, self.run.half_width, z1]])

    def within(self, volumes: list[tuple[int, int]], z0: float, z1: float) -> list[tuple[int, int]]:
        """What of volumes lies in it, where it is cut."""
        if not any(self.ends):
            return volumes
        return gmsh.model.occ.intersect(volumes, [(3, self.block(z0, z1))])[0]

    def block(self, z0: float, z1: float) -> int:
        """Volume tag of its box between two heights."""
        return cad.box(self.start, self.stop, self.half, z0, z1)

    def dowels(self) -> list[tuple[float, float]]:
        """(x, y) of upright ones."""
        y, free = self.half - self.moulds.flange / 2, self.moulds.flange / 2
        a = self.start + (BESIDE_A_CUT if self.ends[0] else free)
        b = self.stop - (BESIDE_A_CUT if self.ends[1] else free)
        return [(x, side * y) for x in ([a, b] if b - a > 2 * free else [(a + b) / 2]) for side in (-1, 1)]


def frustum(low: np.ndarray, high: np.ndarray, z0: float, z1: float) -> int:
    """Volume tag of what lies between two plan polygons (n, 2) with parallel sides, at heights z0 and z1."""
    occ, n = gmsh.model.occ, len(low)
    bottom, top = ([occ.addPoint(x, y, z) for x, y in plan] for plan, z in ((low, z0), (high, z1)))
    rings = [[occ.addLine(r[i], r[(i + 1) % n]) for i in range(n)] for r in (bottom, top)]
    posts = [occ.addLine(a, b) for a, b in zip(bottom, top)]
    loops = [*rings, *([rings[0][i], posts[(i + 1) % n], rings[1][i], posts[i]] for i in range(n))]
    faces = [occ.addPlaneSurface([occ.addCurveLoop(loop)]) for loop in loops]
    return occ.addVolume([occ.addSurfaceLoop(faces, sewing=True)])


def rounded(corners: np.ndarray, radius: float) -> np.ndarray:
    """A convex polygon (n, 2) with its corners rounded by chords."""
    if not radius:
        return corners
    out = []
    for before, here, after in zip(np.roll(corners, 1, axis=0), corners, np.roll(corners, -1, axis=0)):
        a, b = ((p - here) / np.linalg.norm(p - here) for p in (before, after))
        half = np.arccos(np.clip(a @ b, -1, 1)) / 2
        middle = here + (a + b) / np.linalg.norm(a + b) * radius / np.sin(half)
        first, last = (np.arctan2(*(here + p * radius / np.tan(half) - middle)[::-1]) for p in (a, b))
        turn = (last - first + np.pi) % (2 * np.pi) - np.pi
        for angle in first + turn * np.linspace(0, 1, CHORDS + 1):
            out.append(middle + radius * np.array([np.cos(angle), np.sin(angle)]))
    return np.array(out)


def cylinder(
    centre: tuple[float, float, float], axis: tuple[float, float, float], diameter: float
) -> tuple[int, int]:
    """(3, volume tag) of a cylinder along `axis` from `centre` on."""
    return 3, gmsh.model.occ.addCylinder(*centre, *axis, diameter / 2)


def _one(volumes):
    found = [tag for dim, tag in volumes if dim == 3]
    if len(found) != 1:
        raise InputError(f"segment: a mould of this body falls into {len(found)} pieces: walls are too thin")
    return found[0]


def _without(tag, tools):
    return _one(gmsh.model.occ.cut([(3, tag)], tools)[0]) if tools else tag


def outside(run: Run, plane: float, moulds: Moulds) -> list[tuple[int, int]]:
    """The body without its void, from below `plane` up; fins between chambers have draft."""
    tags = []
    for p in run.parts:
        s, z0 = p.segment, plane - 1
        tags.append(cad.box(p.start, p.stop, s.width / 2, z0, p.core[1]))
        for x in p.positions if 1 in p.sides else ():
            low, high = (
                cad.slanted_plan(x, s.chamber_thickness + 2 * grown, s.width / 2, s, 1)
                for grown in (moulds.slope * (s.chamber_top - z0), 0.0)
            )
            tags.append(frustum(low, high, z0, s.chamber_top))
    return cad.fuse(tags, unify=True)


def void(run: Run, plane: float, top: float, below: float, moulds: Moulds) -> list[int]:
    """Volume tags of the channel and the chambers' cavities between `plane` and `top`, from `below` the plane
    on, thinner upwards by the draft."""
    tags = []
    for p in run.parts:
        s, z0 = p.segment, plane - below

        def add(stop, plan, z0=z0):
            """plan(inset): the polygon, moved inwards."""
            low, high = (plan(moulds.slope * (z - plane)) for z in (z0, stop))
            tags.append(frustum(low, high, z0, stop))

        stop, (x0, x1) = min(s.channel_height / 2, top), p.channel
        if stop > plane + 1e-9 and x1 > x0:

            def channel(inset, x0=x0, x1=x1, half=s.channel_width / 2):
                y = half - inset
                return np.array([[x0, -y], [x1, -y], [x1, y], [x0, y]])

            add(stop, channel)
        for side in p.sides:
            low, high = sorted((side * s.cavity_floor, side * s.cavity_top))
            if low > plane + 1e-9 or min(high, top) < plane + 1e-9:
                continue
            for x in p.positions:

                def cavity(inset, x=x, s=s, side=side):
                    thickness, half = s.cavity_thickness - 2 * inset, s.cavity_width / 2 - inset
                    return rounded(cad.slanted_plan(x, thickness, half, s, side), moulds.fillet)

                add(min(high, top), cavity)
    return tags


def tray(piece: MouldPiece, plane: float, top: float) -> int:
    """Around what lies above `plane`; open there."""
    m = piece.moulds
    tag = piece.block(plane, top + m.floor)
    tools = outside(piece.run, plane, m)
    tools += [
        cylinder((x, y, plane - 1), (0, 0, DEPTH + 1), m.dowel + m.clearance) for x, y in piece.dowels()
    ]
    return _without(tag, tools + _joints(piece, plane, top + m.floor))


def _joints(piece, z0, z1):
    """Holes for dowels along x in the faces at which a mould is cut."""
    m, z = piece.moulds, (z0 + z1) / 2
    if z1 - z0 < m.dowel + 2 * COVER:  # tape holds such a thin one together
        return []
    faces = [
        (x, d) for x, d, there in ((piece.start, 1, piece.ends[0]), (piece.stop, -1, piece.ends[1])) if there
    ]
    y, depth = piece.half - m.flange / 2, (m.plate + DEPTH) / 2
    return [
        cylinder((x - d, side * y, z), (d * (depth + 1), 0, 0), m.dowel + m.clearance)
        for x, d in faces
        for side in (-1, 1)
    ]


def plate_with_cores(piece: MouldPiece, plane: float) -> int:
    """Below `plane`, with the cores."""
    m = piece.moulds
    tag = _with(piece.block(plane - m.plate, plane), piece, plane, np.inf, m.plate / 2)
    through = (0, 0, m.plate + 1)
    holes = [
        cylinder((x, y, plane - m.plate - 1), (0, 0, m.plate + 2), m.dowel + m.clearance)
        for x, y in piece.dowels()
    ]
    holes += [
        cylinder((x, y, plane - m.plate - 1), through, diameter)
        for x, y, diameter in vents(piece.run, m.vent)
        if piece.start + m.vent < x < piece.stop - m.vent
    ]
    return _without(tag, holes)


def vents(run: Run, diameter: float) -> list[tuple[float, float, float]]:
    """(x, y, diameter) where silicone and air leave through a plate: over the gaps, beside the channel, and
    at both ends of every segment."""
    out = []
    for p in run.parts:
        s = p.segment
        y = (s.channel_width + s.width) / 4
        middles = (p.positions[1:] + p.positions[:-1]) / 2
        side = 1 if 1 in p.sides else -1 if p.sides else 0
        room = [diameter, VENT_SHARE * (s.width - s.channel_width) / 2]
        between = min(*room, VENT_SHARE * (2 * s.wall + s.gap) if p.sides else diameter)
        out += [(x + side * s.cot * v, v, between) for x in middles for v in (-y, y)]
        at_ends = min(*room, VENT_SHARE * 2 * s.end_margin)
        out += [(x, v, at_ends) for x in (p.start + s.end_margin, p.stop - s.end_margin) for v in (-y, y)]
    return out


def frame(piece: MouldPiece, low: float, high: float) -> int:
    """Around a middle layer; open at `high`."""
    m = piece.moulds
    boxes = [cad.box(p.start, p.stop, p.segment.width / 2, low, high + 1) for p in piece.run.parts]
    tag = _without(
        piece.block(low - m.floor, high), cad.fuse(boxes, unify=True) + _joints(piece, low - m.floor, high)
    )
    return _with(tag, piece, low, high, m.floor / 2)


def _with(tag, piece, plane, top, below):
    """A plate or frame with what is void between `plane` and `top`."""
    cores = void(piece.run, plane, top, below, piece.moulds)
    if not cores:
        return tag
    own = piece.within(cad.fuse(cores, unify=False), plane - below - 1, plane + 1000)
    if not own:
        return tag
    gmsh.option.setNumber("Geometry.OCCUnionUnify", 1)
    return _one(gmsh.model.occ.fuse([(3, tag)], own)[0])


def core_tops(run: Run, plane: float) -> list[float]:
    """Heights to which the cores above `plane` reach."""
    tops = [p.segment.channel_height / 2 for p in run.parts if p.channel[1] > p.channel[0]]
    tops += [p.segment.cavity_top for p in run.parts if 1 in p.sides]
    return [z for z in tops if z > plane + 1e-9]


def trough(rooms: np.ndarray, piece: MouldPiece, top: float, ports: list[tuple[float, int]]) -> int:
    """A jig: rooms (n, 5) of x0, x1, y0, y1, lowest z, open at `top`; guides for the ports' tubes."""
    m, low = piece.moulds, rooms[:, 4].min() - piece.moulds.floor
    tag = piece.block(low, top)
    boxes = [
        gmsh.model.occ.addBox(x0, y0, z0, x1 - x0, y1 - y0, top + 1 - z0) for x0, x1, y0, y1, z0 in rooms
    ]
    tools = cad.fuse(boxes, unify=True) + _joints(piece, low, top)
    for x, side in ports:
        if piece.start < x < piece.stop:
            tools.append(cylinder((x, side * (piece.half + 1), 0), (0, -side * (piece.half + 1), 0), m.port))
    return _without(tag, tools)


def body_solid(manipulator: Manipulator, moulds: Moulds, ports: bool = True) -> int:
    """Volume tag of the body in one piece, with the holes for its tubes if asked."""
    m, tools = manipulator, []
    outer = [t for s, x in zip(m.segments, m.starts) for t in cad.outer_solids(s, x)]
    for group, channel in zip(m.groups, m.channels):
        own = [t for i in group for t in cad.cavity_solids(m.segments[i], m.starts[i], *channel)]
        tools += cad.fuse(own, unify=False)
    if ports:
        for x in m.ports:
            s = m.segments[int(np.searchsorted(m.starts, x, side="right")) - 1]
            hole = cylinder((x, -s.width / 2 - 1, 0), (0, s.width / 2 + 1, 0), _hole(s, moulds))
            gmsh.model.occ.rotate([hole], 0, 0, 0, 1, 0, 0, np.radians(s.roll))
            tools.append(hole)
    return _without(_one(cad.fuse(outer, unify=True)), tools)


def _hole(segment, moulds):
    """Diameter (mm) of a tube's hole: tight, and not tangent to a face, which no solid could be."""
    hole = TIGHT * moulds.port
    near = 2 * np.abs([segment.cavity_floor, segment.channel_height / 2])
    return hole - 0.01 if (np.abs(hole - near) < 0.005).any() else hole
