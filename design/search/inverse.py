"""Inverse design: the manipulator and the pressure whose predicted centreline lies on the target.

Bounded least squares with exact derivatives over angles, dimensions, numbers of chambers, the pressure and
the base's direction: from first guesses of the lookup table, with chambers counted as real numbers, then as
whole ones, then with dimensions on the grid that they are cast on.
"""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.search.aims import EQ27, OBJECTIVES, PAIRED, Aim
from pneunet.design.search.lookup import Guess, first_guesses
from pneunet.design.search.problem import Body, Evaluation, Problem
from pneunet.design.search.space import Variable, grid, limits, prototype, variables_of
from pneunet.design.search.whole import STEPS, TRIED, on_grid, optimised, with_whole_chambers
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import PRESSURE_LIMIT, Target
from pneunet.geometry.parameters import PASSIVE, Manipulator, Segment
from pneunet.reduced.analytic.clearance import gap_left
from pneunet.reduced.rod.laws import SegmentLaw

LEAST_PRESSURE = 0.002  # MPa
SPLIT_KEPT = 0.3  # a segment's number of chambers stays within this fraction of what its piece asks for
#: of the curve's length: nothing better is looked for below the first; starts are tried until one is below
#: the second
FINE_ENOUGH, GOOD_ENOUGH = 1e-4, 1e-3
STARTS = 4
#: alternatives: so many, at pressures (MPa) so far apart, with angles (deg) so different or other numbers
ALTERNATIVES, APART, DISTINCT = 3, 0.008, 3.0
#: RMS of an alternative over the design's at which it takes its place
BETTER = 0.9
#: name -> step beyond a bound that its cost is told of, in words; 0.1 mm of all others
USUAL = {"angle": (1.0, "1 deg"), "pressure": (0.001, "1 kPa"), "chambers": (1.0, "1")}
#: mm; bounds that cost less are named without
WORTH_TELLING = 0.005
log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A body that can be cast: pressures (aims,) in MPa; base_pose (4, 4) in target coordinates; rms: root
    mean square misfit, mm; problem, at: what it is the optimum of, and its Evaluation."""

    manipulator: Manipulator
    pressures: np.ndarray
    base_pose: np.ndarray
    rms: float
    problem: Problem
    at: Evaluation

    @property
    def pressure(self) -> float:
        """Of the first shape, MPa."""
        return float(self.pressures[0])

    def __str__(self) -> str:
        segments = self.manipulator.segments
        counts = " / ".join(str(s.chambers) for s in segments)
        pressures = ", ".join(f"{KPA_PER_MPA * P:.1f}" for P in self.pressures)
        return f"angles {_angles(segments)} deg, chambers {counts}, {pressures} kPa, RMS {self.rms:.2f} mm"

    def differs(self, other: "Candidate") -> bool:
        """Whether another one has other numbers of chambers or clearly other angles."""
        pairs = list(zip(self.manipulator.segments, other.manipulator.segments))
        return any(a.chambers != b.chambers or abs(a.angle - b.angle) >= DISTINCT for a, b in pairs)


@dataclass(frozen=True, eq=False)
class Found:
    """best: the design. alternatives: distinct ones, best first. active: bounds that the optimum sits on, and
    what they cost; stopped_by: the one that costs most, "" where none costs anything. flush_costs: mm by
    which steps in the underside would lower the misfit."""

    best: Candidate
    alternatives: tuple[Candidate, ...]
    active: tuple[str, ...]
    stopped_by: str
    flush_costs: float
    evaluations: int


def search(
    target: Target,
    pieces: Sequence[Extracted],
    law: SegmentLaw,
    objective: str = PAIRED,
    alternatives: int = ALTERNATIVES,
) -> Found:
    """The `Found` for a Target split into `pieces` (`Extracted`), with so many alternatives at most.

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
    return _Search(target, tuple(pieces), law, objective, alternatives).run(guesses)


