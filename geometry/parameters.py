"""The parameters of segments and manipulators, validated; `Manipulator` is what every package builds or
predicts.

Body axes: x along the undeformed centreline, y width, z height, z = 0 on the channel axis; mm, degrees.
Chambers are upright boxes whose long side makes `angle` with x in plan. A one-sided segment has them above a
core; a twisting one has a second set, the first turned by half a turn about x, so that twist adds up and
bending cancels; a passive one has none. All this is in a segment's own axes, which `roll` turns about x.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError, located
from pneunet.base.materials.laws import BODY_LIMITS, Hyperelastic, NeoHookean
from pneunet.base.quantities import Checked, quantities, quantity
from pneunet.geometry.fillets import check_fillet
from pneunet.geometry.sections import joint_is_covered
from pneunet.geometry.tags import MOST_GROUPS, MOST_SEGMENTS

ONE_SIDED, TWISTING, PASSIVE = "one-sided", "twisting", "passive"
#: with chambers: what a unit cell can be of, and a law can learn
KINDS = (ONE_SIDED, TWISTING)
SEGMENT_KINDS = (*KINDS, PASSIVE)
#: degrees about x; sections are boxes, which other rolls do not fit together
ROLLS = (0, 90, 180, 270)
#: of a passive segment: what stands for "no chambers"
PLAIN: dict[str, Any] = {"angle": 90.0, "chambers": 0}
NO_CHAMBERS = "a passive segment has no chambers: leave this out"
#: keys of Segment in files that say what chambers are like
OF_CHAMBERS = (
    *("angle_deg", "chambers", "chamber_height_mm", "cavity_thickness_mm", "wall_mm", "gap_mm"),
    *("top_wall_mm", "side_wall_mm", "cavity_floor_mm", "fillet_mm"),
)
#: and what the core is like
OF_THE_CORE = (
    *("width_mm", "base_thickness_mm", "roof_mm", "channel_width_mm", "channel_height_mm", "end_margin_mm"),
    *("layer_thickness_mm", "roll_deg", "pressure_group"),
)
_size = partial(quantity, "mm", above=0, low=0.05, high=500, hint="not a castable size; is it in metres?")


@dataclass(frozen=True)
class Segment(Checked):
    """One run of equal chambers, or a passive piece of core. "normal" = across the chamber."""

    kind: str = quantity(
        None,
        note="'one-sided' (bends, helical away from 90 deg), 'twisting' or 'passive' (core alone)",
        choices=SEGMENT_KINDS,
    )
    angle: float = quantity(
        "deg", note="between the chambers' long side and the x axis; 90 = across the beam", low=30, high=150
    )
    chambers: int = quantity(None, note="whole chambers (pairs, for a twisting segment)", low=0)
    width: float = _size(12.0, "body width")
    chamber_height: float = _size(4.0, "cavity, floor to ceiling")
    cavity_thickness: float = _size(2.0, "cavity, normal")
    wall: float = _size(1.0, "between cavity and gap, normal")
    gap: float = _size(1.0, "between neighbouring chambers, normal")
    top_wall: float = _size(1.0, "above the cavity")
    side_wall: float = _size(1.0, "at both ends of the cavity's long side, along y")
    base_thickness: float = _size(2.0, "below the channel (one-sided, passive)")
    roof: float = _size(1.0, "core above the channel, under the gaps")
    channel_width: float = _size(4.0, "air channel, y")
    channel_height: float = _size(2.0, "air channel, z")
    cavity_floor: float = quantity("mm", 1.0, "z of the cavity's floor; at most half the channel height")
    end_margin: float = _size(
        2.0,
        "bare core beyond a chamber's outermost corner, each end; passive: what closes its channel's end",
    )
    layer_thickness: float = quantity(
        "mm", 0.0, "stiff layer at the bottom of the base (one-sided, passive); 0 = none"
    )
    fillet: float = quantity("mm", 0.0, "radius of chambers' edges; in CAD and tetrahedra", low=0)
    plain_length: float = quantity("mm", 0.0, "of a passive segment", low=0, high=2000)
    roll: int = quantity(
        "deg",
        0,
        "turn of the segment about x, right-handed: 180 = chambers below, 90 = chambers towards -y",
        choices=ROLLS,
    )
    group: int = quantity(
        None,
        1,
        "segments with one number share a cavity, so a pressure",
        key="pressure_group",
        low=1,
        high=MOST_GROUPS,
    )
    material: Hyperelastic = NeoHookean(mu=0.317)
    layer_material: Hyperelastic | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        with located("material"):
            self.material.check_limits(*BODY_LIMITS)
        self._check_layer()
        if self.kind == PASSIVE:
            self._check_passive()
        else:
            self._check_chambers()
            check_fillet(self)
        if self.length > 2000:
            raise InputError(
                f"chambers = {self.chambers}: the segment would be {self.length:.0f} mm long (at most 2000)"
            )

    def _check_passive(self):
        of_chambers = [
            key
            for key, field in quantities(Segment).items()
            if key in OF_CHAMBERS and getattr(self, field.name) != PLAIN.get(field.name, field.default)
        ]
        if of_chambers:
            raise InputError(f"{', '.join(of_chambers)}: {NO_CHAMBERS}")
        if self.plain_length <= self.end_margin:
            raise InputError(
                f"plain_length_mm = {self.plain_length:g}: give the length of the passive segment, more than"
                f" end_margin_mm = {self.end_margin:g}"
            )
        if self.end_margin < 0.5:
            raise InputError(
                f"end_margin_mm = {self.end_margin:g} must be at least 0.5: it closes the channel's end"
            )
        if self.channel_width >= self.width:
            raise InputError(
                f"channel_width_mm = {self.channel_width:g} is not less than width_mm = {self.width:g}"
            )

    def _check_chambers(self):
        if self.chambers < 1:
            raise InputError(f"chambers = {self.chambers} must be at least 1")
        if self.plain_length:
            raise InputError(
                f"plain_length_mm = {self.plain_length:g}: only a passive segment has it; the chambers give"
                " the length of others"
            )
        if 2 * self.side_wall >= self.width:
            raise InputError(
                f"side_wall_mm = {self.side_wall:g}: two side walls do not fit into width_mm = {self.width:g}"
            )
        if self.channel_width > self.cavity_width:
            raise InputError(
                f"channel_width_mm = {self.channel_width:g} is wider than the cavity ({self.cavity_width:g}"
                " mm = width - 2 side walls)"
            )
        lowest = 0.0 if self.kind == TWISTING else -self.channel_height / 2
        if not lowest <= self.cavity_floor <= self.channel_height / 2:
            raise InputError(
                f"cavity_floor_mm = {self.cavity_floor:g} must lie in {lowest:g}..{self.channel_height / 2:g}"
                " (half the channel height), else the cavity does not open into the channel"
            )
        if self.chamber_top <= self.core_top:
            raise InputError(
                f"chamber_height_mm = {self.chamber_height:g}: the chamber (top at z = {self.chamber_top:g}"
                f" mm) does not rise above the core (z = {self.core_top:g} mm)"
            )
        if self.end_wall < 0.5 - 1e-9:
            needed = np.ceil(100 * (self.end_margin + 0.5 - self.end_wall) - 1e-6) / 100
            raise InputError(
                f"end_margin_mm = {self.end_margin:g} leaves {self.end_wall:.2g} mm to close the channel's"
                f" end: at least {needed:g} mm is needed with gap_mm = {self.gap:g}"
            )

    def _check_layer(self):
        if not self.layer_thickness:
            if self.layer_material is not None:
                raise InputError(
                    "layer_thickness_mm is missing or 0, but there is a layer material: give the layer's"
                    " thickness"
                )
            return
        if self.kind == TWISTING:
            raise InputError(
                f"layer_thickness_mm = {self.layer_thickness:g}: only a one-sided segment has a bottom layer"
            )
        if not 0.05 <= self.layer_thickness <= self.base_thickness - 0.05:
            raise InputError(
                f"layer_thickness_mm = {self.layer_thickness:g} must lie in"
                f" 0.05..{self.base_thickness - 0.05:g}: the layer is part of base_thickness_mm ="
                f" {self.base_thickness:g}"
            )
        if self.layer_material is None:
            raise InputError(
                f"layer_thickness_mm = {self.layer_thickness:g} needs a material: write [layer_material] or"
                " [segment.layer_material]"
            )

    @property
    def key(self) -> "Segment":
        """Hashable identity of the cell: everything that the strains of the middle of a long segment depend
        on, in the segment's own axes."""
        if self.kind == PASSIVE:
            return replace(self, plain_length=2.0, end_margin=1.0, roll=0, group=1)
        return replace(
            self, chambers=1, end_margin=1.0 + self.gap / self.sin / 2, roll=0, group=1, fillet=0.0
        )

    @property
    def mirrored(self) -> "Segment":
        """The mirror image: 180 - angle, opposite handedness, opposite roll."""
        return replace(self, angle=180.0 - self.angle, roll=-self.roll % 360)

    def plain(self, length: float) -> "Segment":
        """The passive segment of this one's core, `length` mm long."""
        core = {f.name: getattr(self, f.name) for key, f in quantities(Segment).items() if key in OF_THE_CORE}
        if self.kind == TWISTING:
            core["base_thickness"] = self.roof
        layer = self.layer_material
        return Segment(
            PASSIVE, **PLAIN, **core, material=self.material, layer_material=layer, plain_length=length
        )

    @cached_property
    def sin(self) -> float:
        return float(np.sin(np.radians(self.angle)))

    @cached_property
    def cot(self) -> float:
        """cot(angle); 0 exactly at 90 degrees, odd about it."""
        return float(np.tan(np.radians(90.0 - self.angle)))

    @property
    def chamber_thickness(self) -> float:
        """Outer thickness of a chamber, normal, mm."""
        return self.cavity_thickness + 2 * self.wall

    @property
    def pitch(self) -> float:
        """Axial distance of neighbouring chambers, mm."""
        return (self.chamber_thickness + self.gap) / self.sin

    @property
    def cavity_width(self) -> float:
        return self.width - 2 * self.side_wall

    @property
    def core_top(self) -> float:
        return self.channel_height / 2 + self.roof

    @property
    def core_bottom(self) -> float:
        return -self.core_top if self.kind == TWISTING else -self.channel_height / 2 - self.base_thickness

    @property
    def layer_top(self) -> float:
        """z (mm) up to which the bottom layer's material reaches; core_bottom when there is none."""
        return self.core_bottom + self.layer_thickness

    @property
    def cavity_top(self) -> float:
        return self.cavity_floor + self.chamber_height

    @property
    def chamber_top(self) -> float:
        """Highest point of the body, z in mm."""
        return self.cavity_top + self.top_wall if self.sides else self.core_top

    @property
    def chamber_bottom(self) -> float:
        """Lowest point of the body, z in mm."""
        return -self.chamber_top if self.kind == TWISTING else self.core_bottom

    @property
    def sides(self) -> tuple[int, ...]:
        """+1 for the chambers above the core, -1 for the set turned by half a turn about x."""
        return {ONE_SIDED: (1,), TWISTING: (1, -1), PASSIVE: ()}[self.kind]

    @property
    def end_length(self) -> float:
        """Passive length at each end, mm: wedge of the slanted chamber and the bare core beyond it."""
        if self.kind == PASSIVE:
            return self.plain_length / 2
        return self.width / 2 * abs(self.cot) + self.end_margin

    @property
    def end_wall(self) -> float:
        """What closes the channel at the end of its cavity, mm: the channel runs half a gap beyond the
        outermost chamber."""
        return self.end_margin if self.kind == PASSIVE else self.end_length - self.gap / self.sin / 2

    @property
    def active_length(self) -> float:
        """(N-1) pitches and one chamber, mm."""
        if self.kind == PASSIVE:
            return 0.0
        return (self.chambers - 1) * self.pitch + self.chamber_thickness / self.sin

    @property
    def length(self) -> float:
        return self.active_length + 2 * self.end_length

    @property
    def chamber_positions(self) -> np.ndarray:
        """Centres of the chambers on the axis, x in mm from the segment's start, shape (chambers,)."""
        first = self.end_length + self.chamber_thickness / self.sin / 2
        return first + self.pitch * np.arange(self.chambers)


