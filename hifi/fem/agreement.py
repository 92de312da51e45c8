"""Errors of one rank, known to all of them before anybody waits in a collective call."""

from collections.abc import Callable
from typing import TypeVar

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
