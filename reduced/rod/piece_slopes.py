"""A body's free pieces, as reduced.rod.ends has them, with their derivatives by every dimension, the number
of chambers and the pressure."""

from collections.abc import Collection, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import ONE_SIDED, PASSIVE, Segment
from pneunet.geometry.sections import rotation
from pneunet.geometry.shape_numbers import PITCH_BY, SHAPE
from pneunet.reduced.rod.ends import free_pieces
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.states import VARIABLES, StatesWithSlopes

#: what the derivatives are by, in order: degrees, mm, mm, mm, -, MPa, MPa
FIELDS = (*SHAPE, "end_margin", "plain_length", "chambers", "pressure", "mu")
FIELD_AT = {name: i for i, name in enumerate(FIELDS)}
#: of what laws give slopes by
OF_LAWS = [FIELD_AT[name] for name in VARIABLES]


def cell_states(
    law: SegmentLaw, segments: Sequence[Segment], pressures: ArrayLike, names: Collection[str] = SHAPE
) -> StatesWithSlopes:
    """StatesWithSlopes of n segments in their own axes at a pressure (MPa) for all or (n,), by those of SHAPE
    that are among `names` at least; passive segments are at rest and known."""
    n = len(segments)
    rows = [i for i, s in enumerate(segments) if s.kind != PASSIVE]
    pressures = np.broadcast_to(np.asarray(pressures, float), n)[rows]
    found = law.each_with_slopes([segments[i] for i in rows], pressures, names)
    if len(rows) == n:
        return found
    whole = {f.name: np.zeros((n, *getattr(found, f.name).shape[1:])) for f in fields(found)}
    whole["strains"][:, 0] = 1.0
    for name, values in whole.items():
        values[rows] = getattr(found, name)
    return StatesWithSlopes(**whole)


def piece_twists(
    segments: Sequence[Segment], free: np.ndarray, slopes: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(twists (3 n, 6) = (k, e) times length of the pieces of n segments in the body's axes, derivatives
    (3 n, 6, fields) by FIELDS of their own segment).

    free (n, 6), slopes (n, 6, 15): strains of the cells, derivatives by OF_LAWS; counts (n,): real numbers of
    chambers.
    """
    lengths, strains = free_pieces(segments, RodStrains.of_vector(free), counts)
    by = np.zeros((len(segments), 3, 6, len(FIELDS)))
    for i, segment in enumerate(segments):
        if segment.kind == PASSIVE:
            by[i, :, 3, FIELD_AT["plain_length"]] = 1 / 3
            continue
        q, by_q = free[i], np.zeros((6, len(FIELDS)))
        by_q[:, OF_LAWS] = slopes[i]
        by_end, by_middle = _end_by(segment), cells_length_by(segment, counts[i])
        by[i, 0, 3] = by[i, 2, 3] = by_end
        by[i, 1] = lengths[3 * i + 1] * np.roll(by_q, 3, axis=0) + np.roll(q, 3)[:, None] * by_middle
        if segment.kind == ONE_SIDED:
            turn = segment.core_bottom * by_q[3] - by_q[1]
            turn[FIELD_AT["channel_height"]] -= q[3] / 2
            turn[FIELD_AT["base_thickness"]] -= q[3]
            by[i, 0, 2], by[i, 2, 2] = turn, -turn
        if segment.roll:
            by[i] = (rotation(segment) @ by[i].reshape(3, 2, 3, -1)).reshape(3, 6, -1)
    return lengths[:, None] * strains.twist_vector, by.reshape(-1, 6, len(FIELDS))


def strain_slopes(segments: Sequence[Segment], free: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """(3 n, 6, 6) derivatives of `piece_twists` by the free strains of their own segment's cells."""
    n, none = len(segments), np.zeros((len(segments), 6, len(OF_LAWS)))
    unit = none.copy()
    unit[:, range(6), range(6)] = 1.0
    # what lengths do on their own is in both
    with_strains, without = (piece_twists(segments, free, a, counts)[1] for a in (unit, none))
    return (with_strains - without)[:, :, OF_LAWS[:6]].reshape(3 * n, 6, 6)


def cells_length_by(segment: Segment, count: float) -> np.ndarray:
    """(fields,) derivatives of the length (mm) of `count` cells."""
    out = np.zeros(len(FIELDS))
    out[: len(SHAPE)] = count / segment.sin * PITCH_BY
    out[FIELD_AT["chambers"]] = segment.pitch
    out[FIELD_AT["angle"]] = -count * segment.pitch * segment.cot * np.radians(1.0)
    return out


def _end_by(segment):
    """(fields,) derivatives of the length of an end."""
    end = np.zeros(len(FIELDS))
    end[FIELD_AT["end_margin"]], end[FIELD_AT["width"]] = 1.0, abs(segment.cot) / 2
    end[FIELD_AT["gap"]] = -0.5 / segment.sin
    by_angle = -np.sign(segment.cot) * segment.width / 2 / segment.sin + segment.gap * segment.cot / 2
    end[FIELD_AT["angle"]] = by_angle / segment.sin * np.radians(1.0)
    return end
