"""The errors a user can cause or must be told about."""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Bad input, told in one line that names the key (or file) and the fix; the command line exits with 2."""


class ConvergenceError(RuntimeError):
    """A computation stopped short: says at which load, why and what to try. Accepted results are on disk
    already."""


@contextmanager
def located(where: object) -> Iterator[None]:
    """An InputError of the block names the place (a file, a table in it) that the input came from."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
