"""The casting set of a body: which moulds there are, and each as a closed surface that lies as it is printed.

Each layer of a run (geometry.moulds.layers) lies between a tray, which has the body's outside with fins for
the gaps, and a plate at its split plane, which carries the cores. A middle layer lies in an open frame. The
lower layer is the upper one of the run turned over.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.progress import progress
from pneunet.geometry.cad import body as cad
from pneunet.geometry.cad import mould_solids as solids
from pneunet.geometry.cad.meshing import TRIANGLE, write_model
from pneunet.geometry.cad.mould_solids import MouldPiece
from pneunet.geometry.ends import Bar, placed
from pneunet.geometry.moulds.layers import LOWER, MIDDLE, UPPER, Run, runs
from pneunet.geometry.moulds.parameters import Moulds, printed
from pneunet.geometry.moulds.part import Part, outward
from pneunet.geometry.parameters import Manipulator
from pneunet.geometry.sections import whole_section

OVER = np.diag([1.0, -1.0, -1.0, 1.0])  # half a turn about x


@dataclass(frozen=True, eq=False)
class _Form:
    """A Part to be: build gives its volume in a run's frame, where it begins at `low` (3,) and has `size`
    (3,); over: it is printed turned over; frames: (4, 4) each, from the run's to the body's; silicone (2, 3):
    corners of what it forms, in the run's frame."""

    name: str
    does: str
    build: Callable[[], int]
    low: np.ndarray
    size: np.ndarray
    frames: tuple[np.ndarray, ...]
    over: bool = False
    silicone: np.ndarray | None = None
    count: int = 1

    @property
    def shift(self) -> np.ndarray:
        """(3,) to the bed's corner, after it is turned over."""
        high = self.low + self.size
        return -np.array([self.low[0], -high[1], -high[2]] if self.over else self.low)

    @property
    def place(self) -> np.ndarray:
        """(4, 4) from the bed to the run's frame."""
        back = np.eye(4)
        back[:3, 3] = -self.shift
        return OVER @ back if self.over else back

    def part(self, step: Path | None) -> Part:
        """Built, and written to `step`."""
        box = self.silicone
        if box is not None:
            back = np.linalg.inv(self.place)
            box = np.sort(box @ back[:3, :3].T + back[:3, 3], axis=0)
        surface = solid(self.build, self.shift, self.over, step)
        places = tuple(frame @ self.place for frame in self.frames)
        return Part(self.name, self.does, *surface, self.count, places, box)


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
    """(points, triangles) of the mesh on a volume's surface, outward."""
    faces = [tag for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False)]
    corners = np.concatenate([gmsh.model.mesh.getElementsByType(TRIANGLE, tag)[1] for tag in faces])
    numbers, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(numbers)
    used, triangles = np.unique(np.searchsorted(numbers[order], corners), return_inverse=True)
    points = points.reshape(-1, 3)[order][used]
    # not gmsh's setOutwardOrientation, which turns the bottoms of blind holes inwards on Debian 13
    return points, outward(points, triangles.reshape(-1, 3))


def body_part(
    manipulator: Manipulator, moulds: Moulds, folder: Path | None = None, ports: bool = True
) -> Part:
    """The body itself, in its own axes and size."""
    step = folder / "body.step" if folder else None
    surface = solid(lambda: solids.body_solid(manipulator, moulds, ports), np.zeros(3), False, step)
    return Part("body", "what is to be cast", *surface)


def mould_parts(manipulator: Manipulator, moulds: Moulds, folder: Path | None = None) -> Iterator[Part]:
    """All Parts to print for a body, one after the other; their STEP files go to `folder`. InputError, before
    anything is built, where one is larger than the bed or a parameter does not go with the body."""
    large = printed(manipulator, moulds)
    found = runs(large, moulds.split_as_printed)
    forms = [
        form
        for number, run in enumerate(found, start=1)
        for form in _of_run(run, moulds, f"run{number}-" if len(found) > 1 else "")
    ]
    if len(found) > 1:
        forms += _assembly(large, found, moulds)
    forms.append(_pin(moulds, sum(_dowels(run, moulds) for run in found)))
    for form in forms:
        _refuse_larger(form, moulds)
    for form in progress(forms, "parts to print"):
        yield form.part(folder / f"{form.name}.step" if folder else None)


def _pieces(run, moulds):
    cuts = run.cuts(moulds)
    return [MouldPiece(run, a, b, moulds) for a, b in zip(cuts, cuts[1:])]


def _dowels(run, moulds):
    """How many a run takes: for all its trays, and two at every cut of all that has walls."""
    pieces, trays = _pieces(run, moulds), 1 if run.same_turned else 2
    walls = trays + len(run.planes)  # with the jig, and a frame between two planes
    return trays * sum(len(piece.dowels()) for piece in pieces) + 2 * walls * (len(pieces) - 1)


