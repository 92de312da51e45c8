"""Start a command on several MPI ranks: `pneunet run -n N ...`.

Open MPI refuses to run as root and to run more ranks than it counts cores, and its versions 4 and 5
read different variables to be told otherwise. Here they are all told, whichever is installed.
"""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pneunet.base.system.doorman import end_with_parent
from pneunet.base.system.log import RANK_VARIABLES
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


def environment() -> dict[str, str]:
    """The environment for mpirun: ours, the settings above, this Python's programs first on PATH."""
    # started by an mpirun ourselves, its marks would confuse the new one
    env = SETTINGS | (environment_without_launcher() if "PMIX_RANK" in os.environ else dict(os.environ))
    env["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), env.get("PATH", os.defpath)])
    return env


def command_line(ranks: int, command: list[str]) -> list[str]:
    """The mpirun line. A command that starts with "--" is any program, else a sub-command of pneunet."""
    if ranks < 1:
        raise ValueError(f"the number of ranks must be at least 1, not {ranks}")
    program = (
        command[1:] if command[:1] == ["--"] else [str(Path(sys.executable).with_name("pneunet")), *command]
    )
    if not program or not command:
        raise ValueError(
            "no command to run: pneunet run -n 2 solve DESIGN.toml, or pneunet run -n 2 -- PROGRAM ..."
        )
    return ["mpirun", "-n", str(ranks), *program]


def run(ranks: int, command: list[str]) -> int:
    """Run `command` on `ranks` ranks, with our standard streams; returns its exit code."""
    try:
        line = command_line(ranks, command)
    except ValueError as error:
        print(f"pneunet run: {error}", file=sys.stderr)
        return 2
    env = environment()
    for needed in ("mpirun", line[3]):
        if shutil.which(needed, path=env["PATH"]) is None:
            print(f"pneunet run: {needed} not found (make setup; pneunet doctor tells more)", file=sys.stderr)
            return 127
    # killed ourselves, even by SIGKILL, we leave no ranks behind that would write into the next run's results
    with subprocess.Popen(
        line, env=env, preexec_fn=end_with_parent if os.name == "posix" else None
    ) as process:
        # Told to end, we tell mpirun, so that no rank is left behind.
        previous = signal.signal(signal.SIGTERM, lambda *_: process.terminate())
        try:
            code = process.wait()
        except KeyboardInterrupt:  # mpirun got it too, from the terminal
            code = process.wait() or 130
        finally:
            signal.signal(signal.SIGTERM, previous)
    code = code if code >= 0 else 128 - code
    if 128 < code < 160:  # said here, since mpirun is told to be quiet
        why = " (out of memory?)" if code == 137 else ""
        resume = (
            "; the same command with --resume goes on from the last accepted step"
            if "solve" in command
            else ""
        )
        print(f"pneunet run: a rank was stopped by signal {code - 128}{why}{resume}", file=sys.stderr)
    return code


@contextmanager
def rank_map() -> Iterator[Callable | None]:
    """A `map` that spreads its calls over the MPI ranks when a launcher has started us, Python's own
    otherwise.

    On ranks other than 0 it is None: they have done the work by the time the block is entered. Rank 0 hands
    out and computes nothing itself.
    """
    if not any(name in os.environ for name in RANK_VARIABLES):
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
