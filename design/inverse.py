"""Inverse design: the manipulator and the pressure whose predicted centreline lies on the target.

Bounded least squares over angles, dimensions, numbers of chambers, the common pressure and the direction of the base;
chambers are counted as real numbers first, then searched as whole ones. The default objective pairs points at equal
fractions of arc length, which bounds the paper's Eq. 27 from above and, unlike it, cannot be lowered by making the
manipulator too long; docs/use-design.md says more.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from base import se3
from base.errors import ConvergenceError, InputError
from base.strains import RodStrains
from design.curves import arc_lengths, evenly, nearest_points
from design.lookup import active_length, first_guesses
from design.targets import BENDING, PRESSURE_LIMIT, TWISTING
from geometry.parameters import ONE_SIDED, Manipulator, Segment
from geometry.parameters import TWISTING as TWISTING_KIND
from reduced.rod import centreline

PAIRED, EQ27 = "paired", "eq27"
OBJECTIVES = (PAIRED, EQ27)
PAIRS = 101
STEP = 1e-5  # of a variable's range, for differences
CONFIRMED = 1.05  # cost over that of the next start from there, which leaves the bounds, at which an optimum is one
INSET = 0.05  # of a variable's range: starts keep off the bounds, where the interior method crawls
AT_BOUND = 1e-3  # of a variable's range
PREFERENCE = 0.02  # mm of misfit per range that a dimension leaves its start by: decides where the target does not
SPLIT_KEPT = 0.3  # a segment's number of chambers stays within this fraction of what its piece asks for
GOOD_ENOUGH = 1.05  # cost of whole chambers over that of real-valued ones at which the search for others stops
LEAST_PRESSURE = 0.002  # MPa

#: start dimensions, mm, where they differ from Segment's own: castable and of the paper's magnitudes
START = {
    ONE_SIDED: {"end_margin": 1.0},
    TWISTING_KIND: {"end_margin": 1.0, "chamber_height": 5.5, "cavity_floor": 0.5, "gap": 2.0},
}
#: start range and castable limits, mm and degrees, of what varies by default
RANGES = {
    ONE_SIDED: {
        "angle": ((45, 135), (30, 150)),
        "chamber_height": ((3, 5), (2, 8)),
        "base_thickness": ((1.5, 3), (1, 5)),
        "gap": ((1, 2), (1, 3)),
    },
    TWISTING_KIND: {
        "angle": ((45, 135), (30, 150)),
        "chamber_height": ((4, 6), (2, 6)),  # higher ones lean on each other as the segment twists
        "gap": ((2, 3), (2, 4)),
    },
}
UNITS = {"pressure": (" kPa", 1e3), "angle": (" deg", 1.0), "chambers": ("", 1.0)}
ROUNDING = {"angle": 2}  # decimals; mm and everything else to 3


@dataclass(frozen=True)
class Variable:
    """A design variable of one segment (None: of all) with its range, which may grow to its limits."""

    name: str
    segment: int | None
    value: float
    low: float
    high: float
    least: float
    most: float
    start: float | None = None  # a dimension's preferred value

    @property
    def scale(self):
        """What counts as a large change."""
        return max(self.high - self.low, 1e-3 * abs(self.value))

    @property
    def bound(self):
        """The end of the range that the value sits on, or None."""
        for end in (self.low, self.high):
            if abs(self.value - end) <= AT_BOUND * self.scale:
                return end
        return None

    @property
    def grown(self):
        """With a wider range where the value sits on a bound that may grow; otherwise the same."""
        low, high = self.low, self.high
        if self.bound == low and low > self.least:
            low = max(self.least, low - self.scale / 2)
        elif self.bound == high and high < self.most:
            high = min(self.most, high + self.scale / 2)
        return replace(self, low=low, high=high)

    @property
    def title(self):
        return self.name if self.segment is None else f"segment {self.segment + 1} {self.name}"


@dataclass(frozen=True)
class Solution:
    """base_pose (4, 4) in target coordinates; pressure in MPa; cost in mm^2; active: bounds the optimum sits on."""

    manipulator: Manipulator
    pressure: float
    base_pose: np.ndarray
    cost: float
    active: tuple
    grown: tuple
    evaluations: int


class Trial:
    """What a vector of variables stands for: segments, real counts of chambers, pressure and base rotation."""

    def __init__(self, problem, variables, x):
        changes = [{} for _ in problem.prototypes]
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

    def centreline(self, law, base_point):
        lengths, e, k = [], [], []
        rest = RodStrains.unstrained()
        for segment, count in zip(self.segments, self.counts):
            strains = law.strains(segment, self.pressure)
            lengths += [segment.end_length, active_length(segment, count), segment.end_length]
            e += [rest.e, strains.e, rest.e]
            k += [rest.k, strains.k, rest.k]
        return centreline(lengths, RodStrains(e, k), 2.0, se3.make_pose(self.rotation, base_point))


@dataclass(frozen=True)
class Problem:
    """The least-squares problem around a state: prototypes (chambers 1), counts, pressure, base rotation and its freedom.

    turns (3, m): the columns are the axes, in base axes, about which the base may turn: 3 when it is free, 1 when its
    direction is fixed, none when it is fixed altogether.
    """

    target: object
    pieces: tuple
    law: object
    objective: str
    prototypes: tuple
    counts: tuple
    pressure: float
    rotation: np.ndarray
    turns: np.ndarray

    def residual(self, trial):
        """Residual vector in mm whose squared norm is the cost in mm^2."""
        target = self.target
        line = trial.centreline(self.law, target.points[0])
        if self.objective == EQ27:
            misfits = [(nearest_points(target.points, line.points) - target.points) / np.sqrt(len(target.points))]
        else:
            misfits = [self._paired(line)]
        misfits.append(self._unseen_twists(trial))
        return np.concatenate([m.ravel() for m in misfits])

    def _paired(self, line):
        """Points at equal fractions of arc length; with frames also the body's edges, half a width off the line."""
        target = self.target
        own = line.arc_length
        frames = line.at(np.interp(np.linspace(0, own[-1], PAIRS), own, line.s))
        misfit = [frames[:, :3, 3] - evenly(target.points, PAIRS)]
        if target.frames is not None:
            s = arc_lengths(target.points)
            nearest = np.abs(s[:, None] - np.linspace(0, s[-1], PAIRS)).argmin(axis=0)
            edges = self.prototypes[0].width / 2 * (frames[:, :3, 1:3] - target.frames[nearest][:, :, 1:3])
            misfit.append(edges.reshape(PAIRS, 6))
        return np.hstack(misfit) / np.sqrt(PAIRS)

    def _unseen_twists(self, trial):
        """Misfit at the body's edge, mm, of twists that no point of the target shows."""
        misfits = [0.0]
        for piece, segment, count in zip(self.pieces, trial.segments, trial.counts):
            if not piece.twist_seen:
                turned = self.law.strains(segment, trial.pressure).k[0] * active_length(segment, count)
                misfits.append(segment.width / 2 * (turned - piece.twist * piece.length))
        return np.array(misfits)


