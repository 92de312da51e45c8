"""The planes that bound the blocks of a segment, and how the room between them is divided.

In a segment's own axes every face of a chamber, a cavity and the core lies in a plane across y, across z, or
across xi = x - s(z) cot(angle) y: s = 1 in a one-sided segment; in a twisting one it goes from -1 below the
lower cavity's floor to 1 above the upper one's.
"""

from dataclasses import dataclass, replace

import numpy as np

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


@dataclass(frozen=True)
class Planes:
    """Places (n,) in mm, rising, and sharp (n,): whether edges at which the body fills three quarters of the
    room lie in the plane. Stresses are singular there."""

    places: np.ndarray
    sharp: np.ndarray

    @classmethod
    def of(cls, sharp: list[float], smooth: list[float]) -> "Planes":
        """Of places in any order; what is there twice is one plane."""
        places = np.array([*sharp, *smooth], float)
        order = np.argsort(places, kind="stable")
        first = np.append(True, np.diff(places[order]) > _SAME)
        # those that are sharp and smooth are sharp
        groups, kinds = np.cumsum(first) - 1, np.arange(len(places))[order] < len(sharp)
        return cls(places[order][first], np.bincount(groups, kinds) > 0)

    def mirrored(self) -> "Planes":
        """With their mirror images at 0."""
        both = [np.concatenate([-p, p]).tolist() for p in (self.places[self.sharp], self.places[~self.sharp])]
        return Planes.of(*both)

    def within(self, low: float, high: float) -> "Planes":
        """Those between two of them, which included."""
        kept = (self.places > low - _SAME) & (self.places < high + _SAME)
        return Planes(self.places[kept], self.sharp[kept])

    def divided(self, size: float, layer: float | None = None) -> np.ndarray:
        """(m,) mm: the places and others between them, at most `size` apart; `layer`: with one element of
        this thickness on each side of a sharp plane, where there is room."""
        parts = [
            _divided(a, b, size, layer, low, high)
            for a, b, low, high in zip(self.places, self.places[1:], self.sharp, self.sharp[1:])
        ]
        return np.concatenate([*(part[:-1] for part in parts), self.places[-1:]])

    def spread(self, count: int) -> np.ndarray:
        """(count + 1,) mm: the places and others between them, of which the largest distance is smallest."""
        lengths = np.diff(self.places)
        counts = np.ones(len(lengths), int)
        for _ in range(count - len(lengths)):
            counts[np.argmax(lengths / counts - 1e-12 * np.arange(len(lengths)))] += 1
        parts = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(self.places, self.places[1:], counts)]
        return np.concatenate([*parts, self.places[-1:]])

    def count(self, size: float) -> int:
        """How many elements of at most `size` they need."""
        return sum(_count(length, size) for length in np.diff(self.places))


def _count(length, size):
    return max(1, int(np.ceil(length / size - 1e-6)))


def _divided(a, b, size, layer, low, high):
    if layer is None or not (low or high):
        return np.linspace(a, b, _count(b - a, size) + 1)
    inner = b - a - (int(low) + int(high)) * layer
    if inner < layer / 2:
        return np.linspace(a, b, max(int(low) + int(high), _count(b - a, layer)) + 1)
    ends = a + low * layer, b - high * layer
    middle = np.linspace(*ends, _count(inner, size) + 1)
    return np.concatenate([[a] * bool(low), middle, [b] * bool(high)])


def along(segment: Segment) -> Planes:
    """Planes across xi of half a pitch, from a chamber's middle to that of the gap."""
    s = segment
    return Planes.of([s.cavity_thickness / 2 / s.sin, s.chamber_thickness / 2 / s.sin], [0.0, s.pitch / 2])


def sideways(segment: Segment, middle: bool = False) -> Planes:
    """Planes across y in the segment's own axes; `middle`: y = 0 is one of them."""
    s = segment
    inner = [s.channel_width / 2, *([s.cavity_width / 2] if s.sides else [])]
    return Planes.of(inner, [s.width / 2] + [0.0] * middle).mirrored()


def upright(segment: Segment, size: float) -> Planes:
    """Planes across z in the segment's own axes.

    Between a twisting segment's floors edges lean from one side to the other. There they are at most `size`
    (mm) long at the core's sides, where the lean is largest: in elements that are sheared by a pitch the
    response is 2 % too stiff.
    """
    s = segment
    half = s.channel_height / 2
    sharp, smooth = [half, -half], [s.core_bottom, s.core_top, s.layer_top]
    if s.sides:
        own = [s.cavity_floor, s.core_top, s.cavity_top]
        sharp += [side * z for side in s.sides for z in own]
        smooth += [side * s.chamber_top for side in s.sides]
    if s.kind == TWISTING:
        edge = np.hypot(2 * s.cavity_floor, s.width * s.cot)
        smooth += np.linspace(-s.cavity_floor, s.cavity_floor, _count(edge, size) + 1).tolist()
    return Planes.of(sharp, smooth)


def lean(segment: Segment, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """s(z) cot(angle) y, mm, of places in the segment's own axes: how far x lies beyond xi."""
    s = segment
    if not s.sides:
        return np.zeros(np.broadcast(y, z).shape)
    fraction = np.clip(z / s.cavity_floor, -1, 1) if s.kind == TWISTING else np.ones_like(z)
    return fraction * s.cot * y
