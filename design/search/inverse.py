"""Inverse design: the manipulator and the pressure whose predicted centreline lies on the target.

Bounded least squares over angles, dimensions, numbers of chambers, the common pressure and the direction of
the base: a first guess from the lookup table, then chambers counted as real numbers, then as whole ones.
"""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from pneunet.base import se3
from pneunet.base.curve import Curve
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.search.lookup import first_guesses
from pneunet.design.search.problem import EQ27, OBJECTIVES, PAIRED, PAIRS, Calls, Problem, Trial
from pneunet.design.search.space import Variable, grid, limits, prototype
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import PRESSURE_LIMIT, Target
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced.analytic.clearance import gap_left
from pneunet.reduced.rod.laws import SegmentLaw

LEAST_PRESSURE = 0.002  # MPa
INSET = 0.05  # of a variable's range: starts keep off the bounds, where the interior method crawls
#: cost over that of the next start from there, which leaves the bounds, at which an optimum is one
CONFIRMED = 1.05
SPLIT_KEPT = 0.3  # a segment's number of chambers stays within this fraction of what its piece asks for
#: cost of whole chambers over that of real-valued ones at which the search for others stops
GOOD_ENOUGH = 1.05
FINE_ENOUGH = 1e-3  # objective over the curve's length at which it stops as well
ROUNDING = {"angle": 2}  # decimals; mm and everything else to 3
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Found:
    """base_pose (4, 4) in target coordinates; pressure in MPa; cost in mm^2; active: bounds the optimum sits
    on."""

    manipulator: Manipulator
    pressure: float
    base_pose: np.ndarray
    cost: float
    active: tuple[str, ...]
    grown: tuple[str, ...]
    evaluations: int


def search(target: Target, pieces: Sequence[Extracted], law: SegmentLaw, objective: str = PAIRED) -> Found:
    """The `Found` for a Target split into `pieces` (`Extracted`).

    InputError where the pieces cannot be built, ConvergenceError where the law has no answer at any pressure.
    """
    if objective not in OBJECTIVES:
        raise InputError(f"objective = '{objective}' is not known: write {' or '.join(OBJECTIVES)}")
    prototypes = [prototype(target, piece) for piece in pieces]
    guesses = _guesses(target, pieces, prototypes, law)
    if not guesses:
        raise ConvergenceError(
            "the law has no equilibrium for these dimensions at any allowed pressure: make the walls thicker"
        )
    log.info(
        f"lookup table: first guess at {KPA_PER_MPA * guesses[0].pressure:.1f} kPa, angles "
        + _angles(guesses[0].segments)
    )
    run = _Run.start(target, pieces, law, guesses[0]).optimised(real_counts=True)
    if objective == EQ27:
        run = run.with_objective(EQ27).optimised(real_counts=True)
    log.info(f"real-valued optimum: {run.title}")
    run = _whole_chambers(run)
    log.info(f"whole chambers:      {run.title}")
    return run.solution()


def _guesses(target, pieces, prototypes, law):
    angles, heights = [], []
    for i, (piece, segment) in enumerate(zip(pieces, prototypes)):
        least = 2 * segment.end_length + segment.chamber_thickness
        if piece.length < least:
            found = f"length_mm = {piece.length:.3g}"
            raise InputError(
                f"[[piece]] {i + 1}: {found} is too short for one chamber and its ends ({least:.3g} mm)"
            )
        varying = limits(target, piece, segment)
        angles.append(grid(varying.get("angle"), 90.0, 5.0))
        heights.append(grid(varying.get("chamber_height"), segment.chamber_height, 1.0))
    low, high = target.pressure_range or (0.010, PRESSURE_LIMIT)
    pressures = (
        np.linspace(low, high, max(1, round((high - low) / 0.010)) + 1) if high > low else np.array([low])
    )
    return first_guesses(pieces, prototypes, angles, heights, pressures, law)


def _angles(segments):
    return " / ".join(f"{s.angle:.0f}" for s in segments)


