"""What a law says of a whole manipulator: its free shape, and reasons to doubt it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import PASSIVE, Manipulator
from pneunet.reduced.rod.centreline import Centreline, centreline
from pneunet.reduced.rod.ends import cell_strains, free_pieces
from pneunet.reduced.rod.laws import SegmentLaw


def predict(
    manipulator: Manipulator,
    pressure: float | ArrayLike,
    law: SegmentLaw,
    spacing: float = 1.0,
    base_pose: np.ndarray | None = None,
) -> Centreline:
    """The Centreline of a free manipulator at `pressure` (MPa; one for all, or one for each group of
    segments), end effects included: that of Rod.of, without the rod.

    spacing in mm; base_pose (4, 4) the base frame, default the identity. InputError and ConvergenceError as
    for SegmentLaw.strains.
    """
    lengths, strains = _pieces(manipulator, pressure, law)
    return centreline(lengths, strains, spacing, base_pose)


def segment_strains(manipulator: Manipulator, pressure: float | ArrayLike, law: SegmentLaw) -> RodStrains:
    """RodStrains (segments, 3) of the cells of a free manipulator in the body's axes; pressure as in
    `predict`."""
    return RodStrains.of_vector(_pieces(manipulator, pressure, law)[1].vector[1::3])


def _pieces(
    manipulator: Manipulator, pressure: float | ArrayLike, law: SegmentLaw
) -> tuple[np.ndarray, RodStrains]:
    strains = cell_strains(law, manipulator.segments, manipulator.pressures(pressure))
    return free_pieces(manipulator.segments, strains)


def doubts(
    manipulator: Manipulator, pressures: float | Sequence[float | Sequence[float]], law: SegmentLaw
) -> tuple[str, ...]:
    """Lines of text, one a reason, not to trust a law for the manipulator at a pressure (MPa) or several,
    each as in `predict`."""
    who: dict[str, list[str]] = {}
    levels = pressures if isinstance(pressures, Sequence) else [pressures]
    of_each = np.array([manipulator.pressures(pressure) for pressure in levels]).T
    for i, (segment, own) in enumerate(zip(manipulator.segments, of_each), start=1):
        for reason in () if segment.kind == PASSIVE else law.doubts(segment, own):
            who.setdefault(reason, []).append(str(i))
    return tuple(f"segment {', '.join(numbers)}: {reason}" for reason, numbers in who.items())
