"""The doorman of a child process: run as a script it sets the limits on itself and becomes the command.

(Python's own way, a function between fork and exec, is not safe in a process with MPI's threads.) It knows
the standard library alone, so that a child starts at once. Linux only.
"""

import ctypes
import os
import signal
import sys


def end_with_parent(number: int = signal.SIGTERM) -> None:
    """Have the kernel send this process a signal when the thread that started it ends, even by SIGKILL; other
    systems than Linux cannot."""
    PR_SET_PDEATHSIG = 1
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)


def become(parent: int, memory: int, command: list[str]) -> None:
    """Turn into `command`, which dies with `parent` (process id) and gets `memory` bytes (0: all)."""
    import resource

    end_with_parent(signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit("the process that started this one is gone")
    if memory:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.execvp(command[0], command)


if __name__ == "__main__":
    become(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
