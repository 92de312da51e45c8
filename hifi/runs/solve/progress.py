"""What a solve says on the screen: a line for each step, a sentence on what it meets for the first time."""

import logging
from collections.abc import Iterator

from pneunet.base.system.progress import eta
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.parameters import Manipulator
from pneunet.hifi.body.manipulator import DEAD_LOADS, ManipulatorSolve, Measured
from pneunet.hifi.contact.touch import Touch
from pneunet.hifi.runs.solve.goal import Goal

log = logging.getLogger(__name__)


class Progress:
    """before: the state that a resumed run starts from."""

    def __init__(self, solve: ManipulatorSolve, goal: Goal, before: Measured | None = None) -> None:
        self.solve, self.goal, self.before = solve, goal, before
        self.breaks_at = break_stretch(solve.manipulator)

    def accepted(self, m: Measured) -> None:
        if m.step:
            log.info(self._line(m))
        for text in self._news(m):
            log.info(text)
        self.before = m

    def _news(self, m: Measured) -> Iterator[str]:
        known = self.before.limit_points if self.before else ()
        for point in m.limit_points[len(known) :]:
            yield point.text
        yield from m.touch.news(self.before.touch if self.before else Touch())

    def _line(self, m: Measured) -> str:
        stage, rest = self.solve.stage, self.solve.rest_volume
        start = rest if stage == "volume" else 0.0
        done = (self.solve.path.parameter - start) / (self.goal.end(stage, rest) - start)
        warning = "".join(f"  {word.upper()}" for word in m.touch.warnings)
        if m.unstable:
            warning += f"  UNSTABLE in {m.unstable}"
        if m.largest_stretch > self.breaks_at:
            warning += f"  BEYOND BREAK (stretch {self.breaks_at:.2f})"
        if stage == DEAD_LOADS:
            place = f"{m.dead_loads * 100:3.0f} % loads"
        else:
            place = f"{m.pressure * KPA_PER_MPA:7.2f} kPa"
        place += f"  {m.volume:9.1f} mm3" * (self.goal.control != "pressure")
        return (
            f"step {m.step:3d}  {place}  {m.iterations:2d} iterations  {m.factorisations} factorisations "
            f" stretch {m.largest_stretch:.2f}  wall distance {m.touch.wall_distance:.2f} mm "
            f" {m.seconds:6.1f} s  {eta(m.seconds, done)}{warning}"
        )


def break_stretch(manipulator: Manipulator) -> float:
    """Smallest stretch at which one of the manipulator's materials breaks; inf when none says."""
    return min(material.break_stretch for material in manipulator.materials)
