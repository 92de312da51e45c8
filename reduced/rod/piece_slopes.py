"""A segment's pieces, bare core, cells, bare core, as reduced.rod.ends has them, with their derivatives by
every dimension, the number of chambers and the pressure."""

from collections.abc import Sequence

import numpy as np

from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import ONE_SIDED, Segment
from pneunet.geometry.shape_numbers import SHAPE
from pneunet.reduced.rod.ends import free_pieces

#: what the derivatives are by, in order: degrees, mm, mm, -, MPa
FIELDS = (*SHAPE, "end_margin", "chambers", "pressure")
_AT = {name: i for i, name in enumerate(FIELDS)}
#: of the shape and the pressure, which are what laws give slopes by
OF_LAWS = [_AT[name] for name in (*SHAPE, "pressure")]

#: derivatives of the normal pitch by cavity_thickness, wall and gap
_OF_PITCH = np.array([1.0, 2.0, 1.0])


def piece_twists(
    segments: Sequence[Segment], free: np.ndarray, slopes: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(twists (3 n, 6) = (k, e) times length of the pieces of n segments, derivatives (3 n, 6, fields) by
    FIELDS of their own segment).

    free (n, 6), slopes (n, 6, 14): strains of the cells and their derivatives by OF_LAWS; counts (n,): real
    numbers of chambers.
    """
    lengths, strains = free_pieces(segments, RodStrains.of_vector(free), counts)
    twists = lengths[:, None] * strains.twist_vector
    by = np.zeros((len(segments), 3, 6, len(FIELDS)))
    for i, segment in enumerate(segments):
        q, by_q = free[i], np.zeros((6, len(FIELDS)))
        by_q[:, OF_LAWS] = slopes[i]
        by_end, by_middle = _lengths_by(segment, counts[i], lengths[3 * i + 1])
        by[i, 0, 3] = by[i, 2, 3] = by_end
        by[i, 1] = lengths[3 * i + 1] * np.roll(by_q, 3, axis=0) + np.roll(q, 3)[:, None] * by_middle
        if segment.kind == ONE_SIDED:
            turn = segment.core_bottom * by_q[3] - by_q[1]
            turn[_AT["channel_height"]] -= q[3] / 2
            turn[_AT["base_thickness"]] -= q[3]
            by[i, 0, 2], by[i, 2, 2] = turn, -turn
    return twists, by.reshape(-1, 6, len(FIELDS))


def _lengths_by(segment, count, middle):
    """Derivatives (fields,) of the lengths of an end and of the cells, `middle` mm."""
    end, cells, degree = np.zeros(len(FIELDS)), np.zeros(len(FIELDS)), np.radians(1.0)
    end[_AT["end_margin"]], end[_AT["width"]], end[_AT["gap"]] = 1.0, abs(segment.cot) / 2, -0.5 / segment.sin
    by_angle = -np.sign(segment.cot) * segment.width / 2 / segment.sin + segment.gap * segment.cot / 2
    end[_AT["angle"]] = by_angle / segment.sin * degree
    cells[_AT["chambers"]], cells[_AT["angle"]] = segment.pitch, -middle * segment.cot * degree
    cells[[_AT[name] for name in ("cavity_thickness", "wall", "gap")]] = count / segment.sin * _OF_PITCH
    return end, cells
