"""Whether the pieces of a target can be reached at all, by any dimensions, angle and pressure that are
allowed."""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.search.space import limits, prototype
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.reach import ANGLES, Reach, reach
from pneunet.design.target.target import BENDING, PRESSURE_LIMIT, Target
from pneunet.geometry.parameters import PASSIVE
from pneunet.reduced.rod.laws import SegmentLaw

#: not dimensions of the cells
_NOT_OF_CELLS = ("angle", "end_margin")
#: degrees between angles
_STEP = 5.0


def reaches(target: Target, piece: Extracted, law: SegmentLaw) -> list[Reach]:
    """Of segments like a piece's at the highest allowed pressure: one for each combination of the ends that
    its dimensions may go to. InputError where none of them can be built."""
    segment = prototype(target, piece)
    ends = {name: bounds for name, (bounds, _) in limits(target, piece, segment).items()}
    angles = ANGLES
    if piece.kind != BENDING:
        low, high = ends["angle"]
        angles = np.linspace(low, high, 1 + round((high - low) / _STEP))
    pressure = max(target.pressure_range or target.pressures or (PRESSURE_LIMIT,))
    dimensions = {name: both for name, both in ends.items() if name not in _NOT_OF_CELLS}
    found = []
    for values in product(*dimensions.values()):
        try:
            found.append(
                reach(segment, [pressure], law, angles, {n: [v] for n, v in zip(dimensions, values)})
            )
        except InputError as error:
            reason = error
    if not found:
        raise reason
    return found


def out_of_reach(target: Target, pieces: Sequence[Extracted], law: SegmentLaw) -> Iterator[str]:
    """A line about each piece that alone, without its neighbours, exceeds all its `reaches`."""
    known: dict[str, list[Reach]] = {}
    for i, piece in enumerate(pieces, start=1):
        if piece.kind == PASSIVE:
            continue
        if piece.kind not in known:
            known[piece.kind] = reaches(target, piece, law)
        share = min(float(most.share(piece.curvature, piece.twist)) for most in known[piece.kind])
        if share == np.inf:
            yield f"piece {i} alone is out of reach: no allowed angle twists so much for its curvature"
        elif share > 1:
            kPa = KPA_PER_MPA * known[piece.kind][0].pressures[-1]
            told = f"{100 * share:.0f} % of the most that allowed dimensions do at {kPa:.3g} kPa"
            yield f"piece {i} alone is out of reach: it asks for {told}"
