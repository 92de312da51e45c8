"""Points in tables of numbers, as people's trackers and CAD write them: columns by their names, with the unit
that is said there."""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.schemas import POINT
from pneunet.base.files.text import Table, read_numbers_table
from pneunet.base.units import LENGTHS, MPA_PER_KPA, PRESSURES_KPA

log = logging.getLogger(__name__)
FRAME_COLUMNS = ("t1x", "t1y", "t1z", "t2x", "t2y", "t2z")
WEIGHT, PRESSURE = "weight", "pressure"

#: a column's name without its unit; "Points:0" is how ParaView writes x
_POSITION = r"(?:points?|pos(?:ition)?|coord(?:inate)?s?)"
_AXIS = re.compile(
    rf"(?:{_POSITION}[\s_.:-]*)?([xyz])(?:[\s_.:-]*{_POSITION})?|points[\s_:]*([012])", re.IGNORECASE
)
_OTHER = re.compile(rf"({'|'.join(FRAME_COLUMNS)}|{WEIGHT}|{PRESSURE})", re.IGNORECASE)
_UNITS = "|".join(sorted([*LENGTHS, *PRESSURES_KPA, "µm"], key=len, reverse=True))
#: with the unit that is said of it or below it
_NAMED = re.compile(rf"(.+?)[\s_]*(?:in\s+|[(\[])?\s*({_UNITS})?\s*[)\]]?", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class PointsTable:
    """points (n, 3) in mm; of the other columns what is there: frames (n, 3, 3), weights (n,), pressures (n,)
    in MPa."""

    points: np.ndarray
    frames: np.ndarray | None = None
    weights: np.ndarray | None = None
    pressures: np.ndarray | None = None


def read_points(path: str | Path) -> PointsTable:
    """The PointsTable of a file: named columns, or three bare columns of numbers. InputError otherwise."""
    table = read_numbers_table(path)
    if not table.header and table.width != 3:
        raise InputError(f"{path}: a CSV without a header has 3 columns x, y, z in mm, not {table.width}")
    values, units = _columns(table)
    for key in "xyz":
        if key not in values:
            raise InputError(
                f"{path}: column '{key}_mm' is missing: there are {', '.join(table.header)[:200]}"
            )
    lengths = {key: units.get(key, "mm") for key in "xyz"}
    if len(set(lengths.values())) > 1:
        given = ", ".join(f"{key} in {unit}" for key, unit in lengths.items())
        raise InputError(f"{path}: {given}: write all three in the same unit")
    points = LENGTHS[lengths["x"]] * np.column_stack([values[c] for c in "xyz"])
    frames = _frames_of(values, path) if "t1x" in values or "t2x" in values else None
    return PointsTable(points, frames, values.get(WEIGHT), _pressures_of(values, units, path))


def _columns(table: Table) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """({what a column is: its numbers}, {the same: the unit that is said}); what is left is told."""
    values, units, left = {}, {}, []
    for i, name in enumerate(table.header or POINT):
        key, unit = _known(f"{name} {table.units[i]}" if table.units else name)
        if key is None:
            left.append(name)
            continue
        if key in values:
            raise InputError(f"{table.path}: two columns '{key}': rename or delete one")
        values[key] = table.numbers(i)
        if unit:
            units[key] = unit
    if any(left):
        log.info(f"{table.path}: columns that are not used: {', '.join(filter(None, left))[:200]}")
    return values, units


def unit_of(name: str) -> tuple[str, str]:
    """(name of a column without the unit that is said in it, that unit in small letters or "")."""
    found = _NAMED.fullmatch(name.strip())
    return (found[1], (found[2] or "").lower().replace("µ", "u")) if found else (name, "")


def _known(name):
    """(what a column of this name is, the unit said or ""); (None, "") for another."""
    word, unit = unit_of(name)
    if axis := _AXIS.fullmatch(word):
        # "x kPa" is no place
        return ((axis[1] or "xyz"[int(axis[2])]).lower(), unit) if unit in ("", *LENGTHS) else (None, "")
    return (word.lower(), unit) if _OTHER.fullmatch(word) else (None, "")


def _pressures_of(values, units, where):
    if PRESSURE not in values:
        return None
    unit = units.get(PRESSURE)
    if unit not in PRESSURES_KPA:
        raise InputError(f"{where}: column 'pressure' says no unit: write 'pressure_kPa'")
    return MPA_PER_KPA * PRESSURES_KPA[unit] * values[PRESSURE]


def _frames_of(values, where):
    missing = [c for c in FRAME_COLUMNS if c not in values]
    if missing:
        raise InputError(f"{where}: column '{missing[0]}' is missing: frames need {', '.join(FRAME_COLUMNS)}")
    t1 = np.column_stack([values[c] for c in FRAME_COLUMNS[:3]])
    t2 = np.column_stack([values[c] for c in FRAME_COLUMNS[3:]])
    return np.stack([t1, t2, np.cross(t1, t2)], axis=2)
