"""Laws and data sets that are bad for certain, made from those that come along."""

import io
import zipfile
from functools import cache

import numpy as np

from benchmarks.strange_files import Content, Random, pick, strange
from pneunet.reduced.choice import DATA_SET, SHIPPED


@cache
def archive(name: str) -> dict[str, np.ndarray]:
    """The arrays of the law or of the data set that come along."""
    with np.load(SHIPPED if name == "law.npz" else DATA_SET) as stored:
        return dict(stored)


def changed_archive(random: Random, name: str) -> tuple[Content, str]:
    arrays, way = dict(archive(name)), random.random()
    member = pick(random, sorted(arrays))
    values, what = arrays[member], f"member {member}"
    if way < 0.15:
        return strange(random)
    if way < 0.25:
        whole = _packed(arrays)
        return whole[: int(random.integers(len(whole) - 30))], "cut short"
    if way < 0.35:  # in the middle of an array's data
        whole = bytearray(_packed({member: values}))
        at = int(random.integers(len(whole)))
        whole[at:] = bytes(len(whole) - at)
        return bytes(whole), "zeros from the middle on"
    if way < 0.45:
        table = (
            b"[]",
            b"{}",
            b"[" * 3000,
            b"\xff",
            b'{"schema": 5}',
            b'{"schema": "pneunet-law-1", "kinds": 3}',
        )
        arrays["about"] = np.frombuffer(pick(random, table), np.uint8)
        what = "member about"
    elif way < 0.55:
        del arrays[member]
    elif way < 0.65:
        arrays[member] = values.astype(complex)
    elif way < 0.72:
        arrays[member] = np.array(["a"] * max(len(values.ravel()), 1))
    elif way < 0.8:
        arrays[member] = np.broadcast_to(values, (2, *values.shape))
    elif way < 0.85:
        return _bomb(member), f"{what}: 100 GB by its header"
    else:
        member = pick(
            random,
            sorted(k for k, v in arrays.items() if v.dtype.kind == "f" and v.size and "slopes" not in k),
        )
        if member in ("limit_pressure", "first_touch", "wall_distance"):
            member = "strains"
        values = arrays[member].astype(float)
        values.flat[int(random.integers(values.size))] = pick(random, (np.nan, np.inf, 1e300))
        arrays[member], what = values, f"nan or more in {member}"
    return _packed(arrays), what


def _packed(arrays: dict[str, np.ndarray]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def _bomb(member: str) -> bytes:
    """A small archive whose member claims to be huge."""
    stream = io.BytesIO()
    header = io.BytesIO()
    about = {"descr": "<f8", "fortran_order": False, "shape": (10**10,)}
    np.lib.format.write_array_header_1_0(header, about)
    with zipfile.ZipFile(stream, "w") as packed:
        packed.writestr("about.npy", header.getvalue())
        packed.writestr(f"{member}.npy", header.getvalue() + bytes(100))
    return stream.getvalue()
