"""A cell's body carried over to one of slightly other dimensions: the mesh of the one becomes a mesh of the
other.

All faces of a cell are planes across X3, across X2 or across xi = X1 less the chambers' lean
(geometry.ends). A map that is piecewise linear in each of these coordinates takes the planes of one
cell to those of another, and its grid to the other's.
"""

import numpy as np

from pneunet.geometry.ends import lean
from pneunet.geometry.parameters import TWISTING, Segment


def moved(points: np.ndarray, segment: Segment, other: Segment) -> np.ndarray:
    """(n, 3) places in the cell of `other` of points (n, 3) of the cell of `segment` (mm), a chamber of both
    centred at X1 = 0.

    The two are of one kind, and their faces in the same order along each coordinate.
    """
    x, y, z = points.T
    new_y = np.interp(y, _both(_sideways(segment)), _both(_sideways(other)))
    new_z = np.interp(z, *_planes(_heights(segment), _heights(other)))
    xi = x - lean(segment, y, z)
    number = np.round(xi / segment.pitch)
    within = np.interp(xi - number * segment.pitch, _both(_walls(segment)), _both(_walls(other)))
    new_xi = within + number * other.pitch
    return np.column_stack([new_xi + lean(other, new_y, new_z), new_y, new_z])


def _both(values):
    return np.concatenate([-np.array(values[::-1]), values])


def _walls(s):
    return [s.cavity_thickness / 2 / s.sin, s.chamber_thickness / 2 / s.sin, s.pitch / 2]


def _sideways(s):
    return [s.channel_width / 2, s.cavity_width / 2, s.width / 2]


def _heights(s):
    above = [s.channel_height / 2, s.cavity_floor, s.core_top, s.cavity_top, s.chamber_top]
    return np.array(
        [*above, *(-np.array(above) if s.kind == TWISTING else [-s.channel_height / 2, s.core_bottom])]
    )


def _planes(heights, others):
    """Both in rising order, those that are one plane once."""
    order = np.argsort(heights, kind="stable")
    heights, others = heights[order], others[order]
    first = np.append(True, np.diff(heights) > 1e-9)
    return heights[first], others[first]