@dataclass(frozen=True)
class _Run:
    """A problem, its variables with their present values and ranges, and the cost there."""

    problem: Problem
    variables: tuple[Variable, ...]
    cost: float = np.inf
    grown: tuple[str, ...] = ()
    evaluations: int = 0

    @classmethod
    def start(cls, target, pieces, law, guess):
        """From an entry of the lookup table, with the base turned to the target."""
        variables = []
        for i, (piece, segment) in enumerate(zip(pieces, guess.segments)):
            preferred = prototype(target, piece)
            for name, ((low, high), (least, most)) in limits(target, piece, segment).items():
                value, usual = (float(np.clip(getattr(s, name), low, high)) for s in (segment, preferred))
                start = None if name == "angle" else usual
                variables.append(Variable(name, i, value, low, high, least, most, start))
        if target.pressure_range is None:
            low, high = max(LEAST_PRESSURE, 0.6 * guess.pressure), min(PRESSURE_LIMIT, 1.4 * guess.pressure)
            variables.append(
                Variable("pressure", None, guess.pressure, low, high, LEAST_PRESSURE, PRESSURE_LIMIT)
            )
        elif target.pressure_range[1] > target.pressure_range[0]:
            low, high = target.pressure_range
            variables.append(Variable("pressure", None, guess.pressure, low, high, low, high))
        for i, n in enumerate(guess.counts):
            low, high = max(1.0, (1 - SPLIT_KEPT) * n), (1 + SPLIT_KEPT) * n + 1
            variables.append(Variable("chambers", i, n, low, high, low, high, n))
        turns = np.eye(3)[:, : 3 if target.base_direction is None else 1 if target.base_width is None else 0]
        problem = Problem(
            target,
            tuple(pieces),
            law,
            PAIRED,
            guess.segments,
            guess.counts,
            guess.pressure,
            _some_rotation(target),
            turns,
        )
        return cls(problem, tuple(v for v in variables if v.high > v.low)).turned_to_target()

    def allows(self, counts):
        """Whether numbers of chambers lie in their ranges, rounded outwards."""
        ranges = {
            v.segment: (np.floor(v.low), np.ceil(v.high)) for v in self.variables if v.name == "chambers"
        }
        return all(ranges[i][0] <= n <= ranges[i][1] for i, n in enumerate(counts))

    def with_objective(self, objective):
        return replace(self, problem=replace(self.problem, objective=objective))

    def with_counts(self, counts):
        variables = tuple(
            replace(v, value=float(counts[v.segment])) if v.name == "chambers" else v for v in self.variables
        )
        problem = replace(self.problem, counts=tuple(float(n) for n in counts))
        return replace(self, problem=problem, variables=variables, cost=np.inf)

    def turned_to_target(self):
        """The base turned about its free axes to bring the present curve nearest to the target, in closed
        form."""
        problem, free = self.problem, self.problem.turns.shape[1]
        trial = Trial(problem, self.variables, self._x(self.variables))
        points = Curve(trial.centreline(problem.law, np.zeros(3)).points).evenly(PAIRS) @ problem.rotation
        wanted = (problem.target.curve.evenly(PAIRS) - problem.target.points[0]) @ problem.rotation
        moment = points.T @ wanted
        turn = np.eye(3)
        if free == 1:
            turn = se3.exp_rotation(
                np.array([np.arctan2(moment[1, 2] - moment[2, 1], moment[1, 1] + moment[2, 2]), 0, 0])
            )
        elif free == 3:
            U, _, Vt = np.linalg.svd(moment)
            turn = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
        return replace(self, problem=replace(problem, rotation=problem.rotation @ turn))

    def _x(self, variables):
        return np.array([v.value for v in variables] + [0.0] * self.problem.turns.shape[1])

    def optimised(self, real_counts):
        """The local optimum; ranges grow while it sits on a bound that may, and a new start has to confirm
        it."""
        run = self
        while True:
            before, run = run.cost, run.optimised_once(real_counts)
            variables = tuple(v.grown for v in run.variables)
            if variables == run.variables and before < CONFIRMED * run.cost:
                return run
            names = [v.title for v, w in zip(run.variables, variables) if v != w]
            run = replace(run, variables=variables, grown=tuple(dict.fromkeys(run.grown + tuple(names))))

    def optimised_once(self, real_counts):
        """The local optimum within the present ranges."""
        problem, free = self.problem, self.problem.turns.shape[1]
        variables = tuple(v for v in self.variables if real_counts or v.name != "chambers")
        scale = np.array([v.scale for v in variables] + [1.0] * free)
        low = np.array([v.low for v in variables] + [-np.inf] * free)
        high = np.array([v.high for v in variables] + [np.inf] * free)
        calls = Calls(problem, variables, scale, high)
        inset = np.array([INSET * (v.high - v.low) for v in variables] + [0.0] * free)
        starts = [np.clip(self._x(variables), low + d, high - d) for d in (inset, 0 * inset)]
        start = next((x for x in starts if calls.attempt(x) is not None), None)
        if start is None:
            raise ConvergenceError(
                f"the law has no equilibrium at {KPA_PER_MPA * problem.pressure:.1f} kPa: lower the pressure"
            )
        options = {"x_scale": scale, "xtol": 1e-5, "ftol": 3e-3, "gtol": 1e-10, "max_nfev": 40}
        fit = least_squares(calls.residual, start, calls.jacobian, (low, high), **options)
        trial = Trial(problem, variables, fit.x)
        found = dict(zip(variables, fit.x))
        values = tuple(replace(v, value=float(found.get(v, v.value))) for v in self.variables)
        problem = replace(
            problem,
            prototypes=tuple(trial.segments),
            counts=tuple(trial.counts),
            pressure=trial.pressure,
            rotation=trial.rotation,
        )
        return replace(
            self,
            problem=problem,
            variables=values,
            cost=2 * fit.cost,
            evaluations=self.evaluations + calls.count,
        )

    @property
    def title(self):
        counts = " / ".join(f"{n:.3g}" for n in self.problem.counts)
        return (
            f"angles {_angles(self.problem.prototypes)} deg, chambers {counts},"
            f" {KPA_PER_MPA * self.problem.pressure:.1f} kPa,"
            f" objective {np.sqrt(self.cost):.3f} mm (root mean square)"
        )

    def solution(self):
        """Rounded to what a drawing can say, with the cost there."""
        segments = []
        for i, (segment, count) in enumerate(zip(self.problem.prototypes, self.problem.counts)):
            names = [v.name for v in self.variables if v.segment == i and v.name != "chambers"]
            sizes = {name: round(getattr(segment, name), ROUNDING.get(name, 3)) for name in names}
            segments.append(replace(segment, chambers=round(count), **sizes))
        pressure = round(self.problem.pressure, 6)
        rounded = replace(self.problem, prototypes=tuple(segments), pressure=pressure)
        residual = rounded.residual(Trial(rounded, (), np.zeros(self.problem.turns.shape[1])))
        active = (*(v.text for v in self.variables if v.text), *about_to_touch(segments, pressure))
        pose = se3.make_pose(self.problem.rotation, self.problem.target.points[0])
        body, cost = Manipulator(tuple(segments)), float(residual @ residual)
        return Found(body, pressure, pose, cost, active, self.grown, self.evaluations)


