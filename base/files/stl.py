"""Triangles of STL files, read from binary or text and written as binary: nothing else of them is kept."""

from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import atomic_path
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


def write_stl(path: str | Path, triangles: np.ndarray, name: str = "") -> None:
    """Write triangles (m, 3, 3), outward, as a binary STL; name: what it is, of which 60 characters are
    kept."""
    records = np.zeros(len(triangles), _RECORD)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    records["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    records["corners"] = triangles
    head = f"pneunet, mm: {name[:60]}".encode("ascii", "replace").ljust(80)
    with atomic_path(path) as temporary:
        temporary.write_bytes(head + len(triangles).to_bytes(4, "little") + records.tobytes())
