"""How far a long piece of work is, and when it will be done."""

import logging
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

#: seconds from one line to the next, and to the first: what is done before says nothing
PAUSE = 2.0
log = logging.getLogger(__name__)
Item = TypeVar("Item")


def eta(seconds: float, done: float) -> str:
    """'ETA 12 s' of work of which a share `done` (0 to 1) has taken so many seconds, at that pace."""
    return f"ETA {seconds * (1 - done) / done:.0f} s"


def progress(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """The items; where they take long, a line every PAUSE seconds says how many are done, and the time left.

    what: 'frames of the film'; total: how many there are, by default len(items).
    """
    count = len(items) if total is None else total  # type: ignore[arg-type]
    started = told = time.monotonic()
    for done, item in enumerate(items, start=1):
        yield item
        now = time.monotonic()
        if now - told >= PAUSE and done < count:
            told = now
            log.info(f"{done} of {count} {what}, {now - started:.0f} s, {eta(now - started, done / count)}")


class Pace:
    """Of work whose parts are not alike: when it began, and so when it will end."""

    def __init__(self) -> None:
        self.started = time.monotonic()

    def left(self, done: float) -> str:
        """'; ETA 12 s' when a share `done` (0 to 1) of the work is done; '' where it takes no time."""
        seconds = time.monotonic() - self.started
        return f"; {eta(seconds, done)}" if seconds / done >= PAUSE else ""