def _guesses(target, pieces, prototypes, law):
    angles, heights = [], []
    for i, (piece, segment) in enumerate(zip(pieces, prototypes)):
        if segment.kind != PASSIVE and piece.length < (least := shortest(segment)):
            found = f"length_mm = {piece.length:.3g}"
            raise InputError(
                f"[[piece]] {i + 1}: {found} is too short for one chamber and its ends ({least:.3g} mm)"
            )
        varying = limits(target, piece, segment)
        angles.append(grid(varying.get("angle"), 90.0, 5.0))
        heights.append(grid(varying.get("chamber_height"), segment.chamber_height, 1.0))
    if len(target.pressures) > 1:
        raise InputError("pressure_kPa: a design has one pressure for all segments: give one")
    low, high = target.pressure_range or (0.010, PRESSURE_LIMIT)
    if target.weights is not None and not target.weights.any():  # the curve is a guide to the last tip point
        low = high = max([float(s.pressures[0]) for s in target.shapes] + _tip_pressures(target))
    pressures = (
        np.linspace(low, high, max(1, round((high - low) / 0.010)) + 1) if high > low else np.array([low])
    )
    return first_guesses(pieces, prototypes, angles, heights, pressures, law)


def _tip_pressures(target):
    return [] if target.tip is None else target.tip.pressures.tolist()


def shortest(segment: Segment) -> float:
    """Length (mm) of one chamber and its ends, at rest."""
    return 2 * segment.end_length + segment.chamber_thickness


def _angles(segments):
    return " / ".join("plain" if s.kind == PASSIVE else f"{s.angle:.0f}" for s in segments)