def _of_run(run, moulds, prefix):
    pieces, turned = _pieces(run, moulds), _pieces(run.turned, moulds)
    frame = np.eye(4)
    if run.turn:
        frame[1:3, 1:3] = [[0, -1], [1, 0]]
    for i, (piece, flipped) in enumerate(zip(pieces, turned), start=1):
        after = f"-{i}" * (len(pieces) > 1)

        def named(kind, after=after):
            return f"{prefix}{kind}{after}"

        upper, lower = frame, frame @ OVER
        if run.same_turned:
            yield from _closed(piece, UPPER, named, (upper, lower))
        else:
            yield from _closed(piece, UPPER, named, (upper,))
            yield from _closed(flipped, LOWER, named, (lower,))
        if len(run.planes) == 2:
            yield _open(piece, named, frame)
        yield _jig(piece, named, frame)


def _closed(piece, name, named, frames):
    """Tray and plate of what lies above the highest plane of a piece's run."""
    m, run = piece.moulds, piece.run
    plane, top = run.planes[-1], max(p.whole[1] for p in run.parts)
    silicone = piece.silicone(plane - run.depth(plane), top)
    low, size = piece.bounds(plane, top + m.floor)
    does = f"outside of the {name} layer"
    yield _Form(
        named(f"{name}-tray"),
        does,
        lambda: solids.tray(piece, plane, top),
        low,
        size,
        frames,
        True,
        silicone,
    )
    highest = max(solids.core_tops(run, plane), default=plane)
    low, size = piece.bounds(plane - piece.plate(plane), highest)
    does = f"cores of the {name} layer, lid of its tray"
    build = lambda: solids.plate_with_cores(piece, plane)  # noqa: E731
    yield _Form(named(f"{name}-plate"), does, build, low, size, frames, False, silicone)


def _open(piece, named, frame):
    low, high = piece.run.planes
    does = "the middle layer with the channel, levelled off at its rim"
    return _Form(
        named(f"{MIDDLE}-frame"),
        does,
        lambda: solids.frame(piece, low, high),
        *piece.bounds(low - piece.moulds.floor, high),
        (frame,),
        silicone=piece.silicone(low, high),
    )


def _jig(piece, named, frame):
    run, c = piece.run, piece.moulds.clearance + piece.run.grown(piece.moulds)
    rooms = []
    top = max(float(p.core.sections[:, 1, 1].max()) for p in run.parts)
    for p in run.parts:
        sections = p.core.sections + [[-c, c], [0.0, 0.0]]
        sections[:, 1] = p.whole[0], top + 1
        rooms.append(Bar(p.core.x.copy(), sections))
    _widen(rooms, c)
    ports = [port for p in run.parts for port in p.ports]
    does = "holds the layers while they are bonded; guides for the tubes"
    bounds = piece.bounds(solids.lowest(rooms) - piece.moulds.floor, top)
    return _Form(named("jig"), does, lambda: solids.trough(rooms, piece, top, ports), *bounds, (frame,))


def _assembly(large, found, moulds):
    """Troughs in which runs of different planes are joined end to end, in the body's axes."""
    c = moulds.clearance + max(run.grown(moulds) for run in found)
    row = placed(large.segments, castable=True)
    top = max(float(part.core.sections[:, 1, 1].max()) for part in row)
    rooms = []
    for part in row:
        # chambers that point sideways reach beyond the core
        all_of_it = np.concatenate([part.core.sections, [whole_section(part.segment)]])
        (y0, y1), (z0, _) = ([section.min(), section.max()] for section in np.moveaxis(all_of_it, 1, 0))
        section = [[y0 - c, y1 + c], [z0, top + 1]]
        rooms.append(Bar(np.array([part.start, part.stop]), np.array([section] * 2)))
    _widen(rooms, c)
    joined = Run(tuple(p for run in found for p in run.parts), (0.0,), 0, 0)
    half = max(float(np.abs(room.sections[:, 0]).max()) for room in rooms) - c
    pieces = [MouldPiece(joined, p.start, p.stop, moulds, half) for p in _pieces(joined, moulds)]
    for i, piece in enumerate(pieces, start=1):
        name = "assembly-jig" + f"-{i}" * (len(pieces) > 1)
        does = "holds the cast runs while they are joined end to end"
        bounds = piece.bounds(solids.lowest(rooms) - moulds.floor, top)
        build = lambda piece=piece: solids.trough(rooms, piece, top, [])  # noqa: E731
        yield _Form(name, does, build, *bounds, (np.eye(4),))


def _widen(rooms, clearance):
    """Rooms in a row, the first and the last as much longer."""
    rooms[0].x[0] -= clearance
    rooms[-1].x[-1] += clearance


def _pin(moulds, count):
    size, d = moulds.plate + solids.DEPTH - 0.5, moulds.dowel
    build = lambda: solids.cylinder((0, 0, 0), (0, 0, size), d)[1]  # noqa: E731
    low, whole = np.array([-d / 2, -d / 2, 0]), np.array([d, d, size])
    return _Form("dowel", "aligns, or take steel pins", build, low, whole, (np.eye(4),), count=count)


def _refuse_larger(form, moulds):
    bed = moulds.bed_length, moulds.bed_width, moulds.bed_height
    for key, needed, there in zip(("length", "width", "height"), form.size, bed):
        if needed > there + 1e-6:
            less = " or a smaller flange_mm" if key == "width" else ""
            raise InputError(
                f"bed_{key}_mm = {there:g}: '{form.name}' needs {needed:.1f} mm: take a larger bed{less}"
            )
