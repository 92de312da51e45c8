"""Reading a `Target` from a CSV of points or a TOML; docs/use-targets.md shows the files.

Every bad input is one line that names the key and the fix.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.errors import InputError, located
from pneunet.base.files.kinds import TARGET, read_tables
from pneunet.base.files.toml import as_table, from_table, number, read_toml, refuse_unknown, vector
from pneunet.base.materials.laws import PAPER_TWISTING, material_from_table
from pneunet.base.quantities import Checked, quantities, quantity, shown
from pneunet.base.strains import helix_frenet
from pneunet.base.units import KPA_PER_MPA, MPA_PER_KPA, TO_INTERNAL
from pneunet.design.target.casting import RANGES, Casting
from pneunet.design.target.points import held_base
from pneunet.design.target.shapes import TargetShape, TipPoints, guide_to
from pneunet.design.target.table import PointsTable, read_points
from pneunet.design.target.target import (
    BENDING,
    HELICAL,
    PRESSURE_LIMIT,
    Piece,
    SplitOptions,
    Target,
)
from pneunet.design.target.wrapfile import wrapped
from pneunet.geometry.parameters import MOST_GROUPS, PASSIVE, TWISTING, Segment

#: targets that come along: octopus.toml, vase.toml, ...
SHIPPED = Path(__file__).resolve().parents[1] / "data"

#: file key -> field of Segment that the user may give a start value or let vary; kind, angle and chambers are
#: found, and a bottom layer and fillets, which the law does not know, are no variables of the inverse design
START_KEYS = {
    key: f.name
    for key, f in quantities(Segment).items()
    if f.metadata["unit"] == "mm" and f.name not in ("layer_thickness", "fillet")
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
    found = read_points(path)
    given = {"points": found.points, "frames": found.frames, "weights": found.weights}
    return _target(str(path), **given, name=path.stem, source=path.name)


def _target(where, **values):
    try:
        return Target(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


#: one of these says the curve
CURVES = ("points", "points_mm", "wrap")
SHAPE_KEYS = (*CURVES, "frames", "weights", "pressure_kPa")
KEYS = (
    *("name", "target", *SHAPE_KEYS, "pressure_range_kPa", "pressure_groups", "gravity_m_per_s2"),
    *("shape", "tip_points", "piece", "base", "material", "casting", "segment", "split", "vary"),
)


def _from_toml(path):
    table = read_tables(path, TARGET)
    refuse_unknown(table, KEYS, str(path))
    folder = path.parent
    if "target" in table:
        table, folder = _on_shipped(table, path)
    where = str(path)
    shapes = _tables(table, "shape", where)
    for i, row in enumerate(shapes, start=1):
        refuse_unknown(row, SHAPE_KEYS, f"{where} [[shape]] {i}")
    if shapes and not _says_curve(table):  # the first shape is the one that is split
        first = shapes.pop(0)
        for key in sorted(first.keys() & table.keys()):
            raise InputError(f"{where}: '{key}' is given at the top and in the first [[shape]]: give it once")
        table = table | first
    tip = _tip(table, folder, where)
    base = as_table(table.get("base", {}), f"{where} [base]")
    point, (direction, width) = _base_point(base, where), _base(base, f"{where} [base]")
    pieces = _pieces(table, where)
    if _says_curve(table) or tip is None:
        if point is not None:
            raise InputError(
                f"{where} [base]: 'point_mm' goes with tip_points alone: else the curve begins there"
            )
        curve = _curve(table, folder, where)
    else:
        curve, pieces = _guide(tip, pieces, point, direction, where)
    pressure_range, pressures = _pressure(table, where)
    material = table.get("material")
    return _target(
        where,
        points=curve.points,
        frames=curve.frames,
        weights=curve.weights,
        name=str(table.get("name", path.stem)),
        source=path.name,
        pieces=pieces,
        base_direction=direction,
        base_width=width,
        pressure_range=pressure_range,
        pressures=pressures,
        groups=table.get("pressure_groups", 1),
        gravity=_gravity(table, where),
        shapes=tuple(_shape(row, folder, f"{where} [[shape]] {i}") for i, row in enumerate(shapes, start=1)),
        tip=tip,
        material=PAPER_TWISTING if material is None else material_from_table(material, f"{where} [material]"),
        casting=_casting(table.get("casting", {}), f"{where} [casting]"),
        start=_start(table.get("segment", {}), f"{where} [segment]"),
        split=from_table(SplitOptions, table.get("split", {}), f"{where} [split]"),
        vary=_vary(table["vary"], f"{where} [vary]") if "vary" in table else None,
    )


def _says_curve(table):
    return any(key in table for key in CURVES)


def _on_shipped(table, path):
    """The tables of the shipped target that `target` names, with the user's own in their place where
    given."""
    names = sorted(p.stem for p in SHIPPED.glob("*.toml"))
    if table["target"] not in names:
        known = ", ".join(names) or "none in this installation: give points instead"
        raise InputError(f"{path}: target = '{table['target']}' is not shipped: shipped are {known}")
    if _says_curve(table):
        raise InputError(f"{path}: 'target' and 'points' exclude each other: give one")
    shipped = read_toml(SHIPPED / f"{table['target']}.toml")
    own = {key: value for key, value in table.items() if key != "target"}
    if "pressure_kPa" in own or "pressure_range_kPa" in own:
        shipped = {key: value for key, value in shipped.items() if not key.startswith("pressure")}
    return shipped | own, SHIPPED


def _curve(table, folder, where):
    """The PointsTable that `points`, `points_mm` or [wrap] gives, with frames and weights from keys of their
    own."""
    if sum(key in table for key in CURVES) != 1:
        raise InputError(
            f"{where}: give one of 'points' (a CSV file), 'points_mm' (a list of [x, y, z]), [wrap],"
            " 'tip_points' or 'target'"
        )
    if "points" in table:
        if not isinstance(table["points"], str) or not table["points"]:
            raise InputError(f"{where}: 'points' names a CSV file; write a list as 'points_mm'")
        curve = read_points(folder / table["points"])
    elif "wrap" in table:
        curve = PointsTable(wrapped(table["wrap"], folder, f"{where} [wrap]"))
    else:
        curve = PointsTable(_array(table["points_mm"], "points_mm", where, 2))
    if "frames" in table:
        curve = replace(curve, frames=np.swapaxes(_array(table["frames"], "frames", where, 3), 1, 2))
    if "weights" in table:
        curve = replace(curve, weights=_array(table["weights"], "weights", where, 1))
    return curve


def _tables(table, key, where):
    """The tables of an array of tables, as a list."""
    rows = table.get(key, [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(f"{where}: {key}s are written [[{key}]], with double brackets")
    return list(rows)


def _shape(row, folder, where):
    """A [[shape]]: a curve with its pressures."""
    if "pressure_kPa" not in row:
        raise InputError(
            f"{where}: key 'pressure_kPa' is missing: at which pressure is the body to be there?"
        )
    one, several = _pressure(row, where)
    curve = _curve(row, folder, where)
    with located(where):
        return TargetShape(curve.points, several or one[:1], curve.frames, curve.weights)


def _tip(table, folder, where):
    """TipPoints of the file that `tip_points` names, None without."""
    if "tip_points" not in table:
        return None
    if not isinstance(table["tip_points"], str):
        raise InputError(
            f"{where}: 'tip_points' names a CSV file with columns pressure_kPa, x_mm, y_mm, z_mm"
        )
    file = folder / table["tip_points"]
    found = read_points(file)
    if found.pressures is None:
        raise InputError(
            f"{file}: column 'pressure_kPa' is missing: at which pressure is the tip to be there?"
        )
    with located(file):
        return TipPoints(found.points, found.pressures, found.weights)


def _guide(tip, pieces, point, direction, where):
    """(PointsTable of weights 0, pieces) for tip points alone: an arc from the base to the farthest of them,
    as long as the pieces together."""
    if direction is None:
        raise InputError(
            f"{where} [base]: key 'direction' is missing: tip_points alone need to know where to"
        )
    base = np.zeros(3) if point is None else point
    with located(where):
        points = guide_to(tip.points, base, direction)
    length = Curve(points).length
    if pieces:
        points = base + sum(p.length for p in pieces) / length * (points - base)
    else:
        pieces = (Piece(HELICAL, length),)
    return PointsTable(points, weights=np.zeros(len(points))), pieces


def _base_point(base, where):
    """The point (3,) that [base] names, taken out of it; None without."""
    given = base.pop("point_mm", None)
    return None if given is None else np.array(vector(given, "point_mm", f"{where} [base]"))


def _gravity(table, where):
    """mm/s2"""
    key = "gravity_m_per_s2"
    return tuple(TO_INTERNAL["m_per_s2"] * v for v in vector(table.get(key, (0, 0, 0)), key, where))


def _casting(table, where):
    """The Casting of [casting]."""
    table, given = as_table(table, where), {}
    for key, (name, *_) in RANGES.items():
        if key in table:
            given[name] = _range(table.pop(key), key, where)
    names = table.pop("silicones", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{where}: 'silicones' must be a list of names, not {shown(names)}")
    refuse_unknown(table, (*quantities(Casting), *RANGES, "silicones"), where)
    return from_table(Casting, table, where, silicones=tuple(names), **given)


def _array(value, key, where, dimensions):
    try:
        array = np.array(value)
        numeric = array.dtype.kind in "if" and array.ndim == dimensions
    except (ValueError, OverflowError):
        numeric = False
    if not numeric:
        shape = {1: "numbers", 2: "[x, y, z]", 3: "[t1, t2, t3] of three numbers each"}[dimensions]
        raise InputError(f"{where}: '{key}' must be a list of {shape}")
    return array.astype(float)


def _pressure(table, where):
    """((low, high) in MPa or None, pressures of groups in MPa or ())."""
    if "pressure_kPa" in table and "pressure_range_kPa" in table:
        raise InputError(
            f"{where}: 'pressure_kPa' (fixed) and 'pressure_range_kPa' exclude each other: give one"
        )
    if "pressure_range_kPa" in table:
        key = "pressure_range_kPa"
        values = _range(table[key], key, where)
    elif "pressure_kPa" in table:
        key = "pressure_kPa"
        given = table[key]
        values = tuple(number(v, key, where) for v in (given if isinstance(given, list) else [given]))
    else:
        return None, ()
    low = key == "pressure_range_kPa" and 0 in values[:1]  # a range may begin at rest
    if not values or not all(0 < v <= KPA_PER_MPA * PRESSURE_LIMIT for v in values[low:]):
        raise InputError(
            f"{where}: {key} = {table[key]} must lie in 0..{KPA_PER_MPA * PRESSURE_LIMIT:g} kPa (above it the"
            " chambers leak), and not be 0"
        )
    pressures = tuple(MPA_PER_KPA * v for v in values)
    if key == "pressure_kPa" and len(pressures) > 1:
        return None, pressures
    return (pressures[0], pressures[-1]), ()


def _range(value, key, where):
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where}: '{key}' must be [smallest, largest], not {value!r}")
    low, high = (number(v, key, where) for v in value)
    if low > high:
        raise InputError(f"{where}: '{key}' = {value}: the smallest comes first")
    return low, high


PIECE_KEYS = {
    PASSIVE: ("kind", "length_mm", "pressure_group"),
    TWISTING: ("kind", "length_mm", "pressure_group", "tau_rad_per_mm"),
    BENDING: ("kind", "length_mm", "pressure_group", "roll_deg", "curvature_per_m"),
    HELICAL: (
        "kind",
        "length_mm",
        "pressure_group",
        "roll_deg",
        "cylinder_curvature_per_m",
        "pitch_mm",
        "curvature_per_m",
        "torsion_rad_per_m",
    ),
}


def _pieces(table, where):
    rows = _tables(table, "piece", where)
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
    group: int = quantity(None, 1, key="pressure_group", low=1, high=MOST_GROUPS)


def _piece(row, where):
    given = from_table(_Given, row, where)
    refuse_unknown(row, PIECE_KEYS[given.kind], where)
    curvature, twist = (given.curvature, given.twist) if given.kind != HELICAL else _helix(given, where)
    return Piece(given.kind, given.length, twist, curvature, given.roll, given.group)


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
    names = "direction", "width_direction"
    with located(where):
        return held_base(table.get(names[0]), table.get(names[1]), names)


def _start(table, where):
    refuse_unknown(table, START_KEYS, where)
    return {START_KEYS[key]: float(number(value, key, where)) for key, value in table.items()}


def _vary(table, where):
    refuse_unknown(table, VARY_KEYS, where)
    return {VARY_KEYS[key]: _range(value, key, where) for key, value in table.items()}
