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
from pneunet.base.curve import Curve
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.search.aims import EQ27, OBJECTIVES, PAIRED, PAIRS, Aim
from pneunet.design.search.lookup import Guess, first_guesses
from pneunet.design.search.problem import Body, Evaluation, Problem
from pneunet.design.search.space import Variable, grid, limits, prototype, variables_of
from pneunet.design.search.whole import on_grid, optimised, with_whole_chambers
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
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Found:
    """base_pose (4, 4) in target coordinates; pressure in MPa; cost in mm^2; active: bounds the optimum sits
    on; flush_costs: mm by which steps in the underside would lower the misfit; at: the design's Evaluation
    in its problem."""

    manipulator: Manipulator
    pressure: float
    base_pose: np.ndarray
    cost: float
    active: tuple[str, ...]
    flush_costs: float
    evaluations: int
    problem: Problem
    at: Evaluation


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
    return _Search(target, tuple(pieces), law, objective).run(guesses)


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
    low, high = target.pressure_range or (0.010, PRESSURE_LIMIT)
    pressures = (
        np.linspace(low, high, max(1, round((high - low) / 0.010)) + 1) if high > low else np.array([low])
    )
    return first_guesses(pieces, prototypes, angles, heights, pressures, law)


def shortest(segment: Segment) -> float:
    """Length (mm) of one chamber and its ends, at rest."""
    return 2 * segment.end_length + segment.chamber_thickness


def _angles(segments):
    return " / ".join("plain" if s.kind == PASSIVE else f"{s.angle:.0f}" for s in segments)


class _Search:
    """The way from guesses to a Found; counts evaluations."""

    def __init__(self, target, pieces, law, objective):
        self.target, self.pieces, self.law, self.objective = target, pieces, law, objective
        self.floor, self.evaluations = (FINE_ENOUGH * target.length) ** 2, 0

    def run(self, guesses):
        problem, optimum = self._from_guesses(guesses)
        if self.objective == EQ27:
            aims = (Aim.of(self.target, problem.body.segments[0].width, EQ27),)
            problem, optimum = self._counted(optimised(replace(problem, aims=aims), self.floor))
        log.info(f"real-valued optimum: {_told(problem, optimum)}")
        flush = self._flush_costs(problem, optimum)
        whole = with_whole_chambers(problem, optimum, self.floor)
        self.evaluations += sum(o.evaluations for _, o in whole)
        problem, optimum = whole[0]
        log.info(f"whole chambers:      {_told(problem, optimum)}")
        final, at = self._counted(on_grid(whole[0], self._grid(), self.floor))
        log.info(f"dimensions on grid:  {_told(final, at)}")
        return self._found(problem, optimum, final, at, flush)

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
        best = None
        for guess in guesses[:STARTS]:
            found = optimised(start(self.target, self.pieces, self.law, guess), self.floor)
            if found is None:
                continue
            self.evaluations += found[1].evaluations
            if best is None or found[1].cost < best[1].cost:
                best = found
            if best[1].cost < (GOOD_ENOUGH * self.target.length) ** 2:
                break
        if best is None:
            least = KPA_PER_MPA * min(g.pressure for g in guesses)
            raise ConvergenceError(f"the law has no equilibrium at {least:.1f} kPa: lower the pressure")
        return best

    def _flush_costs(self, problem, optimum):
        """By how much (mm) the root mean square would fall if undersides need not be flush."""
        joined = [v for v in problem.variables if v.name == "base_thickness" and len(v.segments) > 1]
        if not joined:
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
        names = ("wall", "base_thickness", "roof", "chamber_height", "top_wall", "side_wall")
        names += ("cavity_thickness", "gap", "end_margin", "plain_length")
        steps = dict.fromkeys(names, casting.grid or 0.001)
        return {"angle": casting.angle_grid or 0.01} | steps

    def _found(self, problem, optimum, final, at, flush):
        body = final.body
        counts = [round(n) for n in body.counts]
        segments = [replace(s, chambers=n) for s, n in zip(body.segments, counts)]
        pressure = round(float(body.pressures[0, 0]), 6)
        active = (*_active(problem, optimum), *about_to_touch(segments, pressure))
        cost, evaluations = float(at.at.residual @ at.at.residual), self.evaluations
        return Found(
            Manipulator(tuple(segments)),
            pressure,
            body.base_pose,
            cost,
            active,
            flush,
            evaluations,
            final,
            at.at,
        )


def start(target: Target, pieces: tuple[Extracted, ...], law: SegmentLaw, guess: Guess) -> Problem:
    """The Problem at an entry of the lookup table, with the base turned to the target."""
    segments, n = guess.segments, len(pieces)
    variables = variables_of(target, pieces, segments, not target.casting.steps)
    everyone = tuple(range(n))
    if target.pressure_range is None:
        variables.append(Variable("pressure", everyone, LEAST_PRESSURE, PRESSURE_LIMIT, 0.02))
    elif target.pressure_range[1] > target.pressure_range[0]:
        low, high = target.pressure_range
        variables.append(Variable("pressure", everyone, low, high, high - low))
    for i, count in enumerate(guess.counts):
        if segments[i].kind == PASSIVE:
            continue
        low, high = np.floor(max(1.0, (1 - SPLIT_KEPT) * count)), np.ceil((1 + SPLIT_KEPT) * count + 1)
        variables.append(Variable("chambers", (i,), low, high, 0.3 * count + 1, count))
    turns = np.eye(3)[:, : 3 if target.base_direction is None else 1 if target.base_width is None else 0]
    body = Body(
        segments,
        np.array(guess.counts),
        np.full((1, n), guess.pressure),
        _some_rotation(target),
        target.points[0],
    )
    # flush undersides, and values within their ranges
    values = np.array([np.clip(body.value(v), v.low, v.high) for v in variables])
    body = body.changed(variables, values)
    aims = (Aim.of(target, segments[0].width),)
    return _turned_to_target(Problem(aims, pieces, law, tuple(variables), body, turns), target)


def _turned_to_target(problem, target):
    """The base turned about its free axes to bring the present curve nearest to the target, in closed
    form."""
    free, body = problem.turns.shape[1], problem.body
    at = problem.evaluate(problem.x)
    if at is None or not free:
        return problem
    points = (Curve(at.shapes[0].placed.points).evenly(PAIRS) - body.origin) @ body.rotation
    wanted = (target.curve.evenly(PAIRS) - target.points[0]) @ body.rotation
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
    """Bounds that the optimum sits on, in words."""
    for variable, value in zip(problem.variables, optimum.x):
        if variable.bound(value) is not None:
            yield variable.text(value)


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
