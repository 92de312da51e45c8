"""The folder of compiled forms, which all runs of a user on a machine share. Each module in it is made by one
process at a time: who wants the same one waits for it, who wants another does not.

A process that is stopped while it compiles leaves half a module, for which every later one would wait in
vain. Nobody is at it while we hold its lock, so what is unfinished then is removed. The lock is a byte of the
file `lock` and falls with its process, however that ends.
"""

import fcntl
import hashlib
import os
import socket
from pathlib import Path

from mpi4py import MPI

from pneunet.base.errors import InputError
from pneunet.hifi.fem.agreement import on_rank_0


def form_cache() -> Path:
    """The folder, $XDG_CACHE_HOME/pneunet/HOST: modules are compiled for this machine's processor."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pneunet" / socket.gethostname()


def make_form_cache(comm: MPI.Comm) -> None:
    """Make the folder if need be; collective. InputError on all ranks when it cannot be written to."""
    folder = form_cache()

    def make():
        folder.mkdir(parents=True, exist_ok=True)
        os.close(_open_locks())

    try:
        on_rank_0(comm, make)
    except OSError as error:
        why = error.strerror or error
        raise InputError(
            f"{folder}: compiled forms cannot be kept there ({why}): set XDG_CACHE_HOME to a folder that can"
            " be written to"
        ) from None


def lock_module(name: str) -> int:
    """Wait for the module's lock and remove the module if it is half; os.close(what this returns) unlocks."""
    locks = _open_locks()
    fcntl.lockf(locks, fcntl.LOCK_EX, 1, int.from_bytes(hashlib.sha256(name.encode()).digest()[:7], "big"))
    both = [form_cache() / f"{name}.c{whole}" for whole in ("", ".cached")]  # when it is whole
    if not all(file.exists() for file in both):
        for file in both:
            file.unlink(missing_ok=True)
    return locks


def _open_locks():
    return os.open(form_cache() / "lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
