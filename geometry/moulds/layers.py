"""What is cast in one go: runs of segments, and their layers between split planes.

A rigid core leaves a body along z if the void's sections only shrink along z. Chambers stand upright on the
channel, and are wider than it; their floor lies within the channel's height. So above a plane at the floor's
height the void shrinks upwards, and below it the channel alone is left: a body with chambers on one side
falls into two layers. With chambers on both sides there are two such planes, and between them a middle layer
whose section is the same at every height. A run is what shares these planes: neighbours whose chambers point
up or down in one frame, with floors at one height.

The frame of a run is the body's, turned about x by `turn` (0 or 90 degrees). There a segment is `up` if its
own z axis points up.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import Hyperelastic
from pneunet.geometry.ends import Bar, placed
from pneunet.geometry.moulds.parameters import Moulds
from pneunet.geometry.parameters import PASSIVE, TWISTING, Manipulator, Segment
from pneunet.geometry.sections import rotation
from pneunet.geometry.snapping import snapped

#: mm; floors at one height
SAME = 1e-9
#: half a turn about x
OVER = np.diag([1.0, -1.0, -1.0])
UPPER, MIDDLE, LOWER = "upper", "middle", "lower"


@dataclass(frozen=True)
class RunMember:
    """A segment in a run's frame, from x = start on: its core, channel and bottom layer; leans: dx / dy of
    the channel's ends; ports: [(x, side of y from which the tube comes)]. All mm."""

    segment: Segment
    start: float
    up: bool
    core: Bar
    channel: Bar
    layer: Bar | None
    leans: tuple[float, float]
    ports: tuple[tuple[float, int], ...] = ()

    @property
    def stop(self) -> float:
        return self.start + self.segment.length

    @property
    def sides(self) -> tuple[int, ...]:
        """+1 for chambers that point up here, -1 for those that point down."""
        return tuple(side if self.up else -side for side in self.segment.sides)

    @property
    def whole(self) -> tuple[float, float]:
        """Lowest and highest z of all."""
        s, z = self.segment, self.core.sections[:, 1]
        low, high = (s.chamber_bottom, s.chamber_top) if self.up else (-s.chamber_top, -s.chamber_bottom)
        return min(low, float(z.min())), max(high, float(z.max()))

    @property
    def positions(self) -> np.ndarray:
        """x of the chambers' centres, (chambers,)."""
        return self.start + self.segment.chamber_positions

    def turned(self) -> "RunMember":
        """The same, turned by half a turn about x."""
        return replace(
            self,
            up=not self.up,
            core=self.core.turned(OVER),
            channel=self.channel.turned(OVER),
            layer=self.layer and self.layer.turned(OVER),
            leans=(-self.leans[0], -self.leans[1]),
            ports=tuple((x, -side) for x, side in self.ports),
        )


@dataclass(frozen=True)
class Run:
    """Neighbouring segments that are cast together; planes: one or two z (mm) at which they are split;
    segments of the body from `first` (0 ..) on; turn (degrees about x) from the body's axes to the run's."""

    parts: tuple[RunMember, ...]
    planes: tuple[float, ...]
    first: int
    turn: int

    @property
    def start(self) -> float:
        return self.parts[0].start

    @property
    def stop(self) -> float:
        return self.parts[-1].stop

    @property
    def half_width(self) -> float:
        return max(float(np.abs(p.core.sections[:, 0]).max()) for p in self.parts)

    @property
    def turned(self) -> "Run":
        """The same, turned by half a turn about x: its lower layer is this one's upper."""
        parts = tuple(p.turned() for p in self.parts)
        return replace(self, parts=parts, planes=tuple(-z for z in self.planes[::-1]))

    @property
    def same_turned(self) -> bool:
        """Whether half a turn about x changes nothing, so that one mould makes the upper and the lower
        layer."""
        return abs(self.planes[0] + self.planes[-1]) < SAME and all(
            p.segment.kind in (TWISTING, PASSIVE)
            and all(
                np.allclose(bar.sections, bar.turned(OVER).sections, atol=SAME) for bar in (p.core, p.channel)
            )
            for p in self.parts
        )

    def grown(self, moulds: Moulds) -> float:
        """By how much (mm) draft widens the sides of its layers at most."""
        z = [min(p.whole[0] for p in self.parts), *self.planes, max(p.whole[1] for p in self.parts)]
        return moulds.slope_outside * float(np.diff(z).max())

    def depth(self, plane: float) -> float:
        """How far (mm) the channel's roof dips below a split plane where it goes over to a lower one. There
        the layer above reaches down as teeth, which close the grooves of the layer below."""
        return max(0.0, *(plane - float(p.channel.sections[:, 1, 1].min()) for p in self.parts))

    @cached_property
    def layers(self) -> tuple["Layer", ...]:
        """From the top down."""
        names = (UPPER, MIDDLE, LOWER) if len(self.planes) == 2 else (UPPER, LOWER)
        heights = [np.inf, *self.planes[::-1], -np.inf]
        return tuple(Layer(self, name, z0, z1) for name, z1, z0 in zip(names, heights, heights[1:]))

    def cuts(self, moulds: Moulds) -> list[float]:
        """x at which moulds of this run, flanges included, begin and end, and are cut to fit the bed: at
        joints of segments and between chambers."""
        ends = self.start - moulds.flange, self.stop + moulds.flange
        between = [(p.positions[1:] + p.positions[:-1]) / 2 for p in self.parts if p.segment.chambers]
        places = np.concatenate([[p.start for p in self.parts[1:]], *between])
        return cut(*ends, moulds.bed_length, places)


