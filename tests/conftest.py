"""Serial and MPI runs alike: release PETSc objects and keep ranks together between tests."""

import gc
import logging
import os
import sys
from pathlib import Path

import pytest

ROOT = str(Path(__file__).resolve().parent.parent)
sys.path.insert(0, ROOT)
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [ROOT, os.environ.get("PYTHONPATH")]))  # toy cases
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(autouse=True)
def release_between_tests(request):
    yield
    if {"hifi", "verification"} & set(request.path.parts):
        from mpi4py import MPI

        gc.collect()
        MPI.COMM_WORLD.barrier()


@pytest.fixture(autouse=True)
def nothing_on_the_screen():
    """Tests share a process: what a command has set up for showing messages ends with its test."""
    logger = logging.getLogger("pneunet")
    logger.handlers.clear()
    logger.setLevel(logging.NOTSET)
    logger.propagate = True


@pytest.fixture
def shared_directory(tmp_path_factory):
    """A temporary folder that all ranks agree on."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    return Path(comm.bcast(str(tmp_path_factory.mktemp("shared")) if comm.rank == 0 else None, root=0))


def pytest_runtest_logreport(report):
    """A test that fails on one rank would leave the others waiting in a collective call: stop them all."""
    if report.failed and os.environ.get("OMPI_COMM_WORLD_SIZE", "1") != "1":
        from mpi4py import MPI

        print(report.longreprtext, file=sys.stderr, flush=True)
        MPI.COMM_WORLD.Abort(1)
