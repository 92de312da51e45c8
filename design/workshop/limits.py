"""How far a casting may be inflated, and why: the walls touch, the silicone tears, or the shape gives way."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.units import MPA_PER_KPA
from pneunet.design.report.rundata import Solution
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import Segment
from pneunet.reduced.rod.clearance import allowed_stretch
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.prediction import doubts, predict_design

#: of the design's pressure: no limit is looked for beyond
FARTHEST = 3.0


NO_EQUILIBRIUM = "limit point: the law finds no equilibrium beyond"


@dataclass(frozen=True)
class Limit:
    """pressure in MPa, the largest of the groups'; reason in words."""

    pressure: float
    reason: str


def limits(design: DesignFile, law: SegmentLaw, solved: Solution | None = None) -> list[Limit]:
    """What limits the pressure, the lowest first; finite elements know better than estimates where there are
    any."""
    found = [*_touch(design, law, solved), *_break(design, law, solved), *_limit_point(design, law, solved)]
    return sorted(found, key=lambda limit: limit.pressure)


def _touch(design, law, solved):
    told = None if solved is None else solved.record.get("first_touch_kPa")
    if told is not None:
        alone = " under the dead loads alone" * (told == 0 and bool(design.loads))
        yield Limit(told * MPA_PER_KPA, f"walls of neighbouring chambers touch{alone} (finite elements)")
        return
    pressure, i = _first(design, lambda s, p: 1 - law.walls(s, p)[0], solved)
    if i is not None:
        yield Limit(pressure, f"walls of segment {i} touch ({_of_walls(design, law)})")


def _break(design, law, solved):
    most = min(allowed_stretch(s) for s in design.manipulator.segments)
    if solved is not None and np.isfinite(most):
        steps = solved.steps
        over = np.flatnonzero(steps["largest_stretch"] > most)
        if len(over):
            pressure = steps["pressure_kPa"][over[0]] * MPA_PER_KPA
            yield Limit(pressure, f"stretch {most:.2f}, half of the elongation at break (finite elements)")
            return
    pressure, i = _first(design, lambda s, p: allowed_stretch(s) - law.walls(s, p)[1], solved)
    if i is not None:
        most = allowed_stretch(design.manipulator.segments[i - 1])
        yield Limit(
            pressure,
            f"walls of segment {i} come to stretch {most:.2f}, half of the elongation at break"
            f" ({_of_walls(design, law)})",
        )


def _first(
    design: DesignFile, left: Callable[[Segment, float], float], solved: Solution | None
) -> tuple[float, int | None]:
    """(lowest of the largest pressures, MPa, at which left(segment, its pressure) is 0; number of that
    segment), (inf, None) where it is positive for all up to FARTHEST. Not below what was solved without
    it."""
    top = FARTHEST * design.largest_pressure
    found: list[tuple[float, int | None]] = [(np.inf, None)]
    for i, s in enumerate(design.manipulator.segments):

        def of(p, s=s, i=i):
            value = left(s, float(design.manipulator.pressures(design.scaled(p))[i]))
            return min(value, 1e3)

        if s.chambers and of(top) < 0:
            found.append((float(brentq(of, 0.0, top, xtol=1e-6)), i + 1))
    pressure, number = min(found, key=lambda each: each[0])
    return max(pressure, solved.pressure if solved else 0.0), number


def _limit_point(design, law, solved):
    points = [] if solved is None else solved.record.get("limit_points", [])
    if points:
        reached = points[0]["pressure_kPa"] * MPA_PER_KPA
        yield Limit(reached, "limit point: the pressure rises no further (finite elements)")
        return

    def objection(pressure):
        try:
            predict_design(design, design.scaled(pressure), law)
        except ConvergenceError:
            return NO_EQUILIBRIUM
        except InputError as error:
            return str(error)
        told = doubts(design.manipulator, [design.scaled(pressure)], law)
        return f"the law vouches no further: {told[0]}" if told else None

    low, high = 0.0, FARTHEST * design.largest_pressure
    reason = objection(high) if high else None
    if not reason:
        return
    while high - low > 0.01 * design.largest_pressure:
        middle = (low + high) / 2
        told = objection(middle)
        low, high, reason = (low, middle, told) if told else (middle, high, reason)
    if low or reason == NO_EQUILIBRIUM:
        yield Limit(low, reason)


def _of_walls(design, law):
    """Whose knowledge of walls it is; no law knows what loads do to them."""
    return law.of_walls + ", without the loads" * bool(design.loads)
