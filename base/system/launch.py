"""Start a command on several MPI ranks: `pneunet run -n N ...`.

Open MPI refuses to run as root and to run more ranks than it counts cores, and its versions 4 and 5
read different variables to be told otherwise. Here they are all told, whichever is installed.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pneunet.base.errors import InputError
from pneunet.base.quantities import listed
from pneunet.base.system.doorman import end_with_parent
from pneunet.base.system.interrupts import EXIT_CODE, HANDED_ON, Handler, handled
from pneunet.base.system.log import complain, under_launcher
from pneunet.base.system.processes import environment_without_launcher

# Variables of Open MPI 4 (OMPI_...) and 5 (PRTE_... for its launcher). A value the user has set wins.
SETTINGS = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "PRTE_ALLOW_RUN_AS_ROOT": "1",
    "PRTE_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # more ranks than cores
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":OVERSUBSCRIBE",
    # no pinning to cores: two runs at once, or a container's cpuset, would share the same few
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    # containers may forbid to read another process's memory; version 5 finds that out by itself
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    # one machine: shared memory is enough, and a container may have no network
    "OMPI_MCA_btl": "^tcp",
    # a command that ends with an error has said why itself; no page about it from mpirun (5 cannot be told)
    "OMPI_MCA_orte_execute_quiet": "1",
    # a rank that waits gives its core to the one it waits for
    "OMPI_MCA_mpi_yield_when_idle": "1",
    # one thread a rank, and no remarks on the machine's topology
    "OMP_NUM_THREADS": "1",
    "HWLOC_HIDE_ERRORS": "2",
}
#: more than this is a slip of the pen, which would bring the machine down
RANKS_PER_CORE = 64
HEARING_SECONDS = 0.3
#: sub-commands whose ranks share the work; of others they would all do the same
PARALLEL = ("design", "solve", "study", "campaign", "train", "workspace")


def environment() -> dict[str, str]:
    """The environment for mpirun: ours, the settings above, this Python's programs first on PATH."""
    # started by an mpirun ourselves, its marks would confuse the new one
    env = SETTINGS | (environment_without_launcher() if "PMIX_RANK" in os.environ else dict(os.environ))
    env["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), env.get("PATH", os.defpath)])
    return env


def command_line(ranks: int, command: list[str]) -> list[str]:
    """The mpirun line. A command that starts with "--" is any program, else a sub-command of pneunet.

    InputError where it makes no sense.
    """
    most = RANKS_PER_CORE * (os.cpu_count() or 1)
    if not 1 <= ranks <= most:
        raise InputError(f"run: -n {ranks}: the number of ranks must be at least 1, and at most {most} here")
    program = (
        command[1:] if command[:1] == ["--"] else [str(Path(sys.executable).with_name("pneunet")), *command]
    )
    if not program or not command:
        raise InputError(
            "run: no command given: pneunet run -n 2 solve DESIGN.toml, or pneunet run -n 2 -- PROGRAM ..."
        )
    if ranks > 1 and command[0] not in ("--", *PARALLEL):
        raise InputError(
            f"run: {command[0]} works on one rank: leave out run -n {ranks}, which is for {listed(PARALLEL)},"
            " or after -- for any program"
        )
    return ["mpirun", "-n", str(ranks), *program]


def run(ranks: int, command: list[str]) -> int:
    """Run `command` on `ranks` ranks, with our standard streams; returns its exit code.

    Interrupted, we hand that on to the ranks, which end in order; a second signal ends them at once.
    """
    line = command_line(ranks, command)
    env = environment()
    for needed in ("mpirun", line[3]):
        if shutil.which(needed, path=env["PATH"]) is None:
            raise InputError(f"run: {needed} not found (make setup; pneunet doctor tells more)")
    # killed ourselves, even by SIGKILL, we leave no ranks behind that would write into the next run's
    # results; a group of its own, since mpirun, told by the terminal too, gives its ranks no time
    with subprocess.Popen(line, env=env, preexec_fn=end_with_parent, process_group=0) as process:
        told = Handler(process.terminate)
        with handled(told):
            while (code := _wait(process)) is None:
                if told.first:  # again and again: mpirun hears nothing while it starts
                    process.send_signal(HANDED_ON)
    code = code if code >= 0 else 128 - code
    if told.first and code:
        if code != EXIT_CODE:  # the ranks have not said so themselves
            complain("interrupted")
        return EXIT_CODE
    if 128 < code < 160:  # said here, since mpirun is told to be quiet
        why = " (out of memory?)" if code == 137 else ""
        resume = (
            "; the same command with --resume goes on from the last accepted step"
            if "solve" in command
            else ""
        )
        complain(f"run: a rank was stopped by signal {code - 128}{why}{resume}")
    return code


def _wait(process):
    """The exit code, None when it is still at work after a moment."""
    try:
        return process.wait(HEARING_SECONDS)
    except subprocess.TimeoutExpired:
        return None


@contextmanager
def rank_map() -> Iterator[Callable | None]:
    """A `map` that spreads its calls over the MPI ranks when a launcher has started us, Python's own
    otherwise.

    On ranks other than 0 it is None: they have done the work by the time the block is entered. Rank 0 hands
    out and computes nothing itself.
    """
    if not under_launcher():
        yield map
        return
    from mpi4py import MPI
    from mpi4py.futures import MPICommExecutor

    if MPI.COMM_WORLD.size == 1:
        yield map
        return
    executor: Any
    with MPICommExecutor(MPI.COMM_WORLD, root=0) as executor:
        yield executor.map if executor else None
