"""Caches of compiled forms of which each serves one process at a time, so that cases side by side do not
compile into the same.

A process that is killed while it compiles leaves half a module, for which every later one would wait in vain;
here nobody else can be at it, and what is unfinished is removed.
"""

import fcntl
import itertools
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def own_cache() -> Iterator[Path]:
    """A folder for XDG_CACHE_HOME, the first of $XDG_CACHE_HOME/pneunet/HOST-0, HOST-1, ... that nobody uses;
    ours within the block.

    Forms compiled there by earlier cases are found again. The lock falls with this process, however it ends.
    """
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pneunet"
    for number in itertools.count():
        # modules are compiled for this machine's processor
        folder = root / f"{socket.gethostname()}-{number}"
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder / "lock", "w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            remove_unfinished(folder)
            yield folder
            return


def remove_unfinished(folder: Path) -> None:
    """Remove the modules that ffcx began (NAME.c) and did not finish (NAME.c.cached)."""
    for source in (folder / "fenics").glob("libffcx_*.c"):
        if not source.with_suffix(".c.cached").exists():
            source.unlink()
