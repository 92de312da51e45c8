"""`pneunet solve`: mesh, solve, record and resume a design."""

import logging
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

from mpi4py import MPI

from pneunet.base.errors import ConvergenceError, InputError, located
from pneunet.base.files.atomic import room_in
from pneunet.base.files.folder import output_folder
from pneunet.base.files.reading import read_json
from pneunet.base.files.record import read_record
from pneunet.base.files.schemas import STEP_FILES
from pneunet.base.system.interrupts import Interrupted, deferred
from pneunet.geometry.designfile import DesignFile, body_tables
from pneunet.geometry.loading import Extras
from pneunet.geometry.meshfile import MESH, read_mesh
from pneunet.hifi.body import tip
from pneunet.hifi.body.manipulator import ManipulatorSolve, Measured
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.fem.agreement import agreed_interrupt, folder_of_all, on_rank_0
from pneunet.hifi.path.stepping import StepResult
from pneunet.hifi.runs.solve.checkpoint import CHECKPOINT, Checkpoint, read_checkpoint, restore
from pneunet.hifi.runs.solve.fields import FieldWriter
from pneunet.hifi.runs.solve.goal import Goal
from pneunet.hifi.runs.solve.progress import Progress
from pneunet.hifi.runs.solve.record import Record
from pneunet.hifi.runs.solve.tables import Tables

log = logging.getLogger(__name__)

#: of a run's identity: what its run.json tells
KEPT = ("loads", "body", "mesh_size_mm", "pressure_shares")
#: what to do after a full disk
RESUME = " and go on with pneunet solve --resume"


class Observer(Protocol):
    """Sees every accepted state of a solve, on all ranks."""

    def accepted(self, m: Measured, /) -> None: ...


def solve_design(
    design: DesignFile,
    directory: str | Path,
    mesh_size: float | None = None,
    pressure: float | None = None,
    fields: bool = True,
    comm: MPI.Comm = MPI.COMM_WORLD,
    resume: bool = False,
    milestones: Sequence[float] = (),
    observers: Sequence[Observer] = (),
) -> Measured:
    """Mesh (if not there yet) and solve a geometry.designfile.DesignFile; files in directory/mesh and
    directory/solve.

    mesh_size in mm and pressure in MPa override the design's. `resume` goes on from
    directory/solve/checkpoint.npz, which every accepted step leaves, on any number of ranks. milestones:
    pressures (MPa; mm3 or mm under another control) that are hit exactly; observers see every accepted state
    once it is on disk. Returns the last Measured. Raises InputError on bad input and ConvergenceError (with
    everything accepted on disk) when the end asked for cannot be reached.
    """
    directory, size = Path(directory), mesh_size or design.mesh_size
    with folder_of_all(comm, directory / "solve"):
        return _solve(design, directory, size, pressure, fields, comm, resume, milestones, observers)


def _solve(design, directory, mesh_size, pressure, fields, comm, resume, milestones, observers):
    started = time.perf_counter()
    mesh_path, out = directory / "mesh" / MESH, directory / "solve"
    goal = Goal.of(design, pressure)
    identity = {
        "body": body_tables(design.manipulator),
        "mesh_size_mm": mesh_size,
        "element": design.element,
        "loads": design.loads.table(),
        "base": design.base_pose.tolist() if design.loads else None,
        "control": goal.control,
        "contact": design.contact,
        **({"pressure_shares": list(design.shares)} if len(design.shares) > 1 else {}),
    }
    mesh, kept = on_rank_0(comm, lambda: _prepare(design, directory, mesh_size, identity, resume))
    loads = design.loads.in_body(design.base_pose)
    penalty = WallPenalty() if design.contact == "auto" else None
    log.info("solve: set up; forms that are new to this machine are compiled, up to a minute")
    solve = ManipulatorSolve(
        design.manipulator, mesh_path, comm, loads=loads, contact=penalty, shares=design.shares
    )
    tables = Tables(comm, out, solve.walls.gaps, design.shares)
    writer = FieldWriter(out, solve, goal) if fields else None
    log.info(
        f"solve: {mesh['cells']} cells, {solve.problem.dofs} dofs (Taylor-Hood), {comm.size}"
        f" rank{'s' * (comm.size > 1)}, {goal.plan()}{_proportions(design)}; set up in"
        f" {time.perf_counter() - started:.1f} s"
    )
    before, last, complete = None, None, False
    if kept:
        before, last = _go_on(kept, solve, goal, tables, out)
        complete = goal.share(solve.stage, before.load, solve.rest_volume) == 1
        started -= before.seconds
        if writer:
            with room_in(out, RESUME):
                writer.resume(tables)
    extras = on_rank_0(comm, lambda: _extras_there(out)) if complete else {}
    missing = {name for name, wanted in asdict(design.measure).items() if wanted and name not in extras}
    if last and complete and not missing:
        reached = f"has reached {goal.key} = {goal.value:g}"
        log.info(f"complete: the run in {out} {reached}; there is nothing to resume")
        solve.destroy()
        return last
    about = {
        **{name: value for name, value in identity.items() if name in KEPT},
        "mesh": mesh,
        "cells": mesh["cells"],
        "resumed_after_step": before and before.number,
    }
    record = Record(out, solve, goal, tables, started, about, extras)
    checkpoint, progress = Checkpoint(out, solve, identity), Progress(solve, goal, last)
    # in this order: a checkpoint refers to what is on disk before it
    told = _Told(out, last, [writer, tables, record, checkpoint, progress, *observers])
    if not before:
        told.accepted(solve.measure())
    result = StepResult() if complete else _walk(solve, goal, told, record, milestones, before)
    last, status = told.last, f"reached the {goal.noun} asked for"
    reached = solve.path.told(solve.path.parameter)
    if result.reason:
        status = f"stopped at {reached} of {goal.key} = {goal.value:g}: {result.reason}"
    elif "tip_stiffness" in missing:
        extras["tip_stiffness"] = tip.stiffness(solve)
    with room_in(out, RESUME):
        record.finished(status, last, result.failures)
    solve.destroy()
    if result.reason:
        raise ConvergenceError(goal.failure(last, solve.stage, reached, result, out))
    if "blocked_force" in missing:
        log.info("blocked force: the same body with its tip held")
        held = design.manipulator, mesh_path, last.pressure, loads, comm, penalty, design.shares
        extras["blocked_force"] = tip.blocked_force(*held)
        with room_in(out, RESUME):
            record.finished(status, last, result.failures)
    ending = goal.done(last, solve.stage, reached)
    log.info("; ".join([ending, *(point.text for point in last.limit_points), f"results in {out}"]))
    return last


