"""Arrays with a table about them in one .npz file of a named schema.

What a file holds is declared once, as Members, and checked before an array is made of it: an archive from a
stranger is data of these types and shapes, or refused in a line that names the member.
"""

import io
import json
import zipfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.atomic import atomic_path
from pneunet.base.files.reading import MB, open_file
from pneunet.base.quantities import LARGEST_NUMBER

#: bytes of all arrays of a file together, unpacked
LARGEST_UNPACKED = 800 * MB
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


@dataclass(frozen=True)
class Member:
    """What one array must be. kinds: letters of numpy's kinds of types; shape: of each axis the size, or a
    sum such as "m + d" of numbers and names, of which each stands for one size throughout the file; its
    values lie in low <= value < below. gaps: whether others that are not finite may stand among them."""

    kinds: str
    shape: tuple[int | str, ...] = ()
    low: float = -LARGEST_NUMBER
    below: float | str = LARGEST_NUMBER
    gaps: bool = False

    def require_form(self, shape: tuple[int, ...], kind: str, sizes: dict[str, int]) -> None:
        """InputError for another shape or kind; `sizes` learns the names that are new."""
        if kind not in self.kinds:
            raise InputError(f"its type is of kind '{kind}', not '{self.kinds}'")
        if len(shape) == len(self.shape):
            for size, name in zip(shape, self.shape):
                if isinstance(name, str) and "+" not in name:
                    sizes.setdefault(name, size)
        wanted = tuple(_size(each, sizes) for each in self.shape)
        if shape != wanted:
            raise InputError(f"has shape {shape}, not {wanted}")

    def require_values(self, values: np.ndarray, sizes: Mapping[str, int]) -> None:
        """InputError for values that are not allowed."""
        if self.kinds == "b":
            return
        # numpy 2 would round bare limits to the array's own precision, in which they may be infinite
        low, below = np.float64(self.low), np.float64(_size(self.below, sizes))
        good = (values >= low) & (values < below)
        if self.gaps:
            good |= ~np.isfinite(values)
        if not good.all():
            bad = values[~good].flat[0]
            raise InputError(f"holds {bad:g}, where numbers in {low:g}..{below:g} are wanted")


def _size(wanted: Any, sizes: Mapping[str, int]) -> Any:
    """A number, that of a name, or of a sum of both."""
    if not isinstance(wanted, str) or wanted in sizes:
        return sizes.get(wanted, wanted)
    return sum(sizes[part] if part in sizes else int(part) for part in wanted.split(" + "))


def write_archive(
    path: str | Path, schema: str, about: dict, arrays: Mapping[str, np.ndarray], compress: bool = False
) -> None:
    """Write {name: array} to `path` with `about`, a table for JSON, of this schema."""
    table = np.frombuffer(json.dumps({"schema": schema, **about}, default=float).encode(), np.uint8)
    # in memory first: a zip file on a full disk fails a second time, out of reach, when Python discards it
    archive = io.BytesIO()
    (np.savez_compressed if compress else np.savez)(archive, about=table, **arrays)
    with atomic_path(path) as temporary:
        temporary.write_bytes(archive.getbuffer())


def read_archive(
    path: str | Path,
    schema: str,
    what: str,
    fix: str,
    keys: Mapping[str, type],
    members: Callable[[dict, Collection[str]], Mapping[str, Member]],
    largest: int = LARGEST_UNPACKED,
) -> tuple[dict, dict[str, np.ndarray]]:
    """(about, {name: array}) of the members that members(about, names in the file) declares.

    keys: what `about` must hold, and of which types; a dict that is missing is empty. InputError when the
    file is no `what` of this schema, as `fix` makes it, or when something in it is missing, damaged, of
    another form or more than `largest` bytes.
    """
    sizes: dict[str, int] = {}
    arrays = {}
    with open_file(path, largest, f": {fix.replace('again ', '')}") as stream:
        try:
            archive = zipfile.ZipFile(stream)
        except Exception as error:  # whatever a damaged directory leads to
            raise InputError(f"{path}: not {what} ({error}): {fix}") from None
        infos = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        if sum(info.file_size for info in infos.values()) > largest:
            raise InputError(f"{path}: holds over {largest // MB} MB of arrays: {fix}")

        def read(name: str, member: Member) -> np.ndarray:
            with located(f"{path}: member '{name}'"):
                try:
                    if name not in infos:
                        raise InputError("is missing")
                    values = _read_member(archive, infos[name], member, sizes)
                    member.require_values(values, sizes)
                except InputError as error:
                    raise InputError(f"{error}: {fix}") from None
            return values

        table = read("about", Member("u", ("characters of about",)))
        about = _about(table, f"{path}: member 'about'", fix)
        if about.get("schema") != schema:
            raise InputError(f"{path}: schema '{about.get('schema')}' is not '{schema}': {fix}")
        for key, kind in keys.items():
            value = about.setdefault(key, {}) if kind is dict else about.get(key)
            if not isinstance(value, kind):
                raise InputError(f"{path}: member 'about' has no {kind.__name__} '{key}': {fix}")
        with located(path):
            declared = members(about, infos)
        for name, member in declared.items():
            arrays[name] = read(name, member)
    return about, arrays


def _read_member(archive, info, member, sizes):
    try:
        with archive.open(info) as stream:
            shape, by_column, kind = _HEADERS[np.lib.format.read_magic(stream)](stream)
            member.require_form(shape, kind.kind, sizes)
            # no more than is there, whatever the header says
            data = stream.read()
        return np.frombuffer(data, kind).reshape(shape, order="F" if by_column else "C").copy()
    except InputError:
        raise
    except Exception as error:  # zip, zlib and numpy each have errors of their own for damaged bytes
        raise InputError(f"is damaged ({error})") from None


def _about(table, where, fix):
    try:
        about = json.loads(table.tobytes())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: is not valid JSON ({error}): {fix}") from None
    if not isinstance(about, dict):
        raise InputError(f"{where}: is no table of keys: {fix}")
    return about
