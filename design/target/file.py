"""Reading a `Target` from a CSV of points or a TOML; docs/use-design.md shows the files.

Every bad input is one line that names the key and the fix.
"""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.kinds import TARGET, read_tables
from pneunet.base.files.schemas import POINT
from pneunet.base.files.text import read_numbers_table
from pneunet.base.files.toml import from_table, number, read_toml, refuse_unknown
from pneunet.base.materials.laws import PAPER_TWISTING, material_from_table
from pneunet.base.quantities import Checked, quantities, quantity
from pneunet.base.strains import helix_frenet
from pneunet.base.units import KPA_PER_MPA, LENGTHS, MPA_PER_KPA
from pneunet.design.target.target import BENDING, HELICAL, PASSIVE, PRESSURE_LIMIT, Piece, Target
from pneunet.geometry.parameters import TWISTING, Segment

#: targets that come along: octopus.toml, vase.toml, ...
SHIPPED = Path(__file__).resolve().parents[1] / "data"
log = logging.getLogger(__name__)
FRAME_COLUMNS = ("t1x", "t1y", "t1z", "t2x", "t2y", "t2z")

#: file key -> field of Segment that the user may give a start value or let vary; kind, angle and chambers are
#: found, and a bottom layer is no variable of the inverse design
START_KEYS = {
    key: f.name
    for key, f in quantities(Segment).items()
    if f.metadata["unit"] == "mm" and f.name != "layer_thickness"
}
SHARED = ("width", "channel_width", "channel_height", "cavity_floor", "end_margin")
VARY_KEYS = {"angle_deg": "angle"} | {key: name for key, name in START_KEYS.items() if name not in SHARED}


def read_target(path: str | Path) -> Target:
    """The Target in a CSV of points or a TOML, or a shipped one by its name; InputError otherwise."""
    path = Path(path)
    if (
        path.name == str(path)
        and not path.exists()
        and f"{path}.toml" in {p.name for p in SHIPPED.glob("*.toml")}
    ):
        path = SHIPPED / f"{path}.toml"
    if path.suffix.lower() == ".toml":
        return _from_toml(path)
    points, frames = _read_points(path)
    return _target(str(path), points=points, frames=frames, name=path.stem, source=path.name)


