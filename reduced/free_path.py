"""The free states of one kind of cell along their path, as a trained law knows them.

Strains over pressure bend ever more towards a limit load, each design's at its own place, and end there. Along the path itself, at
whatever leading strain, nothing happens at a limit load: learned is the pressure over the leading strain as a function of shape and
leading strain, and the other strains over it. (Measured, against functions of the pressure: a fifth to a quarter off the 95th
percentile of the error.) The leading strain at a pressure is found from it by Euler's method: each step goes to where the parabola
with the curve's value, slope and curvature meets the pressure, or to its top where it does not: beyond a limit load.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reduced.along_input import AlongInput
from reduced.gaussian import ROWS
from reduced.law_coordinates import LEADING, SMALL_STRAIN, Coordinates, cosine, odd
from reduced.side_by_side import SideBySide

#: steps over the slope that end the search, of log(leading strain): what is left after them is of third order (measured: at most 5e-5
#: in the leading strain, a hundredth of the law's error); the longest; how many. (Slopes next
#: to a limit load count as FLAT there: at most 4e-6.)
NEAR, LONGEST, MOST = 0.07, 0.7, 20
#: of d log P/d log(leading strain), from there on next to a limit load: derivatives and deviations are no larger than there
FLAT = 0.02
#: of log P by which a pressure lies beyond the end of a path
ABOVE = 1e-3
#: place of the leading strain among the inputs
PLACE = -2


@dataclass(frozen=True)
class FreePath:
    """learned: processes of Coordinates.learned_strains at path_inputs, the leading strain's by itself; start: a rough one of
    log(leading strain/P) at inputs; furthest: leading strain up to which paths are followed."""

    kind: str
    learned: SideBySide
    start: SideBySide
    furthest: float

    @cached_property
    def coordinates(self):
        return Coordinates(self.kind)

    @cached_property
    def _last(self):
        return float(np.log(self.furthest))

    @cached_property
    def _along(self):
        return AlongInput(self.learned.processes[0], PLACE)

    def at(self, shape, pressure, level):
        """(leading strain (n,), log P beyond the path's end (n,), 0 up to it, path_inputs (n, d)) at shape numbers (n, 13), P/mu
        (n,) > 0 and the mesh's level, (n,) or a number. A path ends at its limit load, or where it leaves what is known."""
        if len(shape) > ROWS:
            each = shape, pressure, np.broadcast_to(level, len(shape))
            parts = [self.at(*(a[i : i + ROWS] for a in each)) for i in range(0, len(shape), ROWS)]
            return tuple(map(np.concatenate, zip(*parts)))
        x, wanted, last = self.coordinates.inputs(shape, pressure, level), np.log(pressure), self._last
        v = np.minimum(self.start(x)[:, 0] + wanted, last)
        x[:, PLACE] = at_start = np.log(np.exp(v) + SMALL_STRAIN)
        found, beyond, searched, start = np.empty(len(v)), np.zeros(len(v)), slice(None), self._along.start(x)
        for _ in range(MOST):
            lead = np.exp(v)
            end = lead + SMALL_STRAIN
            h = lead / end  # the input's derivative by v
            value, slope, curvature = self._along.at(start, np.log(end) - at_start)
            missing, slope, curvature = wanted - value - v, 1 + slope * h, h * (curvature * h + slope * (1 - h))
            step = np.minimum(_euler(missing, slope, curvature), last - v)
            v = v + step
            found[searched], beyond[searched] = v, missing * ((slope < FLAT) | (v >= last))
            far = np.abs(step) > NEAR * np.maximum(slope, FLAT)
            if not far.any():
                break
            if not far.all():
                searched = np.arange(len(found))[searched][far]
                v, wanted, at_start, start = v[far], wanted[far], at_start[far], [a[far] for a in start]
        lead = np.exp(found)
        x[:, PLACE] = np.log(lead + SMALL_STRAIN)
        return lead, beyond * (beyond > ABOVE), x

    def strains(self, shape, pressure, level):
        """(n, 6) free strains."""
        lead, _, x = self.at(shape, pressure, level)
        return self.coordinates.strains(shape, lead, self.learned.rest(x))

    def _slopes(self, shape, pressure, level):
        """(lead (n,), inputs x, ratios (n, p - 1), slopes (n, p, d) by x, d log P/d log(lead) (n,) at least FLAT)."""
        lead, _, x = self.at(shape, pressure, level)
        learned, slopes = self.learned(x, derivative=True)
        steep = 1 + slopes[:, 0, PLACE] * lead / (lead + SMALL_STRAIN)
        return lead, x, learned[:, 1:], slopes, np.maximum(steep, FLAT)

    def strains_and_slopes(self, shape, pressure, level):
        """(strains (n, 6), slopes (n, 6, 14)): derivatives by the 13 shape numbers (the angle in degrees) and P/mu."""
        co = self.coordinates
        lead, _, ratios, slopes, steep = self._slopes(shape, pressure, level)
        by = co.by_shape(shape, slopes)  # (n, p, 14)
        by_lead = -by[:, 0] * (lead / steep)[:, None]
        by_lead[:, -1] = lead / steep / pressure
        by[:, 1:] += (slopes[:, 1:, PLACE] / (lead + SMALL_STRAIN)[:, None])[:, :, None] * by_lead[:, None]
        return co.strains(shape, lead, ratios), co.strain_slopes(shape, lead, ratios, by[:, 1:], by_lead)

    def spread(self, shape, pressure, level):
        """(n, 6) standard deviation of the free strains as the Gaussian processes see it, taken as independent."""
        lead, x, ratios, slopes, steep = self._slopes(shape, pressure, level)
        deviation = self.learned.deviation(x)
        of_lead, (first, others), out = lead * deviation[:, 0] / steep, LEADING[self.kind], np.zeros((len(lead), 6))
        out[:, first] = of_lead
        by_lead = ratios + slopes[:, 1:, PLACE] * (lead / (lead + SMALL_STRAIN))[:, None]
        c = np.abs(odd(self.coordinates.strain_parity[1:], cosine(shape)))
        out[:, others] = c * np.hypot(lead[:, None] * deviation[:, 1:], by_lead * of_lead[:, None])
        return out

    def deviation(self, x):
        """(n,) standard deviation of log P at path_inputs (n, d)."""
        return self.learned.processes[0].deviation(x)[:, 0]


def _euler(missing, slope, curvature):
    """(n,) steps to where slope s + curvature s^2/2 is what is missing, on the branch of positive slope, or to the parabola's top."""
    inside = slope**2 + 2 * curvature * missing
    root = np.sqrt(np.maximum(inside, 0))
    if slope.min() > FLAT and inside.min() >= 0:
        return np.minimum(2 * missing / (slope + root), LONGEST)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.where(slope > 0, 2 * missing / (slope + root), np.where(curvature < 0, (root - slope) / curvature, -LONGEST))
        step = np.where((inside < 0) & (curvature < 0), -slope / curvature, step)
    return np.clip(step, -LONGEST, LONGEST)
