"""The parameters of segments and manipulators, validated; `Manipulator` is what every package builds or
predicts.

Body axes: x along the undeformed centreline, y width, z height, z = 0 on the channel axis; mm, degrees.
Chambers are upright boxes whose long side makes `angle` with x in plan. A one-sided segment has them above a
core; a twisting one has a second set, the first turned by half a turn about x, so that twist adds up and
bending cancels.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.materials.laws import BODY_LIMITS, Hyperelastic, NeoHookean
from pneunet.base.quantities import Checked, quantity

ONE_SIDED, TWISTING = "one-sided", "twisting"
KINDS = (ONE_SIDED, TWISTING)
_size = partial(quantity, "mm", above=0, low=0.05, high=500, hint="not a castable size; is it in metres?")


@dataclass(frozen=True)
class Segment(Checked):
    """One run of equal chambers. "normal" = across the chamber."""

    kind: str = quantity(
        None, note="'one-sided' (bends, helical away from 90 deg) or 'twisting'", choices=KINDS
    )
    angle: float = quantity(
        "deg", note="between the chambers' long side and the x axis; 90 = across the beam", low=30, high=150
    )
    chambers: int = quantity(None, note="whole chambers (pairs, for a twisting segment)", low=1)
    width: float = _size(12.0, "body width")
    chamber_height: float = _size(4.0, "cavity, floor to ceiling")
    cavity_thickness: float = _size(2.0, "cavity, normal")
    wall: float = _size(1.0, "between cavity and gap, normal")
    gap: float = _size(1.0, "between neighbouring chambers, normal")
    top_wall: float = _size(1.0, "above the cavity")
    side_wall: float = _size(1.0, "at both ends of the cavity's long side, along y")
    base_thickness: float = _size(2.0, "below the channel (one-sided)")
    roof: float = _size(1.0, "core above the channel, under the gaps")
    channel_width: float = _size(4.0, "air channel, y")
    channel_height: float = _size(2.0, "air channel, z")
    cavity_floor: float = quantity("mm", 1.0, "z of the cavity's floor; at most half the channel height")
    end_margin: float = _size(2.0, "bare core beyond the outermost corner of a chamber, each end")
    layer_thickness: float = quantity(
        "mm", 0.0, "stiff layer at the bottom of the base (one-sided); 0 = none"
    )
    material: Hyperelastic = NeoHookean(mu=0.317)
    layer_material: Hyperelastic | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        with located("material"):
            self.material.check_limits(*BODY_LIMITS)
        self._check_layer()
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
        if self.length > 2000:
            raise InputError(
                f"chambers = {self.chambers}: the segment would be {self.length:.0f} mm long (at most 2000)"
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
        on."""
        return replace(self, chambers=1, end_margin=1.0 + self.gap / self.sin / 2)

    @property
    def mirrored(self) -> "Segment":
        """The mirror image: 180 - angle, opposite handedness."""
        return replace(self, angle=180.0 - self.angle)

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
        return self.cavity_top + self.top_wall

    @property
    def chamber_bottom(self) -> float:
        """Lowest point of the body, z in mm."""
        return -self.chamber_top if self.kind == TWISTING else self.core_bottom

    @property
    def sides(self) -> tuple[int, ...]:
        """+1 for the chambers above the core, -1 for the set turned by half a turn about x."""
        return (1, -1) if self.kind == TWISTING else (1,)

    @property
    def end_length(self) -> float:
        """Passive length at each end, mm: wedge of the slanted chamber and the bare core beyond it."""
        return self.width / 2 * abs(self.cot) + self.end_margin

    @property
    def end_wall(self) -> float:
        """What closes the channel at a free end, mm: the channel runs half a gap beyond the outermost
        chamber."""
        return self.end_length - self.gap / self.sin / 2

    @property
    def active_length(self) -> float:
        """(N-1) pitches and one chamber, mm."""
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
    """Segments in a row, joined on the channel axis, sharing one cavity."""

    segments: tuple[Segment, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "segments", tuple(self.segments))
        if not self.segments:
            raise InputError("segment: at least one [[segment]] is needed")
        for i, (a, b) in enumerate(zip(self.segments, self.segments[1:]), start=1):
            half_height, channel_width = (
                max(a.channel_height, b.channel_height) / 2,
                max(a.channel_width, b.channel_width),
            )
            covered = max(a.core_bottom, b.core_bottom) < -half_height and half_height < min(
                a.core_top, b.core_top
            )
            if not covered or min(a.width, b.width) <= channel_width:
                raise InputError(
                    f"segment {i} and {i + 1}: the channel of one does not fit into the core of the other"
                )

    @property
    def length(self) -> float:
        return sum(s.length for s in self.segments)

    @property
    def starts(self) -> np.ndarray:
        """Undeformed arc length at which each segment begins, mm, shape (segments,)."""
        return np.concatenate([[0.0], np.cumsum([s.length for s in self.segments])[:-1]])

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
