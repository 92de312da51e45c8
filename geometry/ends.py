"""Segments as they stand in a body: how chambers' lean fades in their passive ends, and how core and channel
of one go over to those of the next.

From its outermost chamber towards its end a segment's planes lean less and less, down to a flat one. Where
the segment is joined to another, the sections of core and channel go over to those of the joint beyond that
plane, over half the end margin. A channel that is closed there ends at a plane that still leans. Grids, CAD
and moulds describe this one body.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneunet.geometry.grids.planes import SNAP, lean
from pneunet.geometry.parameters import TWISTING, Segment
from pneunet.geometry.sections import channel_section, core_section, rotation

#: mm: sections that differ by less are one
_SAME = 1e-9


@dataclass(frozen=True)
class End:
    """A passive end, in distances (mm) on the axis from the segment's own end: up to `flat` all planes are
    flat and the levels move to the neighbour's, up to `wall` the lean grows to the outermost chamber's; up to
    `solid` there is no channel, 0 where it runs on into the neighbour."""

    flat: float
    wall: float
    solid: float

    @classmethod
    def of(cls, segment: Segment, joint: bool, closed: bool) -> "End":
        """That of a segment which ends at a joint or freely, its channel closed or not."""
        s = segment
        flat = s.end_margin / 2 if joint else 0.0
        solid = s.end_wall if closed else 0.0
        if not s.sides:
            return cls(flat, flat, solid)
        if joint and closed and abs(solid - flat) < SNAP:
            flat = solid - SNAP
        return cls(flat, s.end_length, solid)

    @property
    def planes(self) -> list[float]:
        """Distances at which planes must stand."""
        return [0.0, self.flat, self.wall, self.solid]

    def slant(self, distance: np.ndarray) -> np.ndarray:
        """How much of the chambers' lean planes have, 0 to 1."""
        if self.wall == self.flat:
            return np.zeros_like(distance)
        return np.clip((distance - self.flat) / (self.wall - self.flat), 0, 1)

    def taper(self, distance: np.ndarray) -> np.ndarray:
        """How far levels have moved to those of the joint, 0 to 1."""
        return np.clip(1 - distance / self.flat, 0, 1) if self.flat else np.zeros_like(distance)


def joined(own: np.ndarray, end: End, other: np.ndarray, other_end: End) -> np.ndarray:
    """Levels at a joint from those of both sides: the longer taper keeps more of its own, which keeps the
    volume of the step."""
    return (own * end.flat + other * other_end.flat) / (end.flat + other_end.flat)


@dataclass(frozen=True)
class Bar:
    """Rectangular sections (n, 2, 2), lowest and highest y and z in mm, at x (n,), rising; between them they
    go over linearly, so that all its faces are planes."""

    x: np.ndarray
    sections: np.ndarray

    def at(self, x: float) -> np.ndarray:
        """(2, 2) the section there."""
        rows = self.sections.reshape(-1, 4).T
        return np.array([np.interp(x, self.x, row) for row in rows]).reshape(2, 2)

    def within(self, low: float, high: float) -> "Bar":
        """What lies between two x."""
        x = np.concatenate([[low], self.x[(self.x > low + _SAME) & (self.x < high - _SAME)], [high]])
        return Bar(x, np.array([self.at(each) for each in x]))

    def cut_at(self, *heights: float) -> "Bar":
        """With further sections where its bottom or its top crosses one of these z."""
        x = [self.x]
        for edge in self.sections[:, 1].T:
            for height in heights:
                above = edge - height
                i = np.flatnonzero(above[:-1] * above[1:] < 0)
                share = above[i] / (above[i] - above[i + 1])
                x.append(self.x[i] + share * (self.x[i + 1] - self.x[i]))
        places = np.unique(np.concatenate(x))
        return Bar(places, np.array([self.at(each) for each in places]))

    def volume(self, low: float = -np.inf, high: float = np.inf) -> float:
        """mm3 of it between two z."""
        cut = self.cut_at(low, high)
        middles = (cut.sections[1:] + cut.sections[:-1]) / 2
        ends, mid = (
            np.ptp(s[:, 0], axis=1) * np.maximum(np.ptp(np.clip(s[:, 1], low, high), axis=1), 0)
            for s in (cut.sections, middles)
        )
        # a quadratic between sections, which Simpson's rule integrates exactly
        return float(np.diff(cut.x) @ (ends[1:] + ends[:-1] + 4 * mid) / 6)

    def turned(self, turn: np.ndarray) -> "Bar":
        """By a rotation (3, 3) about x by a multiple of 90 degrees."""
        return Bar(self.x, np.sort(turn[1:, 1:] @ self.sections, axis=2))


