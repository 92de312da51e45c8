"""What ranks tell each other: errors of one, before anybody waits in a collective call; rows of arrays."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from mpi4py import MPI

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


def gathered(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray | None:
    """The rows (n, ...) of all ranks, one rank's after the other's, on rank 0; None elsewhere."""
    parts = comm.gather(rows, root=0)
    return np.concatenate(parts) if comm.rank == 0 else None
