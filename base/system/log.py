"""What a run says while it works: Python's logging under the name `pneunet`, one message a line.

Modules say `log = logging.getLogger(__name__)` and `log.info(...)`; nothing is shown until a program asks for
it, as the command line does. Under MPI rank 0 speaks for all.
"""

import logging
import os
import sys

#: what MPI launchers tell a process of its rank
RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK")


def is_rank_0() -> bool:
    """Whether this process is rank 0 of what an MPI launcher started, or was started by none."""
    return all(os.environ.get(name, "0") == "0" for name in RANK_VARIABLES)


class _Screen(logging.Handler):
    """Messages as plain lines on standard output, whatever that is at the time."""

    def emit(self, record: logging.LogRecord) -> None:
        print(self.format(record), file=sys.stdout, flush=True)  # a closed pipe is the caller's to hear of


def show_on_screen() -> None:
    """Print what pneunet says, from level INFO on, on rank 0's standard output."""
    logger = logging.getLogger("pneunet")
    logger.setLevel(logging.INFO if is_rank_0() else logging.CRITICAL)
    logger.propagate = False  # ffcx gives the root logger a handler of its own, on standard error
    if not any(isinstance(handler, _Screen) for handler in logger.handlers):
        logger.addHandler(_Screen())
