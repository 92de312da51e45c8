"""The folder of compiled forms, which all runs of a user on a machine share and one at a time writes to.

A process that is stopped while it compiles leaves half a module, for which every later one would wait in
vain. Nobody is at it while we hold the lock, so what is unfinished then is removed. The lock falls with its
process, however that ends.
"""

import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mpi4py import MPI

from pneunet.base.errors import InputError
from pneunet.hifi.fem.agreement import on_rank_0


def form_cache() -> Path:
    """The folder, $XDG_CACHE_HOME/pneunet/HOST: modules are compiled for this machine's processor."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pneunet" / socket.gethostname()


@contextmanager
def locked_form_cache(comm: MPI.Comm) -> Iterator[None]:
    """The folder, made if need be and free of half modules, is `comm`'s alone within the block; collective.

    InputError on all ranks when it cannot be written to.
    """
    folder, held = form_cache(), []

    def lock():
        folder.mkdir(parents=True, exist_ok=True)
        held.append(os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666))
        fcntl.flock(held[0], fcntl.LOCK_EX)
        for source in folder.glob("libffcx_*.c"):  # beside it, when it is whole, NAME.c.cached
            if not source.with_suffix(".c.cached").exists():
                source.unlink()

    try:
        on_rank_0(comm, lock)
        yield
    except OSError as error:
        why = error.strerror or error
        raise InputError(
            f"{folder}: compiled forms cannot be kept there ({why}): set XDG_CACHE_HOME to a folder that can"
            " be written to"
        ) from None
    finally:
        for descriptor in held:
            os.close(descriptor)