def solve(target, pieces, law, objective=PAIRED, say=print):
    """The `Solution` for a Target split into `pieces` (`Extracted`).

    InputError where the pieces cannot be built, ConvergenceError where the law has no answer at any pressure.
    """
    if objective not in OBJECTIVES:
        raise InputError(f"objective = '{objective}' is not known: write {' or '.join(OBJECTIVES)}")
    prototypes = [prototype(target, piece) for piece in pieces]
    guesses = _guesses(target, pieces, prototypes, law)
    if not guesses:
        raise ConvergenceError("the law has no equilibrium for these dimensions at any allowed pressure: make the walls thicker")
    say(f"lookup table: first guess at {1e3 * guesses[0].pressure:.1f} kPa, angles " + _angles(guesses[0].segments))
    run = _Run.start(target, pieces, law, guesses[0]).optimised(real_counts=True)
    if objective == EQ27:
        run = run.with_objective(EQ27).optimised(real_counts=True)
    say(f"real-valued optimum: {run.title}")
    run = _whole_chambers(run)
    say(f"whole chambers:      {run.title}")
    return run.solution()


def prototype(target, piece):
    """The Segment with a piece's start dimensions: material and shared dimensions are the same for all pieces."""
    kind = TWISTING_KIND if piece.kind == TWISTING else ONE_SIDED
    try:
        return Segment(kind, 90.0, 1, **(START[kind] | target.start), material=target.material)
    except InputError as error:
        raise InputError(f"[segment] (start dimensions of the {kind} segments): {error}") from None