def _target(where, **values):
    try:
        return Target(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


# ---- CSV


#: a column's name, with or without the unit that is said of it or below it
_COLUMN = re.compile(r"(t[12])?[xyz]", re.IGNORECASE)
_NAMED = re.compile(r"(\w+?)[\s_]*(?:in\s+|[(\[])?\s*(mm|cm|m|um|µm|inch|in)?\s*[)\]]?", re.IGNORECASE)


def _read_points(path):
    """(points (n, 3), frames (n, 3, 3) or None) of a CSV: named columns, or three bare columns of numbers."""
    table = read_numbers_table(path)
    if not table.header and table.width != 3:
        raise InputError(f"{path}: a CSV without a header has 3 columns x, y, z in mm, not {table.width}")
    values, units, left = {}, {}, []
    for i, name in enumerate(table.header or POINT):
        found = _NAMED.fullmatch(f"{name} {table.units[i]}".strip() if table.units else name.strip())
        if not found or not _COLUMN.fullmatch(found[1]):
            left.append(name)
            continue
        key = found[1].lower()
        if key in values:
            raise InputError(f"{path}: two columns '{key}': rename or delete one")
        values[key] = table.numbers(i)
        if len(key) == 1:
            units[key] = (found[2] or "mm").lower().replace("µ", "u")
    for key in "xyz":
        if key not in values:
            raise InputError(
                f"{path}: column '{key}_mm' is missing: there are {', '.join(table.header)[:200]}"
            )
    if len(set(units.values())) > 1:
        given = ", ".join(f"{key} in {unit}" for key, unit in units.items())
        raise InputError(f"{path}: {given}: write all three in the same unit")
    if any(left):
        log.info(f"{path}: columns that are not used: {', '.join(filter(None, left))[:200]}")
    points = LENGTHS[units["x"]] * np.column_stack([values[c] for c in "xyz"])
    return points, _frames_of(values, path) if "t1x" in values or "t2x" in values else None


def _frames_of(values, where):
    missing = [c for c in FRAME_COLUMNS if c not in values]
    if missing:
        raise InputError(f"{where}: column '{missing[0]}' is missing: frames need {', '.join(FRAME_COLUMNS)}")
    t1 = np.column_stack([values[c] for c in FRAME_COLUMNS[:3]])
    t2 = np.column_stack([values[c] for c in FRAME_COLUMNS[3:]])
    return np.stack([t1, t2, np.cross(t1, t2)], axis=2)


# ---- TOML

POINT_KEYS = ("target", "points", "points_mm", "frames")
KEYS = (
    "name",
    *POINT_KEYS,
    "pressure_kPa",
    "pressure_range_kPa",
    "piece",
    "base",
    "material",
    "segment",
    "vary",
)


def _from_toml(path):
    table = read_tables(path, TARGET)
    refuse_unknown(table, KEYS, str(path))
    folder = path.parent
    if "target" in table:
        table, folder = _on_shipped(table, path)
    where = str(path)
    points, frames = _toml_points(table, folder, where)
    direction, width = _base(table.get("base", {}), f"{where} [base]")
    material = table.get("material")
    return _target(
        where,
        points=points,
        frames=frames,
        name=str(table.get("name", path.stem)),
        source=path.name,
        pieces=_pieces(table.get("piece", []), where),
        base_direction=direction,
        base_width=width,
        pressure_range=_pressure_range(table, where),
        material=PAPER_TWISTING if material is None else material_from_table(material, f"{where} [material]"),
        start=_start(table.get("segment", {}), f"{where} [segment]"),
        vary=_vary(table["vary"], f"{where} [vary]") if "vary" in table else None,
    )


def _on_shipped(table, path):
    """The tables of the shipped target that `target` names, with the user's own in their place where
    given."""
    names = sorted(p.stem for p in SHIPPED.glob("*.toml"))
    if table["target"] not in names:
        known = ", ".join(names) or "none in this installation: give points instead"
        raise InputError(f"{path}: target = '{table['target']}' is not shipped: shipped are {known}")
    if "points" in table or "points_mm" in table:
        raise InputError(f"{path}: 'target' and 'points' exclude each other: give one")
    shipped = read_toml(SHIPPED / f"{table['target']}.toml")
    own = {key: value for key, value in table.items() if key != "target"}
    if "pressure_kPa" in own or "pressure_range_kPa" in own:
        shipped = {key: value for key, value in shipped.items() if not key.startswith("pressure")}
    return shipped | own, SHIPPED


def _toml_points(table, folder, where):
    if ("points" in table) == ("points_mm" in table):
        raise InputError(
            f"{where}: give one of 'points' (a CSV file), 'points_mm' (a list of [x, y, z]) or 'target'"
        )
    if "points" in table:
        if not isinstance(table["points"], str):
            raise InputError(f"{where}: 'points' names a CSV file; write a list as 'points_mm'")
        points, frames = _read_points(folder / table["points"])
    else:
        points, frames = _array(table["points_mm"], "points_mm", where, 2), None
    if "frames" in table:
        frames = np.swapaxes(_array(table["frames"], "frames", where, 3), 1, 2)
    return points, frames


def _array(value, key, where, dimensions):
    try:
        array = np.array(value)
        numeric = array.dtype.kind in "if" and array.ndim == dimensions
    except ValueError:
        numeric = False
    if not numeric:
        shape = "[x, y, z]" if dimensions == 2 else "[t1, t2, t3] of three numbers each"
        raise InputError(f"{where}: '{key}' must be a list of {shape}")
    return array.astype(float)


def _pressure_range(table, where):
    if "pressure_kPa" in table and "pressure_range_kPa" in table:
        raise InputError(
            f"{where}: 'pressure_kPa' (fixed) and 'pressure_range_kPa' exclude each other: give one"
        )
    if "pressure_kPa" in table:
        low = high = number(table["pressure_kPa"], "pressure_kPa", where)
        key = "pressure_kPa"
    elif "pressure_range_kPa" in table:
        key = "pressure_range_kPa"
        low, high = _range(table[key], key, where)
    else:
        return None
    if not 0 < low <= high <= KPA_PER_MPA * PRESSURE_LIMIT:
        raise InputError(
            f"{where}: {key} = {table[key]} must lie in 0..{KPA_PER_MPA * PRESSURE_LIMIT:g} kPa (above it the"
            " chambers leak)"
        )
    return low * MPA_PER_KPA, high * MPA_PER_KPA


def _range(value, key, where):
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where}: '{key}' must be [smallest, largest], not {value!r}")
    low, high = (number(v, key, where) for v in value)
    if low > high:
        raise InputError(f"{where}: '{key}' = {value}: the smallest comes first")
    return low, high


