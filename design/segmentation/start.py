"""The first rod: the cheapest chain of stretches, joined in a section frame that is continuous along it."""

from dataclasses import dataclass

import numpy as np

from pneunet.base import se3
from pneunet.design.segmentation.fit import Observations, RodFit
from pneunet.design.segmentation.rod import PiecewiseRod, advance
from pneunet.design.segmentation.windows import Stretch, Stretches
from pneunet.design.target.extraction import turn_about_axis

FREE_FRAME = 5.0  # what a stretch's own frame explains more than a rod's continuous one would
HALF_TURN = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class _Part:
    """A piece before it is joined: arc lengths, strains, which of them are wanted, frames (3, 3) at both
    ends."""

    low: float
    high: float
    strains: np.ndarray
    wanted: np.ndarray
    before: np.ndarray
    after: np.ndarray


def _options(stretch, variance, framed, price):
    """[(cost, (k1, k2) wanted)] of a stretch as straight, circle and helix."""
    square, (torsion, bend) = stretch.square / variance, stretch.wald / variance
    # without frames a straight stretch may have any torsion
    straight = bend + torsion if framed else bend
    return (
        (square + straight, (False, False)),
        (square + torsion + price, (False, True)),
        (square + 2 * price, (True, True)),
    )


def chain(stretches: Stretches, noise: float, price: float) -> list[tuple[Stretch, np.ndarray]]:
    """The stretches, each with (2,) whether k1 and k2 are wanted, that together cover the curve at the least
    price (of a strain and of half a joint, in units of the noise's variance): dynamic programming over the
    cells. No two straight ones follow each other."""
    count = len(stretches.edges) - 1
    framed = stretches.frames is not None
    #: of every cell's end, by whether what ends there is straight: cost, stretch and what comes before it
    best: list[dict[bool, tuple]] = [{False: (0.0, None, None, None)}] + [{} for _ in range(count)]
    by_end: list[list[Stretch]] = [[] for _ in range(count + 1)]
    for stretch in stretches.found.values():
        by_end[stretch.last].append(stretch)
    for last in range(1, count + 1):
        for stretch in by_end[last]:
            for cost, wanted in _options(stretch, noise**2, framed, price):
                straight = not framed and not wanted[1]
                for before, step in best[stretch.first].items():
                    total = step[0] + cost + 2 * price + FREE_FRAME
                    if not (straight and before) and total < best[last].get(straight, (np.inf,))[0]:
                        best[last][straight] = (total, stretch, np.array(wanted), before)
    found: list[tuple[Stretch, np.ndarray]] = []
    last, straight = count, min(best[count], key=lambda s: best[count][s][0])
    while last:
        _, stretch, wanted, straight = best[last][straight]
        found.insert(0, (stretch, wanted))
        last = stretch.first
    return found


def _parts(stretches, chosen):
    parts = []
    for stretch, wanted in chosen:
        low, high = stretches.edges[stretch.first], stretches.edges[stretch.last]
        strains, turn = stretch.strains.copy(), stretch.pose[:3, :3]
        if stretches.frames is not None or wanted[1]:
            # of a curved one both are kept, or it would not end where it does
            wanted = np.array([True, True])
        if stretches.frames is None and strains[1] < 0:
            strains[1], turn = -strains[1], turn @ HALF_TURN
        strains = np.where(wanted, strains, 0.0)
        ends = advance(np.tile(strains, (2, 1)), np.array([low, high]) - stretch.s)[1]
        parts.append(_Part(low, high, strains, wanted, turn @ ends[0], turn @ ends[1]))
    return parts


def first_rods(
    data: Observations, stretches: Stretches, loose: tuple[float, ...], price: float
) -> list[RodFit]:
    """The chain's rods, not yet refined, one for each bound of `loose` (rad): where two curved pieces meet in
    planes further apart, modulo half a turn, a twisting piece is put between."""
    chosen = chain(stretches, data.noise, price)
    parts = _parts(stretches, chosen)
    rods, seen = [], set()
    for bound in loose:
        joints, strains, free, place = _joined(data, parts, bound)
        if tuple(np.round(joints, 6)) in seen:
            continue
        seen.add(tuple(np.round(joints, 6)))
        # the longest stretch's frame is where it was found; that of a straight one may have any roll
        anchor = max(range(len(parts)), key=lambda i: (parts[i].wanted[1], parts[i].high - parts[i].low))
        stretch = chosen[anchor][0]
        rod = PiecewiseRod(np.eye(4), np.array(joints), np.array(strains))
        station = rod.at(np.array([stretch.s]))
        turn = stretch.pose[:3, :3]
        own = strains[place[anchor]][1]
        if stretches.frames is None and own * stretch.strains[1] < 0:
            turn = turn @ HALF_TURN
        here = se3.make_pose(station.frames[0], station.points[0])
        there = se3.make_pose(turn, stretch.pose[:3, 3])
        start = there @ se3.inverse_pose(here)
        rods.append(
            RodFit(data, PiecewiseRod(start, rod.joints, rod.strains), np.array(free, bool), stretches.s)
        )
    return rods


def _joined(data, parts, bound):
    """(joints, strains, free, index of each part's piece) of the parts in one continuous frame."""
    joints, strains, free, place = [], [], [], []
    framed = data.frames is not None
    sign, last_curved = 1.0, None
    for i, part in enumerate(parts):
        curved = bool(part.wanted[1])
        if framed or not curved:
            strains.append(part.strains)
            free.append([framed, framed] if framed else [False, False])
            place.append(len(strains) - 1)
            joints.append(part.high)
            continue
        if last_curved is not None:
            turn = turn_about_axis(parts[last_curved].after, part.before)
            if abs(turn) > np.pi / 2:
                sign, turn = -sign, turn - np.sign(turn) * np.pi
            between = parts[last_curved + 1 : i]
            if between:
                # straight: its twist is what turns the plane
                first = place[last_curved] + 1
                length = sum(p.high - p.low for p in between)
                for j in range(first, len(strains)):
                    strains[j] = np.array([turn / length, 0.0])
                    free[j] = [True, False]
            elif abs(turn) > bound:
                half = data.shortest / 2
                centre = joints.pop()
                joints += [centre - half, centre + half]
                strains.append(np.array([turn / data.shortest, 0.0]))
                free.append([True, False])
        strains.append(part.strains * [1.0, sign])
        free.append(list(part.wanted))
        place.append(len(strains) - 1)
        joints.append(part.high)
        last_curved = i
    return joints[:-1], strains, free, place
