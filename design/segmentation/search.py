"""From the first rod to the best one: moves are tried, best predicted first, as long as one is better."""

from dataclasses import replace

import numpy as np

from pneunet.design.segmentation.fit import FIRM, RodFit, refined
from pneunet.design.segmentation.moves import HOPE, allowed, merged, moves, without
from pneunet.design.segmentation.rod import PiecewiseRod

FEW = 8  # ways tried in which a rod may have a piece less
TRIES = 20  # moves tried before a rod is taken for the best
BETTER = 0.02  # of the criterion: a smaller gain is none
ROUNDS = 40
SHORT = 0.5  # mm by which a piece may be too short
POLISH = 60  # steps of the last refinement


def searched(fit: RodFit, most: int) -> RodFit:
    """The best rod that moves from a refined one lead to, with at most `most` pieces, none of them too
    short."""
    while len(fit.free) > most:
        fit = _fewer(fit, range(len(fit.free)))
    while True:
        fit = refined(_climbed(fit, most), POLISH, 1e-4)
        if len(fit.free) == 1 or not len(_short(fit)):
            return fit
        firm = refined(replace(fit, data=replace(fit.data, slack=FIRM)), POLISH, 1e-2)
        if not len(_short(firm)):
            return firm
        fit = _fewer(fit, _short(fit))
        most = len(fit.free)


def _short(fit):
    """Indices of pieces that are too short to be built."""
    return np.flatnonzero(fit.lengths < fit.data.shortest - SHORT)


def _fewer(fit, pieces):
    """With one piece less, at the least loss; one of `pieces` goes or is merged."""
    framed, based = fit.data.frames is not None, fit.data.base is not None
    options = [
        (move, free)
        for move, free in (*merged(fit), *without(fit))
        if move.piece in pieces or (move.name == "merge" and move.piece + 1 in pieces)
    ]
    good = [move for move, free in options if allowed(free, framed, based)] or [move for move, _ in options]
    good = sorted(good, key=lambda m: -m.gain)[: 2 if fit.data.effort.spent else FEW]
    return min((untwisted(refined(move.made())) for move in good), key=lambda f: f.criterion)


def _climbed(fit, most):
    """As far as single moves lead."""
    for _ in range(ROUNDS):
        if fit.data.effort.spent:
            break
        options = [m for m in moves(fit, most) if m.gain > HOPE]
        for move in sorted(options, key=lambda m: -m.gain)[:TRIES]:
            if fit.data.effort.spent:
                return fit
            trial = untwisted(refined(move.made()))
            if trial.criterion < fit.criterion - BETTER:
                fit = trial
                break
        else:
            break
    return fit


def untwisted(fit: RodFit) -> RodFit:
    """The same curve with the twists of its twisting pieces within a quarter turn: half a turn more bends all
    that follows to the other side, which a rolled piece does without it. With frames it would show."""
    if fit.data.frames is not None:
        return fit
    strains, lengths = fit.rod.strains.copy(), fit.lengths
    for i in np.flatnonzero(fit.free[:, 0] & ~fit.free[:, 1]):
        half_turns = np.round(strains[i, 0] * lengths[i] / np.pi)
        strains[i, 0] -= half_turns * np.pi / lengths[i]
        strains[i + 1 :, 1] *= (-1) ** half_turns
    if (strains == fit.rod.strains).all():
        return fit
    return RodFit(fit.data, PiecewiseRod(fit.rod.start, fit.rod.joints, strains), fit.free, fit.feet)
