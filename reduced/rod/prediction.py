"""What a law says of a whole manipulator: its shape, free or under dead loads, and reasons to doubt it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.strains import RodStrains
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import PASSIVE, Manipulator
from pneunet.reduced.rod.centreline import Centreline, centreline
from pneunet.reduced.rod.ends import cell_strains, free_pieces
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.rod import Rod

#: of the length, by which elements of a loaded rod may be off
TOLERANCE = 1e-4


def predict(
    manipulator: Manipulator,
    pressure: float | ArrayLike,
    law: SegmentLaw | Sequence[SegmentLaw],
    spacing: float = 1.0,
    base_pose: np.ndarray | None = None,
    loads: DeadLoads | None = None,
) -> Centreline:
    """The Centreline of a manipulator at `pressure` (MPa; one for all, or one for each group of segments),
    end effects included: that of Rod.of, of a free one without the rod.

    law: one for all segments or one for each. spacing in mm; base_pose (4, 4) the base frame in space, mm,
    default the identity; loads: fixed in space, by default none. InputError and ConvergenceError as for
    SegmentLaw.strains, under loads as for Rod.equilibrium.
    """
    if loads:
        line = Rod.of(manipulator, law, pressure, base_pose).equilibrium(loads, tolerance=TOLERANCE).line
        return centreline(np.diff(line.s), line.strains, spacing, line.poses[0])
    lengths, strains = _pieces(manipulator, pressure, law)
    return centreline(lengths, strains, spacing, base_pose)


def predict_design(
    design: DesignFile, pressure: float | ArrayLike, law: SegmentLaw, spacing: float = 1.0
) -> Centreline:
    """`predict` of a design, in the target's coordinates and under the design's own loads."""
    return predict(design.manipulator, pressure, law, spacing, design.base_pose, design.loads)


def segment_strains(manipulator: Manipulator, line: Centreline) -> RodStrains:
    """RodStrains (segments, 3) in the body's axes: the mean over the cells of each segment, of a Centreline
    that `predict` gave."""
    n = len(manipulator.segments)
    lengths, _ = free_pieces(manipulator.segments, RodStrains.of_vector(np.tile(np.eye(6)[0], (n, 1))))
    h, strains = np.diff(line.s), line.strains.vector
    piece = np.searchsorted(np.cumsum(lengths)[:-1], line.s[:-1] + h / 2)
    weights = np.where(piece == 1 + 3 * np.arange(n)[:, None], h, 0.0)
    return RodStrains.of_vector(weights @ strains / weights.sum(axis=1, keepdims=True))


def _pieces(manipulator, pressure, law):
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
