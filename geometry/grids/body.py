"""The grid of a manipulator: its segments' cells in a row, on one set of indices.

Between its outermost chambers a segment is copies of its cell's grid. In its passive ends the lean fades to a
flat plane, x = xi + t (X - xi) + (1 - t) s(z) cot(angle) y; beyond it, over half the end margin, the core's
planes move to those of the neighbour. A grid whose lean and levels changed together could turn inside out;
one after the other they cannot. The index of the core's and of the channel's faces is one for all segments,
so that they fit together whatever their dimensions; planes between them, and the chambers beyond, are each
segment's own.
"""

from dataclasses import dataclass

import numpy as np

from pneunet.geometry import tags
from pneunet.geometry.ends import End, ends_of, joined
from pneunet.geometry.grids.cell import contents
from pneunet.geometry.grids.planes import Planes, along, lean, sideways, snapped, upright
from pneunet.geometry.grids.tensor import AIR_OF_GROUP, CHANNEL_AIR, EMPTY, TensorGrid
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.geometry.sections import rotation


def body_grid(manipulator: Manipulator, size: float) -> TensorGrid:
    """The body, elements in its active parts at most `size` mm along x, y and z."""
    segments = [snapped(s) for s in manipulator.segments]
    parts = [
        _Part(tags.BODY + i, start, _Section(s, size), ends)
        for i, (s, start, ends) in enumerate(zip(segments, manipulator.starts, ends_of(segments)))
    ]
    counts = np.max([part.section.counts for part in parts], axis=0)
    for part in parts:
        part.section.divide(counts)
    layers, contents_ = [], []
    for before, part, after in zip([None, *parts[:-1]], parts, [*parts[1:], None]):
        points, kinds = part.grid(size, before, after)
        layers.append(points if after is None else points[:-1])
        contents_.append(kinds)
    return TensorGrid(
        np.concatenate(layers), np.concatenate(contents_), {(0, -1): tags.BASE, (0, 1): tags.TIP}
    )


class _Axis:
    """Planes across one of the body's directions in five stretches: below the core, in it below the channel,
    beside the channel, above it, and above the core. faces: of the core, channel, channel and core."""

    def __init__(self, planes: Planes, faces: list[float]):
        self._planes, self._faces = planes, faces
        marks = [min(planes.places[0], faces[0]), *faces, max(planes.places[-1], faces[-1])]
        self._stretches = [planes.within(a, b) for a, b in zip(marks, marks[1:])]

    @property
    def reversed(self) -> "_Axis":
        planes = Planes(-self._planes.places[::-1], self._planes.sharp[::-1])
        return _Axis(planes, [-face for face in self._faces[::-1]])

    def counts(self, size: float) -> np.ndarray:
        """(5,) elements that the stretches need."""
        return np.array([stretch.count(size) for stretch in self._stretches])

    def spread(self, counts: np.ndarray, size: float) -> np.ndarray:
        """(sum of counts + 1,) mm. Beyond the core a segment needs no more than its own; what is left is
        empty."""
        low, *core, high = self._stretches
        below, above = (stretch.spread(stretch.count(size)) for stretch in (low, high))
        rest = counts[0] + 1 - len(below), counts[4] + 1 - len(above)
        return np.concatenate(
            [
                below[0] - np.arange(rest[0], 0, -1),
                below[:-1],
                *(stretch.spread(count)[:-1] for stretch, count in zip(core, counts[1:4])),
                above,
                above[-1] + np.arange(1, rest[1] + 1),
            ]
        )


