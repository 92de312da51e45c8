"""A cell's grid carried over to a cell of other dimensions: the mesh of the one becomes a mesh of the other.

All faces of a cell are planes across X3, across X2 or across xi = X1 less the chambers' lean
(geometry.ends). Maps that are piecewise linear in each of these coordinates take the planes of one
cell to those of another, and its grid to the other's.
"""

import numpy as np

from pneunet.geometry.ends import lean
from pneunet.geometry.parameters import TWISTING, Segment


class Morph:
    """From the cell of `segment` to that of `other`, a chamber of both centred at X1 = 0.

    The two are of one kind, and their faces in the same order along each coordinate.
    """

    def __init__(self, segment: Segment, other: Segment):
        self.segment, self.other = segment, other
        self._walls = _planes(_both(_walls(segment)), _both(_walls(other)))
        self._sides = _planes(_both(_sideways(segment)), _both(_sideways(other)))
        self._levels = _planes(_heights(segment), _heights(other))

    def along(self, xi: np.ndarray) -> np.ndarray:
        """Coordinates xi (n,) in mm, of any pitch."""
        number = np.round(xi / self.segment.pitch)
        return np.interp(xi - number * self.segment.pitch, *self._walls) + number * self.other.pitch

    def sideways(self, y: np.ndarray) -> np.ndarray:
        """Coordinates y (n,) in mm."""
        return np.interp(y, *self._sides)

    def upright(self, z: np.ndarray) -> np.ndarray:
        """Coordinates z (n,) in mm."""
        return np.interp(z, *self._levels)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) places in the other cell of points (n, 3), mm."""
        x, y, z = points.T
        new_xi = self.along(x - lean(self.segment, y, z))
        new_y, new_z = self.sideways(y), self.upright(z)
        return np.column_stack([new_xi + lean(self.other, new_y, new_z), new_y, new_z])


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
