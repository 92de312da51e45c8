"""Files that are whole or not there: everything is written to a temporary name and renamed."""

import csv
import io
import os
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.text import read_text


class NotWritten(InputError):
    """A file could not be written: the disk is full, or the folder is not ours."""


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path` to write to; renamed onto it when the block ends without an exception.
    NotWritten for one of the system's."""
    with room_in(path):
        with _replacing(Path(path)) as temporary:
            yield temporary


@contextmanager
def _replacing(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    try:
        yield Path(temporary)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    finally:
        Path(temporary).unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, UTF-8 with plain line ends on every system."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_csv(path: str | Path, header: Sequence[str], rows: Iterable[Iterable]) -> None:
    """A CSV of numbers (and words), full precision to 12 digits."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow([f"{v:.12g}" if isinstance(v, (float, np.floating)) else v for v in row])
    write_text(path, out.getvalue())


def read_csv(path: str | Path) -> tuple[list[str], list[list[str]]]:
    """(header, rows of text) of a CSV file that the project wrote itself; InputError when it is missing or
    damaged."""
    try:
        reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
        rows = [row for row in reader if row and any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{path}: cannot be read as CSV ({error}): is a quotation mark missing?") from None
    if not rows:
        raise InputError(f"{path}: is empty")
    return rows[0], rows[1:]


def read_columns(path: str | Path, columns: Sequence[str]) -> np.ndarray:
    """Float array (n, len(columns)) of named columns of a CSV the project wrote itself."""
    header, rows = read_csv(path)
    missing = [c for c in columns if c not in header]
    if missing:
        raise InputError(f"{path}: column '{missing[0]}' is missing")
    out = np.empty((len(rows), len(columns)))
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            try:
                out[i, j] = float(row[header.index(column)])
            except (ValueError, IndexError):
                raise InputError(
                    f"{path} row {i + 2}: '{column}' is not a number: make the file again"
                ) from None
    return out


def output_directory(path: str | Path) -> Path:
    """The folder, made if need be; an unwritable one is an InputError before any work is done."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written to ({error.strerror}): choose another folder with -o"
        ) from None
    return path


@contextmanager
def room_in(directory: str | Path, then: str = "") -> Iterator[None]:
    """Where `directory` is written to while work goes on: a full disk is NotWritten, which says what to do
    `then`."""
    try:
        yield
    except NotWritten as error:
        raise NotWritten(f"{error}{then}") from None
    except OSError as error:
        why = error.strerror or error
        raise NotWritten(f"{directory}: cannot be written to ({why}): make room there{then}") from None


def require_writable(path: str | Path) -> None:
    """InputError when the folder `path` could not be made or written to; leaves nothing, for use before long
    work."""
    existing = whole = Path(path).absolute()
    try:
        while not existing.exists():
            existing = existing.parent
        with tempfile.TemporaryDirectory(dir=existing, prefix=".try-") as trial:
            (Path(trial) / whole.relative_to(existing)).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written to ({error.strerror}): choose another folder with -o"
        ) from None
