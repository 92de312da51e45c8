"""`pneunet solve`: mesh, solve, record and resume a design."""

import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.atomic import output_directory
from pneunet.base.files.record import write_record
from pneunet.geometry.designfile import body_tables
from pneunet.geometry.loading import Extras
from pneunet.hifi.body import tip
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.contact.penalty import WallPenalty
from pneunet.hifi.contact.touch import Touch
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.agreement import on_rank_0
from pneunet.hifi.path.stepping import StepResult
from pneunet.hifi.runs.solve import checkpoint
from pneunet.hifi.runs.solve.fields import FieldWriter
from pneunet.hifi.runs.solve.goal import Goal
from pneunet.hifi.runs.solve.tables import KPA, ResultFiles, limit_table, limit_text


def solve_design(
    design,
    directory,
    mesh_size=None,
    pressure=None,
    fields=True,
    comm=MPI.COMM_WORLD,
    say=print,
    resume=False,
    milestones=(),
    on_measured=lambda measured: None,
):
    """Mesh (if not there yet) and solve a geometry.designfile.Design; files in directory/mesh and
    directory/solve.

    mesh_size in mm and pressure in MPa override the design's. `resume` goes on from
    directory/solve/checkpoint.npz, which every accepted step leaves, on any number of ranks. milestones:
    pressures (MPa; mm3 or mm under another control) that are hit exactly; on_measured(Measured) sees every
    accepted state. Returns the last Measured. Raises InputError on bad input and ConvergenceError (with
    everything accepted on disk) when the end asked for cannot be reached.
    """
    directory, out = Path(directory), Path(directory) / "solve"
    goal = Goal.of(design, pressure)
    mesh_size = mesh_size or design.mesh_size
    say = say if comm.rank == 0 else (lambda text: None)
    started = time.perf_counter()
    identity = {
        "body": body_tables(design.manipulator),
        "mesh_size_mm": mesh_size,
        "loads": design.loads.table(),
        "base": design.base_pose.tolist() if design.loads else None,
        "control": goal.control,
        "contact": design.contact,
    }
    facts, kept = on_rank_0(comm, lambda: _prepare(design, directory, mesh_size, identity, resume, say))
    mesh_path, loads = directory / "mesh" / "manipulator.msh", design.loads.in_body(design.base_pose)
    penalty = WallPenalty() if design.contact == "auto" else None
    solve = ManipulatorSolve(design.manipulator, mesh_path, comm, loads=loads, contact=penalty)
    target = goal.target(solve.rest_volume)
    files = ResultFiles(out, solve.walls.gaps)
    writer = FieldWriter(out, solve.problem, solve.stretch, solve.walls) if fields else None
    say(
        f"solve: {facts['cells']} cells, {solve.problem.dofs} dofs (P2/P1), {comm.size}"
        f" rank{'s' * (comm.size > 1)}, {goal.plan()}; set up in {time.perf_counter() - started:.1f} s"
    )
    breaks_at = break_stretch(design.manipulator)
    last, history, before, extras = [], [], None, {}
    if kept:
        solve.begin(str(kept["stage"]))
        before = solve.last_step = checkpoint.restore(kept, solve.path)
        history, watched = _written(
            comm, out, lambda: (files.keep(before.number), files.history(), files.watched())[1:]
        )
        for state in watched:
            solve.watch.see(*state)
        last[:] = [solve.measure(before)]
        if goal.is_last(solve.stage) and before.load > goal.end(solve.stage, target) * (1 + 1e-12):
            raise InputError(
                f"{out / checkpoint.NAME}: has passed {goal.key} = {goal.value:g} already: solve without"
                " --resume"
            )
        say(f"resumed after step {before.number} at {goal.where(solve.stage, before.load)}")
        if writer:
            _written(
                comm,
                out,
                lambda: writer.keep(
                    [(row["step"], goal.time(row["step"], row["pressure_kPa"])) for row in history]
                ),
            )

    def record(status, failures=()):
        if comm.rank == 0:
            write_record(
                out,
                status=status,
                pressure_reached_kPa=last[0].pressure * KPA,
                **goal.table,
                loads=identity["loads"],
                limit_points=[limit_table(p) for p in last[0].limit_points],
                **last[0].touch.table(),
                **extras,
                body=identity["body"],
                mesh=facts,
                cells=facts["cells"],
                dofs=solve.problem.dofs,
                ranks=comm.size,
                mesh_size_mm=facts["mesh_size_mm"],
                wall_seconds=time.perf_counter() - started + (before.seconds if before else 0.0),
                resumed_after_step=before.number if before else None,
                largest_stretch=last[0].largest_stretch,
                stretch_at_break=breaks_at if np.isfinite(breaks_at) else None,
                timings=solve.path.newton.timings,
                newton=vars(solve.path.newton.options),
                versions=versions(),
                failed_attempts=[[goal.where(solve.stage, load), why] for load, why in failures],
                stability_factorisations=sum(row["stability_factorisations"] for row in history),
                steps=history,
            )

    def keep(m):
        try:
            write(m)
        except OSError as error:
            raise _unwritable(out, error) from None

    def write(m):
        news = [limit_text(p) for p in (m.limit_points[len(last[0].limit_points) :] if last else ())]
        news += m.touch.news(last[0].touch if last else Touch())
        last[:] = [m]
        if writer:
            writer.write(m.step, goal.time(m.step, m.pressure * KPA), m.touch.marks)
        on_rank_0(
            comm,
            lambda: (
                (files.add(m), history.append(files.history()[-1]), record("running, or ended by force"))
                and None
            ),
        )
        if m.step:  # last: what a checkpoint refers to is on disk
            checkpoint.save(out, solve.path, solve.last_step, solve.stage, identity)
            if comm.rank == 0:
                start = solve.rest_volume if solve.stage == "volume" else 0.0
                say(
                    goal.progress(
                        m,
                        solve.stage,
                        (solve.path.parameter - start) / (goal.end(solve.stage, target) - start),
                        breaks_at,
                    )
                )
        for text in news:
            say(text)
        on_measured(m)

    complete = (
        before and goal.is_last(solve.stage) and before.load >= (1 - 1e-12) * goal.end(solve.stage, target)
    )
    if complete:
        extras |= on_rank_0(comm, lambda: _extras_there(out))
    missing = [name for name, wanted in asdict(design.measure).items() if wanted and name not in extras]
    if complete and not missing:
        say(f"complete: the run in {out} has reached {goal.key} = {goal.value:g}; there is nothing to resume")
        solve.destroy()
        return last[0]
    if not before:
        keep(solve.measure())
    status, result, failure = f"reached the {goal.noun} asked for", StepResult(), None
    try:
        if not complete:
            result = solve.run(target, keep, milestones, before=before, control=goal.control)
    except KeyboardInterrupt:
        record("interrupted")
        say(
            f"interrupted at {goal.where(solve.stage, solve.path.parameter)}; the result up to there is in"
            f" {out}"
        )
        raise
    except ConvergenceError as error:
        failure, result = error, error.result
        status = (
            f"stopped at {goal.where(solve.stage, solve.path.parameter)} of {goal.key} = {goal.value:g}:"
            f" {result.reason}"
        )
    if "tip_stiffness" in missing and not failure:
        extras["tip_stiffness"] = tip.stiffness(solve)
    _written(comm, out, lambda: record(status, result.failures))
    solve.destroy()
    if failure:
        raise ConvergenceError(goal.failure(last[0], solve.stage, solve.path.parameter, result, out))
    if "blocked_force" in missing:
        say("blocked force: the same body with its tip held")
        extras["blocked_force"] = tip.blocked_force(
            design.manipulator, mesh_path, last[0].pressure, loads, comm, penalty
        )
        _written(comm, out, lambda: record(status, result.failures))
    ending = goal.done(last[0], solve.stage, solve.path.parameter)
    say("; ".join([ending, *map(limit_text, last[0].limit_points), f"results in {out}"]))
    return last[0]


