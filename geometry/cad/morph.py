"""A cell's body carried over to one of slightly other dimensions: the mesh of the one becomes a mesh of the
other.

All faces of a cell are planes: across X3, across X2, or slanted walls, which are planes across X1 - X2
cot(angle). A map that is piecewise linear in each of these coordinates takes the planes of one cell to those
of another.
"""

import numpy as np

from pneunet.geometry.parameters import TWISTING, Segment


def moved(points: np.ndarray, segment: Segment, other: Segment) -> np.ndarray:
    """(n, 3) places in the cell of `other` of points (n, 3) of the cell of `segment` (mm), a chamber of both
    centred at X1 = 0.

    The two are of one kind, and their faces in the same order along each coordinate.
    """
    x, y, z = points.T
    new_y = np.interp(y, _both(_sideways(segment)), _both(_sideways(other)))
    new_z = np.interp(z, *_planes(_heights(segment), _heights(other)))
    if segment.kind == TWISTING:
        # the two sets of chambers lean to opposite sides; between them, in the channel's height, nothing is
        # slanted
        above = (1 + np.clip(z / segment.cavity_floor, -1, 1)) / 2
        new_x = sum(
            w * _along(x, y, new_y, segment, other, side) for w, side in ((above, 1), (1 - above, -1))
        )
    else:
        new_x = _along(x, y, new_y, segment, other, 1)
    return np.column_stack([new_x, new_y, new_z])


def _along(x, y, new_y, segment, other, side):
    along = x - side * segment.cot * y
    number = np.round(along / segment.pitch)
    within = np.interp(along - number * segment.pitch, _both(_walls(segment)), _both(_walls(other)))
    return within + number * other.pitch + side * other.cot * new_y


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