PIECE_KEYS = {
    PASSIVE: ("kind", "length_mm"),
    TWISTING: ("kind", "length_mm", "tau_rad_per_mm"),
    BENDING: ("kind", "length_mm", "roll_deg", "curvature_per_m"),
    HELICAL: (
        "kind",
        "length_mm",
        "roll_deg",
        "cylinder_curvature_per_m",
        "pitch_mm",
        "curvature_per_m",
        "torsion_rad_per_m",
    ),
}


def _pieces(rows, where):
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(f"{where}: pieces are written [[piece]], with double brackets")
    return tuple(_piece(row, f"{where} [[piece]] {i}") for i, row in enumerate(rows, start=1))


@dataclass(frozen=True)
class _Given(Checked):
    """What a [[piece]] may say; PIECE_KEYS: the keys that go with its kind."""

    kind: str = quantity(None, choices=tuple(PIECE_KEYS))
    length: float = quantity("mm", note="deformed length", above=0, low=1, high=2000)
    twist: float | None = quantity("rad_per_mm", None, key="tau_rad_per_mm", low=-2, high=2)
    curvature: float | None = quantity(
        "per_m", None, above=0, high=2e3, low=1e-6, hint="its direction follows from the points"
    )
    torsion: float | None = quantity("rad_per_m", None, low=-2e3, high=2e3)
    cylinder_curvature: float | None = quantity("per_m", None, above=0, low=1e-6, high=2e3)
    pitch: float | None = quantity("mm", None, low=-1e5, high=1e5)
    roll: float = quantity("deg", 0.0, low=0, high=270)


def _piece(row, where):
    given = from_table(_Given, row, where)
    refuse_unknown(row, PIECE_KEYS[given.kind], where)
    curvature, twist = (given.curvature, given.twist) if given.kind != HELICAL else _helix(given, where)
    return Piece(given.kind, given.length, twist, curvature, given.roll)


def _helix(given, where):
    """Frenet curvature and torsion from either pair of givens, (None, None) without."""
    cylinder, frenet = (given.cylinder_curvature, given.pitch), (given.curvature, given.torsion)
    if cylinder == (None, None) and (None not in frenet or frenet == cylinder):
        return frenet
    if frenet == (None, None) and None not in cylinder:
        return helix_frenet(*cylinder)
    raise InputError(
        f"{where}: a helix is given by cylinder_curvature_per_m and pitch_mm, or by curvature_per_m and"
        " torsion_rad_per_m (Frenet), or not at all"
    )


def _base(table, where):
    """(direction, width) unit vectors or None."""
    refuse_unknown(table, ("direction", "width_direction"), where)
    direction, width = (_unit_vector(table, key, where) for key in ("direction", "width_direction"))
    if width is None:
        return direction, None
    if direction is None:
        raise InputError(f"{where}: 'width_direction' needs 'direction' too")
    if abs(direction @ width) > 1e-3:
        raise InputError(f"{where}: 'width_direction' must be perpendicular to 'direction'")
    width = width - (width @ direction) * direction
    return direction, width / np.linalg.norm(width)


def _unit_vector(table, key, where):
    if key not in table:
        return None
    vector = _array([table[key]], key, where, 2)[0]
    if vector.shape != (3,) or not 0 < np.linalg.norm(vector) < np.inf:
        raise InputError(f"{where}: '{key}' must be three numbers, not all 0")
    return vector / np.linalg.norm(vector)


def _start(table, where):
    refuse_unknown(table, START_KEYS, where)
    return {START_KEYS[key]: float(number(value, key, where)) for key, value in table.items()}


def _vary(table, where):
    refuse_unknown(table, VARY_KEYS, where)
    return {VARY_KEYS[key]: _range(value, key, where) for key, value in table.items()}
