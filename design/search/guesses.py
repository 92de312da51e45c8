"""Where the search starts: entries of the lookup table at every modulus that may be chosen, and the problem
at one of them, with the base turned to the target."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.materials.laws import of_modulus
from pneunet.design.search.aims import Aim
from pneunet.design.search.lookup import Guess, first_guesses
from pneunet.design.search.problem import Body, Problem
from pneunet.design.search.space import Variable, grid, limits, prototype, variables_of
from pneunet.design.target.extraction import Extracted
from pneunet.design.target.target import PRESSURE_LIMIT, Target
from pneunet.geometry.parameters import PASSIVE, Manipulator, Segment
from pneunet.reduced.rod.laws import SegmentLaw

LEAST_PRESSURE = 0.002  # MPa
SPLIT_KEPT = 0.3  # a segment's number of chambers stays within this fraction of what its piece asks for
#: moduli at which first guesses are made, of a range of them: one over the other
MODULI_APART = 1.5


def guesses(target: Target, pieces: Sequence[Extracted], law: SegmentLaw) -> list[Guess]:
    """Of every modulus that may be chosen, best first. InputError where a piece or a group of them cannot be
    built, ConvergenceError where the law has no answer at any pressure."""
    materials = [target.material]
    if target.casting.moduli is not None:
        low, high = target.casting.moduli
        moduli = np.geomspace(low, high, 1 + int(np.ceil(np.log(high / low) / np.log(MODULI_APART))))
        materials = [of_modulus(target.material, mu) for mu in moduli.tolist()]
    found = []
    for material in materials:
        of_it = replace(target, material=material)
        found += _guesses_at(of_it, pieces, [prototype(of_it, piece) for piece in pieces], law)
    if not found:
        raise ConvergenceError(
            "the law has no equilibrium for these dimensions at any allowed pressure: make the walls thicker"
        )
    return sorted(found, key=lambda guess: guess.misfit)


def _guesses_at(target, pieces, prototypes, law):
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
    body = Manipulator(tuple(prototypes))
    if len(target.pressures) > 1:
        fixed = body.pressures(target.pressures)[None]
        return first_guesses(pieces, prototypes, angles, heights, fixed, law)
    low, high = target.pressure_range or (0.010, PRESSURE_LIMIT)
    if target.guided:  # the last tip point is where it leads
        low = high = max([max(s.pressures) for s in target.shapes] + _tip_pressures(target))
    pressures = (
        np.linspace(low, high, max(1, round((high - low) / 0.010)) + 1) if high > low else np.array([low])
    )
    alike = np.tile(pressures[:, None], (1, len(pieces)))
    return first_guesses(pieces, prototypes, angles, heights, alike, law)


def _tip_pressures(target):
    return [] if target.tip is None else target.tip.pressures.tolist()


def shortest(segment: Segment) -> float:
    """Length (mm) of one chamber and its ends, at rest."""
    return 2 * segment.end_length + segment.chamber_thickness


def start(target: Target, pieces: tuple[Extracted, ...], law: SegmentLaw, guess: Guess) -> Problem:
    """The Problem at an entry of the lookup table, with the base turned to the target."""
    segments = guess.segments
    variables = variables_of(target, pieces, segments, not target.casting.allow_steps)
    aims = Aim.all_of(target, segments[0].width)
    # chambers are counted by the guess
    whole = Manipulator(segments)
    pressures = [guess.pressures if a.pressure is None else whole.pressures(a.pressure) for a in aims]
    if aims[0].pressure is None and not target.pressures:
        low, high = target.pressure_range or (LEAST_PRESSURE, PRESSURE_LIMIT)
        if high > low:
            scale = high - low if target.pressure_range else 0.02
            several = len(whole.groups) > 1
            for number, members in enumerate(whole.groups, start=1):
                variables.append(Variable("pressure", members, low, high, scale, group=several * number))
    for i, count in enumerate(guess.counts):
        if segments[i].kind == PASSIVE:
            continue
        low, high = np.floor(max(1.0, (1 - SPLIT_KEPT) * count)), np.ceil((1 + SPLIT_KEPT) * count + 1)
        variables.append(Variable("chambers", (i,), low, high, 0.3 * count + 1, count))
    turns = np.eye(3)[:, : 3 if target.base_direction is None else 1 if target.base_width is None else 0]
    body = Body(
        segments,
        np.array(guess.counts),
        np.array(pressures),
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


def _some_rotation(target):
    """The base's rotation where it is fixed, else any one with the fixed direction, else the identity."""
    if target.base_rotation is not None:
        return target.base_rotation
    if target.base_direction is None:
        return np.eye(3)
    aside = np.cross(np.eye(3)[np.argmin(abs(target.base_direction))], target.base_direction)
    aside /= np.linalg.norm(aside)
    return np.column_stack([target.base_direction, aside, np.cross(target.base_direction, aside)])