def _limits(target, piece, segment):
    """{name: (start range, limits)} of what varies in one segment; the user's bounds are limits at once."""
    ranges = RANGES[segment.kind]
    if target.vary is not None:
        ranges = {"angle": ranges["angle"]} | {name: (bounds, bounds) for name, bounds in target.vary.items()}
        if segment.kind == TWISTING_KIND:
            ranges.pop("base_thickness", None)
        for name, bounds in target.vary.items():
            for value in bounds:
                try:
                    replace(segment, **{name: value})
                except InputError as error:
                    raise InputError(f"[vary]: {error}") from None
    if piece.kind == BENDING:
        ranges = {name: limits for name, limits in ranges.items() if name != "angle"}
    return ranges


def _guesses(target, pieces, prototypes, law):
    angles, heights = [], []
    for i, (piece, segment) in enumerate(zip(pieces, prototypes)):
        shortest = 2 * segment.end_length + segment.chamber_thickness
        if piece.length < shortest:
            raise InputError(
                f"[[piece]] {i + 1}: length_mm = {piece.length:.3g} is too short for one chamber and its ends ({shortest:.3g} mm)"
            )
        limits = _limits(target, piece, segment)
        angles.append(_grid(limits.get("angle"), 90.0, 5.0))
        heights.append(_grid(limits.get("chamber_height"), segment.chamber_height, 1.0))
    low, high = target.pressure_range or (0.010, PRESSURE_LIMIT)
    pressures = np.linspace(low, high, max(1, round((high - low) / 0.010)) + 1) if high > low else np.array([low])
    return first_guesses(pieces, prototypes, angles, heights, pressures, law)


def _grid(limits, fixed, step):
    if limits is None:
        return [fixed]
    low, high = limits[0]
    return np.linspace(low, high, max(1, round((high - low) / step)) + 1) if high > low else [low]


def _angles(segments):
    return " / ".join(f"{s.angle:.0f}" for s in segments)


