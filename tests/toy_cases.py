"""Cases that end in every way there is, and a program that runs them: `python -m tests.toy_cases DIRECTORY
WHICH [--retry]`."""

import ctypes
import json
import os
import sys
import time
from pathlib import Path

#: what a toy may take; far more than an honest one needs
SECONDS, MEMORY_MB = 8, 400
#: toy -> the status it must get
ENDINGS = {
    "square": "done",
    "ends_short": "stopped",
    "refuses": "refused",
    "raises": "error",
    "aborts": "crashed",
    "reads_nowhere": "crashed",
    "hangs": "out of time",
    "eats": "out of memory",
}


def square(inputs, directory):
    (directory / "note.txt").write_text("of this case")
    return inputs["x"] ** 2


def ends_short(inputs, directory):
    from pneunet.base.errors import ConvergenceError

    raise ConvergenceError("stopped at 3 kPa")


def refuses(inputs, directory):
    from pneunet.base.errors import InputError

    raise InputError("x must be even")


def raises(inputs, directory):
    raise ZeroDivisionError("by x")


def aborts(inputs, directory):
    os.abort()


def reads_nowhere(inputs, directory):
    ctypes.string_at(0)


def hangs(inputs, directory):
    """A child of the child hangs too; its number is left in the file `inputs` name."""
    import subprocess

    child = subprocess.Popen(["sleep", "600"])
    Path(inputs["grandchild"]).write_text(str(child.pid))
    child.wait()


def eats(inputs, directory):
    eaten = []
    while True:
        eaten.append(bytearray(1 << 20))


def naps(inputs, directory):
    """Slow, and tells in a file how often it was begun."""
    with open(inputs["journal"], "a") as journal:
        journal.write(f"{inputs['x']}\n")
    time.sleep(0.4)


def initialises_mpi(inputs, directory):
    from mpi4py import MPI

    return MPI.COMM_WORLD.size


def main(directory, which, *options):
    from mpi4py import MPI

    from pneunet.base.system.interrupts import Interrupted, leave
    from pneunet.base.system.log import show_on_screen
    from pneunet.base.system.processes import Limits
    from pneunet.hifi.runs.cases import Case, run_cases

    files = {"journal": f"{directory}.journal", "grandchild": f"{directory}.grandchild"}
    cases = {
        "endings": [
            Case(f"tests.toy_cases:{name}", {"x": 3, **files})
            for name in [*ENDINGS, "initialises_mpi", "square"]
        ],
        "naps": [Case("tests.toy_cases:naps", {"x": x, **files}) for x in range(8)],
        "failures": [
            Case(f"tests.toy_cases:{name}", {}) for name in ("ends_short", "refuses", "raises", "aborts")
        ],
        "none": [],
    }[which]
    show_on_screen()
    try:
        records = run_cases(cases, directory, Limits(SECONDS, MEMORY_MB), retry="--retry" in options)
    except Interrupted as error:
        sys.exit(leave(error))
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(records))


if __name__ == "__main__":
    main(*sys.argv[1:])
