"""`fillet_mm`: how edges of chambers are rounded, and how far they can be.

Outside, the feet and the tops of a chamber's walls, along its long sides; inside, the ceiling and the upright
edges of its cavity. These are the edges that moulds round: tips of fins and of cores, and what lies between.
Where parts of moulds meet, edges stay sharp.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.errors import InputError

if TYPE_CHECKING:
    from pneunet.geometry.parameters import Segment

NO_GRID = 'a grid of hexahedra has sharp edges: leave it out, or write element = "tetrahedra"'
NO_CELL = "a cell has sharp edges, and so has the law: leave it out; whole bodies can have fillets"
#: mm: what stays flat between two rounded edges
_FLAT = 0.02


def largest_fillet(segment: "Segment") -> tuple[float, str]:
    """(largest radius that can be built, mm; key of what limits it)."""
    s = segment
    room = {
        "cavity_thickness_mm": s.cavity_thickness / 2,
        "side_wall_mm": s.cavity_width / 2,
        "chamber_height_mm": s.cavity_top - max(s.cavity_floor, s.channel_height / 2),
        "top_wall_mm": (s.chamber_top - s.core_top) / 2,
        # a foot stays off the taper at the segment's end
        "end_margin_mm": s.end_margin / 2 * s.sin,
    }
    if s.chambers > 1:
        room["gap_mm"] = s.gap / 2
    key = min(room, key=lambda each: room[each])
    return max(room[key] - _FLAT, 0.0), key


def check_fillet(segment: "Segment") -> None:
    """InputError where a segment's fillet is too large to be built."""
    if segment.fillet:
        room, key = largest_fillet(segment)
        largest = np.floor(100 * room + 1e-9) / 100
        if segment.fillet > room:
            raise InputError(
                f"fillet_mm = {segment.fillet:g} cannot be built: at most {largest:g} fits, limited by {key}"
            )


def refuse_fillets(segments: Iterable["Segment"], why: str) -> None:
    """InputError where a segment has a fillet."""
    for segment in segments:
        if segment.fillet:
            raise InputError(f"fillet_mm = {segment.fillet:g}: {why}")


def rounding(radius: float, chords: int) -> np.ndarray:
    """(chords + 1, 2) [along, inset] of a quarter of a rounded edge, from where it leaves the wall on: at
    `along` mm towards the other face the wall has moved in by `inset`."""
    angle = np.linspace(0, np.pi / 2, chords + 1)
    return radius * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
