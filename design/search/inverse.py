"""Inverse design: the manipulator and the pressure whose predicted centreline lies on the target.

Bounded least squares with exact derivatives over angles, dimensions, numbers of chambers, the pressure and
the base's direction: from first guesses of the lookup table, with chambers counted as real numbers, then as
whole ones, then with dimensions on the grid that they are cast on.
"""

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.materials.laws import of_modulus
from pneunet.base.progress import Pace, progress
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.search.aims import EQ27, OBJECTIVES, PAIRED, Aim
from pneunet.design.search.groups import divided
from pneunet.design.search.guesses import guesses, start
from pneunet.design.search.problem import Evaluation, Problem
from pneunet.design.search.walls import at_limits
from pneunet.design.search.whole import STEPS, TRIED, on_grid, optimised, with_whole_chambers
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import Target
from pneunet.geometry.parameters import PASSIVE, Manipulator
from pneunet.reduced.rod.centreline import Centreline
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.overlap import overlap_doubts

Map = Callable[..., Iterable]
#: of the curve's length: nothing better is looked for below the first; starts are tried until one is below
#: the second
FINE_ENOUGH, GOOD_ENOUGH = 1e-4, 1e-3
STARTS = 4
#: of a search's time, what is over after starts, whole chambers and grid: without and with gravity
OVER = {False: (0.5, 0.58, 0.6), True: (0.93, 0.97, 0.99)}
#: alternatives: so many, at pressures (MPa) so far apart, with angles (deg) so different or other numbers
ALTERNATIVES, APART, DISTINCT = 3, 0.008, 3.0
#: RMS of an alternative over the design's at which it takes its place
BETTER = 0.9
#: name -> step beyond a bound that its cost is told of, in words; 0.1 mm of all others
USUAL = {"angle": (1.0, "1 deg"), "pressure": (0.001, "1 kPa"), "chambers": (1.0, "1")}
USUAL |= {"mu": (0.01, "0.01 MPa")}
#: mm; bounds that cost less are named without
WORTH_TELLING = 0.005
log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A body that can be cast: pressures (aims, groups of segments) in MPa; base_pose (4, 4) in target
    coordinates; rms: of the misfit, mm: what is minimised, frames and further shapes in it; problem, at: what
    it is the optimum of, and its Evaluation."""

    manipulator: Manipulator
    pressures: np.ndarray
    base_pose: np.ndarray
    rms: float
    problem: Problem
    at: Evaluation

    @property
    def pressure(self) -> float | tuple[float, ...]:
        """Of the first shape, MPa; one for each group where there are several."""
        own = tuple(self.pressures[0].tolist())
        return own if len(own) > 1 else own[0]

    def __str__(self) -> str:
        segments = self.manipulator.segments
        counts = " / ".join(str(s.chambers) for s in segments)
        pressures = ", ".join(map(_kPa, self.pressures))
        told = f"angles {_angles(segments)} deg, chambers {counts}, {pressures} kPa"
        return f"{told}, RMS {self.centreline_rms:.2f} mm"

    @property
    def centreline_rms(self) -> float:
        """Of the points that the first shape is to meet, mm: no frames and no other shapes in it."""
        away = self.at.shapes[0].placed.points - self.problem.aims[0].points
        return float(np.sqrt(np.mean(np.sum(away**2, axis=1))))

    @cached_property
    def overlaps(self) -> bool:
        """Whether the body runs through itself where its sections along the wanted curve would not."""
        for aim, shape in zip(self.problem.aims, self.at.shapes):
            if aim.nearest or len(aim.points) < 2 or not self._overlaps(aim, shape.placed.poses):
                continue
            wanted = shape.placed.poses.copy()
            wanted[:, :3, 3] = aim.points
            if not self._overlaps(aim, wanted):
                return True
        return False

    def _overlaps(self, aim, poses):
        line = Centreline(aim.fractions * self.manipulator.length, poses)
        return bool(overlap_doubts(self.manipulator, line))

    def differs(self, other: "Candidate") -> bool:
        """Whether another one has other silicone, groups or numbers of chambers, or clearly other angles."""
        pairs = list(zip(self.manipulator.segments, other.manipulator.segments))
        if any((a.material.name, a.group) != (b.material.name, b.group) for a, b in pairs):
            return True
        return any(a.chambers != b.chambers or abs(a.angle - b.angle) >= DISTINCT for a, b in pairs)


@dataclass(frozen=True, eq=False)
class Found:
    """best: the design. alternatives: distinct ones, best first. active: bounds that the optimum sits on, and
    what they cost; stopped_by: the one that costs most, a limit of walls where none costs anything, "" where
    there is none. flush_costs: mm by which steps in the underside would lower the misfit. pieces: with the
    groups that were chosen."""

    best: Candidate
    alternatives: tuple[Candidate, ...]
    active: tuple[str, ...]
    stopped_by: str
    flush_costs: float
    evaluations: int
    pieces: tuple[Extracted, ...]


def search(
    target: Target,
    pieces: Sequence[Extracted],
    law: SegmentLaw,
    objective: str = PAIRED,
    alternatives: int = ALTERNATIVES,
    mapping: Map = map,
) -> Found:
    """The `Found` for a Target split into `pieces` (`Extracted`), with so many alternatives at most.

    mapping: a `map` that spreads the starts, over processes for instance; the answer does not depend on it.

    InputError where the pieces cannot be built, ConvergenceError where the law has no answer at any pressure.
    """
    if objective not in OBJECTIVES:
        raise InputError(f"objective = '{objective}' is not known: write {' or '.join(OBJECTIVES)}")
    tried, failed = [], None
    divisions = divided(target, pieces)
    for material, parts in progress(list(product(target.materials, divisions)), "searches"):
        if len(target.materials) > 1:
            log.info(f"silicone {material.name}:")
        if len(divisions) > 1:
            log.info(f"pressure groups of the pieces: {', '.join(str(p.group) for p in parts)}")
        of_it = replace(target, material=_within(material, target.casting.moduli))
        try:
            tried.append(_Search(of_it, parts, law, objective, alternatives, mapping))
        except ConvergenceError as error:
            failed = error
    if not tried:
        assert failed is not None
        raise failed
    chosen = min(tried, key=lambda one: (one.best.overlaps, one.best.rms))
    others = [one for one in tried if one is not chosen]
    chosen.evaluations += sum(one.evaluations for one in others)
    return chosen.found([one.best for one in others])


def _within(material, moduli):
    """The material with its modulus brought into (lowest, highest), if there is such a range."""
    return material if moduli is None else of_modulus(material, float(np.clip(material.mu, *moduli)))


def _kPa(pressures):
    return " / ".join(f"{KPA_PER_MPA * P:.1f}" for P in pressures)


def _angles(segments):
    return " / ".join("plain" if s.kind == PASSIVE else f"{s.angle:.0f}" for s in segments)


class _Search:
    """The way from guesses to the best body of one silicone and division into pressure groups, and on to a
    Found; counts evaluations."""

    def __init__(self, target, pieces, law, objective, most, mapping):
        self.mapping = mapping
        self.target, self.pieces, self.law, self.objective = target, pieces, law, objective
        self.optima, self.pace = [], Pace()
        self.loaded = any(target.gravity)  # ten times the cost: no alternatives, no price of flushness
        self.most = most if objective == PAIRED and not self.loaded else 0
        self.floor, self.evaluations = (FINE_ENOUGH * target.length) ** 2, 0
        self.guesses = guesses(target, pieces, law)
        problem, optimum = self._from_guesses(self.guesses)
        if self.objective == EQ27:
            aims = Aim.all_of(self.target, problem.body.segments[0].width, EQ27)
            problem, optimum = self._counted(optimised(replace(problem, aims=aims), self.floor))
        log.info(f"real-valued optimum: {_told(problem, optimum)}")
        self.real, self.whole = (problem, optimum), self._whole(problem, optimum)
        _, after_whole, after_grid = OVER[self.loaded]
        log.info(f"whole chambers:      {_told(*self.whole)}{self.pace.left(after_whole)}")
        self.best = self._cast(self.whole)
        log.info(f"dimensions on grid:  {self.best}{self.pace.left(after_grid)}")

    def found(self, rivals):
        """The Found, with the best Candidates of other searches among the alternatives."""
        best, whole = self.best, self.whole
        flush = self._flush_costs(*self.real)
        bounds = sorted(_active(*whole), key=lambda pair: -pair[0])
        alternatives = self._alternatives(best, whole, self.guesses, rivals)
        all_of_them = (best, *alternatives)
        # none that runs through itself unless all do; then what is clearly better
        best = min(all_of_them, key=lambda c: (c.overlaps, c.rms * (BETTER if c is self.best else 1.0)))
        if best is not self.best:
            alternatives = tuple(c for c in all_of_them if c is not best)
            through = "; the design so far runs through itself" if self.best.overlaps > best.overlaps else ""
            log.info(f"another candidate wins:  {best}{through}")
        segments, pressures = best.manipulator.segments, best.at.body.pressures.max(axis=0)
        of_walls = list(at_limits(segments, pressures, self.law, self.target.casting.allow_touch))
        stopping = [text for saved, text in bounds if saved > 0] + of_walls
        return Found(
            best,
            alternatives,
            (*(text for _, text in bounds), *of_walls),
            stopping[0] if stopping else "",
            flush,
            self.evaluations,
            self.pieces,
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
        work = partial(_from_guess, self.target, self.pieces, self.law, self.floor)
        best, count = None, len(guesses[:STARTS])
        if self.loaded:
            log.info(f"under gravity every step balances the whole body: {count} starts at most, in order")
        for number, found in enumerate(self.mapping(work, guesses[:STARTS]), start=1):
            self._keep(found)
            told = "no equilibrium" if found is None else _told(*found)
            left = self.pace.left(OVER[self.loaded][0] * number / count)
            log.info(f"start {number} of at most {count}: {told}{left}")
            best = min(self.optima, key=lambda found: found[1].cost, default=None)
            if best and best[1].cost < (GOOD_ENOUGH * self.target.length) ** 2:
                break
        if not self.optima:
            least = KPA_PER_MPA * min(g.pressure for g in guesses)
            raise ConvergenceError(f"the law has no equilibrium at {least:.1f} kPa: lower the pressure")
        return best

    def _try(self, problem, steps=30):
        """Its local optimum to the others'."""
        return self._keep(optimised(problem, self.floor, steps))

    def _keep(self, found):
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
        return {"angle": casting.angle_grid or 0.01, "mu": 0.001} | steps

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
        body = replace(body, pressures=body.pressures.round(6))
        problem = replace(problem, body=body, everything=True)
        at = problem.evaluate(problem.x) or optimum.at
        segments = tuple(replace(s, chambers=round(n)) for s, n in zip(body.segments, body.counts))
        rms, whole = float(np.sqrt(at.misfit)), Manipulator(segments)
        pressures = body.pressures[:, [group[0] for group in whole.groups]]
        return Candidate(whole, pressures, body.base_pose, rms, problem, at)

    def _alternatives(self, best, whole, guesses, rivals):
        """Distinct Candidates that are not much worse."""
        allowed = max(2 * best.rms, 5 * GOOD_ENOUGH * self.target.length)
        found = [c for c in rivals if c.rms <= allowed]
        found = sorted(found, key=lambda c: c.rms)[: self.most]
        if len(found) == self.most:
            return tuple(found)
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
        chosen = whole[0].body.pressures[0].max()
        seen = [chosen]
        for problem, optimum in sorted(self.optima, key=lambda found: found[1].cost):
            own = problem.body.pressures[0].max()
            if min(abs(own - P) for P in seen) >= APART:
                seen.append(own)
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


def _from_guess(target, pieces, law, floor, guess):
    return optimised(start(target, pieces, law, guess), floor)


def _held_near(problem, pressure):
    """The Problem with its pressure kept near one (MPa)."""
    low, high = pressure - APART / 2, pressure + APART / 2
    variables = (
        replace(v, low=max(v.low, low), high=min(v.high, high)) if v.name == "pressure" else v
        for v in problem.variables
    )
    return replace(problem, variables=tuple(variables))


def _told(problem, optimum):
    body = problem.body
    counts = " / ".join(f"{n:.3g}" for n in body.counts)
    return (
        f"angles {_angles(body.segments)} deg, chambers {counts},"
        f" {_kPa(list(dict.fromkeys(body.pressures[0].tolist())))} kPa,"
        f" misfit {np.sqrt(optimum.at.misfit):.3f} mm"
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
