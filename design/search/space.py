"""The design space: start dimensions, what varies in each kind of segment, and how far it may."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import BENDING, Target
from pneunet.geometry.parameters import ONE_SIDED, PASSIVE, TWISTING, Segment

Range = tuple[float, float]
AT_BOUND = 1e-6  # of a variable's range
#: start dimensions, mm, where they differ from Segment's own: castable and of the paper's magnitudes
START: dict[str, dict] = {
    ONE_SIDED: {},
    TWISTING: {"chamber_height": 5.5, "cavity_floor": 0.5, "gap": 2.0},
}
#: castable limits, mm and degrees, of what varies by default, and what counts as a large change
RANGES: dict[str, dict[str, tuple[Range, float]]] = {
    ONE_SIDED: {
        "angle": ((30, 150), 90.0),
        "chamber_height": ((2, 8), 2.0),
        "base_thickness": ((1, 5), 1.5),
        "wall": ((1, 2), 0.5),
        "gap": ((1, 3), 1.0),
        "end_margin": ((2, 4), 1.0),  # half a gap of channel must fit into it
    },
    TWISTING: {
        "angle": ((30, 150), 90.0),
        "chamber_height": ((2, 8), 2.0),
        "gap": ((1, 3), 1.0),
        "end_margin": ((2, 4), 1.0),
    },
    PASSIVE: {"plain_length": ((3, 500), 5.0), "base_thickness": ((1, 5), 1.5)},
}
#: what a caster's thinnest and thickest wall is asked of
WALLS = ("wall", "top_wall", "side_wall", "roof")
UNITS = {
    "pressure": (" kPa", KPA_PER_MPA),
    "mu": (" MPa", 1.0),
    "angle": (" deg", 1.0),
    "chambers": ("", 1.0),
}


@dataclass(frozen=True)
class Variable:
    """A design variable of some segments: its field (reduced.rod.piece_slopes.FIELDS), range, what counts as
    a large change, and the value it is drawn to where the target does not decide; of a pressure, the aims
    that it is meant for, and the number of its group of segments where there are several."""

    name: str
    segments: tuple[int, ...]
    low: float
    high: float
    scale: float
    start: float | None = None
    aims: tuple[int, ...] = (0,)
    group: int = 0

    @property
    def title(self) -> str:
        """As users read it; of several segments at once, without their numbers."""
        if self.group:
            return f"{self.name} of group {self.group}"
        alone = len(self.segments) == 1 and self.name not in ("pressure", "mu")
        return f"segment {self.segments[0] + 1} {self.name}" if alone else self.name

    def bound(self, value: float) -> float | None:
        """The end of the range that a value sits on, or None."""
        for end in (self.low, self.high):
            if abs(value - end) <= AT_BOUND * (self.high - self.low):
                return end
        return None

    def text(self, value: float) -> str:
        """A value on a bound, in words."""
        unit, factor = UNITS.get(self.name, (" mm", 1.0))
        side = "lower" if self.bound(value) == self.low else "upper"
        shown = round(value) if self.name == "chambers" else factor * value
        return f"{self.title} = {shown:.4g}{unit} ({side} bound)"


def prototype(target: Target, piece: Extracted) -> Segment:
    """The Segment with a piece's start dimensions: material and shared dimensions are the same for all
    pieces."""
    kind = piece.kind if piece.kind in (TWISTING, PASSIVE) else ONE_SIDED
    of_chambers = TWISTING if kind == TWISTING else ONE_SIDED
    try:
        segment = Segment(
            of_chambers, 90.0, 1, **(_start(of_chambers, target) | target.start), material=target.material
        )
        segment = replace(segment, roll=round(piece.roll), group=piece.group)
        return segment.plain(piece.length) if kind == PASSIVE else segment
    except InputError as error:
        raise InputError(f"[segment] (start dimensions of the {kind} segments): {error}") from None


def _start(kind, target):
    """Start dimensions of a kind, with walls that can be cast."""
    start, walls = START[kind], target.casting.walls
    usual = {f.name: f.default for f in fields(Segment)} | start
    return start | {name: float(np.clip(usual[name], *walls)) for name in WALLS}


def limits(target: Target, piece: Extracted, segment: Segment) -> dict[str, tuple[Range, float]]:
    """{name: (range, large change)} of what varies in one segment."""
    ranges = RANGES[segment.kind]
    if target.vary is not None and segment.kind != PASSIVE:
        ranges = {name: ranges[name] for name in ("angle", "end_margin")}
        ranges |= {name: ((low, high), max(high - low, 1e-6)) for name, (low, high) in target.vary.items()}
        if segment.kind == TWISTING:
            ranges.pop("base_thickness", None)
        _check_vary(target.vary, segment)
    elif "wall" in ranges:
        ranges = ranges | {"wall": (target.casting.walls, ranges["wall"][1])}
    given = "end_margin" in target.start and "end_margin" not in (target.vary or {})
    dropped = ("angle",) * (piece.kind == BENDING) + ("end_margin",) * given
    return {name: both for name, both in ranges.items() if name not in dropped}


def _check_vary(vary, segment):
    for name, bounds in vary.items():
        for value in bounds:
            try:
                replace(segment, **{name: value})
            except InputError as error:
                raise InputError(f"[vary]: {error}") from None


def variables_of(
    target: Target, pieces: Sequence[Extracted], segments: Sequence[Segment], flush: bool
) -> list[Variable]:
    """Of the dimensions of all segments. flush: the undersides of all but twisting ones in one plane."""
    found, base = [], []
    for i, (piece, segment) in enumerate(zip(pieces, segments)):
        usual = prototype(target, piece)
        for name, ((low, high), scale) in limits(target, piece, segment).items():
            start = None if name == "angle" else float(np.clip(getattr(usual, name), low, high))
            if high <= low:
                continue
            if name == "base_thickness" and flush:
                base.append((i, low, high, scale, start))
            elif name != "base_thickness" or segment.kind != PASSIVE:
                found.append(Variable(name, (i,), float(low), float(high), scale, start))
    if any(segments[i].kind == ONE_SIDED for i, *_ in base):
        members, lows, highs, scales, starts = zip(*base)
        found.append(Variable("base_thickness", members, max(lows), min(highs), scales[0], starts[0]))
    if target.casting.moduli is not None:
        low, high = target.casting.moduli
        if high > low:
            everywhere = tuple(range(len(segments)))
            found.append(Variable("mu", everywhere, low, high, (high - low) / 2, target.material.mu))
    return found


def grid(limits: tuple[Range, float] | None, fixed: float, step: float) -> np.ndarray:
    """Values (n,) about `step` apart, half a large change to either side of `fixed` within the range; what
    does not vary has one value."""
    if limits is None:
        return np.array([fixed])
    (least, most), scale = limits
    low, high = max(least, fixed - scale / 2), min(most, fixed + scale / 2)
    return np.linspace(low, high, max(1, round((high - low) / step)) + 1) if high > low else np.array([low])
