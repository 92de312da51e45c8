"""One case of a campaign: a cell over its range of pressures, free, then at prescribed strains around some of
its free states.

The range is found first: by the cavity's volume the path is walked until the pressure asked for or a limit
point of it. The states at the levels are then corrected from interpolations of that path, at fractions of the
top pressure; beyond a share of the limit load nothing is recorded. Walls that touch are held apart.
Everything is in mm and MPa with mu = 1 MPa.
"""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pneunet.base.errors import ConvergenceError
from pneunet.base.files.atomic import write_text
from pneunet.base.materials.laws import material_from_table
from pneunet.geometry.cad.cell import mesh_cell
from pneunet.geometry.cad.grid import grid_cell
from pneunet.geometry.designfile import segment_from_table
from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.slopes import StateSlopes
from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
from pneunet.hifi.cell.unfolding import unfolding
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.contact.touch import Load, TouchWatch
from pneunet.hifi.fem.solver import NotConverged
from pneunet.hifi.path.control import LoadControl, VolumeControl
from pneunet.hifi.path.equilibrium import EquilibriumPath, PathState
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.path.stepping import StepSize, run_steps
from pneunet.hifi.runs.campaign.sample import typical

STATES = "states.json"
#: the path is only a guide for what is computed on it
SCOUT_TOLERANCE, SCOUT_VOLUME_TOLERANCE = 1e-5, 1e-7
#: of the volume at rest: first, smallest and largest step of the scout, and how far it goes
STEPS, FURTHEST = (0.03, 3e-5, 0.5), 30.0
#: on grids with edge layers, where strains at edges are large (measured: 4 factorisations in place of 19). A
#: surface that is compressed beside an edge folds there, in waves as short as elements are. No smaller step
#: goes on, and the path ends before
STEPS_WITH_LAYERS = (0.03, 0.03, 0.12)
#: a prescribed state is walked to in steps of at most this part of the way
HOLD_STEP, SMALLEST_HOLD_STEP = 0.5, 0.1
#: free states whose stiffness is differentiated by the shape, where the strains are: every n-th
STIFFNESS_SLOPES_EVERY = 3
REST = np.eye(6)[0]


class _Enough(Exception):
    """The scout has seen the pressures it was sent for."""


def solve_campaign_case(inputs: dict, directory: Path) -> dict:
    """Case of hifi.runs.cases; inputs: {"segment", "material", "mesh", "levels", "top_pressure",
    "limit_share", "prescribed", "slopes": whether free states are differentiated by shape and stiffening,
    "stiffness_slopes": whether their stiffness is too, "apart": whether the path ends where walls touch}.

    directory/states.json is rewritten with every state. Returns facts: mesh, limit pressure (MPa, None where
    there was none), top pressure, first touch of walls, why prescribed states are missing, CPU time.
    ConvergenceError when the free path ends before its top pressure.
    """
    segment = segment_from_table(
        inputs["segment"], "segment", material_from_table(inputs["material"], "material")
    )
    # half turns spare most of a grid, but strains without the symmetry need the whole
    settings, path, apart = inputs["mesh"], directory / "cell.npz", inputs["apart"]
    part = settings.get("element") == "hexahedra"
    problem, mesh = _problem(segment, settings, path, part, apart)
    every = STIFFNESS_SLOPES_EVERY if inputs["stiffness_slopes"] else 0
    steps = STEPS_WITH_LAYERS if "edge_size_mm" in settings else STEPS
    sampler = Sampler(problem, directory, inputs["slopes"], every, apart, steps)
    top, limit = sampler.scout(inputs["top_pressure"], inputs["limit_share"])
    sampler.free(top * np.arange(inputs["levels"] + 1) / inputs["levels"])
    if part and inputs["prescribed"]:
        sampler.unfold(_problem(segment, settings, path, False, apart)[0])
    missing = sampler.prescribed(inputs["prescribed"])
    return {
        "mesh": mesh,
        "limit_pressure": limit,
        "top_pressure": top,
        "first_touch": first_touch(sampler.states),
        "missing": missing,
        "cpu_seconds": time.process_time(),
    }