class _Search:
    """The way from guesses to a Found; counts evaluations."""

    def __init__(self, target, pieces, law, objective, most):
        self.target, self.pieces, self.law, self.objective = target, pieces, law, objective
        self.optima = []
        self.loaded = any(target.gravity)  # a hundred times the cost: no alternatives, no price of flushness
        self.most = most if objective == PAIRED and not self.loaded else 0
        self.floor, self.evaluations = (FINE_ENOUGH * target.length) ** 2, 0

    def run(self, guesses):
        problem, optimum = self._from_guesses(guesses)
        if self.objective == EQ27:
            aims = Aim.all_of(self.target, problem.body.segments[0].width, EQ27)
            problem, optimum = self._counted(optimised(replace(problem, aims=aims), self.floor))
        log.info(f"real-valued optimum: {_told(problem, optimum)}")
        flush = self._flush_costs(problem, optimum)
        whole = self._whole(problem, optimum)
        log.info(f"whole chambers:      {_told(*whole)}")
        best = self._cast(whole)
        log.info(f"dimensions on grid:  {best}")
        bounds = sorted(_active(*whole), key=lambda pair: -pair[0])
        stopped = bounds[0][1] if bounds and bounds[0][0] > 0 else ""
        alternatives = self._alternatives(best, whole, guesses)
        if alternatives and alternatives[0].rms < BETTER * best.rms:
            best, alternatives = alternatives[0], (best, *alternatives[1:])
        touching = () if self.target.casting.allow_touch else _touching(best)
        return Found(
            best, alternatives, (*(text for _, text in bounds), *touching), stopped, flush, self.evaluations
        )

    def _counted(self, found):
        if found is None:
            raise ConvergenceError("the law has no equilibrium near the first guess: lower the pressure")
        self.evaluations += found[1].evaluations
        return found

    def _from_guesses(self, guesses):
        """The best of the local optima from the most promising guesses."""
        log.info(
            f"lookup table: first guess at {KPA_PER_MPA * guesses[0].pressure:.1f} kPa, angles "
            + _angles(guesses[0].segments)
        )
        for guess in guesses[:STARTS]:
            self._try(start(self.target, self.pieces, self.law, guess))
            best = min(self.optima, key=lambda found: found[1].cost, default=None)
            if best and best[1].cost < (GOOD_ENOUGH * self.target.length) ** 2:
                break
        if not self.optima:
            least = KPA_PER_MPA * min(g.pressure for g in guesses)
            raise ConvergenceError(f"the law has no equilibrium at {least:.1f} kPa: lower the pressure")
        return best

    def _try(self, problem, steps=30):
        """Its local optimum to the others'."""
        found = optimised(problem, self.floor, steps)
        if found is not None:
            self.evaluations += found[1].evaluations
            self.optima.append(found)
        return found

    def _flush_costs(self, problem, optimum):
        """By how much (mm) the root mean square would fall if undersides need not be flush."""
        joined = [v for v in problem.variables if v.name == "base_thickness" and len(v.segments) > 1]
        if not joined or self.loaded:
            return 0.0
        apart = tuple(replace(v, segments=(i,)) for v in joined for i in v.segments)
        kept = tuple(v for v in problem.variables if v not in joined)
        found = optimised(replace(problem, variables=kept + apart), self.floor)
        if found is None:
            return 0.0
        self.evaluations += found[1].evaluations
        return max(0.0, float(np.sqrt(optimum.at.misfit) - np.sqrt(found[1].at.misfit)))

    def _grid(self):
        casting = self.target.casting
        names = ["wall", "base_thickness", "roof", "chamber_height", "top_wall", "side_wall"]
        names += ["cavity_thickness", "gap", "end_margin", "plain_length"]
        steps = dict.fromkeys(names, casting.grid or 0.001)
        return {"angle": casting.angle_grid or 0.01} | steps

    def _whole(self, problem, optimum, tried=TRIED):
        """With whole numbers of chambers."""
        found = with_whole_chambers(problem, optimum, self.floor, tried)
        self.evaluations += sum(o.evaluations for _, o in found)
        if not found:
            raise ConvergenceError("no whole numbers of chambers near the optimum can be built")
        return found[0]

    def _cast(self, whole):
        """The Candidate on the grid."""
        problem, optimum = on_grid(whole, self._grid(), self.floor)
        self.evaluations += optimum.evaluations
        body = problem.body
        pressures = body.pressures[:, 0].round(6)
        body = replace(body, pressures=np.broadcast_to(pressures[:, None], body.pressures.shape))
        problem = replace(problem, body=body, everything=True)
        at = problem.evaluate(problem.x) or optimum.at
        segments = tuple(replace(s, chambers=round(n)) for s, n in zip(body.segments, body.counts))
        rms = float(np.sqrt(at.misfit))
        return Candidate(Manipulator(segments), pressures, body.base_pose, rms, problem, at)

    def _alternatives(self, best, whole, guesses):
        """Distinct Candidates that are not much worse."""
        found: list[Candidate] = []
        allowed = max(2 * best.rms, 5 * GOOD_ENOUGH * self.target.length)
        for other in self._others(whole, guesses) if self.most else ():
            if np.sqrt(other[1].at.misfit) > allowed:
                continue
            candidate = self._cast(other)
            if candidate.rms <= allowed and all(candidate.differs(c) for c in (best, *found)):
                found.append(candidate)
                if len(found) == self.most:
                    break
        return tuple(sorted(found, key=lambda c: c.rms))

    def _others(self, whole, guesses):
        """With whole chambers: from the other local optima, at other pressures, with one chamber more or
        less."""
        chosen = whole[0].body.pressures[0, 0]
        seen = [chosen]
        for problem, optimum in sorted(self.optima, key=lambda found: found[1].cost):
            if min(abs(problem.body.pressures[0, 0] - P) for P in seen) >= APART:
                seen.append(problem.body.pressures[0, 0])
                yield self._whole(problem, optimum, tried=1)
        apart = [g for g in guesses[:ALTERNATIVES] if min(abs(g.pressure - P) for P in seen) >= APART]
        for guess in apart:
            first = start(self.target, self.pieces, self.law, guess)
            if found := self._try(_held_near(first, guess.pressure), STEPS):
                yield self._whole(found[0], found[1], tried=1)
        body = whole[0].body
        longest = int(np.argmax(body.counts))
        for change in (1, -1):
            counts = body.counts.copy()
            counts[longest] = max(1, counts[longest] + change)
            if found := self._try(replace(whole[0], body=replace(body, counts=counts))):
                yield found


def _held_near(problem, pressure):
    """The Problem with its pressure kept near one (MPa)."""
    low, high = pressure - APART / 2, pressure + APART / 2
    variables = (
        replace(v, low=max(v.low, low), high=min(v.high, high)) if v.name == "pressure" else v
        for v in problem.variables
    )
    return replace(problem, variables=tuple(variables))


