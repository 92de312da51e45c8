"""What ranks tell each other: errors of one, before anybody waits in a collective call; rows of arrays."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from pneunet.base.files.folder import output_folder
from pneunet.base.system.interrupts import Interrupted, is_interrupted

Result = TypeVar("Result")


def on_rank_0(comm: MPI.Comm, work: Callable[[], Result]) -> Result:
    """Run `work` on rank 0; its result, or its error, on all ranks."""
    result, error = None, None
    if comm.rank == 0:
        try:
            result = work()
        except Exception as problem:
            error = problem
    result, error = comm.bcast((result, error), root=0)
    if error is not None:
        raise error
    return result


@contextmanager
def folder_of_all(comm: MPI.Comm, path: str | Path) -> Iterator[None]:
    """`output_folder`, which rank 0 holds for all; its error on all ranks."""
    with ExitStack() as held:
        on_rank_0(comm, lambda: held.enter_context(output_folder(path)) and None)
        yield


def agreed_interrupt(comm: MPI.Comm) -> None:
    """Interrupted on all ranks where one of them has been asked to end; collective."""
    if comm.allreduce(is_interrupted(), op=MPI.LOR):
        raise Interrupted


def gathered(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray | None:
    """The rows (n, ...) of all ranks, one rank's after the other's, on rank 0; None elsewhere."""
    parts = comm.gather(rows, root=0)
    return np.concatenate(parts) if comm.rank == 0 else None
