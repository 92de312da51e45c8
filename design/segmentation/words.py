"""What a split tells its user: what no point shows, which convention was taken, what was given up."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pneunet.base.units import PER_MM_PER_M
from pneunet.design.segmentation.fit import RodFit, refined
from pneunet.design.target.target import Piece, SplitOptions, Target
from pneunet.geometry.parameters import PASSIVE, TWISTING

AT_LIMIT = 0.01  # of a limit: a strain so near sits on it
NOTED = 4.0  # standard deviations of squares beyond which the points are said to lie off the rod


def thinned(points: int) -> str:
    """That not all points are used."""
    return f"{points} points are more than the split needs: means of neighbouring ones are used"


def told(fit: RodFit, pieces: Sequence[Piece], target: Target, options: SplitOptions) -> Iterator[str]:
    """The notes of a final fit."""
    data, last = fit.data, len(pieces) - 1
    framed = data.frames is not None
    if len(target.points) > len(data.points):
        yield thinned(len(target.points))
    if not data.noise_seen:
        yield f"too few points to tell their noise: {data.noise:.2g} mm is assumed; tolerance_mm says it"
    for i, (piece, length) in enumerate(zip(pieces, fit.lengths)):
        name = f"piece {i + 1}"
        if piece.kind == PASSIVE and not framed:
            at_end = i == last or (i == 0 and data.base is None)
            if at_end:
                yield f"{name} is straight and at an end: no point shows a twist of it, none is taken"
            else:
                yield f"{name} is straight: half turns of twist would not show, none is taken"
        if piece.kind == TWISTING and not framed:
            angle = np.degrees((piece.twist or 0.0) * length)
            yield (
                f"{name} twists by {angle:.1f} deg: the points show it but for half turns, the smallest is"
                " taken; half a turn more is the same curve with all that follows rolled by 180 deg"
            )
    yield from _limits(fit, pieces)
    if fit.poor > NOTED and not data.reach:
        worst = int(np.argmax(np.sum(fit.away[:, 1:] ** 2, axis=1)))
        away = float(np.linalg.norm(fit.away[worst, 1:]))
        yield (
            f"the points lie {fit.rms:.3g} mm (root mean square) off the pieces, more than noise explains"
            f" ({data.noise:.2g} mm a coordinate), most at {fit.feet[worst] - fit.feet[0]:.0f} mm"
            f" ({away:.3g} mm): corners, or pieces shorter than {data.shortest:.3g} mm, are not followed"
        )
    if len(pieces) >= options.most_pieces:
        yield (
            f"{len(pieces)} pieces are the most that are allowed: a larger tolerance_mm asks for fewer, a"
            " larger most_pieces allows more"
        )


def _limits(fit, pieces):
    """Which strains sit on what can be reached, and what that costs."""
    if not fit.data.reach:
        return
    on = []
    for i, (piece, kind) in enumerate(zip(pieces, fit.kinds), start=1):
        most = fit.data.reach.get(kind, (np.inf, np.inf))
        rates = (("twist", abs(piece.twist or 0.0), "rad/m"), ("curvature", piece.curvature, "1/m"))
        for (name, value, unit), limit in zip(rates, most):
            if limit > 0 and value >= (1 - AT_LIMIT) * limit:
                on.append(f"the {name} of piece {i} to {limit / PER_MM_PER_M:.3g} {unit}")
    if on:
        free = refined(replace(fit, data=replace(fit.data, reach={})))
        with_limits, without = f"{fit.rms:.3g}", f"{free.rms:.3g}"
        cost = "at no cost" if with_limits == without else f"RMS {with_limits} mm instead of {without} mm"
        yield f"given up for what can be reached: {', '.join(on)}; {cost}"
