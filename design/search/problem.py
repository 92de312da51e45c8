"""The least-squares problem: what a vector of variables stands for, and how far its curve is from the target.

The default objective pairs points at equal fractions of arc length. It bounds the paper's Eq. 27 from above,
since a nearest point is no farther than the paired one, and unlike Eq. 27 it is not lowered by a manipulator
that is too long.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneunet.base import se3
from pneunet.base.curve import Curve
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.design.search.space import Variable
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import Target
from pneunet.geometry.parameters import Segment
from pneunet.reduced.analytic.clearance import gap_left
from pneunet.reduced.rod.centreline import Centreline, centreline
from pneunet.reduced.rod.ends import free_pieces
from pneunet.reduced.rod.laws import SegmentLaw

PAIRED, EQ27 = "paired", "eq27"
OBJECTIVES = (PAIRED, EQ27)
PAIRS = 101
SPACING = 2.0  # mm between the samples of a trial's centreline
STEP = 1e-5  # of a variable's range, for differences
#: mm of misfit per mm that facing walls would overlap: contact is not in the law, so it is not designed into
TOUCH = 5.0
BEYOND = 20.0  # mm of misfit per width of what the law knows that a segment lies outside of it
#: mm of misfit per range that a dimension leaves its start by: decides where the target does not
PREFERENCE = 0.02


class Trial:
    """What a vector of variables stands for: segments, real counts of chambers, pressure and base
    rotation."""

    def __init__(self, problem: "Problem", variables: Sequence[Variable], x: np.ndarray) -> None:
        changes: list[dict] = [{} for _ in problem.prototypes]
        self.counts = np.array(problem.counts, float)
        self.pressure = problem.pressure
        for variable, value in zip(variables, x):
            if variable.segment is None:
                self.pressure = float(value)
            elif variable.name == "chambers":
                self.counts[variable.segment] = value
            else:
                changes[variable.segment][variable.name] = float(value)
        self.segments = [replace(s, **change) for s, change in zip(problem.prototypes, changes)]
        self.rotation = problem.rotation @ se3.exp_rotation(problem.turns @ x[len(variables) :])

    def centreline(self, law: SegmentLaw, base_point: np.ndarray) -> Centreline:
        """The Centreline from base_point (3,), mm."""
        pieces = free_pieces(self.segments, law.each(self.segments, self.pressure), self.counts)
        return centreline(*pieces, SPACING, se3.make_pose(self.rotation, base_point))


@dataclass(frozen=True)
class Problem:
    """The problem around a state: prototypes (chambers 1), real counts, pressure, base rotation and its
    freedom.

    turns (3, m): the columns are the axes, in base axes, about which the base may turn: 3 when it is free, 1
    when its direction is fixed, none when it is fixed altogether.
    """

    target: Target
    pieces: tuple[Extracted, ...]
    law: SegmentLaw
    objective: str
    prototypes: tuple[Segment, ...]
    counts: tuple[float, ...]
    pressure: float
    rotation: np.ndarray
    turns: np.ndarray

    def residual(self, trial: Trial) -> np.ndarray:
        """Residual vector in mm whose squared norm is the cost in mm^2."""
        target = self.target
        line = trial.centreline(self.law, target.points[0])
        if self.objective == EQ27:
            misfits = [
                (Curve(line.points).nearest(target.points) - target.points) / np.sqrt(len(target.points))
            ]
        else:
            misfits = [self._paired(line)]
        misfits += [self._unseen_twists(trial), TOUCH * walls_overlap(trial.segments, trial.pressure)]
        misfits += [BEYOND * self.law.excess(segment, trial.pressure) for segment in trial.segments]
        return np.concatenate([m.ravel() for m in misfits])

    def _paired(self, line):
        """Points at equal fractions of arc length; with frames also the body's edges, half a width off the
        line."""
        target = self.target
        own = line.arc_length
        frames = line.at(np.interp(np.linspace(0, own[-1], PAIRS), own, line.s))
        misfit = [frames[:, :3, 3] - target.curve.evenly(PAIRS)]
        if target.frames is not None:
            s = target.curve.arc_lengths
            nearest = np.abs(s[:, None] - np.linspace(0, s[-1], PAIRS)).argmin(axis=0)
            edges = self.prototypes[0].width / 2 * (frames[:, :3, 1:3] - target.frames[nearest][:, :, 1:3])
            misfit.append(edges.reshape(PAIRS, 6))
        return np.hstack(misfit) / np.sqrt(PAIRS)

    def _unseen_twists(self, trial):
        """Misfit at the body's edge, mm, of twists that no point of the target shows."""
        misfits = [0.0]
        for piece, segment, count in zip(self.pieces, trial.segments, trial.counts):
            if not piece.twist_seen:
                turned = self.law.each([segment], trial.pressure).k[0, 0] * count * segment.pitch
                misfits.append(segment.width / 2 * (turned - piece.twist * piece.length))
        return np.array(misfits)


def walls_overlap(segments: Sequence[Segment], pressure: float) -> np.ndarray:
    """By how much (mm) facing walls of each segment are expected to pass through each other; 0 where a gap
    stays."""
    return np.array([max(0.0, -gap_left(s, pressure)) for s in segments])


class Calls:
    """Residual and its differences for least_squares, counted; where the law has no equilibrium no step is
    taken."""

    def __init__(
        self, problem: Problem, variables: Sequence[Variable], scale: np.ndarray, high: np.ndarray
    ) -> None:
        self.problem, self.variables, self.scale, self.high = problem, variables, scale, high
        self.preferred = [i for i, v in enumerate(variables) if v.start is not None]
        self.count, self.size = 0, 0

    def attempt(self, x: np.ndarray) -> np.ndarray | None:
        """The residual (m,), or None where there is no such body or no equilibrium."""
        self.count += 1
        try:
            misfit = self.problem.residual(Trial(self.problem, self.variables, x))
        except (InputError, ConvergenceError):
            return None
        away = [(x[i] - self.variables[i].start) / self.scale[i] for i in self.preferred]
        out = np.concatenate([misfit, PREFERENCE * np.array(away)])
        self.size = out.size
        return out

    def residual(self, x: np.ndarray) -> np.ndarray:
        """The residual (m,); where there is none, numbers too large to be taken."""
        out = self.attempt(x)
        return np.full(self.size, self.problem.target.length) if out is None else out

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """One-sided differences, away from the upper bound or from where there is no equilibrium."""
        at = self.residual(x)
        columns = []
        for i, scale in enumerate(self.scale):
            step = STEP * scale if x[i] + STEP * scale <= self.high[i] else -STEP * scale
            moved = self._moved(x, i, step)
            if moved is None:
                step = -step
                moved = self._moved(x, i, step)
            columns.append(np.zeros(at.size) if moved is None else (moved - at) / step)
        return np.column_stack(columns)

    def _moved(self, x, i, step):
        moved = x.copy()
        moved[i] += step
        return self.attempt(moved)
