"""Which segments share a pressure, where a target asks for several and does not say."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import comb

from pneunet.base.errors import InputError
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import Target
from pneunet.geometry.parameters import PASSIVE

#: each is a search of its own
MOST = 12


def divided(target: Target, pieces: Sequence[Extracted]) -> list[tuple[Extracted, ...]]:
    """The pieces in every division into neighbours with as many pressures as the target asks for; as they are
    where it says groups, or asks for one pressure.

    A passive piece goes with what is before it. InputError where there are too few pieces or too many
    divisions.
    """
    count = max([target.groups, len(target.pressures), *(len(s.pressures) for s in target.shapes)])
    if count == 1 or any(piece.group > 1 for piece in pieces):
        return [tuple(pieces)]
    active = [i for i, piece in enumerate(pieces) if piece.kind != PASSIVE]
    if len(active) < count:
        raise InputError(
            f"pressure_kPa: {count} pressures need as many pieces that bend or twist, not {len(active)}: give"
            " fewer pressures, or a split with more pieces"
        )
    if comb(len(active) - 1, count - 1) > MOST:
        raise InputError(
            f"there are too many ways to divide {len(active)} pieces into {count} pressure groups: write"
            " pressure_group = 1, 2, ... in the [[piece]] tables (split.toml of a first design has them)"
        )
    return [
        tuple(replace(piece, group=1 + sum(i >= cut for cut in cuts)) for i, piece in enumerate(pieces))
        for cuts in combinations(active[1:], count - 1)
    ]
