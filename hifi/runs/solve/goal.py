"""Where a solve is to end, and the words for it on the screen and in run.json."""

from dataclasses import dataclass

from pneunet.base.errors import InputError
from pneunet.hifi.body.manipulator import DEAD_LOADS
from pneunet.hifi.runs.solve.tables import KPA


@dataclass(frozen=True)
class Goal:
    """control: what is prescribed; `value` of the file's `key`, in file units; dead: whether dead loads come
    first."""

    control: str
    key: str
    value: float
    dead: bool

    @classmethod
    def of(cls, design, pressure=None):
        """The design's, or another pressure (MPa); InputError when that makes no sense."""
        control = design.control
        if control.name != "pressure" and pressure is not None:
            raise InputError(
                f'--pressure-kPa does not go with the design\'s control = "{control.name}": change that in'
                " the design"
            )
        pressure = design.pressure if pressure is None else pressure
        if pressure == 0 and not design.loads:
            raise InputError(
                "pressure_kPa = 0 leaves nothing to solve: give a pressure, or [loads] in the design"
            )
        key, value = {
            "pressure": ("pressure_kPa", pressure * KPA),
            "volume": ("volume_factor", control.volume_factor),
            "arc length": ("arc_length_mm", control.arc_length),
        }[control.name]
        return cls(control.name, key, value, bool(design.loads))

    def target(self, rest_volume):
        """The control's parameter at the end: MPa, mm3 or mm."""
        return {"pressure": self.value / KPA, "volume": self.value * rest_volume, "arc length": self.value}[
            self.control
        ]

    def end(self, stage, target):
        """The path's parameter at which `stage` is over."""
        return 1.0 if stage == DEAD_LOADS else target

    def is_last(self, stage):
        """Whether nothing comes after `stage`."""
        return stage == self.control or (self.control == "pressure" and self.value == 0)

    @property
    def noun(self):
        return "loads" if self.is_last(DEAD_LOADS) else self.control

    @property
    def table(self):
        return {"control": self.control, self.key: self.value}

    def time(self, step, pressure_kPa):
        """What ParaView lists a state under: its pressure where that grows from state to state, else its
        step."""
        return pressure_kPa if self.control == "pressure" and not self.dead else step

    def where(self, stage, parameter):
        """The place on the path in words."""
        if stage == DEAD_LOADS:
            return f"{parameter * 100:.4g} % of the dead loads"
        return (
            f"{parameter * KPA:.4g} kPa"
            if stage == "pressure"
            else f"{parameter:.4g} {'mm3' if stage == 'volume' else 'mm'}"
        )

    def plan(self):
        """What will be walked, in words."""
        inflation = f"{self.key} to {self.value:g}"
        return (
            "dead loads alone"
            if self.is_last(DEAD_LOADS)
            else f"dead loads, then {inflation}"
            if self.dead
            else inflation
        )

    def done(self, m, stage, parameter):
        """The last line's beginning, of the last state, and what makes it doubtful."""
        pressure = f" at {m.pressure * KPA:.4g} kPa" * (stage in ("volume", "arc length"))
        return f"done: {self.where(stage, parameter)}{pressure}" + f"; {m.touch.text}" * bool(m.touch.text)

    def progress(self, m, stage, done, breaks_at):
        """The line of an accepted state (hifi.body.manipulator.Measured), `done` of the whole stage."""
        eta = m.seconds / done * (1 - done)
        warning = "".join(f"  {word.upper()}" for word in m.touch.warnings)
        if m.unstable:
            warning += f"  UNSTABLE in {m.unstable}"
        if m.largest_stretch > breaks_at:
            warning += f"  BEYOND BREAK (stretch {breaks_at:.2f})"
        place = (
            f"{m.pressure * KPA:7.2f} kPa" if stage != DEAD_LOADS else f"{m.dead_loads * 100:3.0f} % loads"
        )
        place += f"  {m.volume:9.1f} mm3" * (self.control != "pressure")
        return (
            f"step {m.step:3d}  {place}  {m.iterations:2d} iterations  {m.factorisations} factorisations "
            f" stretch {m.largest_stretch:.2f}  wall distance {m.touch.wall_distance:.2f} mm "
            f" {m.seconds:6.1f} s  ETA {eta:5.0f} s{warning}"
        )

    def failure(self, m, stage, parameter, result, out):
        """Why the run ended short of its goal, where its data are, and what to try; m: its last state,
        `result`: hifi.path.stepping.StepResult."""
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
            f"{what} not reached: stopped at {self.where(stage, parameter)} ({result.reason}),"
            f" {result.diagnosis or f'usually by {why}'}; the result up to there is in {out}{overlap}; try"
            f" {remedy}"
        )