def about_to_touch(segments: Sequence[Segment], pressure: float) -> Iterator[str]:
    """Segments whose estimated clearance the design has used up, in words."""
    for i, segment in enumerate(segments, start=1):
        left = gap_left(segment, pressure)
        if left < 0.02 * segment.gap:
            yield (
                f"segment {i} clearance of facing walls (estimate: {max(left, 0.0):.2f} mm left of"
                f" {segment.gap:.2f} mm)"
            )


def _whole_chambers(run):
    """Whole numbers of chambers: from the nearest ones, one chamber more or less at a time while that
    helps."""
    tried = {}

    def attempt(counts):
        if counts not in tried:
            tried[counts] = run.with_counts(counts).optimised_once(real_counts=False)
        return tried[counts]

    nearest = tuple(max(1, round(n)) for n in run.problem.counts)
    present = run.with_counts(nearest).optimised(real_counts=False)
    enough = max(GOOD_ENOUGH * run.cost, (FINE_ENOUGH * run.problem.target.length) ** 2)
    while present.cost > enough:
        counts = tuple(round(n) for n in present.problem.counts)
        around = [counts[:i] + (n + d,) + counts[i + 1 :] for i, n in enumerate(counts) for d in (-1, 1)]
        likely = min((attempt(c) for c in around if run.allows(c)), key=lambda r: r.cost, default=present)
        candidate = likely.optimised(real_counts=False)
        if candidate.cost > 0.99 * present.cost:
            break
        present = candidate
    return present


def _some_rotation(target):
    """The base's rotation where it is fixed, else any one with the fixed direction, else the identity."""
    if target.base_rotation is not None:
        return target.base_rotation
    if target.base_direction is None:
        return np.eye(3)
    aside = np.cross(np.eye(3)[np.argmin(abs(target.base_direction))], target.base_direction)
    aside /= np.linalg.norm(aside)
    return np.column_stack([target.base_direction, aside, np.cross(target.base_direction, aside)])
