"""Limits of chambers' walls that a design has come to, in words: they touch, or stretch too far."""

from collections.abc import Iterator, Sequence

from pneunet.design.search.problem import NEARLY
from pneunet.geometry.parameters import PASSIVE, Segment
from pneunet.reduced.rod.clearance import allowed_stretch
from pneunet.reduced.rod.laws import SegmentLaw

#: of the gap: with less left, it counts as used up
LEFT = 0.02
#: part of the strain that walls are allowed from which on it is told: a little below where it counts
TOLD = NEARLY - 0.02


def at_limits(
    segments: Sequence[Segment], pressures: Sequence[float], law: SegmentLaw, may_touch: bool
) -> Iterator[str]:
    """Segments whose estimated clearance a design at their pressures (MPa) has used up, unless walls may
    touch, and those whose walls are estimated to come near the stretch that they are allowed."""
    for i, (segment, pressure) in enumerate(zip(segments, pressures), start=1):
        if segment.kind == PASSIVE:
            continue
        closed, stretch = law.walls(segment, float(pressure))
        left = segment.gap * (1 - closed)
        if not may_touch and left < LEFT * segment.gap:
            yield (
                f"segment {i} clearance of facing walls (estimate: {max(left, 0.0):.2f} mm left of"
                f" {segment.gap:.2f} mm)"
            )
        allowed = allowed_stretch(segment)
        if stretch - 1 > TOLD * (allowed - 1):
            yield f"segment {i} stretch of walls (estimate: {stretch:.3f} of {allowed:.3f} allowed)"
