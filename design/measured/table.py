"""Measurements over pressure in tables of numbers, as motion capture and spreadsheets export them."""

import logging
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.errors import InputError
from pneunet.base.files.text import Table, read_numbers_table
from pneunet.base.units import LARGEST_PRESSURE_KPA, LENGTHS, MPA_PER_KPA, PRESSURES_KPA
from pneunet.design.target.table import unit_of

log = logging.getLogger(__name__)
MARKERS, CENTRELINE, ANGLE, DISPLACEMENT = "markers", "centreline", "angle", "displacement"
TIP, BASE = "tip", "base"
#: points that a measured centreline is compared at; fewer than LEAST measured points make no centreline
STATIONS, LEAST = 21, 5
#: of the largest pressure: rows closer than this are one level, and a level up to REST is the body at rest
SAME, REST = 0.002, 0.01
#: a ramp has a pressure of its own in every row: it is cut into so many levels
MOST_LEVELS = 40

_POINT = re.compile(r"(.*?)[\s_.:/-]*(?:pos(?:ition)?[\s_.:-]*)?([xyz])", re.IGNORECASE)
_ANGLE = re.compile(
    r"(?:(?:bend(?:ing)?|tip)[\s_]*)?(?:angle|tilt)[\s_]*[(\[]?(deg(?:rees?)?|°|rad)?[)\]]?", re.IGNORECASE
)
_DISPLACEMENT = re.compile(r"(?:tip[\s_]*)?(?:displacement|deflection|drop)", re.IGNORECASE)
_PRESSURE = re.compile(r"(?:gauge[\s_]*)?(?:pressure|p)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Measurement:
    """What was measured, a mean over the rows of each pressure.

    what: MARKERS, CENTRELINE, ANGLE or DISPLACEMENT. pressures (n,) in MPa, rising. values (n, k, 3) in mm in
    the camera's coordinates, of k markers `names` or k stations of the centreline, nan where a marker was not
    seen; or (n, 1, 1): an angle in degrees, or how far the tip is from where it was at rest, mm. spread (n,
    k): root mean square distance of the rows from their mean, nan for a single one; rows (n,): their number.
    """

    path: str
    what: str
    pressures: np.ndarray
    values: np.ndarray
    spread: np.ndarray
    rows: np.ndarray
    names: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        return "deg" if self.what == ANGLE else "mm"

    @property
    def at_rest(self) -> bool:
        """Whether the first level is the body without pressure."""
        return bool(self.pressures[0] <= REST * self.pressures[-1])


def read_measured(path: str | Path) -> Measurement:
    """The Measurement in a table with a column of pressure and those of markers, of the tip, of a centreline,
    of an angle or of a displacement. InputError, in one line, where these are missing or in no known unit."""
    table = read_numbers_table(path)
    if not table.header:
        raise InputError(f"{path}: has no header: name the columns, for instance pressure_kPa, tip_x_mm, ...")
    pressures, points, scalars = _columns(table)
    if list(points) == [""] and np.unique(pressures, return_counts=True)[1].max() > 1:
        return _centrelines(table, pressures, _point(table, "", points[""]))
    if points:
        usual = {"": TIP, **{name: name.lower() for name in points if name.lower() in (TIP, BASE)}}
        points = {usual.get(name, name): columns for name, columns in points.items()}
        rows = np.stack([_point(table, name, columns) for name, columns in points.items()], axis=1)
        return _levels(table, MARKERS, pressures, rows, tuple(points))
    for what in (ANGLE, DISPLACEMENT):
        if what in scalars:
            column, factor = scalars[what]
            rows = factor * table.numbers(column, gaps=True)[:, None, None]
            if what == ANGLE and np.nanmax(np.abs(rows), initial=0.0) > 180:
                raise InputError(f"{path}: an angle over 180 deg is not told from 360 less it: give points")
            return _levels(table, what, pressures, rows)
    raise InputError(
        f"{path}: holds nothing to compare: name columns NAME_x_mm, NAME_y_mm, NAME_z_mm of markers"
        " (tip_x_mm, ... of the tip), x_mm, y_mm, z_mm of a centreline, angle_deg or displacement_mm"
    )


def read_places(path: str | Path) -> dict[str, np.ndarray]:
    """{marker: (3,) mm} of a table marker, x_mm, y_mm, z_mm: where markers sit on the body at rest, in its
    axes (x from the base along the channel, y width, z height). InputError otherwise."""
    table = read_numbers_table(path)
    found = {}
    for i, name in enumerate(table.header):
        word, unit = _named(table, i)
        if word.lower() in ("x", "y", "z"):
            found[word.lower()] = i, _millimetres(table, name, unit)
    if sorted(found) != ["x", "y", "z"]:
        raise InputError(f"{path}: columns marker, x_mm, y_mm, z_mm are needed: where each marker sits")
    places = _point(table, "", found, gaps=False)
    return {row[0]: place for row, place in zip(table.rows, places)}


def _columns(table: Table):
    """(pressures (rows,) in MPa, {marker: {axis: (column, mm a unit)}}, {ANGLE or DISPLACEMENT: (column,
    factor)}). Bare x, y, z have the name "", and numbers where the names stood in a row above; the rest is
    told."""
    named = [_named(table, i) for i in range(len(table.header))]
    several = (
        max(Counter(w.lower() for w, _ in named if w.lower() in ("x", "y", "z")).values(), default=0) > 1
    )
    pressure: list[tuple[int, str]] = []
    points: dict[str, dict[str, tuple[int, float]]] = {}
    scalars: dict[str, tuple[int, float]] = {}
    left: list[str] = []
    bare: Counter[str] = Counter()
    for i, (name, (word, unit)) in enumerate(zip(table.header, named)):
        angle, point = _ANGLE.fullmatch(name.strip()), _POINT.fullmatch(word)
        if _PRESSURE.fullmatch(word) and unit not in LENGTHS:
            pressure.append((i, unit))
        elif angle:
            said = angle[1] or (table.units[i] if table.units else "")
            scalars.setdefault(ANGLE, (i, np.degrees(1.0) if "rad" in said.lower() else 1.0))
        elif _DISPLACEMENT.fullmatch(word):
            scalars.setdefault(DISPLACEMENT, (i, _millimetres(table, name, unit)))
        elif point and unit in ("", *LENGTHS):
            marker, axis = point[1].strip(), point[2].lower()
            if not marker and several:
                bare[axis] += 1
                marker = str(bare[axis])
            if axis in points.setdefault(marker, {}):
                raise InputError(
                    f"{table.path}: marker '{marker}' has two columns {axis}: rename or delete one"
                )
            points[marker][axis] = i, _millimetres(table, name, unit)
        else:
            left.append(name)
    if any(left):
        log.info(f"{table.path}: columns that are not used: {', '.join(filter(None, left))[:200]}")
    return _pressures(table, pressure), points, scalars


def _named(table, i):
    """(name of a column without its unit, the unit said there or in the row of units, or "")."""
    word, unit = unit_of(table.header[i])
    return word, unit or (unit_of(f"in {table.units[i]}")[1] if table.units else "")


def _millimetres(table, name, unit):
    if unit not in ("", *LENGTHS):
        raise InputError(f"{table.path}: column '{name}' is in no unit of length: write mm, cm, m or in")
    return LENGTHS[unit or "mm"]


def _pressures(table, columns):
    """(rows,) in MPa; what a gauge shows below 0 at rest is 0."""
    if len(columns) != 1:
        what = "is missing: give every row its pressure" if not columns else "is there twice: rename one"
        raise InputError(f"{table.path}: column 'pressure_kPa' {what}")
    (column, unit), *_ = columns
    if unit not in PRESSURES_KPA:
        raise InputError(f"{table.path}: column '{table.header[column]}' says no unit: write 'pressure_kPa'")
    kPa = PRESSURES_KPA[unit] * table.numbers(column)
    low, high = kPa.min(), kPa.max()
    if low < -REST * abs(high):
        row = table.lines[int(kPa.argmin())]
        raise InputError(
            f"{table.path} row {row}: a pressure of {low:g} kPa: give gauge pressures, 0 at rest"
        )
    if not 0 < high <= LARGEST_PRESSURE_KPA:
        raise InputError(
            f"{table.path}: pressures up to {high:g} kPa: 0..{LARGEST_PRESSURE_KPA:g} is allowed"
        )
    return MPA_PER_KPA * np.maximum(kPa, 0.0)


def _point(table, name, columns, gaps=True):
    """(rows, 3) in mm."""
    for axis in "xyz":
        if axis not in columns:
            raise InputError(f"{table.path}: column '{f'{name}_' * bool(name)}{axis}_mm' is missing")
    return np.column_stack([factor * table.numbers(i, gaps) for i, factor in map(columns.get, "xyz")])


def _numbers_of_levels(pressures):
    """(rows,) number of each row's level."""
    order, top = np.argsort(pressures, kind="stable"), pressures.max()
    rising = pressures[order]
    number = np.concatenate([[0], np.cumsum(np.diff(rising) > SAME * top)])
    if number[-1] >= MOST_LEVELS:
        number = np.minimum((rising / top * MOST_LEVELS).astype(int), MOST_LEVELS - 1)
        number = np.where(rising <= REST * top, -1, number)
    out = np.empty(len(pressures), int)
    out[order] = np.unique(number, return_inverse=True)[1]
    return out


def _levels(table, what, pressures, rows, names=()):
    """The Measurement of rows (rows, k, d); a level where nothing was seen is left out."""
    number = _numbers_of_levels(pressures)
    found = []
    for level in range(number.max() + 1):
        own = rows[number == level]
        seen = np.isfinite(own).all(axis=2)
        count = seen.sum(axis=0)
        if not count.any():
            continue
        own = np.where(seen[..., None], own, 0.0)
        mean = np.where(count[:, None], own.sum(axis=0) / np.maximum(count, 1)[:, None], np.nan)
        off = np.where(seen, np.sum((own - mean) ** 2, axis=2), 0.0).sum(axis=0)
        spread = np.sqrt(np.where(count > 1, off / np.maximum(count - 1, 1), np.nan))
        found.append((pressures[number == level].mean(), mean, spread, len(own)))
    if len(found) < 2:
        raise InputError(f"{table.path}: holds one pressure only: give at least two, one of them 0")
    P, values, spread, counts = map(np.array, zip(*found))
    return Measurement(str(table.path), what, P, values, spread, counts, names)


def _centrelines(table, pressures, points):
    """The Measurement of points from base to tip in rows of equal pressure."""
    found = []
    for P in np.unique(pressures):
        own = points[pressures == P]
        own = own[np.isfinite(own).all(axis=1)]
        if len(own) < LEAST:
            raise InputError(
                f"{table.path}: {len(own)} points at {1e3 * P:g} kPa make no centreline: give at least"
                f" {LEAST} from base to tip; the tip alone has columns tip_x_mm, tip_y_mm, tip_z_mm"
            )
        found.append((P, Curve(own).evenly(STATIONS), len(own)))
    if len(found) < 2:
        raise InputError(f"{table.path}: holds one pressure only: give at least two, one of them 0")
    P, values, counts = map(np.array, zip(*found))
    return Measurement(str(table.path), CENTRELINE, P, values, np.full(values.shape[:2], np.nan), counts)