def start(target: Target, pieces: tuple[Extracted, ...], law: SegmentLaw, guess: Guess) -> Problem:
    """The Problem at an entry of the lookup table, with the base turned to the target."""
    segments, n = guess.segments, len(pieces)
    variables = variables_of(target, pieces, segments, not target.casting.allow_steps)
    aims = Aim.all_of(target, segments[0].width)
    pressures = np.array([guess.pressure if aim.pressure is None else aim.pressure for aim in aims])
    if aims[0].pressure is None:
        low, high = target.pressure_range or (LEAST_PRESSURE, PRESSURE_LIMIT)
        if high > low:
            scale = high - low if target.pressure_range else 0.02
            variables.append(Variable("pressure", tuple(range(n)), low, high, scale))
    for i, count in enumerate(guess.counts):
        if segments[i].kind == PASSIVE:
            continue
        low, high = np.floor(max(1.0, (1 - SPLIT_KEPT) * count)), np.ceil((1 + SPLIT_KEPT) * count + 1)
        variables.append(Variable("chambers", (i,), low, high, 0.3 * count + 1, count))
    turns = np.eye(3)[:, : 3 if target.base_direction is None else 1 if target.base_width is None else 0]
    body = Body(
        segments,
        np.array(guess.counts),
        np.tile(pressures[:, None], (1, n)),
        _some_rotation(target),
        target.points[0],
    )
    # flush undersides, and values within their ranges
    values = np.array([np.clip(body.value(v), v.low, v.high) for v in variables])
    body = body.changed(variables, values)
    gravity = np.array(target.gravity)
    touch = target.casting.allow_touch
    return _turned_to_target(
        Problem(aims, pieces, law, tuple(variables), body, turns, gravity, may_touch=touch)
    )


def _turned_to_target(problem):
    """The base turned about its free axes to bring the present curve nearest to the target, in closed
    form."""
    free, body = problem.turns.shape[1], problem.body
    at = problem.evaluate(problem.x)
    if at is None or not free:
        return problem
    aim, placed = problem.aims[0], at.shapes[0].placed
    points, wanted = ((a - body.origin) @ body.rotation for a in (placed.points, aim.points))
    moment = points.T @ wanted
    if free == 1:
        turn = se3.exp_rotation(
            np.array([np.arctan2(moment[1, 2] - moment[2, 1], moment[1, 1] + moment[2, 2]), 0, 0])
        )
    else:
        U, _, Vt = np.linalg.svd(moment)
        turn = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
    return replace(problem, body=replace(body, rotation=body.rotation @ turn))


def _told(problem, optimum):
    body = problem.body
    counts = " / ".join(f"{n:.3g}" for n in body.counts)
    return (
        f"angles {_angles(body.segments)} deg, chambers {counts},"
        f" {KPA_PER_MPA * body.pressures[0, 0]:.1f} kPa,"
        f" {np.sqrt(optimum.at.misfit):.3f} mm (root mean square)"
    )


def _active(problem, optimum):
    """Yields (mm that the root mean square would fall by if it were a usual step wider, that in words) of
    each bound that the optimum sits on."""
    at = optimum.at
    gradient = 2 * at.residual @ at.jacobian
    for variable, value, slope in zip(problem.variables, optimum.x, gradient):
        if variable.bound(value) is None:
            continue
        step, told = USUAL.get(variable.name, (0.1, "0.1 mm"))
        outwards = slope if variable.bound(value) == variable.low else -slope
        saved = np.sqrt(at.misfit) - np.sqrt(max(at.misfit - max(outwards, 0.0) * step, 0.0))
        worth = f"; {told} beyond would save {saved:.2g} mm" if saved >= WORTH_TELLING else ""
        yield float(saved) * (saved >= WORTH_TELLING), variable.text(value) + worth


def _touching(candidate):
    return about_to_touch(candidate.manipulator.segments, float(candidate.pressures.max()))


def about_to_touch(segments: Sequence[Segment], pressure: float) -> Iterator[str]:
    """Segments whose estimated clearance the design has used up, in words."""
    for i, segment in enumerate(segments, start=1):
        if segment.kind == PASSIVE:
            continue
        left = gap_left(segment, pressure)
        if left < 0.02 * segment.gap:
            yield (
                f"segment {i} clearance of facing walls (estimate: {max(left, 0.0):.2f} mm left of"
                f" {segment.gap:.2f} mm)"
            )


def _some_rotation(target):
    """The base's rotation where it is fixed, else any one with the fixed direction, else the identity."""
    if target.base_rotation is not None:
        return target.base_rotation
    if target.base_direction is None:
        return np.eye(3)
    aside = np.cross(np.eye(3)[np.argmin(abs(target.base_direction))], target.base_direction)
    aside /= np.linalg.norm(aside)
    return np.column_stack([target.base_direction, aside, np.cross(target.base_direction, aside)])
