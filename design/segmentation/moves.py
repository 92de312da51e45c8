"""Moves: changes of what a rod is made of, with what each will gain.

A strain is dropped or freed, two pieces become one, one becomes two, a piece goes, a twist comes in between.
What a move will gain is predicted from the present fit alone: by what the strain's estimate and its variance
say of dropping it (Wald's test), by the slope of the cost by what is not free yet (the score test).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pneunet.design.segmentation.fit import STRAIN, RodFit, capped
from pneunet.design.segmentation.rod import PiecewiseRod

HOPE = -8.0  # predicted gain below which a move is not tried
CUT = 5.0  # mm between the places at which a piece may be cut
SHIFT = 10.0  # mm by which a joint is displaced to see whether it settles in a better place


@dataclass(frozen=True, eq=False)
class Move:
    """A change, at or behind a piece, with its predicted gain in the criterion."""

    name: str
    gain: float
    made: Callable[[], RodFit]
    piece: int = 0


def allowed(free: np.ndarray, framed: bool, based: bool) -> bool:
    """Whether points can tell the pieces of free strains (n, 2): without frames no twist shows at an end, and
    of two straight pieces in a row one is enough."""
    if framed:
        return True
    straight = ~free[:, 1]
    if (straight[1:] & straight[:-1]).any():
        return False
    ends = [-1] if based else [0, -1]
    return not any(straight[i] and free[i, 0] for i in ends)


def moves(fit: RodFit, most: int) -> Iterator[Move]:
    """All `Move`s from a refined fit that leave what the points can tell."""
    data = fit.data
    framed, based = data.frames is not None, data.base is not None

    def fits(free):
        return len(free) <= most and allowed(free, framed, based)

    n = len(fit.free)
    for move, free in (*_simpler(fit), *_richer(fit), *merged(fit), *without(fit), *_shifted(fit)):
        if fits(free):
            yield move
    if n < most:
        for move, free in (*_split(fit), *_twisted(fit)):
            if fits(free):
                yield move


def _column(fit, piece, a):
    """Place of a free strain among the free parameters."""
    return 5 + len(fit.free) + int(fit.free.ravel()[: 2 * piece + a].sum())


def _changed(fit, step, free=None, edit=None):
    """The fit after a step of its free parameters, then with strains edited and other ones free."""
    moved = fit.stepped(capped(step, len(fit.free) - 1))
    joints, strains = moved.rod.joints.copy(), moved.rod.strains.copy()
    if edit is not None:
        joints, strains = edit(joints, strains)
    free = fit.free if free is None else free
    strains = np.where(free, strains, 0.0)
    least = 1.0
    low, high = moved.feet.min() + least, moved.feet.max() - least
    joints = np.clip(joints, low, high)
    for i in range(1, len(joints)):
        joints[i] = max(joints[i], joints[i - 1] + 1.5 * least)
    return RodFit(fit.data, PiecewiseRod(moved.rod.start, joints, strains), free, moved.feet)


def _conditional(fit, rows, values):
    """(step that makes linear combinations `rows` (m, q) of the parameters fall by `values` (m,) at the least
    cost, that cost)."""
    across = fit.covariance @ rows.T
    weights = np.linalg.solve(rows @ across, values)
    return -across @ weights, float(values @ weights)


def _simpler(fit):
    for piece, a in zip(*np.nonzero(fit.free)):
        q = _column(fit, piece, a)
        row = np.zeros((1, len(fit.columns)))
        row[0, q] = 1.0
        step, cost = _conditional(fit, row, fit.rod.strains[piece, a][None])
        price = np.log(max(STRAIN**2 / fit.covariance[q, q], 1.0))
        free = fit.free.copy()
        free[piece, a] = False
        yield _drop(fit, "drop", price - cost, step, free), free
        if a == 1 and fit.free[piece, 0]:
            rows = np.zeros((2, len(fit.columns)))
            rows[0, q - 1] = rows[1, q] = 1.0
            step, cost = _conditional(fit, rows, fit.rod.strains[piece])
            straight = free.copy()
            straight[piece] = False
            yield _drop(fit, "straighten", 2 * price - cost, step, straight), straight


def _drop(fit, name, gain, step, free):
    return Move(name, gain, lambda: _changed(fit, step, free))


def _score(fit, columns):
    """Of further columns (m, rows, c) of slopes: gradient (c,), curvature (c, c) once the free parameters
    have answered, and these answers (q, c)."""
    weight = 1 / fit.data.noise**2
    flat = columns.reshape(-1, columns.shape[-1])
    own = fit.slopes[:, 1:, fit.columns].reshape(len(flat), -1)
    across = weight * (flat.T @ own)
    answers = -fit.covariance @ across.T
    curvature = weight * (flat.T @ flat) + across @ answers
    gradient = weight * (flat.T @ fit.misfit.ravel()) + answers.T @ fit.normal[1]
    return gradient, curvature, answers


def _richer(fit):
    n = len(fit.free)
    for piece, a in zip(*np.nonzero(~fit.free)):
        column = fit.slopes[:, 1:, 5 + n + 2 * piece + a, None]
        gradient, curvature, answers = _score(fit, column)
        h = max(curvature[0, 0], 0.0) + 1 / STRAIN**2
        value = gradient[0] / h
        free = fit.free.copy()
        free[piece, a] = True

        def made(value=value, step=answers[:, 0] * value, free=free, piece=piece, a=a):
            def edit(joints, strains):
                strains[piece, a] = value
                return joints, strains

            return _changed(fit, step, free, edit)

        yield Move("free", gradient[0] * value - np.log(STRAIN**2 * h), made), free


def _joint_price(fit, i):
    """What dropping joint i gains."""
    variance = max(fit.covariance[6 + i, 6 + i], 1e-12)
    return fit.data.joint_price - np.log(variance)


def merged(fit: RodFit) -> Iterator[tuple[Move, np.ndarray]]:
    """Two neighbouring pieces become one; with each move the free strains (n, 2) that it leaves."""
    for i in range(len(fit.free) - 1):
        union = fit.free[i] | fit.free[i + 1]
        rows, values, price = [], [], _joint_price(fit, i)
        for a in np.flatnonzero(union):
            row = np.zeros(len(fit.columns))
            for piece, sign in ((i, 1.0), (i + 1, -1.0)):
                if fit.free[piece, a]:
                    row[_column(fit, piece, a)] = sign
            rows.append(row)
            values.append(fit.rod.strains[i, a] - fit.rod.strains[i + 1, a])
            if fit.free[i, a] and fit.free[i + 1, a]:
                price += np.log(max(STRAIN**2 / (row @ fit.covariance @ row), 1.0))
        step, cost = np.zeros(len(fit.columns)), 0.0
        if rows:
            step, cost = _conditional(fit, np.array(rows), np.array(values))
        free = np.delete(fit.free, i + 1, axis=0)
        free[i] = union
        first = fit.lengths[i] > fit.lengths[i + 1]

        def made(step=step, free=free, i=i, union=union, first=first):
            def edit(joints, strains):
                own = fit.free[i] if first else fit.free[i + 1]
                kept = np.where(own, strains[i if first else i + 1], strains[i + 1 if first else i])
                strains[i] = kept
                return np.delete(joints, i), np.delete(strains, i + 1, axis=0)

            return _changed(fit, step, free, edit)

        yield Move("merge", price - cost, made, i), free


def without(fit: RodFit) -> Iterator[tuple[Move, np.ndarray]]:
    """A piece goes and its neighbours meet in its middle; one at an end is taken over by its neighbour. With
    each move the free strains (n, 2) that it leaves."""
    n = len(fit.free)
    for i in range(n) if n > 1 else ():
        free = np.delete(fit.free, i, axis=0)

        def made(i=i, free=free):
            def edit(joints, strains):
                if 0 < i < n - 1:
                    joints[i - 1] = (joints[i - 1] + joints[i]) / 2
                    turned = strains[i, 0] * (fit.rod.joints[i] - fit.rod.joints[i - 1])
                    if not fit.free[i, 1] and abs(turned) > np.pi / 2:
                        strains[i + 1 :, 1] *= -1
                    return np.delete(joints, i), np.delete(strains, i, axis=0)
                return np.delete(joints, max(0, i - 1)), np.delete(strains, i, axis=0)

            return _changed(fit, np.zeros(len(fit.columns)), free, edit)

        short = fit.lengths[i] < 2 * fit.data.shortest
        yield Move("omit", HOPE + 1.0 if short else HOPE - 1.0, made, i), free


def _shifted(fit):
    """A joint may have settled in the wrong place: it is displaced as far as there is room."""
    for i in range(len(fit.rod.joints)):
        for side, room in ((-1, fit.lengths[i]), (1, fit.lengths[i + 1])):
            if room < SHIFT + fit.data.shortest / 2:
                continue

            def made(i=i, side=side):
                row = np.zeros((1, len(fit.columns)))
                row[0, 6 + i] = 1.0
                step, _ = _conditional(fit, row, np.array([-side * SHIFT]))
                return _changed(fit, step)

            yield Move("shift", HOPE + 0.5, made), fit.free


def _split(fit):
    """The best place to cut each piece, and what then changes behind it."""
    n, lengths = len(fit.free), fit.lengths
    ends = np.concatenate([[fit.feet.min()], fit.rod.joints, [fit.feet.max()]])
    places, owner = [], []
    for i in range(n):
        room = lengths[i] - fit.data.shortest
        if room > 0:
            count = int(room / CUT) + 1
            margin = fit.data.shortest / 2
            places.append(np.linspace(ends[i] + margin, ends[i + 1] - margin, count + 2))
            owner.append(np.full(count + 2, i))
    if not places:
        return
    cuts, owners = np.concatenate(places), np.concatenate(owner)
    rod = fit.rod.cut(cuts)
    pieces = len(rod.strains)
    slopes = fit.slopes_of(rod, rod.at(fit.feet))[:, 1:, 5 + pieces :]
    slopes = slopes.reshape(slopes.shape[:2] + (pieces, 2))
    tails = np.cumsum(slopes[:, :, ::-1], axis=2)[:, :, ::-1]
    for i in range(n):
        mine = np.flatnonzero(owners == i)
        if not len(mine):
            continue
        after = i + mine + 1  # index, among the cut rod's pieces, of what begins at each cut
        end = i + mine[-1] + 2
        columns = tails[:, :, after] - (tails[:, :, end : end + 1] if end < pieces else 0.0)
        yield from _best_cuts(fit, i, cuts[mine], columns)


def _best_cuts(fit, piece, places, columns):
    gradient, curvature, answers = _score(fit, columns.reshape(columns.shape[:2] + (-1,)))
    prior = 1 / STRAIN**2
    for subset in ((0, 1), (0,), (1,)):
        best: tuple = (-np.inf,)
        for c, place in enumerate(places):
            index = [2 * c + a for a in subset]
            own = curvature[np.ix_(index, index)] + prior * np.eye(len(index))
            value = np.linalg.solve(own, gradient[index])
            gain = float(gradient[index] @ value)
            size = np.linalg.slogdet(own)[1] + 2 * len(index) * np.log(STRAIN)
            if gain - size > best[0]:
                best = (gain - size, place, value, answers[:, index] @ value)
        gain, place, value, step = best
        free = np.insert(fit.free, piece + 1, fit.free[piece], axis=0)
        free[piece + 1, list(subset)] = True

        def made(free=free, place=place, value=value, step=step, subset=subset):
            def edit(joints, strains):
                strains = np.insert(strains, piece + 1, strains[piece], axis=0)
                strains[piece + 1, list(subset)] += np.clip(value, -0.03, 0.03)
                return np.insert(joints, piece, place), strains

            return _changed(fit, step, free, edit)

        # a joint is placed to some mm
        yield Move("split", gain - fit.data.joint_price + 2.0, made), free


def _twisted(fit):
    """A twisting piece comes in at a joint of two curved ones."""
    n = len(fit.free)
    if n < 2:
        return
    at = fit.rod.at(fit.rod.joints)
    station = fit.station
    for i in range(n - 1):
        if not (fit.free[i, 1] and fit.free[i + 1, 1]):
            continue
        axis, pivot = at.frames[i][:, 0], at.points[i]
        after = (station.piece > i)[:, None]
        back = np.swapaxes(station.frames, 1, 2)
        moved = (back @ np.cross(axis, station.points - pivot)[..., None])[..., 0] * after
        column = moved[:, 1:, None]
        if fit.data.frames is not None:
            return
        gradient, curvature, answers = _score(fit, column)
        h = max(curvature[0, 0], 0.0) + 1.0
        angle = gradient[0] / h
        length = fit.data.shortest
        free = np.insert(fit.free, i + 1, [True, False], axis=0)

        def made(free=free, i=i, angle=angle, step=answers[:, 0] * angle, length=length):
            def edit(joints, strains):
                strains = np.insert(strains, i + 1, [angle / length, 0.0], axis=0)
                joints = np.insert(joints, i, joints[i] - length / 2)
                joints[i + 1] += length / 2
                return joints, strains

            return _changed(fit, step, free, edit)

        price = np.log(h) + fit.data.joint_price - 2.0
        yield Move("twist", gradient[0] * angle - price, made), free