def _problem(segment, settings, path, part, apart):
    """(CellProblem, facts of its mesh); without contact where walls stay apart."""
    size, edge = settings["mesh_size_mm"], settings.get("edge_size_mm")
    if settings.get("element") == "hexahedra":
        like = typical(segment.kind) if settings.get("alike") else None
        facts = grid_cell(segment, size, path, edge, part=part, like=like)
    else:
        facts = mesh_cell(segment, size, path, edge_size=edge)
    problem = CellProblem(segment, path, contact=None if apart else WallPenalty())
    for written in (path, path.with_suffix(".msh")):
        written.unlink()
    return problem, facts | {"unknowns": problem.unknowns}


class Sampler:
    """The states of one cell.

    slopes: free states are differentiated, every n-th one's stiffness too (0: none). apart: walls that meet
    are the path's end. steps: STEPS of the scout.
    """

    def __init__(self, problem, directory, slopes=False, stiffness_slopes_every=0, apart=False, steps=STEPS):
        self.problem, self.directory, self.apart = problem, directory, apart
        self.every, self.steps = stiffness_slopes_every, steps
        self.mu = problem.segment.material.mu
        self.system = CellSystem(problem)
        self.slopes = StateSlopes(problem) if slopes else None
        self.options = NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE)
        self.walked = []  # PathStates of the scout, their parameter the pressure
        self.kept = []  # (CellState, state array) of the free states
        self.states = []  # what states.json says

    def scout(self, top: float, share: float) -> tuple[float, float | None]:
        """(top pressure, limit pressure or None), MPa: `top`, or `share` of the limit load where that is
        less; or, of walls that stay apart, where they nearly touch. ConvergenceError where nothing is
        reached."""
        system, limit = self.system, None
        path = EquilibriumPath(
            system,
            VolumeControl(SCOUT_VOLUME_TOLERANCE),
            replace(self.options, relative_tolerance=SCOUT_TOLERANCE),
            system.volume(),
        )
        rest = path.parameter
        self.walked = [self._walked(path)]

        def keep(step):
            if self._met(system.walls.distance()):
                raise _Enough
            self.walked.append(self._walked(path))
            if path.limit_points or system.load >= top:
                raise _Enough

        try:
            run_steps(
                path,
                FURTHEST * rest,
                StepSize(*(step * rest for step in self.steps)),
                keep,
            )
        except _Enough:
            pass
        except ConvergenceError:
            if len(self.walked) == 1:
                raise
            # what the path has reached is used; that it ended is told below
            limit = max(a.load for a in self.walked)
        if path.limit_points:
            limit = path.limit_points[0].load
        highest = max(a.load for a in self.walked)
        if len(self.walked) == 1:
            raise ConvergenceError("walls that are to stay apart nearly touch within the first step")
        if limit is None and highest < top:
            if self.apart:
                return highest, None
            limit = highest
        if limit is not None and share * limit < top:
            return share * limit, limit
        return top, limit

    def _met(self, distance):
        """Whether walls that stay apart are closer than where contact would begin to push."""
        return self.apart and distance < WallPenalty().onset * self.problem.segment.gap

    @staticmethod
    def _walked(path):
        last = path.accepted[-1]
        return replace(last, parameter=last.load)

    def free(self, levels: np.ndarray) -> None:
        """Record the free states at increasing pressures (n,), MPa."""
        system = self.system
        crest = int(np.argmax([a.load for a in self.walked]))
        rising = self.walked[: crest + 1]
        system.load = 0.0
        system.state = rising[0].state.copy()
        path = EquilibriumPath(system, LoadControl(), self.options)
        self._record(path.accepted[0].state, 0.0, "free")
        for pressure in levels[1:]:
            near = sorted(rising, key=lambda a: abs(a.load - pressure))[: EquilibriumPath.memory]
            path.resume(sorted(near, key=lambda a: -abs(a.load - pressure)), np.inf)
            try:
                *_, residual = path.advance(pressure)
            except NotConverged:
                # from the last level, in steps
                path.resume([self._as_walked(*self.kept[-1])], np.inf)
                step = pressure - path.parameter
                result = run_steps(path, pressure, StepSize(step / 4, step / 256))
                residual = result.steps[-1].residual
            self._record(system.state.copy(), residual, "free")
            path.newton.current = True  # measuring has factorised here

    def _as_walked(self, state, array):
        return PathState(state.pressure, state.pressure, array, state.volume)

    def _record(self, array, residual, kind, system=None):
        system = system or self.system
        state = system.measure()
        slopes = {}
        if kind == "free":
            slopes = self._slopes(system, len(self.kept))
            self.kept.append((state, array.copy()))
        scale = self.mu * self.problem.segment.pitch**2
        row = {
            "kind": kind,
            "pressure": state.pressure,
            "strains": [*state.strains.vector],
            "forces": [*state.force, *state.moment],
            "stiffness": state.stiffness.tolist(),
            "volume": state.volume,
            "energy": self.problem.stored_energy(),
            "unstable": state.unstable,
            "largest_stretch": state.largest_stretch,
            "residual": residual / scale,
            "wall_distance": state.wall_distance,
            # where there is none, nothing has touched
            "contact": True,
            "contact_force": state.contact.force if state.contact else 0.0,
            **slopes,
        }
        self.states.append(row)
        write_text(self.directory / STATES, json.dumps(self.states, default=float))

    def _slopes(self, system, number):
        """What a row says of the free state's derivatives: hifi.cell.slopes."""
        if not self.slopes:
            return {}
        strains, stiffness = self.slopes.of(system, stiffness=bool(self.every) and number % self.every == 0)
        return {"strain_slopes": strains.tolist()} | (
            {} if stiffness is None else {"stiffness_slopes": stiffness.tolist()}
        )

    def unfold(self, whole: CellProblem) -> None:
        """Go on with the whole cell of which the problem is a part."""
        unfolded = unfolding(self.problem, whole)
        self.kept = [(state, unfolded(array)) for state, array in self.kept]
        self.system.destroy()
        self.problem, self.system, self.slopes = whole, CellSystem(whole), None

    def prescribed(self, wanted: list[dict]) -> list[str]:
        """Record the states of `wanted` ([{"level", "amplitude", "direction"}]); returns why some are missing
        (n,) texts."""
        missing = []
        for w in wanted:
            index = max(1, round(w["level"] * (len(self.kept) - 1)))
            state, array = self.kept[index]
            q = array[-6:]
            try:
                self._hold(
                    state.pressure,
                    array,
                    prescribed_change(q, state.stiffness, w["amplitude"], w["direction"]),
                )
            except (ConvergenceError, NotConverged) as error:
                missing.append(str(error))
        return missing

    def _hold(self, pressure, array, change):
        system = CellSystem(self.problem, np.ones(6, bool), (pressure, 0.0), (array[-6:].copy(), change))
        try:
            system.state = array.copy()
            path = EquilibriumPath(system, LoadControl("the way to the prescribed strains"), self.options)
            result = run_steps(path, 1.0, StepSize(HOLD_STEP, SMALLEST_HOLD_STEP, HOLD_STEP))
            self._record(system.state, result.steps[-1].residual, "prescribed", system)
        finally:
            system.destroy()


def first_touch(states: list[dict]) -> float | None:
    """Pressure (MPa) at which walls touch on the way through the free states (hifi.contact.touch); None where
    they do not."""
    watch, met = TouchWatch(), None
    for s in states:
        if s["kind"] == "free":
            met = watch.see(
                Load(s["pressure"]), s["wall_distance"], contact_force=s["contact_force"]
            ).walls_from
    return met and met.pressure


def prescribed_change(
    q: np.ndarray, stiffness: np.ndarray, amplitude: float, direction: list[float] | None
) -> np.ndarray:
    """(6,) strains from the free ones q to the prescribed ones: see hifi.runs.campaign.sample.Prescribed."""
    if direction is None:
        return (amplitude - 1) * (q - REST)
    values, vectors = np.linalg.eigh((stiffness + stiffness.T) / 2)
    if values[0] <= 0:
        raise ConvergenceError("the free state is unstable")
    energy = q[3:] @ stiffness[3:, 3:] @ q[3:] / 2
    return amplitude * np.sqrt(2 * energy) * vectors @ ((vectors.T @ np.asarray(direction)) / np.sqrt(values))
