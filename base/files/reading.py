"""Where every file is opened that a user, a colleague or a killed run may have made.

What is no regular file, or larger than a file of its kind can be, is refused before it is read: a pipe would
never end, a device never be empty.
"""

import json
import os
import stat
from pathlib import Path
from typing import Any, BinaryIO

from pneunet.base.errors import InputError

MB = 1_000_000
#: bytes that a file of each kind may have
LARGEST_TEXT, LARGEST_TOML, LARGEST_JSON = 50 * MB, 10 * MB, 50 * MB


def open_file(path: str | Path, largest: int, missing: str = "") -> BinaryIO:
    """The file at `path`, open to be read; InputError when it is no regular file, larger than `largest` bytes
    or not to be read. missing: what to do when there is none."""
    if "\0" in str(path):
        raise InputError("a file's name must not hold a NUL character")
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"{path}: is a folder: give the file in it")
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: is a pipe or a device, not a regular file: save it as a file first")
        if status.st_size > largest:
            raise InputError(f"{path}: is over {largest // MB} MB: keep the part that is needed")
        return open(path, "rb")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file{missing}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def read_bytes(path: str | Path, largest: int) -> bytes:
    """All of a file, as `open_file` opens it."""
    with open_file(path, largest) as stream:
        try:
            data = stream.read(largest + 1)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > largest:  # some of the system's files do not tell their size
        raise InputError(f"{path}: is over {largest // MB} MB: keep the part that is needed")
    return data


def read_json(path: str | Path) -> dict[str, Any]:
    """The object in a JSON file; InputError where something else stands in it."""
    try:
        found = json.loads(read_bytes(path, LARGEST_JSON))
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not valid JSON ({error})") from None
    if not isinstance(found, dict):
        raise InputError(f"{path}: must hold a JSON object, not {type(found).__name__}")
    return found
