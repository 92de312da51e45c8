"""Where a solve is to end, and the words for it on the screen and in run.json."""

import math
from dataclasses import dataclass
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.designfile import DesignFile
from pneunet.hifi.body.manipulator import DEAD_LOADS, Measured
from pneunet.hifi.path.stepping import StepResult

ROUNDING = 1e-12


@dataclass(frozen=True)
class Goal:
    """control: what is prescribed; `value` of the file's `key`, in file units; dead: whether dead loads come
    first."""

    control: str
    key: str
    value: float
    dead: bool

    @classmethod
    def of(cls, design: DesignFile, pressure: float | None = None) -> "Goal":
        """The design's, or another pressure (MPa; of several groups the largest); InputError when that makes
        no sense."""
        control = design.control
        if control.name != "pressure" and pressure is not None:
            raise InputError(
                f'--pressure-kPa does not go with the design\'s control = "{control.name}": change that in'
                " the design"
            )
        pressure = design.largest_pressure if pressure is None else pressure
        if pressure == 0 and not design.loads:
            raise InputError(
                "pressure_kPa = 0 leaves nothing to solve: give a pressure, or [loads] in the design"
            )
        key, value = {
            "pressure": ("pressure_kPa", pressure * KPA_PER_MPA),
            "volume": ("volume_factor", control.volume_factor),
            "arc length": ("arc_length_mm", control.arc_length),
        }[control.name]
        return cls(control.name, key, value, bool(design.loads))

    def end(self, stage: str, rest_volume: float) -> float:
        """The path's parameter at which `stage` is over: MPa, mm3 or mm, and 1 of the dead loads."""
        if stage == DEAD_LOADS:
            return 1.0
        ends = {"pressure": self.value / KPA_PER_MPA, "volume": self.value * rest_volume}
        return ends.get(stage, self.value)

    def is_last(self, stage: str) -> bool:
        """Whether nothing comes after `stage`."""
        return stage == self.control or (self.control == "pressure" and self.value == 0)

    def share(self, stage: str, parameter: float, rest_volume: float) -> float:
        """The parameter over that at which the run ends, 1 within rounding; 0 before the last stage."""
        if not self.is_last(stage):
            return 0.0
        end = self.end(stage, rest_volume)
        share = parameter / end if end else math.inf
        return 1.0 if abs(share - 1) <= ROUNDING else share

    @property
    def noun(self) -> str:
        return "loads" if self.is_last(DEAD_LOADS) else self.control

    @property
    def table(self) -> dict[str, str | float]:
        """run.json's part."""
        return {"control": self.control, self.key: self.value}

    def time(self, step: int, pressure_kPa: float) -> float:
        """What ParaView lists a state under: its pressure where that grows from state to state, else its
        step."""
        return pressure_kPa if self.control == "pressure" and not self.dead else step

    def plan(self) -> str:
        """What will be walked, in words."""
        inflation = f"{self.key} to {self.value:g}"
        return (
            "dead loads alone"
            if self.is_last(DEAD_LOADS)
            else f"dead loads, then {inflation}"
            if self.dead
            else inflation
        )

    def done(self, m: Measured, stage: str, reached: str) -> str:
        """The last line's beginning, of the last state, `reached` in words, and what makes it doubtful."""
        pressure = f" at {m.pressure * KPA_PER_MPA:.4g} kPa" * (stage in ("volume", "arc length"))
        return f"done: {reached}{pressure}" + f"; {m.touch.text}" * bool(m.touch.text)

    def failure(self, m: Measured, stage: str, reached: str, result: StepResult, out: Path) -> str:
        """Why the run ended short of its goal, where its data are, and what to try; m: its last state,
        `reached` in words."""
        if stage == DEAD_LOADS:
            why, remedy = "buckling or too coarse a mesh", "smaller [loads] or a smaller mesh_size_mm"
        else:
            why, remedy = (
                "ballooning, touching walls or too coarse a mesh",
                "less pressure, thicker walls or a smaller mesh_size_mm",
            )
        if result.diagnosis and stage == "pressure":
            remedy = f'control = "volume" in the design, which walks through limit points, or {remedy}'
        what = "[loads] were" if stage == DEAD_LOADS else f"{self.key} = {self.value:g} was"
        overlap = f" ({m.touch.text})" * bool(m.touch.text)
        return (
            f"{what} not reached: stopped at {reached} ({result.reason}),"
            f" {result.diagnosis or f'usually by {why}'}; the result up to there is in {out}{overlap}; try"
            f" {remedy}"
        )