@dataclass(frozen=True)
class Layer:
    """What is cast between two heights (mm; infinite outside) of a run."""

    run: Run
    name: str
    z0: float
    z1: float

    @property
    def volumes(self) -> dict[Hyperelastic, float]:
        """{silicone: mm3}, no waste."""
        out: dict[Hyperelastic, float] = {}
        for part in self.run.parts:
            s = part.segment
            whole = body_volume(part, self.z0, self.z1)
            stiff = 0.0
            if part.layer:
                stiff = part.layer.volume(self.z0, self.z1)
                assert s.layer_material is not None
                out[s.layer_material] = out.get(s.layer_material, 0.0) + stiff
            out[s.material] = out.get(s.material, 0.0) + whole - stiff
        return {silicone: volume for silicone, volume in out.items() if volume > 1e-9}


def cut(start: float, stop: float, longest: float, places: np.ndarray) -> list[float]:
    """start, stop and between them x at which to cut into as few parts as may be, none longer than `longest`:
    about equal ones, at one of `places` where that can be."""
    out = [start]
    for left in range(int(np.ceil((stop - start) / longest - 1e-9)), 1, -1):
        wanted = out[-1] + (stop - out[-1]) / left
        low, high = max(stop - (left - 1) * longest, out[-1]), out[-1] + longest
        fit = places[(places >= low) & (places <= high) & (np.abs(places - wanted) < longest / 4)]
        out.append(float(fit[np.argmin(np.abs(fit - wanted))]) if len(fit) else wanted)
    return [*out, stop]


def runs(manipulator: Manipulator, split: float | None = None) -> tuple[Run, ...]:
    """The runs of a manipulator from its base to its tip; split: of one-sided runs, instead of their
    cavities' floor. InputError where that leaves an undercut."""
    kept: list[list[int]] = []
    for i, s in enumerate(manipulator.segments):
        if not (kept and _together([manipulator.segments[j] for j in kept[-1]], s)):
            kept.append([])
        kept[-1].append(i)
    row = placed([snapped(s, lowest=0.0) for s in manipulator.segments], castable=True)
    return tuple(_run(manipulator, row, indices, split) for indices in kept)


def _together(before, s):
    floors = {abs(b.cavity_floor) for b in (*before, s) if b.chambers}
    return (before[0].roll - s.roll) % 180 == 0 and (
        max(floors, default=0.0) - min(floors, default=0.0) < SAME
    )


def _run(manipulator, row, indices, split):
    turn = row[indices[0]].segment.roll % 180
    to_run = rotation(replace(row[indices[0]].segment, roll=turn)).T
    ports = manipulator.ports
    parts = []
    for i in indices:
        s, start = row[i].segment, row[i].start
        up = s.roll == turn
        mine = float(ports[s.group - 1])
        own = s.chambers and start <= mine < start + s.length
        core, channel = row[i].core.turned(to_run), row[i].channel.turned(to_run)
        layer = row[i].layer and row[i].layer.turned(to_run)
        first, last = (slant * s.cot * (1 if up else -1) for slant in row[i].slants)
        guides = ((mine, -1 if up else 1),) if own else ()
        parts.append(RunMember(s, start, up, core, channel, layer, (first, last), guides))
    planes = sorted({p.segment.cavity_floor * side for p in parts for side in p.sides}) or [0.0]
    if planes[-1] - planes[0] < SAME:
        planes = planes[:1]
    planes = [planes[0], planes[-1]] if len(planes) > 1 else planes
    if split is not None:
        planes = [_chosen(parts, planes, split)]
    return Run(tuple(parts), tuple(z + 0.0 for z in planes), indices[0], turn)


def _chosen(parts, planes, split):
    """The split plane that is asked for."""
    up = all(side > 0 for p in parts for side in p.sides)
    if len(planes) > 1 or not up and any(side > 0 for p in parts for side in p.sides):
        raise InputError(
            f"split_mm = {split:g}: a body with chambers on both sides is split at their floors: leave it out"
        )
    highest = min(p.segment.channel_height for p in parts) / 2
    low = planes[0] if up else -planes[0]
    if not low <= split <= highest:
        raise InputError(
            f"split_mm = {split:g}: must lie in {low:g}..{highest:g}, between the cavities' floor and the"
            " channel's top: elsewhere a cavity is undercut"
        )
    return split if up else -split


def body_volume(part: RunMember, z0: float = -np.inf, z1: float = np.inf) -> float:
    """mm3 of silicone of a segment between two heights of its run."""
    s, inside = part.segment, (z0, z1)
    volume = part.core.volume(z0, z1) - part.channel.volume(z0, z1)
    per_width = s.chambers / s.sin
    for side in part.sides:

        def span(low, high, side=side):
            return (low, high) if side > 0 else (-high, -low)

        volume += per_width * s.chamber_thickness * s.width * _common(span(s.core_top, s.chamber_top), inside)
        cavity = span(s.cavity_floor, s.cavity_top)
        volume -= per_width * s.cavity_thickness * s.cavity_width * _common(cavity, inside)
        shared = span(s.cavity_floor, s.channel_height / 2)
        volume += per_width * s.cavity_thickness * s.channel_width * _common(shared, inside)
    return float(volume)


def _common(a, b):
    """Length that two intervals share."""
    return max(min(a[1], b[1]) - max(a[0], b[0]), 0.0)