@dataclass(frozen=True)
class Manipulator:
    """Segments in a row, joined on the channel axis. Those of one pressure group share one cavity; where the
    next group begins, what closes the channels of both ends is the bulkhead between them."""

    segments: tuple[Segment, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "segments", tuple(self.segments))
        if not 1 <= len(self.segments) <= MOST_SEGMENTS:
            raise InputError(f"segment: {len(self.segments)} [[segment]]: 1 to {MOST_SEGMENTS} make a body")
        for i, (a, b) in enumerate(zip(self.segments, self.segments[1:]), start=1):
            if not joint_is_covered(a, b):
                raise InputError(
                    f"segment {i} and {i + 1}: the channel of one does not fit into the core of the other"
                    + (f" when they are rolled by {a.roll} and {b.roll} deg" if a.roll != b.roll else "")
                    + ": make channel_width_mm and channel_height_mm smaller, or the core thicker"
                    " (base_thickness_mm, roof_mm)"
                )
        self._check_groups()

    def _check_groups(self):
        before = 0
        for i, segment in enumerate(self.segments, start=1):
            if segment.group not in (max(before, 1), before + 1):
                raise InputError(
                    f"segment {i}: pressure_group = {segment.group}: groups are neighbours, numbered in order"
                    f" from 1: write {f'{before} or ' * bool(before)}{before + 1}"
                )
            before = segment.group
        for number, group in enumerate(self.groups, start=1):
            if not any(self.segments[i].chambers for i in group):
                raise InputError(f"pressure_group = {number}: none of its segments has chambers")

    @property
    def length(self) -> float:
        return sum(s.length for s in self.segments)

    @property
    def starts(self) -> np.ndarray:
        """Undeformed arc length at which each segment begins, mm, shape (segments,)."""
        return np.concatenate([[0.0], np.cumsum([s.length for s in self.segments])[:-1]])

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Indices of the segments of each pressure group: those of one cavity."""
        return tuple(
            tuple(i for i, s in enumerate(self.segments) if s.group == number)
            for number in range(1, self.segments[-1].group + 1)
        )

    @property
    def channels(self) -> np.ndarray:
        """x (mm) at which the channel of each group begins and ends, (groups, 2): half a gap beyond the first
        and the last chamber, so that every chamber has its whole cell; what remains of the passive ends
        closes it."""
        ends = self.starts + [s.length for s in self.segments]
        return np.array(
            [
                (
                    self.starts[group[0]] + self.segments[group[0]].end_wall,
                    ends[group[-1]] - self.segments[group[-1]].end_wall,
                )
                for group in self.groups
            ]
        )

    @property
    def ports(self) -> np.ndarray:
        """x (mm) of each group's port, (groups,): that of its first chamber. There the air's tube goes along
        the segment's y axis, from its -y side, into the channel."""
        first = [next(i for i in group if self.segments[i].chambers) for group in self.groups]
        return np.array([self.starts[i] + self.segments[i].chamber_positions[0] for i in first])

    def pressures(self, pressure: ArrayLike) -> np.ndarray:
        """(segments,) pressure of each segment from one for all or one for each group, in its unit;
        InputError for any other number of them."""
        pressure, n = np.asarray(pressure, float), len(self.groups)
        if pressure.shape not in ((), (1,), (n,)):
            count = "one" if n == 1 else f"one for all, or one for each of the {n} groups"
            raise InputError(f"pressure_kPa: give {count}, not {pressure.size}")
        return np.broadcast_to(pressure, n)[[s.group - 1 for s in self.segments]]

    @property
    def materials(self) -> tuple[Hyperelastic, ...]:
        """Every material of the body once, layers included."""
        return tuple(
            dict.fromkeys(m for s in self.segments for m in (s.material, s.layer_material) if m is not None)
        )

    @property
    def chambers(self) -> int:
        return sum(s.chambers for s in self.segments)

    @property
    def mirrored(self) -> "Manipulator":
        return Manipulator(tuple(s.mirrored for s in self.segments))
