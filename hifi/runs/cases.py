"""Many independent cases on MPI ranks, each in a process of its own: studies and campaigns run on this,
whatever a case is.

A case is a function by its import name and its inputs as JSON. It runs alone in a child process with a time
and a memory limit, in a folder that is named by function and inputs and gets its name when the case is
complete, with record.json in it: so a case that is on disk is finished, and a run that was killed at any
moment goes on where it was. A case that raises, crashes, hangs or eats memory is recorded like any other and
stops nothing. Ranks get cases from mpi4py.futures; its manager takes rank 0.
"""

import hashlib
import json
import logging
import os
import shutil
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from mpi4py import MPI

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import temporary_beside, write_text
from pneunet.base.files.reading import read_json
from pneunet.base.files.record import revision
from pneunet.base.files.toml import as_table, from_table
from pneunet.base.system.interrupts import Interrupted, deferred, is_interrupted
from pneunet.base.system.processes import Limits, environment_without_launcher, machine_memory_MB, run_limited
from pneunet.base.system.progress import eta
from pneunet.hifi.fem.agreement import folder_of_all, on_rank_0
from pneunet.hifi.runs.case_process import DONE, ERROR, MEMORY, REFUSED, STOPPED

log = logging.getLogger(__name__)

OUT_OF_TIME, CRASHED = "out of time", "crashed"
#: ways to end that are the case's own answer: doing it again would give the same
ANSWERS = (DONE, STOPPED, REFUSED)
STATUSES = (*ANSWERS, ERROR, CRASHED, OUT_OF_TIME, MEMORY)
RECORD = "record.json"
#: of the machine's memory, shared by the workers on it when no limit is given
MEMORY_SHARE = 0.9


def case_limits(tables: dict, where: str) -> Limits:
    """The Limits of one case in the [limits] of a file's tables: an hour unless it says otherwise."""
    where = f"{where} [limits]"
    return from_table(Limits, {"time_s": 3600.0} | as_table(tables.get("limits", {}), where), where)


@dataclass(frozen=True)
class Case:
    """`function` (a name in case_process.FUNCTIONS) will be called as function(inputs, directory) and returns
    what JSON can hold, or None.

    It raises ConvergenceError where its path ends, InputError on inputs it refuses. label: what progress
    calls it.
    """

    function: str
    inputs: dict[str, Any]
    label: str = ""

    @cached_property
    def name(self) -> str:
        """The folder's name: changed inputs are another case."""
        text = json.dumps([self.function, self.inputs], sort_keys=True, default=float)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def run_cases(
    cases: Sequence[Case],
    directory: str | Path,
    limits: Limits | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
    on_record: Callable[[Case, dict], object] = lambda case, record: None,
    retry: bool = False,
) -> list[dict[str, Any]]:
    """Run what is not finished of `cases` in directory/NAME; collective. Returns the records, in order, on
    rank 0, else [].

    A record: {"function", "inputs", "status", "reason", "result", "seconds", "peak_memory_MB", ...}, status
    one of "done", "stopped" (ConvergenceError), "refused" (InputError), "error", "crashed", "out of time",
    "out of memory". limits: of one case; without a memory limit the workers share their machine's memory.
    on_record(case, record) is called on rank 0 as each comes to be known, those on disk first. retry: cases
    that did not end by themselves are computed again. With more than one rank, rank 0 hands out and computes
    nothing. InputError, on all ranks, when the folder is not to be had.
    """
    directory = Path(directory)
    limits = _with_memory(limits or Limits(), comm)
    records, failure = {}, None
    with deferred(), folder_of_all(comm, directory):
        todo = on_rank_0(comm, lambda: _unfinished(cases, directory, retry, records, on_record))
        work = partial(
            run_case,
            directory=directory,
            limits=limits,
            version=comm.bcast(revision() if comm.rank == 0 else None),
        )
        progress = _Progress(len(todo))

        def take(finished):
            for case, record in finished:
                if record:
                    records[case.name] = record
                    progress.tell(case, record)
                    on_record(case, record)
                if not record or is_interrupted():
                    there = f"{len(records)} of {len({case.name for case in cases})} cases are finished"
                    raise Interrupted(f"interrupted: {there} in {directory}; the same command goes on")

        try:
            _distribute(work, todo, comm, take)
        except (Exception, Interrupted) as error:
            failure = error
        failure = comm.bcast(failure, root=0)
    if failure is not None:
        raise failure
    return [records[case.name] for case in cases] if comm.rank == 0 else []


def _distribute(work, todo, comm, take):
    """take((case, record), ...) on rank 0, as they are finished."""
    if comm.size == 1:
        take(map(work, todo))
        return
    from mpi4py.futures import MPICommExecutor

    with MPICommExecutor(comm, root=0) as executor:
        if executor is not None:
            try:
                take(executor.map(work, todo, unordered=True))
            except BaseException:
                executor.shutdown(wait=False, cancel_futures=True)
                raise


