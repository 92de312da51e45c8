"""A whole manipulator, clamped at its base, under dead loads and the pressure of its cavities."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pneunet.base import se3
from pneunet.base.strains import RodStrains
from pneunet.geometry import tags
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import Manipulator
from pneunet.hifi.body.problem import BodyProblem, Support
from pneunet.hifi.body.system import BodySystem
from pneunet.hifi.contact.body import BodyContact
from pneunet.hifi.contact.body_distance import BodyDistance
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.contact.touch import Load, Touch, TouchWatch
from pneunet.hifi.contact.walls import WallDistances
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.loads import EndLoad, Gravity, Pressure
from pneunet.hifi.fem.sections import SectionFrames
from pneunet.hifi.fem.stretch import PrincipalStretch
from pneunet.hifi.path.control import ArcLength, LoadControl, VolumeControl
from pneunet.hifi.path.equilibrium import EquilibriumPath
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.rod_coordinates import RodCoordinates
from pneunet.hifi.path.stepping import Step, StepResult, StepSize, run_steps
from pneunet.hifi.path.system import PathControl

#: rad, all stations together; Newton on slender bodies is limited by how far they turn in a step, not by how
#: far they strain
TURN_PER_STEP = 2.0
#: the first stage of a path; the others are called after the control (geometry.loading.CONTROLS)
DEAD_LOADS = "dead loads"


@dataclass(frozen=True)
class Measured:
    """One accepted state, the same on all ranks but for `walls`, the smallest distance in each gap (rank 0
    only). Pressure in MPa, of several groups the largest; volume: BodyProblem.cavity_volume; lengths in mm.
    touch: whether parts of the body run into each other.

    dead_loads: the fraction of them that acts. unstable: unstable directions at fixed loads of the tangent
    factorised last: at this very state if stability_factorisations is 1, in this step or before otherwise.
    limit_points: hifi.path.equilibrium.LimitPoints of the pressure passed so far.
    """

    step: int
    pressure: float
    iterations: int
    factorisations: int
    seconds: float
    volume: float
    largest_stretch: float
    stations: np.ndarray
    frames: np.ndarray
    strains: RodStrains
    walls: np.ndarray | None
    touch: Touch
    unstable: int
    dead_loads: float
    stability_factorisations: int
    limit_points: tuple


class ManipulatorSolve:
    """The boundary value problem of a meshed manipulator with everything that is measured on it."""

    def __init__(
        self,
        manipulator: Manipulator,
        mesh_path: Path,
        comm: MPI.Comm = MPI.COMM_WORLD,
        newton_options: NewtonOptions | None = None,
        flip_y: bool = False,
        loads: DeadLoads | None = None,
        hold_tip: bool = False,
        contact: WallPenalty | None = None,
        shares: Sequence[float] | None = None,
    ):
        """flip_y mirrors the mesh at the plane y = 0: for a mirrored manipulator on the original's mesh.
        loads: geometry.loading.DeadLoads in the body's axes. hold_tip: the tip's face stays at its place at
        rest. contact: the hifi.contact.penalty.WallPenalty between neighbouring chambers; without it they may
        pass through each other. shares: of the pressure in each group's cavity, the largest 1; by default
        all."""
        self.manipulator, self.comm, self.newton_options = manipulator, comm, newton_options
        mesh, cell_tags, facet_tags = compat.read_mesh(mesh_path, comm)
        if flip_y:
            mesh.geometry.x[:, 1] *= -1
        materials = {tags.BODY + i: s.material for i, s in enumerate(manipulator.segments)}
        materials |= {
            tags.LAYER + i: s.layer_material for i, s in enumerate(manipulator.segments) if s.layer_thickness
        }
        shares = [1.0] * len(manipulator.groups) if shares is None else list(shares)
        self.pressures = [
            Pressure(tags.cavity_tags(group), share=share) for group, share in enumerate(shares, start=1)
        ]
        #: of the group with the largest
        self.pressure = self.pressures[shares.index(max(shares))]
        self.dead = _dead(loads or DeadLoads(), materials)
        supports = [Support(tags.BASE)] + [Support(tags.TIP)] * hold_tip
        self.problem = BodyProblem(
            mesh, cell_tags, facet_tags, materials, supports, [*self.pressures, *self.dead]
        )
        spacing = float(np.mean([s.pitch for s in manipulator.segments if s.chambers]))
        coordinates = RodCoordinates(self.problem.nodes, self.problem.owned_nodes, comm, spacing)
        self.system = BodySystem(self.problem, coordinates, self._set_pressure)
        self.sections = SectionFrames(self.problem, manipulator)
        self.walls = WallDistances(self.problem, manipulator)
        self.body_distance = BodyDistance(self.problem, manipulator)
        if contact:
            owners = [manipulator.segments[number - 1] for number, _, _, _ in self.walls.gaps]
            laws = [contact.on(s.material.mu, s.gap) for s in owners]
            self.problem.contact = BodyContact(self.problem, self.walls, laws)
        #: what the accepted states have met
        self.watch = TouchWatch(self.problem.contact.gaps > 0)
        solids = [(tags.BODY + i, tags.LAYER + i) for i in range(len(manipulator.segments))]
        self.stretch = PrincipalStretch(self.problem, solids)
        #: hifi.path.stepping.Step of the last accepted state
        self.last_step = None
        #: called between iterations (hifi.path.newton)
        self.between: Callable[[], object] = lambda: None
        self.stability_factorisations, self.rest_volume, self.path = 0, self.system.volume(), None
        self.begin(DEAD_LOADS if self.dead else "pressure")

    # ---- the stages of loading: what the one load factor of the system means
    def _set_pressure(self, value):
        for pressure in self.pressures:
            pressure.value.value = pressure.share * value

    def _set_dead(self, fraction):
        for load in self.dead:
            load.value.value = fraction

    def begin(self, stage: str) -> None:
        """From the present state on, walk along `stage`: DEAD_LOADS from none to all, or inflate under the
        control so called."""
        if stage == DEAD_LOADS:
            self.system.steer(self._set_dead, 0.0)
        else:
            self._set_dead(1.0)
            self.system.steer(self._set_pressure, float(self.pressure.value.value))
        controls: dict[str, Callable[[], PathControl]] = {
            DEAD_LOADS: lambda: LoadControl("the dead loads"),
            "volume": VolumeControl,
            "arc length": lambda: ArcLength(self.system),
        }
        control = controls.get(stage, LoadControl)()
        start = {"volume": self.system.volume(), "arc length": 0.0}.get(stage, self.system.load)
        before, self.stage = self.path, stage
        self.path = EquilibriumPath(self.system, control, self.newton_options, start)
        if before:
            self.path.newton.timings = before.newton.timings

    def measure(self, step: Step | None = None, stability_factorisations: int = 0) -> Measured:
        """Measured of the current state; collective."""
        frames, walls = self.sections.frames(), self.walls.distances()
        return Measured(
            step=step.number if step else 0,
            pressure=float(self.pressure.value.value),
            iterations=step.iterations if step else 0,
            factorisations=step.factorisations if step else 0,
            seconds=step.seconds if step else 0.0,
            volume=self.problem.cavity_volume(),
            largest_stretch=self.stretch.largest(),
            stations=self.sections.stations,
            frames=frames,
            strains=self.sections.segment_strains(frames),
            walls=walls,
            touch=self._touch(walls),
            unstable=self.system.unstable,
            dead_loads=self._dead_fraction,
            stability_factorisations=stability_factorisations,
            limit_points=tuple(self.path.limit_points),
        )

    def _touch(self, walls):
        """The Touch of the current state, the same on all ranks; `walls` on rank 0."""
        body = self.body_distance.smallest()
        nearest = (float(walls.min(initial=np.inf)), body) if self.comm.rank == 0 else None
        force = np.linalg.norm(self.problem.contact.forces(), axis=1).max(initial=0.0)
        load = Load(float(self.pressure.value.value), self._dead_fraction)
        return self.watch.see(load, *self.comm.bcast(nearest, root=0), float(force))

    @property
    def _dead_fraction(self):
        return float(self.dead[0].value.value) if self.dead else 0.0

    def run(
        self,
        target: float,
        on_measured: Callable[[Measured], None] = lambda measured: None,
        milestones: Sequence[float] = (),
        first_step: float | None = None,
        before: Step | None = None,
        control: str = "pressure",
        stability: bool = True,
    ) -> StepResult:
        """The dead loads, if there are any, in a ramp of their own; then inflate to `target`; a StepResult of
        the latter.

        control: 'pressure' with a target in MPa (0: no inflation), 'volume' with one in mm3, 'arc length'
        with one in mm. `on_measured` sees every accepted state. stability: the tangent is factorised at the
        end of either stage and at every milestone, to count unstable directions there (counted apart from the
        stepper's own factorisations). ConvergenceError when it stops short. `before`: the Step that this run
        goes on from (hifi.runs.solve.checkpoint).
        """
        if self.stage == DEAD_LOADS:
            result = StepResult()
            if self.path.parameter < 1.0:
                result = self._walk(1.0, StepSize(0.1, 1e-4, 0.5), on_measured, before, stability)
            if target == 0 and control == "pressure":
                return result
            before = None
        if self.stage != control:
            self.begin(control)
        if self.last_step and not before:  # numbers and seconds go on after the dead loads
            before = replace(self.last_step, next_size=self._step_size(target, first_step).first)
        size = self._step_size(target, first_step)
        size.milestones = tuple(milestones)
        return self._walk(target, size, on_measured, before, stability)

    def _step_size(self, target, first_step):
        """StepSize of the inflation."""
        if self.stage == "pressure":
            softest = min(s.material.mu for s in self.manipulator.segments)
            return StepSize(
                first=min(first_step or 0.01 * softest, target),
                smallest=1e-5 * softest,
                largest=0.05 * softest,
            )
        way = target - (self.rest_volume if self.stage == "volume" else 0.0)
        return StepSize(first=first_step or 0.02 * way, smallest=1e-5 * way, largest=0.1 * way)

    def _walk(self, target, size, on_measured, before, stability):
        largest, marks = size.largest, {*size.milestones, target}

        def limit():
            if len(self.path.accepted) > 1:
                size.largest = min(
                    largest, TURN_PER_STEP / self._turn_per_parameter(*self.path.accepted[-2:])
                )

        def on_step(step):
            self.last_step = step
            limit()
            count = int(stability and step.load in marks)
            if count:
                self.path.newton.factorise()
                self.stability_factorisations += 1
            on_measured(self.measure(step, count))

        limit()
        self.path.newton.between = self.between
        return run_steps(self.path, target, size, on_step, before)

    def _turn_per_parameter(self, first, second):
        """Sum over the stations of how far each section turns against the one before, rad per parameter, of
        two PathStates."""
        relative = []
        for accepted in (first, second):
            rotations = self.sections.frames(accepted.state)[:, :3, :3]
            relative.append(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
        turn = np.linalg.norm(se3.log_rotation(np.swapaxes(relative[0], -1, -2) @ relative[1]), axis=-1).sum()
        return max(turn, 1e-12) / (second.parameter - first.parameter)

    def destroy(self) -> None:
        self.system.destroy()


def _dead(loads, materials):
    """hifi.fem.loads of the DeadLoads that are not zero."""
    dead = [Gravity(materials, loads.gravity)] if any(loads.gravity) else []
    return dead + [EndLoad(tags.TIP, loads.tip_force, loads.tip_moment)] * any(
        [*loads.tip_force, *loads.tip_moment]
    )
