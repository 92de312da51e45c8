"""The printed moulds of a body as solids, by gmsh's OpenCASCADE.

Each layer of a run (geometry.moulds.layers) lies between a tray, which has the body's outside with fins for
the gaps, and a plate at its split plane, which carries the cores. A middle layer lies in an open frame. The
lower layer is the upper one of the run turned over. Blocks reach beyond the planes at which they are cut, so
that no faces of the operands coincide where that can be helped.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry.cad import body as cad
from pneunet.geometry.cad.meshing import TRIANGLE, write_model
from pneunet.geometry.moulds.layers import LOWER, MIDDLE, UPPER, Run, runs
from pneunet.geometry.moulds.parameters import Moulds, printed
from pneunet.geometry.moulds.part import Part
from pneunet.geometry.parameters import Manipulator
from pneunet.geometry.sections import core_section, whole_section

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
OVER = np.diag([1.0, -1.0, -1.0, 1.0])  # half a turn about x


@dataclass(frozen=True)
class _Piece:
    """A run's mould between two x; free ends are not cut."""

    run: Run
    start: float
    stop: float
    moulds: Moulds

    @property
    def ends(self) -> tuple[bool, bool]:
        """Whether it is cut at its start, at its stop."""
        flange = self.moulds.flange
        return self.start > self.run.start - flange + 1e-9, self.stop < self.run.stop + flange - 1e-9

    @property
    def half(self) -> float:
        return self.run.half_width + self.moulds.flange

    def block(self, z0: float, z1: float) -> int:
        return cad.box(self.start, self.stop, self.half, z0, z1)

    def dowels(self) -> list[tuple[float, float]]:
        """(x, y) of upright ones."""
        y, free = self.half - self.moulds.flange / 2, self.moulds.flange / 2
        a = self.start + (BESIDE_A_CUT if self.ends[0] else free)
        b = self.stop - (BESIDE_A_CUT if self.ends[1] else free)
        return [(x, side * y) for x in ([a, b] if b - a > 2 * free else [(a + b) / 2]) for side in (-1, 1)]


def solid(build: Callable[[], int], shift: np.ndarray, over: bool, step: Path | None) -> tuple:
    """(points, triangles) of the one volume that `build` makes, turned over if asked, then shifted; written
    to the file `step`."""
    with cad.session():
        tag = build()
        if over:
            gmsh.model.occ.rotate([(3, tag)], 0, 0, 0, 1, 0, 0, math.pi)
        gmsh.model.occ.translate([(3, tag)], *shift)
        gmsh.model.occ.synchronize()
        if step is not None:
            step.parent.mkdir(parents=True, exist_ok=True)
            write_model(step)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1e4)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        gmsh.model.mesh.generate(2)
        return _triangles(tag)


def _triangles(volume):
    numbers, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(numbers)
    rows = []
    for _, face in gmsh.model.getBoundary([(3, volume)], oriented=True):
        found = gmsh.model.mesh.getElementsByType(TRIANGLE, abs(face))[1].reshape(-1, 3)
        rows.append(found if face > 0 else found[:, ::-1])
    triangles = np.searchsorted(numbers[order], np.concatenate(rows))
    used, triangles = np.unique(triangles, return_inverse=True)
    points, triangles = points.reshape(-1, 3)[order][used], triangles.reshape(-1, 3)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    inside_out = np.einsum("ij,ij->", a, np.cross(b, c)) < 0
    return points, triangles[:, ::-1] if inside_out else triangles


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


def _cylinder(x, y, z, direction, diameter):
    return 3, gmsh.model.occ.addCylinder(x, y, z, *direction, diameter / 2)


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


def _tray(piece: _Piece, plane: float, top: float) -> int:
    """Around what lies above `plane`; open there."""
    m = piece.moulds
    tag = piece.block(plane, top + m.floor)
    tools = outside(piece.run, plane, m)
    tools += [_cylinder(x, y, plane - 1, (0, 0, DEPTH + 1), m.dowel + m.clearance) for x, y in piece.dowels()]
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
        _cylinder(x - d, side * y, z, (d * (depth + 1), 0, 0), m.dowel + m.clearance)
        for x, d in faces
        for side in (-1, 1)
    ]


