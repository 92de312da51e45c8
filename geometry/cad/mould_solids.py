"""Solids of moulds in gmsh's OpenCASCADE: trays, plates with cores, frames, jigs; the body with its ports.

Blocks reach beyond the planes at which they are cut, so that no faces of the operands coincide where that can
be helped.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry.cad import body as cad
from pneunet.geometry.cad.polyhedra import bar_solid, lofted, polyhedron
from pneunet.geometry.ends import Bar, placed
from pneunet.geometry.fillets import rounding
from pneunet.geometry.moulds.layers import Run
from pneunet.geometry.moulds.parameters import Moulds
from pneunet.geometry.parameters import Manipulator
from pneunet.geometry.sections import chamber_plan
from pneunet.geometry.snapping import snapped

#: chords of a quarter of a rounded edge
CHORDS = 4
#: mm: dowels in trays; from a cut to the next upright dowel
DEPTH, BESIDE_A_CUT = 5.0, 16.0
#: mm: least material around a dowel
COVER = 0.8
#: of the silicone's width that a vent may take
VENT_SHARE = 0.7
#: of a vent: its walls are planes, so that beside a tooth they count as no undercut
_CIRCLE = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 16, endpoint=False)])
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

    def plate(self, plane: float) -> float:
        """Thickness of a plate at a split plane, pockets for teeth under it."""
        return self.moulds.plate + self.run.depth(plane)

    def silicone(self, z0: float, z1: float) -> np.ndarray:
        """(2, 3) corners of the box that the body takes of it between two heights."""
        x0, x1 = max(self.start, self.run.start), min(self.stop, self.run.stop)
        y = self.run.half_width + self.run.grown(self.moulds)
        return np.array([[x0, -y, z0], [x1, y, z1]])

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


def frustum(plan: Callable[[float], np.ndarray], heights: Sequence[float]) -> int:
    """Volume tag of what lies between plan polygons (n, 2) with parallel sides at rising heights."""
    points = np.array([np.column_stack([plan(z), np.full(len(plan(z)), z)]) for z in heights])
    n = points.shape[1]
    number = np.arange(points[..., 0].size).reshape(-1, n)
    faces = [number[0].tolist(), number[-1].tolist()]
    for low, high in zip(number, number[1:]):
        faces += np.stack([low, np.roll(low, -1), np.roll(high, -1), high], axis=1).tolist()
    return polyhedron(points.reshape(-1, 3), faces)


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


def upright(
    bar: Bar, z0: float, z1: float | None = None, grown: Callable[[float], float] = lambda z: 0.0
) -> int:
    """Volume tag of what stands under a bar from z0 on, up to z1 or to its top, at a height wider by grown(z)
    (mm) on either side."""
    rings = []
    for x, ((y0, y1), (_, top)) in zip(bar.x, bar.sections):
        high = top if z1 is None else z1
        a, b = grown(z0), grown(high)
        rings.append([[x, y0 - a, z0], [x, y1 + a, z0], [x, y1 + b, high], [x, y0 - b, high]])
    return lofted(np.array(rings))


def _one(volumes):
    found = [tag for dim, tag in volumes if dim == 3]
    if len(found) != 1:
        raise InputError(f"segment: a mould of this body falls into {len(found)} pieces: walls are too thin")
    return found[0]


def _without(tag, tools):
    return _one(gmsh.model.occ.cut([(3, tag)], tools)[0]) if tools else tag


def outside(run: Run, plane: float, moulds: Moulds) -> list[tuple[int, int]]:
    """The body without its void, from below `plane` up; its sides, and fins between chambers, have draft."""
    tags, z0, highest = [], plane - 1, max(p.whole[1] for p in run.parts)

    def grown(z):
        return moulds.slope_outside * (highest - z)

    for p in run.parts:
        s = p.segment
        tags.append(upright(p.core, z0, grown=grown))
        along, inset = rounding(s.fillet, CHORDS).T
        feet, tops = s.core_top + s.fillet - along[::-1], s.chamber_top - s.fillet + along

        def thickness(z, s=s, feet=feet, tops=tops, inset=inset):
            more = np.interp(z, [*feet, *tops], [*inset[::-1], *-inset]) if s.fillet else 0.0
            return s.chamber_thickness + 2 * moulds.slope * (s.chamber_top - z) + 2 * more

        levels = np.unique([z0, *feet, *tops]) if s.fillet else [z0, s.chamber_top]
        for x in p.positions if 1 in p.sides else ():

            def plan(z, x=x, s=s, thickness=thickness):
                return chamber_plan(s, x, thickness(z), s.width / 2 + grown(z))

            tags.append(frustum(plan, levels))
    return cad.fuse(tags, unify=True)


def void(run: Run, plane: float, top: float, below: float, moulds: Moulds) -> list[int]:
    """Volume tags of the channel and the chambers' cavities between `plane` and `top`, from `below` the plane
    on, thinner upwards by the draft."""
    tags, z0 = [], plane - below
    for p in run.parts:
        s = p.segment

        def heights(roof):
            return z0, top if np.isfinite(top) else max(roof, plane)

        pairs = _channel(p, plane, heights, lambda z: moulds.slope * (z - plane))
        tags.extend(lofted(pair) for pair in pairs if pair[:, 2, 2].max() > plane + 1e-9)
        for side in p.sides:
            low, high = sorted((side * s.cavity_floor, side * s.cavity_top))
            if low > plane + 1e-9 or min(high, top) < plane + 1e-9:
                continue
            tips, inset = np.array([min(high, top)]), np.zeros(1)
            if s.fillet and high <= top:
                along, inset = rounding(s.fillet, CHORDS).T
                tips = high - s.fillet + along
            for x in p.positions:

                def cavity(z, x=x, s=s, side=side, tips=tips, inset=inset):
                    tip = float(np.interp(z, tips, inset))
                    less = moulds.slope * (z - plane) + tip
                    plan = chamber_plan(s, x, s.cavity_thickness - 2 * less, s.cavity_width / 2 - less, side)
                    # a corner that shrank to a point would be no polygon's
                    radius = max(s.fillet - tip, s.fillet / 10) if s.fillet else moulds.fillet
                    return rounded(plan, radius)

                tags.append(frustum(cavity, [z0, *tips]))
    return tags


def _channel(p, plane, heights, inset):
    """Rings (2, 4, 3) of the channel's pieces along x, each above `plane` or below it: from and to
    heights(roof), inset(z) narrower."""
    bar, rings = p.channel.cut_at(plane), []
    for x, ((y0, y1), (_, roof)) in zip(bar.x, bar.sections):
        low, high = heights(roof)
        a, b = inset(low), inset(high)
        rings.append([[x, y0 + a, low], [x, y1 - a, low], [x, y1 - b, high], [x, y0 + b, high]])
    places = np.array(rings)
    for i, lean in zip((0, -1), p.leans):
        places[i, :, 0] += lean * places[i, :, 1]
    return np.stack([places[:-1], places[1:]], axis=1)


def teeth(run: Run, plane: float, moulds: Moulds) -> list[tuple[int, int]]:
    """What the layer above `plane` has below it (geometry.moulds.layers.Run.depth), from above the plane on;
    as much narrower as the core that leaves room for it."""
    spread = run.planes[-1] - run.planes[0]
    pairs = [
        pair
        for p in run.parts
        for pair in _channel(
            p, plane, lambda roof: (roof, plane + 1), lambda z: moulds.slope * (plane - z + spread)
        )
    ]
    return [(3, lofted(pair)) for pair in pairs if pair[:, 0, 2].min() < plane - 1e-9]


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
    m, thick = piece.moulds, piece.plate(plane)
    tag = _with(piece.block(plane - thick, plane), piece, plane, np.inf, m.plate / 2)
    holes = [
        cylinder((x, y, plane - thick - 1), (0, 0, thick + 2), m.dowel + m.clearance)
        for x, y in piece.dowels()
    ]
    holes += [
        (3, frustum(lambda z, x=x, y=y, d=diameter: [x, y] + d / 2 * _CIRCLE, [plane - thick - 1, plane]))
        for x, y, diameter in vents(piece.run, m.vent)
        if piece.start + m.vent < x < piece.stop - m.vent
    ]
    return _without(tag, holes + teeth(piece.run, plane, m))


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
    slope = m.slope_outside
    boxes = [upright(p.core, low, high + 1, lambda z: slope * (z - low)) for p in piece.run.parts]
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
    tops = [float(p.channel.sections[:, 1, 1].max()) for p in run.parts]
    tops += [p.segment.cavity_top for p in run.parts if 1 in p.sides]
    return [z for z in tops if z > plane + 1e-9]


def trough(rooms: list[Bar], piece: MouldPiece, top: float, ports: list[tuple[float, int]]) -> int:
    """A jig: rooms from their lowest z up, open at `top`; guides for the ports' tubes."""
    m, low = piece.moulds, lowest(rooms) - piece.moulds.floor
    tag = piece.block(low, top)
    tools = cad.fuse([bar_solid(room) for room in rooms], unify=True) + _joints(piece, low, top)
    for x, side in ports:
        if piece.start < x < piece.stop:
            tools.append(cylinder((x, side * (piece.half + 1), 0), (0, -side * (piece.half + 1), 0), m.port))
    return _without(tag, tools)


def lowest(rooms: list[Bar]) -> float:
    """Lowest z of rooms."""
    return min(float(room.sections[:, 1, 0].min()) for room in rooms)


def body_solid(manipulator: Manipulator, moulds: Moulds, ports: bool = True) -> int:
    """Volume tag of the body in one piece, with the holes for its tubes if asked."""
    m, tools = manipulator, []
    row = placed([snapped(s, lowest=0.0) for s in m.segments], castable=True)
    outer = [tag for part in row for _, tag in cad.outer_body(part)]
    for group in m.groups:
        tools += cad.fuse([t for i in group for t in cad.cavity_solids(row[i])], unify=False)
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
