"""Planes of a segment that all but meet made one, for grids and for the CAD that describes the same body."""

from dataclasses import replace

from pneunet.geometry.parameters import TWISTING, Segment

#: mm: planes of different parts of a body that lie closer together than this become one
SNAP = 0.1
#: mm: a chamber rises above the core at least by this
LOWEST_RISE = 0.05
_SAME = 1e-9


def snapped(segment: Segment, lowest: float = SNAP / 2) -> Segment:
    """The segment whose planes are one or `SNAP` apart, but for the walls and cavities that the dimensions
    ask for themselves.

    A cavity's floor moves to the channel's floor or ceiling, a channel as wide as the cavity is nearly
    becomes as wide, a cavity's ceiling moves to the top of the channel or of the core. A twisting segment's
    floors that are closer to the axis than half of SNAP move to `lowest`: a grid needs some room between
    them, a mould none. Most segments stay as they are.
    """
    s = segment
    if not s.sides:
        return s
    half = s.channel_height / 2
    floor = next((to for to in (half, -half) if abs(s.cavity_floor - to) < SNAP), s.cavity_floor)
    if s.kind == TWISTING:
        floor = lowest if s.cavity_floor < SNAP / 2 else s.cavity_floor
        floor = half if half - s.cavity_floor < SNAP else floor
    s = _with_floor(s, floor)
    if 0 < s.cavity_width - s.channel_width < 2 * SNAP:
        s = replace(s, channel_width=s.cavity_width)
    for height in (half, s.core_top):
        if 0 < abs(s.cavity_top - height) < SNAP and height > s.cavity_floor:
            s = replace(s, chamber_height=height - s.cavity_floor)
    rise = s.chamber_top - s.core_top
    return replace(s, top_wall=s.top_wall + LOWEST_RISE - rise) if rise < LOWEST_RISE - _SAME else s


def _with_floor(s, floor):
    """The floor moved, the ceiling where it was unless the cavity would be too low."""
    if floor == s.cavity_floor:
        return s
    height = s.cavity_top - floor
    return replace(s, cavity_floor=floor, chamber_height=s.chamber_height if height < SNAP else height)
