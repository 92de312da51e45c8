"""The free states of one kind of cell along their path, as a trained law knows them.

Strains over pressure bend ever more towards a limit load, each design's at its own place, and end there.
Along the path itself, at whatever leading strain, nothing happens at a limit load: learned is the pressure
over the leading strain as a function of shape and leading strain, and the other strains over it. (Measured: a
fifth off the error over the pressure.) Where walls touch they have a kink, so by how much walls would overlap
is an input as well. (Measured: an eighth off the error of the tips.) The leading strain at a pressure is
found from it by Euler's method: each step goes to where the parabola with the curve's value, slope and
curvature meets the pressure, or to its top where it does not: beyond a limit load.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.reduced.trained.along_inputs import AlongInputs
from pneunet.reduced.trained.closing import Closing
from pneunet.reduced.trained.coordinates import (
    LEAD,
    LEADING,
    OVERLAP,
    SMALL_STRAIN,
    Coordinates,
    cosine,
    odd,
)
from pneunet.reduced.trained.gaussian import JITTER, ROWS
from pneunet.reduced.trained.side_by_side import SideBySide
from pneunet.reduced.trained.state_on_path import PathChain, StateOnPath
from pneunet.reduced.trained.unexplained import Unexplained

#: steps over the slope that end the search, of log(leading strain): what is left after them is of third order
#: (measured: at most 5e-5 in the leading strain, a hundredth of the law's error); the longest; how many.
#: (Slopes next to a limit load count as FLAT there: at most 4e-6.)
NEAR, LONGEST, MOST = 0.07, 0.7, 20
#: the same for values that agree with their derivatives (left: 1e-8)
NEARER = 0.004
#: of d log P/d log(leading strain), from there on next to a limit load: derivatives and deviations are no
#: larger than there
FLAT = 0.02
#: of log P by which a pressure lies beyond the end of a path
ABOVE = 1e-3


@dataclass(frozen=True)
class FreePath:
    """closing: how walls come nearer; learned: processes of Coordinates.learned_strains at path_inputs, the
    leading strain's by itself; start: a rough one of log(leading strain/P) at inputs; furthest: leading
    strain up to which paths are followed; remainder (2, 2): of each learned process factor and power that
    give from the part of the prior variance that its inducing points leave, as a rule, what observations
    leave besides; landmarks (l,): places among the inducing points of the leading strain's process from which
    alone it mostly shows that enough is known."""

    kind: str
    closing: Closing
    learned: SideBySide
    start: SideBySide
    furthest: float
    remainder: np.ndarray
    landmarks: np.ndarray

    @cached_property
    def coordinates(self) -> Coordinates:
        return Coordinates(self.kind)

    @cached_property
    def _last(self):
        return float(np.log(self.furthest))

    @cached_property
    def _along(self):
        return AlongInputs(self.learned.processes[0], [LEAD, OVERLAP])

    @cached_property
    def _unexplained(self):
        return tuple(Unexplained(process) for process in self.learned.processes)

    @cached_property
    def _by_landmarks(self):
        return Unexplained(self.learned.processes[0], self.landmarks)

    def at(
        self, numbers: np.ndarray, pressure: np.ndarray, near: float = NEAR
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(leading strain (n,), log P beyond the path's end (n,), 0 up to it, path_inputs (n, d)) at numbers
        (n, 15) and P/mu (n,) > 0. A path ends at its limit load, or where it leaves what is known. near:
        which steps end the search."""
        if len(numbers) > ROWS:
            blocks = [slice(start, start + ROWS) for start in range(0, len(numbers), ROWS)]
            parts = [self.at(numbers[b], pressure[b], near) for b in blocks]
            leads, ends, path_inputs = map(np.concatenate, zip(*parts))
            return leads, ends, path_inputs
        co, last = self.coordinates, self._last
        inputs, wanted = co.inputs(numbers, pressure), np.log(pressure)
        v = np.minimum(self.start(inputs)[:, 0] + wanted, last)
        everywhere = x = np.concatenate([inputs, v[:, None]], axis=1)
        found, overlap, beyond, searched = np.empty(len(v)), np.empty(len(v)), np.zeros(len(v)), slice(None)
        for _ in range(MOST):
            lead = np.exp(v)
            over, over_slope, over_curvature = self.closing.along(x, numbers, pressure, lead)
            x[:, LEAD], x[:, OVERLAP] = np.log(lead + SMALL_STRAIN), co.overlap_input(over)
            value, slopes, curvatures = self._along.at(x)
            # derivatives by v = log(leading strain): of one input, of log P along it, and, where walls touch,
            # along the other too
            share, touch = lead / (lead + SMALL_STRAIN), over > 0
            by_share = slopes[:, 0] * share
            slope = 1 + by_share
            curvature = curvatures[:, 0, 0] * share**2 + by_share * (1 - share)
            pace = 1.0
            if touch.any():
                by_overlap = co.overlap_input_slope(over) * lead
                closes = by_overlap * over_slope
                slope += slopes[:, 1] * closes
                curvature += (2 * curvatures[:, 0, 1] * share + curvatures[:, 1, 1] * closes) * closes
                curvature += slopes[:, 1] * (by_overlap * lead * over_curvature + closes * (1 - closes))
                pace = np.maximum(closes, 1)
            missing = wanted - value - v
            step = np.minimum(_euler(missing, slope, curvature), last - v)
            v = v + step
            moved = np.exp(v) - lead
            then = over + moved * (over_slope + moved / 2 * over_curvature)
            found[searched], overlap[searched] = v, then
            beyond[searched] = missing * ((slope < FLAT) | (v >= last))
            far = (np.abs(step) * pace > near * np.maximum(slope, FLAT)) | (touch != (then > 0))
            if not far.any():
                break
            searched = np.arange(len(found))[searched][far]
            x, v, wanted, numbers, pressure = (a[far] for a in (x, v, wanted, numbers, pressure))
        lead = np.exp(found)
        everywhere[:, LEAD], everywhere[:, OVERLAP] = np.log(lead + SMALL_STRAIN), co.overlap_input(overlap)
        return lead, beyond * (beyond > ABOVE), everywhere

    def strains_and_end(self, numbers: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(free strains (n, 6), log P beyond the path's end (n,))."""
        lead, beyond, x = self.at(numbers, pressure)
        return self.coordinates.strains(numbers, lead, self.learned.rest(x)), beyond

    def strains(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, 6) free strains."""
        return self.strains_and_end(numbers, pressure)[0]

    def state_and_slopes(self, numbers: np.ndarray, pressure: np.ndarray, near: float = NEAR) -> StateOnPath:
        """The StateOnPath of numbers (n, 15) at P/mu (n,) > 0; the rest as for `at`."""
        co, (lead, beyond, x) = self.coordinates, self.at(numbers, pressure, near)
        overlap, overlap_by, overlap_by_lead = self.closing.overlap_and_slopes(numbers, pressure, lead)
        chain = PathChain(co, numbers, lead, overlap, overlap_by, overlap_by_lead)
        learned, slopes = self.learned.with_slopes(x)
        by, by_lead = chain.at_lead(slopes), chain.by_lead(slopes)
        steep = np.maximum(1 + by_lead[:, 0] * lead, FLAT)
        missing_by = -by[:, 0]
        missing_by[:, -1] += 1 / pressure
        return StateOnPath(chain, x, learned, by, by_lead, steep, beyond, missing_by)

    def strains_and_slopes(self, numbers: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(strains (n, 6), slopes (n, 6, 14)): derivatives by the 13 shape numbers (the angle in degrees) and
        P/mu."""
        return self.state_and_slopes(numbers, pressure).strains_and_slopes()

    def strains_and_spread(
        self, numbers: np.ndarray, pressure: np.ndarray, exact: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(free strains (n, 6), their standard deviation (n, 6), d log P/d log(leading strain) (n,)) as the
        Gaussian processes see it, taken as independent; from the inducing points alone and the remainder
        (measured: in the shipped law's range 90 % lie within 2 % of it), or exact, which takes some ten
        seconds once."""
        state = self.state_and_slopes(numbers, pressure)
        x, lead, ratios, by_lead = state.inputs, state.chain.lead, state.learned[:, 1:], state.by_lead
        deviation = self.learned.deviation(x) if exact else self._deviations(x)
        of_lead, (first, others) = lead * deviation[:, 0] / state.steep, LEADING[self.kind]
        out = np.zeros((len(lead), 6))
        out[:, first] = of_lead
        with_lead = ratios + by_lead[:, 1:] * lead[:, None]
        c = np.abs(odd(self.coordinates.strain_parity[1:], cosine(numbers)))
        out[:, others] = c * np.hypot(lead[:, None] * deviation[:, 1:], with_lead * of_lead[:, None])
        return self.coordinates.strains(numbers, lead, ratios), out, state.steep

    def _deviation(self, number, left):
        """(n, p) standard deviations of what a learned process says where its inducing points leave this
        part (n,) of the variance."""
        factor, power = self.remainder[number]
        return np.sqrt((left + factor * left**power)[:, None] * self.learned.processes[number].variance)

    def _deviations(self, x):
        return np.hstack([self._deviation(i, left(x)) for i, left in enumerate(self._unexplained)])

    def deviation(self, x: np.ndarray, enough: float = 0.0) -> np.ndarray:
        """(n,) standard deviation of log P at path_inputs (n, d), nearly, where it is more than `enough`;
        elsewhere a bound that is not more than that."""
        deviation = self._deviation(0, self._by_landmarks(x))[:, 0]
        open_ = deviation > enough
        if open_.any():
            deviation[open_] = self._deviation(0, self._unexplained[0](x[open_]))[:, 0]
        return deviation

    def deviation_and_slopes(self, x: np.ndarray, enough: float) -> tuple[np.ndarray, np.ndarray]:
        """(the same, derivatives by the path_inputs (n, d), 0 where it is not more than `enough`)."""
        deviation, slopes = self.deviation(x, enough), np.zeros(x.shape)
        open_ = deviation > enough
        if open_.any():
            left, by = self._unexplained[0].with_slopes(x[open_])
            factor, power = self.remainder[0]
            growth = 1 + factor * power * np.maximum(left, JITTER) ** (power - 1)
            growth *= self.learned.processes[0].variance[0] / 2 / deviation[open_]
            slopes[open_] = growth[:, None] * by
        return deviation, slopes


def _euler(missing, slope, curvature):
    """(n,) steps to where slope s + curvature s^2/2 is what is missing, on the branch of positive slope, or
    to the parabola's top."""
    inside = slope**2 + 2 * curvature * missing
    if np.minimum.reduce(slope) > FLAT and np.minimum.reduce(inside) >= 0:
        return np.minimum(2 * missing / (slope + np.sqrt(inside)), LONGEST)
    root = np.sqrt(np.maximum(inside, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.where(
            slope > 0,
            2 * missing / (slope + root),
            np.where(curvature < 0, (root - slope) / curvature, -LONGEST),
        )
        step = np.where((inside < 0) & (curvature < 0), -slope / curvature, step)
    return np.clip(step, -LONGEST, LONGEST)
