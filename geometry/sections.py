"""Rectangles of a segment's cross-section in the body's axes, where its roll has turned them, and plans of
its chambers."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pneunet.geometry.parameters import Segment

#: roll in degrees -> (cos, sin), exactly
_TURNS = {0: (1.0, 0.0), 90: (0.0, 1.0), 180: (-1.0, 0.0), 270: (0.0, -1.0)}


def rotation(segment: "Segment") -> np.ndarray:
    """(3, 3) that takes the segment's own axes to the body's."""
    c, s = _TURNS[segment.roll]
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def core_section(segment: "Segment") -> np.ndarray:
    """(2, 2) lowest and highest y and z of the core, mm."""
    return _turned(segment, segment.width / 2, segment.core_bottom, segment.core_top)


def channel_section(segment: "Segment") -> np.ndarray:
    """(2, 2) lowest and highest y and z of the channel, mm."""
    return _turned(
        segment, segment.channel_width / 2, -segment.channel_height / 2, segment.channel_height / 2
    )


def whole_section(segment: "Segment") -> np.ndarray:
    """(2, 2) lowest and highest y and z of all there is, chambers included, mm."""
    return _turned(segment, segment.width / 2, segment.chamber_bottom, segment.chamber_top)


def chamber_plan(
    segment: "Segment", x: float, thickness: float, half_width: float, side: int = 1
) -> np.ndarray:
    """Plan corners (4, 2) in mm of a chamber, cavity or gap centred at x, `thickness` (mm) normal to it and
    between y = -half_width and half_width; side -1: turned half a turn about x."""
    half, slant = thickness / segment.sin / 2, segment.cot * half_width * side
    x0, x1, y = x - slant, x + slant, half_width
    return np.array([[x0 - half, -y], [x0 + half, -y], [x1 + half, y], [x1 - half, y]])


def _turned(segment, half_width, z0, z1):
    corners = np.array([[-half_width, half_width], [z0, z1]])
    return np.sort(rotation(segment)[1:, 1:] @ corners, axis=1)


def joint_is_covered(a: "Segment", b: "Segment") -> bool:
    """Whether the channel of either lies inside the core of the other."""
    channels, cores = ([f(s) for s in (a, b)] for f in (channel_section, core_section))
    low = np.minimum(*channels)[:, 0] > np.maximum(*cores)[:, 0]
    high = np.maximum(*channels)[:, 1] < np.minimum(*cores)[:, 1]
    return bool(low.all() and high.all())
