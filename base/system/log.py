"""What a run says while it works: Python's logging under the name `pneunet`, one message a line.

Modules say `log = logging.getLogger(__name__)` and `log.info(...)`; nothing is shown until a program asks for
it, as the command line does. Under MPI rank 0 speaks for all.
"""

import logging
import os
import sys
import time

#: what MPI launchers tell a process of its rank
RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK")


def is_rank_0() -> bool:
    """Whether this process is rank 0 of what an MPI launcher started, or was started by none."""
    return all(os.environ.get(name, "0") == "0" for name in RANK_VARIABLES)


#: characters of one message on the screen; of longer ones the end is kept too, where the fix stands
MOST, KEPT_AT_END = 1000, 300


def printable(text: object) -> str:
    """A message as one line that a terminal can be given, whatever names and files are told in it: control
    characters are spelled out, too long a text is cut."""
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(text))
    return line if len(line) <= MOST else f"{line[: MOST - KEPT_AT_END]} ... {line[-KEPT_AT_END:]}"


def complain(text: object) -> None:
    """Say on standard error why the program ends; from rank 0 alone.

    The others leave later: mpirun ends a job, and with it what rank 0 still has to say, at the first failure.
    """
    if is_rank_0():
        print(f"pneunet: {printable(text)}", file=sys.stderr, flush=True)
    else:
        time.sleep(1.0)


def under_launcher() -> bool:
    """Whether an MPI launcher has started this process.

    The children of a process that uses MPI without one inherit its marks, and Open MPI's that it is alone.
    """
    alone = os.environ.get("OMPI_MCA_ess") == "singleton"
    return not alone and any(name in os.environ for name in RANK_VARIABLES)


class _Screen(logging.Handler):
    """Messages as plain lines on standard output, whatever that is at the time."""

    def emit(self, record: logging.LogRecord) -> None:
        # a closed pipe is the caller's to hear of
        print(printable(self.format(record)), file=sys.stdout, flush=True)


def show_on_screen() -> None:
    """Print what pneunet says, from level INFO on, on rank 0's standard output."""
    logger = logging.getLogger("pneunet")
    logger.setLevel(logging.INFO if is_rank_0() else logging.CRITICAL)
    logger.propagate = False  # ffcx gives the root logger a handler of its own, on standard error
    if not any(isinstance(handler, _Screen) for handler in logger.handlers):
        logger.addHandler(_Screen())
