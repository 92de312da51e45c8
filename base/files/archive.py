"""Arrays with a table about them in one .npz file of a named schema."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import atomic_path


def write_archive(
    path: str | Path, schema: str, about: dict, arrays: Mapping[str, np.ndarray], compress: bool = False
) -> None:
    """Write {name: array} to `path` with `about`, a table for JSON, of this schema."""
    table = np.frombuffer(json.dumps({"schema": schema, **about}).encode(), np.uint8)
    with atomic_path(path) as temporary:
        with open(temporary, "wb") as stream:
            (np.savez_compressed if compress else np.savez)(stream, about=table, **arrays)


@contextmanager
def read_archive(
    path: str | Path, schema: str, what: str, command: str
) -> Iterator[tuple[dict, Mapping[str, np.ndarray]]]:
    """Yields (about, stored arrays by name). InputError when the file is no `what`, as `command` makes it, of
    this schema."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            about = json.loads(bytes(stored["about"]))
            if about.get("schema") != schema:
                raise InputError(
                    f"{path}: schema '{about.get('schema')}' is not '{schema}': make it again with {command}"
                )
            yield about, stored
    except InputError:  # a ValueError too
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file: make it with {command}") from None
    except (KeyError, ValueError, OSError) as error:
        raise InputError(f"{path}: not {what} ({error}): make it again with {command}") from None
