"""The table [wrap] of a target: a surface, from a profile or an STL, and the path around it."""

from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.stl import read_stl
from pneunet.base.files.text import read_numbers_table
from pneunet.base.files.toml import as_table, from_table, number, refuse_unknown
from pneunet.base.quantities import quantities
from pneunet.base.units import LENGTHS
from pneunet.design.target.table import unit_of
from pneunet.design.target.wrap import Revolution, Surface, Triangulated, WrapPath, wrap

SURFACES = ("profile", "stl")
KEYS = (*SURFACES, "stl_unit", "z_mm", *quantities(WrapPath))


def wrapped(table: object, folder: Path, where: str) -> np.ndarray:
    """Points (201, 3) in mm of the curve that a table [wrap] describes; its files are in `folder`. InputError
    that names key and fix."""
    table = as_table(table, where)
    refuse_unknown(table, KEYS, where)
    surface = _surface(table, folder, where)
    given = {key: table[key] for key in quantities(WrapPath) if key in table}
    heights = table.get("z_mm")
    if not isinstance(heights, list) or len(heights) != 2:
        raise InputError(f"{where}: 'z_mm' must be [from, to], the heights that the path begins and ends at")
    z_range = tuple(float(number(v, "z_mm", where)) for v in heights)
    path = from_table(WrapPath, given, where, z_range=z_range)
    with located(where):
        return wrap(surface, path)


def _surface(table, folder, where) -> Surface:
    if sum(key in table for key in SURFACES) != 1:
        raise InputError(f"{where}: give one of 'profile' (a CSV of r_mm and z_mm) or 'stl' (a file)")
    key = next(key for key in SURFACES if key in table)
    if not isinstance(table[key], str):
        raise InputError(f"{where}: '{key}' names a file")
    if key == "profile":
        if "stl_unit" in table:
            raise InputError(
                f"{where}: 'stl_unit' goes with 'stl': a profile says its unit in its columns' names"
            )
        return read_profile(folder / table[key])
    unit = table.get("stl_unit", "mm")
    if unit not in tuple(LENGTHS):
        raise InputError(f"{where}: stl_unit = {unit!r} is not known: write one of {', '.join(LENGTHS)}")
    return Triangulated(LENGTHS[unit] * read_stl(folder / table[key]))


def read_profile(path: str | Path) -> Revolution:
    """The surface of revolution whose radius over height a CSV has, columns r_mm and z_mm, base to top or
    back. InputError otherwise."""
    table = read_numbers_table(path)
    columns = {}
    for i, name in enumerate(table.header):
        word, unit = unit_of(f"{name} {table.units[i]}" if table.units else name)
        if word.lower() in ("r", "radius", "z", "height") and unit in ("", *LENGTHS):
            columns[{"radius": "r", "height": "z"}.get(word.lower(), word.lower())] = LENGTHS[
                unit or "mm"
            ] * table.numbers(i)
    for key in "rz":
        if key not in columns:
            raise InputError(f"{path}: column '{key}_mm' is missing: a profile has columns r_mm and z_mm")
    with located(path):
        return Revolution.through(columns["z"], columns["r"])