def versions():
    """Versions of what computed the result."""
    import petsc4py

    return {
        "dolfinx": compat.VERSION,
        "petsc4py": petsc4py.__version__,
        "mpi": MPI.Get_library_version().split(",")[0],
        "numpy": np.__version__,
    }


def break_stretch(manipulator):
    """Smallest stretch at which one of the manipulator's materials breaks; inf when none says."""
    return min(material.break_stretch for material in manipulator.materials)


def _unwritable(out, error):
    return InputError(
        f"{out}: cannot be written to ({error.strerror or error}): make room there and go on with pneunet"
        " solve --resume"
    )


def _written(comm, out, work):
    """on_rank_0 for work that writes in `out`."""
    try:
        return on_rank_0(comm, work)
    except OSError as error:
        raise _unwritable(out, error) from None


def _extras_there(out):
    """What [measure] asked an earlier run for and got."""
    record = json.loads((out / "run.json").read_text()) if (out / "run.json").exists() else {}
    return {name: record[name] for name in asdict(Extras()) if name in record}


def _prepare(design, directory, mesh_size, identity, resume, say):
    """(facts of the mesh, checkpoint to go on from or None); rank 0."""
    out = output_directory(directory / "solve")
    for old in out.glob(".*-????????.*"):
        old.unlink()  # half a file of a killed run
    kept = checkpoint.read(out, identity) if resume else None
    if resume and not kept:
        say(f"no {checkpoint.NAME} in {out}: starting from the beginning")
    if not kept:
        for old in [*out.glob("step_*.vtu"), out / "solution.pvd", out / "run.json", out / checkpoint.NAME]:
            old.unlink(missing_ok=True)  # of an earlier run, which may have had more steps
    return _mesh(design, directory, mesh_size, say), kept


def _mesh(design, directory, mesh_size, say):
    from pneunet.geometry.cad.mesh import mesh_manipulator, segment_tables

    facts_path = directory / "mesh" / "mesh.json"
    if facts_path.exists() and (directory / "mesh" / "manipulator.msh").exists():
        facts = json.loads(facts_path.read_text())
        if facts.get("mesh_size_mm") == mesh_size and facts.get("segments") == segment_tables(
            design.manipulator
        ):
            return facts
    return mesh_manipulator(design.manipulator, mesh_size, directory / "mesh", say)
