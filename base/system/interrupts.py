"""Ctrl-C and its like: an end in order, with exit code 130, whichever signal asks for it.

A command's signals raise KeyboardInterrupt where they come. Inside a block of `deferred` they wait for
whoever asks `is_interrupted`, between two steps for instance, where the ranks of a run can agree on it.
"""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from pneunet.base.files.folder import leave_all
from pneunet.base.system.log import complain, under_launcher

#: as which a launcher hands them on, again and again: mpirun kills its ranks soon after the others
HANDED_ON = getattr(signal, "SIGUSR1", signal.SIGTERM)
#: Ctrl-C; a batch system's; a launcher's
SIGNALS = {signal.SIGINT, signal.SIGTERM, HANDED_ON}
EXIT_CODE = 130
#: programs like timeout signal a process and its group, which is one signal twice
SAME_SECONDS = 0.5


class Interrupted(KeyboardInterrupt):
    """A run has ended in order, on all ranks alike; says where."""


def leave(error: BaseException) -> int:
    """Say that, or where, the program was interrupted; its exit code. A rank that others may be waiting for
    ends here."""
    agreed = isinstance(error, Interrupted)
    if under_launcher():
        signal.signal(HANDED_ON, signal.SIG_IGN)
    complain(error if agreed else "interrupted")
    if under_launcher() and not agreed:
        os._exit(EXIT_CODE)
    return EXIT_CODE


class Handler:
    """Of signals: keeps the time of the first; the second has `twice` called, unless a launcher repeats the
    first."""

    def __init__(self, twice: Callable[[], object]) -> None:
        self.twice = twice
        self.first: float | None = None

    def __call__(self, number: int, _: object) -> None:
        now = time.monotonic()
        if self.first is None:
            self.first = now
        elif number != HANDED_ON and now > self.first + SAME_SECONDS:
            self.twice()


def is_interrupted() -> bool:
    """Whether a signal has come in the present block of `deferred`."""
    handler = signal.getsignal(signal.SIGINT)
    return isinstance(handler, Handler) and handler.first is not None


@contextmanager
def interruptible() -> Iterator[list[int]]:
    """The signals of the block are KeyboardInterrupts; yields a list of those that have come, since a library
    that is interrupted while it is loaded raises whatever it likes."""
    told: list[int] = []

    def interrupt(number, _):
        told.append(number)
        raise KeyboardInterrupt

    with handled(interrupt):
        yield told


@contextmanager
def handled(handler: Callable) -> Iterator[None]:
    """The signals of the block are the handler's, even where a shell has had them ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the main thread's
        return
    before = {number: signal.signal(number, handler) for number in SIGNALS}
    try:
        yield
    finally:
        for number, its in before.items():
            signal.signal(number, its)


def deferred() -> AbstractContextManager[None]:
    """A block in which the first signal is kept for `is_interrupted`; the second is a KeyboardInterrupt at
    once. A block within a block is one with it."""
    handler = signal.getsignal(signal.SIGINT)
    return handled(handler if isinstance(handler, Handler) else Handler(_interrupt))


def _interrupt():
    raise KeyboardInterrupt


@contextmanager
def kept() -> Iterator[None]:
    """Handlers of signals are after the block what they were before it: gmsh takes Ctrl-C for itself."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            for number, its in before.items():
                if its is not None:  # None: a library's own
                    signal.signal(number, its)


@contextmanager
def at_once() -> Iterator[None]:
    """For a library that works long within one call and lets other threads run: a signal of the block ends
    the process, which has nothing to tell yet and leaves nothing, without waiting for the call's end."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    told, tell = os.pipe()
    os.set_blocking(tell, False)

    def watch():
        while number := os.read(told, 1):
            if number[0] in SIGNALS:
                leave_all()
                complain("interrupted")
                os._exit(EXIT_CODE)
        os.close(told)

    before = signal.set_wakeup_fd(tell)
    threading.Thread(target=watch, daemon=True).start()
    try:
        with handled(lambda *_: None):
            yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(tell)