def _plate(piece: _Piece, plane: float) -> int:
    """Below `plane`, with the cores."""
    m = piece.moulds
    cores = void(piece.run, plane, np.inf, m.plate / 2, m)
    tag = piece.block(plane - m.plate, plane)
    if cores:
        fused = cad.fuse(cores, unify=False)
        if any(piece.ends):
            room = cad.box(piece.start, piece.stop, piece.half, plane - m.plate / 2 - 1, plane + 1000)
            fused = gmsh.model.occ.intersect(fused, [(3, room)])[0]
        if fused:
            gmsh.option.setNumber("Geometry.OCCUnionUnify", 1)
            tag = _one(gmsh.model.occ.fuse([(3, tag)], fused)[0])
    through = (0, 0, m.plate + 1)
    holes = [
        _cylinder(x, y, plane - m.plate - 1, (0, 0, m.plate + 2), m.dowel + m.clearance)
        for x, y in piece.dowels()
    ]
    holes += [
        _cylinder(x, y, plane - m.plate - 1, through, diameter)
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


def _frame(piece: _Piece, low: float, high: float) -> int:
    """Around a middle layer; open at `high`."""
    m = piece.moulds
    boxes = [cad.box(p.start, p.stop, p.segment.width / 2, low, high + 1) for p in piece.run.parts]
    tag = _without(
        piece.block(low - m.floor, high), cad.fuse(boxes, unify=True) + _joints(piece, low - m.floor, high)
    )
    ridge = void(piece.run, low, high, m.floor / 2, m)
    if ridge:
        fused = cad.fuse(ridge, unify=False)
        if any(piece.ends):
            room = cad.box(piece.start, piece.stop, piece.half, low - m.floor, high + 1)
            fused = gmsh.model.occ.intersect(fused, [(3, room)])[0]
        if fused:
            tag = _one(gmsh.model.occ.fuse([(3, tag)], fused)[0])
    return tag


def _trough(
    rooms: np.ndarray,
    piece: _Piece,
    top: float,
    ports: list[tuple[float, int]],
    half: float,
    clearance: float,
) -> int:
    """A jig: rooms (n, 5) of x0, x1, y0, y1, lowest z, open at `top`; guides for the ports' tubes."""
    m, low = piece.moulds, rooms[:, 4].min() - piece.moulds.floor
    tag = cad.box(piece.start, piece.stop, half, low, top)
    boxes = [
        gmsh.model.occ.addBox(x0, y0, z0, x1 - x0, y1 - y0, top + 1 - z0) for x0, x1, y0, y1, z0 in rooms
    ]
    tools = cad.fuse(boxes, unify=True) + _joints(piece, low, top)
    for x, side in ports:
        if piece.start < x < piece.stop:
            tools.append(_cylinder(x, side * (half + 1), 0, (0, -side * (half + 1), 0), m.port))
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
            hole = _cylinder(x, -s.width / 2 - 1, 0, (0, s.width / 2 + 1, 0), _hole(s, moulds))
            gmsh.model.occ.rotate([hole], 0, 0, 0, 1, 0, 0, np.radians(s.roll))
            tools.append(hole)
    return _without(_one(cad.fuse(outer, unify=True)), tools)


def _hole(segment, moulds):
    """Diameter (mm) of a tube's hole: tight, and not tangent to a face, which no solid could be."""
    hole = TIGHT * moulds.port
    near = 2 * np.abs([segment.cavity_floor, segment.channel_height / 2])
    return hole - 0.01 if (np.abs(hole - near) < 0.005).any() else hole


def body_part(
    manipulator: Manipulator, moulds: Moulds, folder: Path | None = None, ports: bool = True
) -> Part:
    """The body itself, in its own axes and size."""
    step = folder / "body.step" if folder else None
    surface = solid(lambda: body_solid(manipulator, moulds, ports), np.zeros(3), False, step)
    return Part("body", "what is to be cast", *surface, place=np.eye(4))


def mould_parts(manipulator: Manipulator, moulds: Moulds, folder: Path | None = None) -> Iterator[Part]:
    """All Parts to print for a body, one after the other; their STEP files go to `folder`. InputError where
    one is larger than the bed, or a parameter does not go with the body."""
    large = printed(manipulator, moulds)
    split = None if moulds.split is None else moulds.split / (1 - moulds.shrinkage)
    found, needed = runs(large, split), 0
    for number, run in enumerate(found, start=1):
        cuts = run.cuts(moulds)
        pieces = [_Piece(run, a, b, moulds) for a, b in zip(cuts, cuts[1:])]
        turned = [_Piece(run.turned, a, b, moulds) for a, b in zip(cuts, cuts[1:])]
        to_body = _turn(run.turn)
        closed = 1 if run.same_turned else 2  # trays with a plate
        needed += closed * sum(len(piece.dowels()) for piece in pieces) + 2 * (closed + 2) * (len(pieces) - 1)
        for i, (piece, flipped) in enumerate(zip(pieces, turned), start=1):
            here = f"run{number}" * (len(found) > 1) + "-" * (len(found) > 1)
            which = f"-{i}" * (len(pieces) > 1)

            def make(
                kind, does, build, size, z0, over, frame, silicone, count=1, a=piece.start, half=piece.half
            ):
                """z0: of the run's frame, where the part's lowest point comes from."""
                name = f"{here}{kind}{which}"
                _refuse_larger(name, size, moulds)
                shift = np.array([-a, half, z0 if over else -z0])
                step = folder / f"{name}.step" if folder else None
                surface = solid(build, shift, over, step)
                back = np.eye(4)
                back[:3, 3] = -shift
                place = frame @ (OVER @ back if over else back)
                if silicone is not None:
                    low, high = silicone
                    box = (
                        np.array([[*low, 1.0], [*high, 1.0]])
                        @ (np.linalg.inv(OVER @ back if over else back)).T
                    )
                    silicone = np.sort(box[:, :3], axis=0)
                return Part(name, does, *surface, count, place, silicone)

            for name, each, frame in ((UPPER, piece, to_body), (LOWER, flipped, to_body @ OVER)):
                if name == LOWER and run.same_turned:
                    continue
                plane, top = each.run.planes[-1], max(p.whole[1] for p in each.run.parts)
                x0, x1 = max(each.start, run.start), min(each.stop, run.stop)
                box = ((x0, -run.half_width, plane), (x1, run.half_width, top))
                length, wide = each.stop - each.start, 2 * each.half
                yield make(
                    f"{name}-tray",
                    f"outside of the {name} layer",
                    lambda each=each, plane=plane, top=top: _tray(each, plane, top),
                    (length, wide, top - plane + moulds.floor),
                    top + moulds.floor,
                    True,
                    frame,
                    box,
                )
                yield make(
                    f"{name}-plate",
                    f"cores of the {name} layer, lid of its tray",
                    lambda each=each, plane=plane: _plate(each, plane),
                    (length, wide, top - plane + moulds.plate),
                    plane - moulds.plate,
                    False,
                    frame,
                    box,
                )
            if len(run.planes) == 2:
                low, high = run.planes
                x0, x1 = max(piece.start, run.start), min(piece.stop, run.stop)
                yield make(
                    f"{MIDDLE}-frame",
                    "the middle layer with the channel, levelled off at its rim",
                    lambda piece=piece, low=low, high=high: _frame(piece, low, high),
                    (piece.stop - piece.start, 2 * piece.half, high - low + moulds.floor),
                    low - moulds.floor,
                    False,
                    to_body,
                    ((x0, -run.half_width, low), (x1, run.half_width, high)),
                )
            yield _jig(make, run, piece, to_body)
    if len(found) > 1:
        yield from _assembly(large, moulds, folder)
    yield _pin(moulds, folder, needed)


def _turn(degrees):
    """(4, 4) from a run's frame to the body's axes."""
    turn = np.eye(4)
    if degrees:
        turn[1:3, 1:3] = [[0, -1], [1, 0]]
    return turn


def _refuse_larger(name, size, moulds):
    bed = moulds.bed_length, moulds.bed_width, moulds.bed_height
    for key, needed, there in zip(("length", "width", "height"), size, bed):
        if needed > there + 1e-6:
            raise InputError(
                f"bed_{key}_mm = {there:g}: '{name}' needs {needed:.1f} mm: take a larger bed"
                + (" or a smaller flange_mm" if key == "width" else "")
            )


def _jig(make, run, piece, to_body):
    c = piece.moulds.clearance
    ends = {run.start: -c, run.stop: c}
    rooms = np.array(
        [
            [
                p.start + ends.get(p.start, 0.0),
                p.stop + ends.get(p.stop, 0.0),
                -p.segment.width / 2 - c,
                p.segment.width / 2 + c,
                p.whole[0],
            ]
            for p in run.parts
        ]
    )
    top = max(p.core[1] for p in run.parts)
    low = rooms[:, 4].min() - piece.moulds.floor
    ports = [port for p in run.parts for port in p.ports]
    return make(
        "jig",
        "holds the layers while they are bonded; guides for the tubes",
        lambda: _trough(rooms, piece, top, ports, piece.half, c),
        (piece.stop - piece.start, 2 * piece.half, top - low),
        low,
        False,
        to_body,
        None,
    )


def _assembly(large, moulds, folder):
    """Troughs in which runs of different planes are joined end to end, in the body's axes."""
    c, rooms = moulds.clearance, []
    for i, (s, x) in enumerate(zip(large.segments, large.starts)):
        (y0, y1), (z0, _) = whole_section(s)
        first, last = i == 0, i == len(large.segments) - 1
        rooms.append([x - c * first, x + s.length + c * last, y0 - c, y1 + c, z0])
    rooms = np.array(rooms)
    top = max(core_section(s)[1, 1] for s in large.segments)
    half = np.abs(rooms[:, 2:4]).max() + moulds.flange
    low = rooms[:, 4].min() - moulds.floor
    whole = runs(large)[0]
    parts = tuple(p for run in runs(large) for p in run.parts)
    joined = Run(parts, whole.planes, 0, 0)
    cuts = joined.cuts(moulds)
    for i, (a, b) in enumerate(zip(cuts, cuts[1:]), start=1):
        piece = _Piece(joined, a, b, moulds)
        name = "assembly-jig" + f"-{i}" * (len(cuts) > 2)
        _refuse_larger(name, (b - a, 2 * half, top - low), moulds)
        shift = np.array([-a, half, -low])
        step = folder / f"{name}.step" if folder else None
        surface = solid(lambda piece=piece: _trough(rooms, piece, top, [], half, c), shift, False, step)
        place = np.eye(4)
        place[:3, 3] = -shift
        yield Part(name, "holds the cast runs while they are joined end to end", *surface, place=place)


def _pin(moulds, folder, count):
    size = moulds.plate + DEPTH - 0.5
    step = folder / "dowel.step" if folder else None
    surface = solid(lambda: _cylinder(0, 0, 0, (0, 0, size), moulds.dowel)[1], np.zeros(3), False, step)
    return Part("dowel", "aligns trays and plates, or take steel pins", *surface, count=count)