class _Section:
    """A segment's cross-section: levels (ny,), (nz,) across the body's y and z; lean (ny, nz) of their
    crossings."""

    def __init__(self, segment: Segment, size: float):
        self.segment, self._size, s = segment, size, segment
        half = np.array([s.width, s.channel_width]) / 2
        own = (
            _Axis(sideways(s), [-half[0], -half[1], half[1], half[0]]),
            _Axis(upright(s, size), [s.core_bottom, -s.channel_height / 2, s.channel_height / 2, s.core_top]),
        )
        self._axes = []
        for row in np.rint(rotation(s)[1:, 1:]).astype(int):
            axis = own[np.flatnonzero(row)[0]]
            self._axes.append(axis if row.sum() > 0 else axis.reversed)
        self.counts = np.array([axis.counts(size) for axis in self._axes])

    def divide(self, counts: np.ndarray) -> None:
        """Take these counts (2, 5) in the stretches across y and z."""
        self.levels = [axis.spread(count, self._size) for axis, count in zip(self._axes, counts)]
        #: index ranges of the core's planes
        self.core = [slice(count[0], count[:4].sum() + 1) for count in counts]
        self.lean = lean(self.segment, *self._own(self.levels))
        self.middles = self._own([(a[1:] + a[:-1]) / 2 for a in self.levels])

    def _own(self, levels):
        """(2, ny, nz): the crossings of planes across the body's y and z, in the segment's own axes."""
        return np.einsum("ji,jab->iab", rotation(self.segment)[1:, 1:], np.meshgrid(*levels, indexing="ij"))


@dataclass(frozen=True)
class _Part:
    """One segment of a body: its volume's tag, where it starts (mm), and its ends."""

    tag: int
    start: float
    section: _Section
    ends: tuple[End, ...]

    def _along(self, size):
        """(x (n,) of the planes from the segment's start, middles (n - 1,) from the nearest chamber's)."""
        s, (first, last) = self.section.segment, self.ends
        left, right = ([*first.planes], [s.length - d for d in last.planes])
        if not s.sides:
            x = Planes.of([], left + right).divided(size)
            return x, np.full(len(x) - 1, np.inf)
        half = along(s).divided(size)
        pitch = np.concatenate([-half[:0:-1], half])
        x = s.chamber_positions[:, None] + pitch[:-1]
        walls = s.end_length - 1e-9, s.length - s.end_length + 1e-9
        x = np.unique(x.ravel().round(12))
        x = x[(x > walls[0]) & (x < walls[1])]
        ends = [Planes.of([], marks).divided(size) for marks in (left, right)]
        x = np.concatenate([ends[0][:-1], x, ends[1][1:]])
        middle = (x[1:] + x[:-1]) / 2
        offset = middle - s.chamber_positions[np.abs(middle[:, None] - s.chamber_positions).argmin(axis=1)]
        return x, np.where((middle > walls[0]) & (middle < walls[1]), offset, np.inf)

    def grid(self, size, before, after):
        """(points (nx + 1, ny, nz, 3), kinds (nx, ny, nz)); before, after: the neighbours' _Parts or None."""
        section, s = self.section, self.section.segment
        x, xi = self._along(size)
        distances = (x, s.length - x)
        slant = np.minimum(*(end.slant(d) for end, d in zip(self.ends, distances)))
        points = np.empty((len(x), *section.lean.shape, 3))
        points[..., 0] = self.start + x[:, None, None] + slant[:, None, None] * section.lean
        for axis, levels in enumerate(section.levels):
            places = np.tile(levels, (len(x), 1))
            for side, (end, d, other) in enumerate(zip(self.ends, distances, (before, after))):
                if other is not None:
                    core = section.core[axis]
                    joint = self._joint(other, axis, end, other.ends[1 - side])
                    places[:, core] += end.taper(d)[:, None] * (joint - levels[core])
            points[..., 1 + axis] = places[:, :, None] if axis == 0 else places[:, None, :]
        y, z = section.middles
        number = self.tag - tags.BODY
        kinds = contents(s, xi[:, None, None], y[None], z[None], self.tag, tags.LAYER + number)
        middles = [(d[1:] + d[:-1]) / 2 for d in distances]
        solid = np.logical_or(*(m < end.solid for m, end in zip(middles, self.ends)))
        kinds[solid[:, None, None] & (kinds == CHANNEL_AIR)] = self.tag
        kinds[(kinds > EMPTY) & (kinds < tags.BODY)] += AIR_OF_GROUP * (s.group - 1)
        return points, kinds

    def _joint(self, other, axis, own_end, other_end):
        """Levels of the core at the joint."""
        (a, first), (b, second) = (
            (part.section.levels[axis][part.section.core[axis]], end)
            for part, end in ((self, own_end), (other, other_end))
        )
        return joined(a, first, b, second)
