"""The design space: start dimensions, what varies in each kind of segment, ranges that grow to castable
limits."""

from dataclasses import dataclass, replace

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import BENDING, Target
from pneunet.geometry.parameters import ONE_SIDED, TWISTING, Segment

Range = tuple[float, float]
AT_BOUND = 1e-3  # of a variable's range
#: start dimensions, mm, where they differ from Segment's own: castable and of the paper's magnitudes
START: dict[str, dict] = {
    ONE_SIDED: {},
    TWISTING: {"chamber_height": 5.5, "cavity_floor": 0.5, "gap": 2.0},
}
#: start range and castable limits, mm and degrees, of what varies by default
RANGES: dict[str, dict[str, tuple[Range, Range]]] = {
    ONE_SIDED: {
        "angle": ((45, 135), (30, 150)),
        "chamber_height": ((3, 5), (2, 8)),
        "base_thickness": ((1.5, 3), (1, 5)),
        "wall": ((1, 1.5), (0.8, 2)),
        "gap": ((1, 2), (1, 3)),  # half a gap of channel must fit into the end margin
    },
    TWISTING: {
        "angle": ((45, 135), (30, 150)),
        "chamber_height": ((4, 6), (2, 8)),
        "gap": ((2, 3), (1, 3)),
    },
}
UNITS = {"pressure": (" kPa", KPA_PER_MPA), "angle": (" deg", 1.0), "chambers": ("", 1.0)}


@dataclass(frozen=True)
class Variable:
    """A design variable of one segment (None: of all) with its range, which may grow to its limits."""

    name: str
    segment: int | None
    value: float
    low: float
    high: float
    least: float
    most: float
    start: float | None = None  # a dimension's preferred value

    @property
    def scale(self) -> float:
        """What counts as a large change."""
        return max(self.high - self.low, 1e-3 * abs(self.value))

    @property
    def bound(self) -> float | None:
        """The end of the range that the value sits on, or None."""
        for end in (self.low, self.high):
            if abs(self.value - end) <= AT_BOUND * self.scale:
                return end
        return None

    @property
    def grown(self) -> "Variable":
        """With a wider range where the value sits on a bound that may grow; otherwise the same."""
        low, high = self.low, self.high
        if self.bound == low and low > self.least:
            low = max(self.least, low - self.scale)
        elif self.bound == high and high < self.most:
            high = min(self.most, high + self.scale)
        return replace(self, low=low, high=high)

    @property
    def title(self) -> str:
        return self.name if self.segment is None else f"segment {self.segment + 1} {self.name}"

    @property
    def text(self) -> str:
        """The bound that the value sits on, in words; "" on none."""
        if self.bound is None:
            return ""
        unit, factor = UNITS.get(self.name, (" mm", 1.0))
        side = "lower" if self.bound == self.low else "upper"
        shown = round(self.value) if self.name == "chambers" else factor * self.bound
        return f"{self.title} = {shown:.4g}{unit} ({side} bound)"


def prototype(target: Target, piece: Extracted) -> Segment:
    """The Segment with a piece's start dimensions: material and shared dimensions are the same for all
    pieces."""
    kind = TWISTING if piece.kind == TWISTING else ONE_SIDED
    try:
        return Segment(kind, 90.0, 1, **(START[kind] | target.start), material=target.material)
    except InputError as error:
        raise InputError(f"[segment] (start dimensions of the {kind} segments): {error}") from None


def limits(target: Target, piece: Extracted, segment: Segment) -> dict[str, tuple[Range, Range]]:
    """{name: (start range, limits)} of what varies in one segment; the user's bounds are limits at once."""
    ranges = RANGES[segment.kind]
    if target.vary is not None:
        ranges = {"angle": ranges["angle"]} | {name: (bounds, bounds) for name, bounds in target.vary.items()}
        if segment.kind == TWISTING:
            ranges.pop("base_thickness", None)
        _check_vary(target.vary, segment)
    if piece.kind == BENDING:
        ranges = {name: both for name, both in ranges.items() if name != "angle"}
    return ranges


def _check_vary(vary, segment):
    for name, bounds in vary.items():
        for value in bounds:
            try:
                replace(segment, **{name: value})
            except InputError as error:
                raise InputError(f"[vary]: {error}") from None


def grid(limits: tuple[Range, Range] | None, fixed: float, step: float) -> np.ndarray:
    """Values (n,) about `step` apart over a start range of `limits`; what does not vary has one value."""
    low, high = limits[0] if limits else (fixed, fixed)
    return np.linspace(low, high, max(1, round((high - low) / step)) + 1) if high > low else np.array([low])