@dataclass(frozen=True)
class _Run:
    """A problem, its variables with their present values and ranges, and the cost there."""

    problem: Problem
    variables: tuple
    cost: float = np.inf
    grown: tuple = ()
    evaluations: int = 0

    @classmethod
    def start(cls, target, pieces, law, guess):
        """From an entry of the lookup table, with the base turned to the target."""
        variables = []
        for i, (piece, segment) in enumerate(zip(pieces, guess.segments)):
            for name, ((low, high), (least, most)) in _limits(target, piece, segment).items():
                value = float(np.clip(getattr(segment, name), low, high))
                start = None if name == "angle" else float(np.clip(getattr(prototype(target, piece), name), low, high))
                variables.append(Variable(name, i, value, low, high, least, most, start))
        if target.pressure_range is None:
            low, high = max(LEAST_PRESSURE, 0.6 * guess.pressure), min(PRESSURE_LIMIT, 1.4 * guess.pressure)
            variables.append(Variable("pressure", None, guess.pressure, low, high, LEAST_PRESSURE, PRESSURE_LIMIT))
        elif target.pressure_range[1] > target.pressure_range[0]:
            low, high = target.pressure_range
            variables.append(Variable("pressure", None, guess.pressure, low, high, low, high))
        for i, n in enumerate(guess.counts):
            low, high = max(1.0, (1 - SPLIT_KEPT) * n), (1 + SPLIT_KEPT) * n + 1
            variables.append(Variable("chambers", i, n, low, high, low, high, n))
        variables = tuple(v for v in variables if v.high > v.low)
        turns = np.eye(3)[:, : 3 if target.base_direction is None else 1 if target.base_width is None else 0]
        problem = Problem(
            target, tuple(pieces), law, PAIRED, guess.segments, guess.counts, guess.pressure, _some_rotation(target), turns
        )
        return cls(problem, variables).turned_to_target()

    def allows(self, counts):
        """Whether numbers of chambers lie in their ranges, rounded outwards."""
        ranges = {v.segment: (np.floor(v.low), np.ceil(v.high)) for v in self.variables if v.name == "chambers"}
        return all(ranges[i][0] <= n <= ranges[i][1] for i, n in enumerate(counts))

    def with_objective(self, objective):
        return replace(self, problem=replace(self.problem, objective=objective))

    def with_counts(self, counts):
        variables = tuple(replace(v, value=float(counts[v.segment])) if v.name == "chambers" else v for v in self.variables)
        problem = replace(self.problem, counts=tuple(float(n) for n in counts))
        return replace(self, problem=problem, variables=variables, cost=np.inf)

    def turned_to_target(self):
        """The base turned about its free axes to bring the present curve nearest to the target, in closed form."""
        problem, free = self.problem, self.problem.turns.shape[1]
        trial = Trial(problem, self.variables, self._x(self.variables))
        points = evenly(trial.centreline(problem.law, np.zeros(3)).points, PAIRS) @ problem.rotation
        wanted = (evenly(problem.target.points, PAIRS) - problem.target.points[0]) @ problem.rotation
        moment = points.T @ wanted
        turn = np.eye(3)
        if free == 1:
            turn = se3.exp_rotation(np.array([np.arctan2(moment[1, 2] - moment[2, 1], moment[1, 1] + moment[2, 2]), 0, 0]))
        elif free == 3:
            U, _, Vt = np.linalg.svd(moment)
            turn = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
        return replace(self, problem=replace(problem, rotation=problem.rotation @ turn))

    def _x(self, variables):
        return np.array([v.value for v in variables] + [0.0] * self.problem.turns.shape[1])

    def optimised(self, real_counts):
        """The local optimum; ranges grow while it sits on a bound that may, and a new start has to confirm it."""
        run = self
        while True:
            before, run = run.cost, run._optimised_once(real_counts)
            variables = tuple(v.grown for v in run.variables)
            if variables == run.variables and before < CONFIRMED * run.cost:
                return run
            names = [v.title for v, w in zip(run.variables, variables) if v != w]
            run = replace(run, variables=variables, grown=tuple(dict.fromkeys(run.grown + tuple(names))))

    def _optimised_once(self, real_counts):
        problem, free = self.problem, self.problem.turns.shape[1]
        variables = tuple(v for v in self.variables if real_counts or v.name != "chambers")
        scale = np.array([v.scale for v in variables] + [1.0] * free)
        low = np.array([v.low for v in variables] + [-np.inf] * free)
        high = np.array([v.high for v in variables] + [np.inf] * free)
        calls = _Calls(problem, variables, scale, high)
        inset = np.array([INSET * (v.high - v.low) for v in variables] + [0.0] * free)
        fit = least_squares(
            calls.residual, np.clip(self._x(variables), low + inset, high - inset), calls.jacobian, (low, high), x_scale=scale,
            xtol=1e-5, ftol=1e-3, gtol=1e-10, max_nfev=40,
        )  # fmt: skip
        trial = Trial(problem, variables, fit.x)
        found = dict(zip(variables, fit.x))
        values = tuple(replace(v, value=float(found.get(v, v.value))) for v in self.variables)
        problem = replace(
            problem, prototypes=tuple(trial.segments), counts=tuple(trial.counts), pressure=trial.pressure, rotation=trial.rotation
        )
        return replace(self, problem=problem, variables=values, cost=2 * fit.cost, evaluations=self.evaluations + calls.count)

    @property
    def title(self):
        counts = " / ".join(f"{n:.3g}" for n in self.problem.counts)
        return (
            f"angles {_angles(self.problem.prototypes)} deg, chambers {counts}, {1e3 * self.problem.pressure:.1f} kPa, "
            f"objective {np.sqrt(self.cost):.3f} mm (root mean square)"
        )

    def solution(self):
        """Rounded to what a drawing can say, with the cost there."""
        segments = []
        for i, (segment, count) in enumerate(zip(self.problem.prototypes, self.problem.counts)):
            names = [v.name for v in self.variables if v.segment == i and v.name != "chambers"]
            rounded = {name: round(getattr(segment, name), ROUNDING.get(name, 3)) for name in names}
            segments.append(replace(segment, chambers=round(count), **rounded))
        pressure = round(self.problem.pressure, 6)
        rounded = replace(self.problem, prototypes=tuple(segments), pressure=pressure)
        residual = rounded.residual(Trial(rounded, (), np.zeros(self.problem.turns.shape[1])))
        active = tuple(_active(v) for v in self.variables if v.bound is not None)
        pose = se3.make_pose(self.problem.rotation, self.problem.target.points[0])
        return Solution(Manipulator(tuple(segments)), pressure, pose, float(residual @ residual), active, self.grown, self.evaluations)