def _proportions(design):
    """Of the pressures of several groups, to be read behind the plan."""
    told = " : ".join(f"{share:.4g}" for share in design.shares)
    return f" (pressure groups in the proportions {told})" * (len(design.shares) > 1)


def _walk(solve, goal, told, record, milestones, before):
    """StepResult of the way to the goal, with a reason where it ended short of it."""
    target = goal.end(goal.control, solve.rest_volume)
    solve.between = lambda: agreed_interrupt(solve.comm)
    try:
        with deferred():
            return solve.run(target, told.accepted, milestones, before=before, control=goal.control)
    except Interrupted:
        status = f"interrupted at {solve.path.told(solve.path.parameter)}"
        with room_in(record.directory, RESUME):
            record.finished(status, told.last)
        text = f"{status}; the result up to there is in {record.directory}: --resume goes on from it"
        raise Interrupted(text) from None
    except ConvergenceError as error:
        return error.result


class _Told:
    """The observers, in the order in which they are told of a state, and the last state they know."""

    def __init__(self, out, last, observers):
        self.out, self.last, self.observers = out, last, [each for each in observers if each]

    def accepted(self, m):
        self.last = m
        with room_in(self.out, RESUME):
            for observer in self.observers:
                observer.accepted(m)


def _go_on(kept, solve, goal, tables, out):
    """(Step, Measured) that the checkpoint `kept` has put the solve at; InputError when that is beyond the
    goal."""
    solve.begin(str(kept["stage"]))
    step = solve.last_step = restore(kept, solve.path)
    for state in tables.resume(step.number):
        solve.watch.see(*state)
    measured = solve.measure(step)
    if goal.share(solve.stage, step.load, solve.rest_volume) > 1:
        raise InputError(
            f"{out / CHECKPOINT}: has passed {goal.key} = {goal.value:g} already: solve without --resume"
        )
    log.info(f"resumed after step {step.number} at {solve.path.told(step.load)}")
    return step, measured


def _extras_there(out):
    """What [measure] asked an earlier run for and got."""
    record = read_record(out / "run.json")
    return {name: record[name] for name in asdict(Extras()) if name in record}


def _prepare(design, directory, mesh_size, identity, resume):
    """(facts of the mesh, checkpoint to go on from or None); rank 0."""
    out = directory / "solve"
    kept = read_checkpoint(out, identity) if resume else None
    if resume and not kept:
        log.info(f"no {CHECKPOINT} in {out}: starting from the beginning")
    if not kept:
        for old in [*out.glob(STEP_FILES), out / "solution.pvd", out / "run.json", out / CHECKPOINT]:
            old.unlink(missing_ok=True)  # of an earlier run, which may have had more steps
    with output_folder(directory / "mesh") as folder:
        return _mesh(design, folder, mesh_size), kept


def _mesh(design, folder, mesh_size):
    """Facts of the design's mesh in `folder`, which is made where there is none."""
    from pneunet.geometry.cad.mesh import mesh_manipulator, segment_tables

    wanted = {
        "element": design.element,
        "mesh_size_mm": mesh_size,
        "segments": segment_tables(design.manipulator),
    }
    if (folder / MESH).exists():
        mesh, facts = read_mesh(folder / MESH)
        if wanted == {name: facts.get(name) for name in wanted} and facts == _facts_for_people(folder):
            body = design.manipulator
            with located(folder / MESH):
                mesh.require_tags([s.layer_thickness > 0 for s in body.segments], len(body.groups))
            return facts
    if folder.is_dir() and any(folder.glob("m*")):
        log.info(f"{folder}: no {MESH} of this body and mesh size with its mesh.json: meshed anew")
    return mesh_manipulator(design.manipulator, mesh_size, folder, design.element)


def _facts_for_people(folder):
    """What mesh.json says; None where it says nothing."""
    try:
        return read_json(folder / "mesh.json")
    except InputError:
        return None
