"""Child processes that a long run can rely on: free of an MPI launcher's marks, gone with their parent,
within limits.

Importable on any system; children are run within limits on Linux alone.
"""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from pneunet.base.quantities import Checked, quantity
from pneunet.base.system.interrupts import Interrupted, is_interrupted

#: variables by which MPI launchers (Open MPI 4 and 5, MPICH, SLURM's PMI) tell a process that it is one of
#: their ranks
LAUNCHER_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "PRTE_")
POLL_SECONDS = 0.02
MB = 1 << 20
#: the script that a child starts as
DOORMAN = Path(__file__).with_name("doorman.py")


@dataclass(frozen=True)
class Limits(Checked):
    """What one child may take: wall time in s, memory (RLIMIT_DATA: heap and private maps of each process) in
    MB; None: all."""

    seconds: float | None = quantity("s", None, key="time_s", above=0, low=1e-3, high=1e9)
    memory_MB: float | None = quantity("MB", None, key="memory_MB", low=10, high=1e8)


@dataclass(frozen=True)
class Ended:
    """How a child ended: exit code (negative: the signal's number), wall seconds, peak resident memory in
    MB."""

    code: int
    seconds: float
    peak_memory_MB: float
    out_of_time: bool


def environment_without_launcher() -> dict[str, str]:
    """This process's environment, in which a child that starts MPI does not take itself for a rank of our
    launcher."""
    return {k: v for k, v in os.environ.items() if not k.startswith(LAUNCHER_PREFIXES)}


def run_limited(
    command: list[str],
    limits: Limits,
    log: str | Path,
    environment: dict[str, str] | None = None,
    directory: str | Path | None = None,
) -> Ended:
    """Run `command` to its end or its limits; returns Ended.

    Standard output and error go to the file `log`. The child leads a process group that is killed with all
    its members when the time is over, when we are interrupted, and when the child ends and leaves some
    behind. It dies with us.
    """
    memory = int((limits.memory_MB or 0) * MB)
    doorman = [sys.executable, "-P", str(DOORMAN), str(os.getpid()), str(memory)]
    started = time.monotonic()
    deadline = started + (limits.seconds or float("inf"))
    out_of_time = False
    with open(log, "wb") as stream:
        child = subprocess.Popen(
            [*doorman, *command],
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
            env=environment,
            cwd=directory,
            start_new_session=True,
        )
    try:
        while not (ended := os.wait4(child.pid, os.WNOHANG))[0]:
            if is_interrupted():
                raise Interrupted
            if not out_of_time and time.monotonic() > deadline:
                out_of_time = True
                _kill_group(child.pid)
            time.sleep(POLL_SECONDS)
        child.returncode = os.waitstatus_to_exitcode(ended[1])
    finally:
        _kill_group(child.pid)
        child.wait()
    return Ended(child.returncode, time.monotonic() - started, ended[2].ru_maxrss / 1024, out_of_time)


def _kill_group(leader: int) -> None:
    try:
        os.killpg(leader, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        pass  # nobody is left


def machine_memory_MB() -> float:
    """Physical memory of this machine in MB; of a container with a limit of its own, that limit (cgroup
    version 2)."""
    total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    except (OSError, ValueError):
        pass  # no such file, or "max"
    return total / MB