def run_case(
    case: Case, directory: Path, limits: Limits, version: str = "unknown"
) -> tuple[Case, dict[str, Any] | None]:
    """(case, record) of one case, run in a child process; directory/NAME is there, complete, when it returns;
    without a record when it was interrupted."""
    started, folder = time.time(), temporary_beside(directory / case.name)
    try:
        folder.mkdir()
        record = _run_in(folder, case, limits)
        record |= {
            "limits": asdict(limits),
            "host": socket.gethostname(),
            "revision": version,
            "started_unix_s": started,
        }
        write_text(folder / RECORD, json.dumps(record, indent=1) + "\n")
        # of a run that did not end by itself, or left no record
        shutil.rmtree(directory / case.name, ignore_errors=True)
        os.rename(folder, directory / case.name)
    except Interrupted:
        shutil.rmtree(folder, ignore_errors=True)
        return case, None
    except OSError as error:  # nothing is on disk: the next run computes it again
        reason = f"could not be started or recorded ({error})"
        record = _record(
            case, {"status": CRASHED, "reason": reason, "result": None}, time.time() - started, None
        )
    return case, record


def _record(case, answer, seconds, memory):
    return {
        "function": case.function,
        "inputs": case.inputs,
        **answer,
        "seconds": seconds,
        "peak_memory_MB": memory,
    }


def _run_in(folder, case, limits):
    """The record of a case whose child works in `folder`."""
    write_text(
        folder / "case.json", json.dumps({"function": case.function, "inputs": case.inputs}, default=float)
    )
    environment = {"OMP_NUM_THREADS": "1"} | environment_without_launcher()
    program = "pneunet.hifi.runs.case_process"
    command = [sys.executable, "-P", "-X", "faulthandler", "-m", program, str(folder.resolve())]
    ended = run_limited(command, limits, folder / "log.txt", environment, folder)
    try:
        answer = json.loads((folder / "answer.json").read_text())
    except FileNotFoundError:
        answer = {
            **_how_it_failed(ended, limits, (folder / "log.txt").read_text(errors="replace")),
            "result": None,
        }
    for name in ("case.json", "answer.json"):
        (folder / name).unlink(missing_ok=True)
    answer["reason"] = answer["reason"].replace(str(folder.resolve()), str(folder.with_name(case.name)))
    return _record(case, answer, ended.seconds, ended.peak_memory_MB)


def _how_it_failed(ended, limits, log):
    """{"status", "reason"} of a child that left no answer."""
    if ended.out_of_time:
        return {"status": OUT_OF_TIME, "reason": f"not finished after {limits.seconds:g} s"}
    if any(sign in log for sign in ("MemoryError", "bad_alloc", "Out of memory")):
        return {"status": MEMORY, "reason": f"needs more than {limits.memory_MB:.0f} MB"}
    how = f"signal {signal.Signals(-ended.code).name}" if ended.code < 0 else f"exit code {ended.code}"
    if ended.code == -signal.SIGKILL:
        how += " (the machine is out of memory?)"
    said = [line.strip() for line in log.splitlines() if line.strip()]
    telling = [line for line in said if "error" in line.lower() and "---" not in line] + said[-1:]
    return {"status": CRASHED, "reason": f"ended by {how}" + (f": {telling[0][:200]}" if telling else "")}


def finished(case: Case, directory: str | Path) -> dict[str, Any] | None:
    """The record of a case that is on disk in directory/NAME, None when it is not finished."""
    try:
        record = read_json(Path(directory) / case.name / RECORD)
    except InputError:
        return None
    whole = record.get("status") in STATUSES and {"reason", "result", "seconds", "revision"} <= set(record)
    return record if whole else None


def _unfinished(cases, directory, retry, records, on_record):
    """The cases to compute, each once; those on disk go to `records`."""
    distinct = {case.name: case for case in cases}
    for name, case in distinct.items():
        record = finished(case, directory)
        if record and (record["status"] in ANSWERS or not retry):
            records[name] = record
            on_record(case, record)
    if records:
        failed = sum(record["status"] not in ANSWERS for record in records.values())
        again = f", {failed} of them failed (--retry computes those again)" if failed else ""
        log.info(f"{len(records)} of {len(distinct)} cases are finished in {directory}{again}")
        others = {record["revision"] for record in records.values()} - {revision()}
        if others:
            log.info(f"note: some were computed by another version of the code ({', '.join(sorted(others))})")
    return [case for name, case in distinct.items() if name not in records]


def _with_memory(limits, comm):
    """Limits with a memory limit: without one, the workers of a machine share it."""
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    idle = machine.allreduce(comm.rank == 0 and comm.size > 1, op=MPI.SUM)
    share = comm.allreduce(MEMORY_SHARE * machine_memory_MB() / max(machine.size - idle, 1), op=MPI.MIN)
    machine.Free()
    return limits if limits.memory_MB else replace(limits, memory_MB=share)


class _Progress:
    """One line a case, with the time that is left at the pace so far."""

    def __init__(self, total):
        self.total, self.done, self.started = total, 0, time.monotonic()

    def tell(self, case, record):
        self.done += 1
        left = eta(time.monotonic() - self.started, self.done / self.total)
        memory = f", {record['peak_memory_MB']:.0f} MB" if record["peak_memory_MB"] else ""
        reason = f": {record['reason']}" if record["reason"] else ""
        log.info(
            f"{self.done:{len(str(self.total))}d}/{self.total}  {case.label or case.name}: {record['status']}"
            f" in {record['seconds']:.1f} s{memory}{reason}; {left}"
        )
