"""The folder that a command writes to: made if need be, cleared of what killed runs have left, for one run at
a time."""

import errno
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import remove_leftovers

LOCK = ".lock"
#: a run that is just being killed needs a moment
PATIENCE_SECONDS = 5.0
#: what file systems that know no locks say; there a run is not kept from another one's folder
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)

#: folders of this process and which of them, and of those above, it has made
_held: dict[Path, list[Path]] = {}


@contextmanager
def output_folder(path: str | Path) -> Iterator[Path]:
    """The folder, made if need be, for the block alone: the lock falls with this process, however it ends.

    A new folder that is still empty at the end goes again. InputError, before any work is done, when it
    cannot be written to or another run is at work in it.
    """
    path = Path(path)
    try:
        made = [each for each in (path, *path.parents) if not each.exists()]
        path.mkdir(parents=True, exist_ok=True)
        handle = _locked(path / LOCK)
        if handle is not None:
            remove_leftovers(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written to ({error.strerror}): choose another folder with -o"
        ) from None
    if handle is None:
        raise InputError(
            f"{path}: another run is at work in it: wait for that, or choose another folder with -o"
        )
    _held[path] = made
    try:
        yield path
    finally:
        _leave(path, _held.pop(path))
        os.close(handle)


def leave_all() -> None:
    """Leave the folders of this process, and nothing half-written in them, as it ends within a block."""
    for path, made in reversed(_held.items()):
        remove_leftovers(path)
        _leave(path, made)


def _leave(path, made):
    with suppress(OSError):  # Windows keeps what is open
        (path / LOCK).unlink()
    with suppress(OSError):  # a folder stays when something is in it
        for each in made:
            each.rmdir()


def lock(path: Path) -> int | None:
    """Handle of the file `path`, made if need be and locked by this process; None where another holds it.

    No link is followed, and nothing is written.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
    try:
        _take(handle)
    except OSError as error:
        if isinstance(error, BlockingIOError):
            os.close(handle)
            return None
        if error.errno not in NO_LOCKS:
            raise
    return handle


def _take(handle):
    """Lock an open file; BlockingIOError where another process has."""
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            raise BlockingIOError from None
    else:
        try:
            import fcntl
        except ModuleNotFoundError:  # a system without locks: there a run is not kept from another's folder
            return
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _locked(path):
    """`lock`, tried again while another run may be ending."""
    deadline = time.monotonic() + PATIENCE_SECONDS
    while True:
        handle = lock(path)
        if handle is None and time.monotonic() > deadline:
            return None
        if handle is not None and _is(handle, path):
            return handle
        if handle is not None:  # the holder has removed the file meanwhile
            os.close(handle)
        time.sleep(0.1)


def _is(handle, path):
    try:
        return os.path.samestat(os.fstat(handle), os.lstat(path))
    except FileNotFoundError:
        return False
