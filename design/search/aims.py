"""What a rod is to meet: points at given fractions of its deformed length, and how far it is from them.

Points paired at equal fractions of arc length are the default. It bounds the paper's Eq. 27 from above, since
a nearest point is no farther than the paired one, and unlike Eq. 27 it is not lowered by a manipulator that
is too long.
"""

from dataclasses import dataclass

import numpy as np

from pneunet.base import se3
from pneunet.base.curve import nearest_on
from pneunet.design.target.shapes import TargetShape
from pneunet.design.target.target import Target
from pneunet.reduced.rod.placing import PlacedRod, Stations

PAIRED, EQ27 = "paired", "eq27"
OBJECTIVES = (PAIRED, EQ27)
PAIRS = 101
#: samples of a rod that nearest points are sought between
FINE = 401


@dataclass(frozen=True, eq=False)
class Aim:
    """points (s, 3) in mm at fractions (s,) of the deformed length; edges (s, 3, 2) or None: the section's
    width and height directions there, times half a width in mm; weights (s,) of mean 1 or None. nearest: the
    fractions are those of the nearest points instead. pressure in MPa, or several of groups, None: the
    design's own."""

    fractions: np.ndarray
    points: np.ndarray
    edges: np.ndarray | None = None
    half_width: float = 0.0
    nearest: bool = False
    weights: np.ndarray | None = None
    pressure: tuple[float, ...] | None = None

    @classmethod
    def of(
        cls,
        wanted: Target | TargetShape,
        width: float,
        objective: str = PAIRED,
        pressure: tuple[float, ...] | None = None,
    ) -> "Aim":
        """What a Target or a TargetShape asks of a body of a width in mm."""
        given = wanted.weights
        if objective == EQ27:
            weights = None if given is None else given / given.mean()
            zeros = np.zeros(len(wanted.points))
            return cls(zeros, wanted.points, nearest=True, weights=weights, pressure=pressure)
        fractions, s = np.linspace(0, 1, PAIRS), wanted.curve.arc_lengths
        weights = edges = None
        if given is not None:
            weights = np.interp(fractions * s[-1], s, given)
            weights = weights / weights.mean()
        if wanted.frames is not None:
            closest = np.abs(s[:, None] - fractions * s[-1]).argmin(axis=0)
            edges = width / 2 * wanted.frames[closest][:, :, 1:3]
        points = wanted.curve.evenly(PAIRS)
        return cls(fractions, points, edges, width / 2, weights=weights, pressure=pressure)

    @classmethod
    def all_of(cls, target: Target, width: float, objective: str = PAIRED) -> "tuple[Aim, ...]":
        """Its own curve, unless that is but a guide, then its further shapes, then where the tip is to be."""
        aims = [] if target.guided else [cls.of(target, width, objective)]
        aims += [cls.of(shape, width, pressure=shape.pressures) for shape in target.shapes]
        if target.tip is not None:
            tip, last = target.tip, np.ones(1)
            weights = np.ones(len(tip.points)) if tip.weights is None else tip.weights / tip.weights.mean()
            for point, pressure, weight in zip(tip.points, tip.pressures, weights):
                aims.append(cls(last, point[None], weights=weight * last, pressure=(float(pressure),)))
        return tuple(aims)

    def stations(self, rod: PlacedRod) -> Stations:
        """Where the rod is that is to meet the points."""
        if not self.nearest:
            return rod.at(self.fractions)
        fine = np.linspace(0, 1, FINE)
        return rod.at(_nearest(rod.points(fine), fine, self.points), sliding=False)

    def misfit(self, placed: Stations) -> np.ndarray:
        """(r,) in mm, whose squared norm is the mean squared distance."""
        parts = [(placed.points - self.points).ravel()]
        if self.edges is not None:
            parts.append((self.half_width * placed.poses[:, :3, 1:3] - self.edges).ravel())
        return self._weighed(np.concatenate(parts))

    def slopes(self, placed: Stations, turns: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """(r, n) derivatives of the misfit, of turns and moves (s, 3, n) of the stations as in Stations."""
        parts = [moves.reshape(3 * len(moves), moves.shape[2])]
        if self.edges is not None:
            columns = np.swapaxes(placed.poses[:, :3, 1:3], 1, 2)
            # a column c changes by turn x c
            edges = -self.half_width * se3.hat(columns) @ turns[:, None]
            parts.append(np.moveaxis(edges, 1, 2).reshape(6 * len(moves), moves.shape[2]))
        return self._weighed(np.vstack(parts))

    def _weighed(self, rows):
        """Rows of the points, then of the edges, whose squares add up to the points' mean and the edges'."""
        count = len(self.points)
        weights = np.ones(count) if self.weights is None else self.weights
        each = [np.repeat(np.sqrt(weights / count), 3)]
        if self.edges is not None:
            each.append(np.repeat(np.sqrt(weights / (2 * count)), 6))
        factors = np.concatenate(each)
        return rows * (factors if rows.ndim == 1 else factors[:, None])


def _nearest(line, fractions, points):
    """Fractions (n,) of the points of a polyline (m, 3), known at its vertices (m,), nearest to points
    (n, 3)."""
    edge, share = nearest_on(line, points)
    return fractions[edge] + share * np.diff(fractions)[edge]
