"""What a law says of a whole manipulator: its free shape, and reasons to doubt it."""

import numpy as np
from numpy.typing import ArrayLike

from pneunet.geometry.parameters import Manipulator
from pneunet.reduced.rod.centreline import Centreline, centreline
from pneunet.reduced.rod.ends import free_pieces
from pneunet.reduced.rod.laws import SegmentLaw


def predict(
    manipulator: Manipulator,
    pressure: float,
    law: SegmentLaw,
    spacing: float = 1.0,
    base_pose: np.ndarray | None = None,
) -> Centreline:
    """The Centreline of a free manipulator at `pressure` (MPa), end effects included: that of Rod.of, without
    the rod.

    spacing in mm; base_pose (4, 4) the base frame, default the identity. InputError and ConvergenceError as
    for SegmentLaw.strains.
    """
    segments = manipulator.segments
    return centreline(*free_pieces(segments, law.each(segments, pressure)), spacing, base_pose)


def doubts(manipulator: Manipulator, pressure: float | ArrayLike, law: SegmentLaw) -> tuple[str, ...]:
    """Lines of text, one a reason, not to trust a law for the manipulator at a pressure (MPa) or several."""
    who: dict[str, list[str]] = {}
    for i, segment in enumerate(manipulator.segments, start=1):
        for reason in law.doubts(segment, pressure):
            who.setdefault(reason, []).append(str(i))
    return tuple(f"segment {', '.join(numbers)}: {reason}" for reason, numbers in who.items())
