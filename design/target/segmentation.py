"""A simple split of a bare curve into straight, bending and helical pieces.

Few pieces of uniform curvature and torsion that together fit the points: dynamic programming over a grid of
joints, with the fit of every candidate piece weighed against its number of rates. It is simple because it
judges each piece by itself: it never sees that two neighbouring arcs would need a twist between them, and it
finds no twist where the curve is nowhere straight. Straight pieces become twisting ones, whose twist is read
off the arcs on either side.
"""

import numpy as np

from pneunet.base.curve import Curve
from pneunet.design.target.extraction import FIT_POINTS, fit_arc
from pneunet.design.target.target import BENDING, HELICAL, Piece
from pneunet.geometry.parameters import TWISTING

SHORTEST = 20.0  # mm; a shorter piece has no room for two chambers and its ends
GRID = 18  # joints tried along the curve
TOLERANCE = 0.001  # of the curve's length: a fit this good is good enough
PRICE = 0.1  # of a rate, in units of a misfit of TOLERANCE over the whole curve
RATES = {TWISTING: 1, BENDING: 2, HELICAL: 3}
NOTE = (
    "simple automatic split (no twist is sought where the curve is not straight): give [[piece]] tables to"
    " split it yourself"
)


def split(curve: Curve) -> tuple[Piece, ...]:
    """The pieces (rates left open) of a Curve."""
    length = curve.length
    shortest = min(SHORTEST, length)
    joints = np.linspace(0, length, min(GRID, max(2, int(length / shortest * 4))) + 1)
    #: of every joint: the cost up to it, and the joint before it with the kind of the piece between
    best = [(0.0, 0, "")] + [(np.inf, 0, "")] * (len(joints) - 1)
    for j in range(1, len(joints)):
        for i in range(j):
            if joints[j] - joints[i] < shortest - 1e-9 or not np.isfinite(best[i][0]):
                continue
            kind, cost = _kind_and_cost(curve, joints[i], joints[j], length)
            if best[i][0] + cost < best[j][0]:
                best[j] = (best[i][0] + cost, i, kind)
    kinds: list[str] = []
    ends, j = [length], len(joints) - 1
    while j:
        _, j, kind = best[j]
        kinds.insert(0, kind)
        ends.insert(0, joints[j])
    ends = _refined(curve, kinds, ends, joints[1], shortest, length)
    return tuple(Piece(kind, high - low) for kind, low, high in zip(kinds, ends[:-1], ends[1:]))


def _misfit(curve, low, high, kind, length):
    """Mean square misfit of one piece in units of the tolerance, weighed by its share of the curve."""
    arc = fit_arc(curve.at(np.linspace(low, high, FIT_POINTS)), kind)
    return (arc.rms / (TOLERANCE * length)) ** 2 * (high - low) / length


def _kind_and_cost(curve, low, high, length):
    """The cheapest kind; richer ones are not tried where even a perfect fit would cost more."""
    best_kind, best = None, np.inf
    for kind, rates in RATES.items():
        if PRICE * rates >= best:
            break
        cost = _misfit(curve, low, high, kind, length) + PRICE * rates
        if cost < best:
            best_kind, best = kind, cost
    return best_kind, best


def _refined(curve, kinds, ends, step, shortest, length):
    """Joints moved by halves of the grid's step, down to 1/16, while that lowers the misfit of the two
    pieces."""

    def misfit(i):
        return _misfit(curve, ends[i - 1], ends[i], kinds[i - 1], length) + _misfit(
            curve, ends[i], ends[i + 1], kinds[i], length
        )

    ends = list(ends)
    for move in (step / 2, step / 4, step / 8, step / 16):
        for i in range(1, len(ends) - 1):
            tried = {}
            for position in (ends[i], ends[i] - move, ends[i] + move):
                if position - ends[i - 1] >= shortest - 1e-9 and ends[i + 1] - position >= shortest - 1e-9:
                    here, ends[i] = ends[i], position
                    tried[position] = misfit(i)
                    ends[i] = here
            ends[i] = min(tried, key=lambda position: tried[position])
    return ends
