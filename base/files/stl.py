"""Triangles of STL files, binary or text, as data: nothing else of them is kept."""

from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.reading import MB, read_bytes

LARGEST_STL = 100 * MB
#: a triangle of a binary file: normal, three corners, two bytes that mean nothing
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("_", "<u2")])
_HEAD = 84


def read_stl(path: str | Path) -> np.ndarray:
    """Triangles (m, 3, 3) in the file's unit of length; InputError for what is no STL, is damaged or has
    none."""
    data = read_bytes(path, LARGEST_STL)
    count = int.from_bytes(data[80:_HEAD], "little") if len(data) >= _HEAD else -1
    # a binary file may begin with "solid" as well: its length tells
    if count > 0 and len(data) == _HEAD + count * _RECORD.itemsize:
        triangles = np.frombuffer(data, _RECORD, offset=_HEAD)["corners"].astype(float)
    elif data[:5].lower() == b"solid":
        triangles = _of_text(path, data)
    else:
        raise InputError(f"{path}: is no STL, or is damaged: export it again as STL")
    if not len(triangles):
        raise InputError(f"{path}: holds no triangles: export it again as STL")
    if not np.isfinite(triangles).all() or not np.ptp(triangles.reshape(-1, 3), axis=0).max() > 0:
        raise InputError(f"{path}: its corners are not finite, or all the same: export it again as STL")
    return triangles


def _of_text(path, data):
    words = [line.split()[1:4] for line in data.splitlines() if line.lstrip()[:6].lower() == b"vertex"]
    try:
        corners = np.array(words, float) if words else np.empty((0, 3))
    except ValueError:
        raise InputError(f"{path}: a vertex is no three numbers: export it again as STL") from None
    if len(corners) % 3 or corners.shape[1] != 3:
        raise InputError(f"{path}: holds vertices that make no triangles: export it again as STL")
    return corners.reshape(-1, 3, 3)