@dataclass(frozen=True)
class PlacedSegment:
    """A segment in a body, from x = start (mm) on, its core, its channel, up to where that ends on the axis,
    and its bottom layer. slants: how much of the chambers' lean the channel's ends have; 0 where it runs
    on."""

    segment: Segment
    start: float
    ends: tuple[End, End]
    core: Bar
    channel: Bar
    layer: Bar | None
    slants: tuple[float, float]

    @property
    def stop(self) -> float:
        return self.start + self.segment.length

    @property
    def positions(self) -> np.ndarray:
        """x of the chambers' centres, (chambers,)."""
        return self.start + self.segment.chamber_positions

    def lean(self, places: np.ndarray) -> np.ndarray:
        """(n,) mm by which the chambers' planes lean along x at y, z (n, 2) of the body's axes."""
        return lean(self.segment, *(places @ rotation(self.segment)[1:, 1:]).T)


def ends_of(segments: Sequence[Segment]) -> list[tuple[End, End]]:
    """The two ends of each."""
    groups = [s.group for s in segments]
    closed = [True, *(a != b for a, b in zip(groups, groups[1:])), True]
    return [
        (End.of(s, i > 0, closed[i]), End.of(s, i + 1 < len(segments), closed[i + 1]))
        for i, s in enumerate(segments)
    ]


def placed(segments: Sequence[Segment], castable: bool = False) -> list[PlacedSegment]:
    """Segments in a row from x = 0 on. castable: channels of twisting ones end upright, at the mean of the
    saddle that their lean makes between the floors, which no core could be pulled out of."""
    ends, out, start = ends_of(segments), [], 0.0
    for i, s in enumerate(segments):

        def bar(section, i=i, s=s, start=start):
            own, stop = section(s), start + s.length
            x, sections = [start, stop], [own, own]
            for side, j in enumerate((i - 1, i + 1)):
                if not 0 <= j < len(segments):
                    continue
                end = ends[i][side]
                joint = joined(own, end, section(segments[j]), ends[j][1 - side])
                if np.abs(joint - own).max() > _SAME:
                    x.append(stop - end.flat if side else start + end.flat)
                    sections.append(own)
                    sections[side] = joint
            order = np.argsort(x, kind="stable")
            return Bar(np.array(x)[order], np.array(sections)[order])

        core, channel = bar(core_section), bar(channel_section)
        first, last = ends[i]
        open_ = channel.within(start + first.solid, start + s.length - last.solid)
        slants = [0.0, 0.0] if castable and s.kind == TWISTING else [_slant(end) for end in ends[i]]
        layer = _layer(s, core, channel)
        out.append(PlacedSegment(s, start, ends[i], core, open_, layer, (slants[0], slants[1])))
        start += s.length
    return out


def _slant(end):
    return float(end.slant(np.array(end.solid))) if end.solid else 0.0


def _layer(s, core, channel):
    """The bottom layer: in tapers it keeps its share of what lies below the channel."""
    if not s.layer_thickness:
        return None
    x = np.unique(np.concatenate([core.x, channel.x]))
    core, channel = (
        Bar(x, np.array([bar.at(each) for each in x])).turned(rotation(s).T) for bar in (core, channel)
    )
    sections = core.sections.copy()
    bottom, share = core.sections[:, 1, 0], s.layer_thickness / s.base_thickness
    sections[:, 1, 1] = bottom + share * (channel.sections[:, 1, 0] - bottom)
    return Bar(x, sections).turned(rotation(s))