class _Calls:
    """Residual and its differences for least_squares; a law without an equilibrium is a step not to be taken."""

    def __init__(self, problem, variables, scale, high):
        self.problem, self.variables, self.scale, self.high, self.count = problem, variables, scale, high, 0
        self.size = None
        self.preferred = [i for i, v in enumerate(variables) if v.start is not None]

    def residual(self, x):
        self.count += 1
        try:
            out = self.problem.residual(Trial(self.problem, self.variables, x))
            away = [(x[i] - self.variables[i].start) / self.scale[i] for i in self.preferred]
            out = np.concatenate([out, PREFERENCE * np.array(away)])
        except ConvergenceError:
            if self.size is None:
                raise
            return np.full(self.size, self.problem.target.length)
        self.size = out.size
        return out

    def jacobian(self, x):
        at = self.residual(x)
        columns = []
        for i, scale in enumerate(self.scale):
            step = STEP * scale if x[i] + STEP * scale <= self.high[i] else -STEP * scale
            moved = x.copy()
            moved[i] += step
            columns.append((self.residual(moved) - at) / step)
        return np.column_stack(columns)


def _whole_chambers(run):
    """Whole numbers of chambers: from the nearest ones, one chamber more or less at a time while that helps."""
    seen = {}

    def best(counts):
        if counts not in seen:
            seen[counts] = run.with_counts(counts).optimised(real_counts=False)
        return seen[counts]

    present = best(tuple(max(1, round(n)) for n in run.problem.counts))
    while present.cost > GOOD_ENOUGH * run.cost:
        counts = tuple(round(n) for n in present.problem.counts)
        around = [counts[:i] + (n + d,) + counts[i + 1 :] for i, n in enumerate(counts) for d in (-1, 1)]
        candidate = min((best(c) for c in around if run.allows(c)), key=lambda r: r.cost, default=present)
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


def _active(variable):
    unit, factor = UNITS.get(variable.name, (" mm", 1.0))
    side = "lower" if variable.bound == variable.low else "upper"
    return f"{variable.title} = {factor * variable.bound:.4g}{unit} ({side} bound)"
