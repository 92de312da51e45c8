"""`Target`: what the user wants. Points in space, and what the user says about them beyond that.

docs/use-design.md shows the files; every bad input is one line that names the key and the fix.
"""

from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from base.errors import InputError
from base.files import read_csv
from base.materials import PAPER_TWISTING, NeoHookean, material_from_table
from base.strains import helix_frenet
from base.tables import file_key, number, read_toml, refuse_unknown
from base.units import MPA_PER_KPA, PER_MM_PER_M
from design.curves import arc_lengths
from geometry.parameters import Segment

TWISTING, BENDING, HELICAL = "twisting", "bending", "helical"
SHIPPED = Path(__file__).resolve().parent.parent / "examples" / "targets"
POINT_COLUMNS = ("x_mm", "y_mm", "z_mm")
FRAME_COLUMNS = ("t1x", "t1y", "t1z", "t2x", "t2y", "t2z")
LENGTH_TOLERANCE = 0.02  # the pieces' lengths may miss the curve's by this fraction
PRESSURE_LIMIT = 0.060  # MPa; beyond it silicone pneu-nets leak (Jiang et al. 2021, Sec. IV D)

#: file key -> field of Segment that the user may give a start value or let vary; kind, angle and chambers are found
START_KEYS = {file_key(f): f.name for f in fields(Segment) if f.metadata.get("unit") == "mm"}
SHARED = ("width", "channel_width", "channel_height", "cavity_floor", "end_margin")
VARY_KEYS = {"angle_deg": "angle"} | {key: name for key, name in START_KEYS.items() if name not in SHARED}


@dataclass(frozen=True)
class Piece:
    """A part of the target that one segment is to follow; lengths and rates per *deformed* length.

    length in mm; twist in rad/mm: the twist tau of a twisting piece, the torsion of a helical one; curvature in 1/mm
    (Frenet's). None = to be extracted from the points.
    """

    kind: str
    length: float
    twist: float | None = None
    curvature: float | None = None


@dataclass(frozen=True)
class Target:
    """points (n, 3) in mm from base to tip, and optionally

    frames (n, 3, 3): section frames at the points, columns t1 (along), t2 (width), t3 (height); pieces: the split;
    base_direction, base_width (3,): unit vectors that fix the base (width None = its roll stays free);
    pressure_range (low, high) in MPa, equal = fixed; material; start: {field of Segment: mm};
    vary: {field of Segment: (low, high)} or None for the default choice.
    """

    points: np.ndarray
    name: str = "target"
    frames: np.ndarray | None = None
    pieces: tuple = ()
    base_direction: np.ndarray | None = None
    base_width: np.ndarray | None = None
    pressure_range: tuple | None = None
    material: NeoHookean = PAPER_TWISTING
    start: dict = field(default_factory=dict)
    vary: dict | None = None

    def __post_init__(self):
        points = np.asarray(self.points, float)
        object.__setattr__(self, "points", points)
        check_points(points)
        if self.frames is not None:
            object.__setattr__(self, "frames", _checked_frames(np.asarray(self.frames, float), points))
        if self.pieces:
            object.__setattr__(self, "pieces", _fitted_to(self.pieces, self.length))

    @property
    def length(self):
        """Arc length of the points' polyline, mm."""
        return float(arc_lengths(self.points)[-1])

    @property
    def base_rotation(self):
        """Rotation (3, 3) of a base that is fixed altogether, else None."""
        if self.base_width is None:
            return None
        return np.column_stack([self.base_direction, self.base_width, np.cross(self.base_direction, self.base_width)])


def read_target(path):
    """The Target in a CSV of points or a TOML; InputError otherwise."""
    path = Path(path)
    if path.suffix.lower() == ".toml":
        return _from_toml(path)
    if path.suffix.lower() == ".csv":
        points, frames = _read_points(path)
        return _target(str(path), points=points, frames=frames, name=path.stem)
    if not path.exists():
        raise InputError(f"{path}: no such file")
    raise InputError(f"{path}: a target is a .csv of points in mm or a .toml")


def check_points(points):
    """InputError unless points are (n >= 4, 3), finite, without repeats and of a length that can be built."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must be rows of x, y, z in mm, not an array of shape {points.shape}")
    if len(points) < 4:
        raise InputError(f"{len(points)} points: a target needs at least 4")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(f"point {bad[0] + 1} is not finite: every coordinate must be a number")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = steps.sum()
    repeated = np.flatnonzero(steps <= 1e-9 * length)
    if len(repeated):
        raise InputError(f"points {repeated[0] + 1} and {repeated[0] + 2} are the same: remove one")
    if not 10 <= length <= 2000:
        raise InputError(f"the curve is {length:.4g} mm long, outside 10..2000 mm: are its coordinates in mm?")


def _checked_frames(frames, points):
    if frames.shape != (len(points), 3, 3):
        raise InputError(f"frames have shape {frames.shape}: {len(points)} points need ({len(points)}, 3, 3)")
    if not np.isfinite(frames).all():
        raise InputError("frames: every component must be a finite number")
    wrong = abs(np.swapaxes(frames, 1, 2) @ frames - np.eye(3)).max(axis=(1, 2)) > 1e-3
    wrong |= np.linalg.det(frames) < 0
    if wrong.any():
        raise InputError(f"frame {np.argmax(wrong) + 1} is not a right-handed set of orthogonal unit vectors t1, t2, t3")
    chords = np.diff(points, axis=0)
    if np.sum(chords * (frames[:-1, :, 0] + frames[1:, :, 0]) / 2) < 0.5 * np.linalg.norm(chords, axis=1).sum():
        raise InputError("frames: t1 does not point along the curve, from base to tip")
    return frames


def _fitted_to(pieces, length):
    """The pieces with lengths scaled to add up to the curve's; more than a rounding apart is the user's mistake."""
    total = sum(p.length for p in pieces)
    if abs(total - length) > LENGTH_TOLERANCE * length:
        raise InputError(
            f"[[piece]] length_mm: the pieces add up to {total:.4g} mm but the curve is {length:.4g} mm long (deformed lengths)"
        )
    return tuple(Piece(p.kind, p.length * length / total, p.twist, p.curvature) for p in pieces)


def _target(where, **values):
    try:
        return Target(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


# ---- CSV


def _is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _read_points(path):
    """(points (n, 3), frames (n, 3, 3) or None) of a CSV: named columns, or three bare columns of numbers."""
    first, rows = read_csv(path)
    header = [cell.strip().lstrip("\ufeff") for cell in first]
    if all(_is_number(cell) for cell in header):
        if len(header) != 3:
            raise InputError(f"{path}: a CSV without a header has 3 columns x, y, z in mm, not {len(header)}")
        header, rows, skipped = list(POINT_COLUMNS), [first, *rows], 0
    else:
        skipped = 1
        refuse_unknown(dict.fromkeys(header), [*POINT_COLUMNS, *FRAME_COLUMNS], f"{path} header")
    values = _numbers(path, header, rows, skipped)
    missing = [c for c in POINT_COLUMNS if c not in values]
    if missing:
        raise InputError(f"{path}: column '{missing[0]}' is missing")
    points = np.column_stack([values[c] for c in POINT_COLUMNS])
    return points, _frames_of(values, path) if "t1x" in values or "t2x" in values else None


def _numbers(path, header, rows, skipped):
    table = np.empty((len(rows), len(header)))
    for i, row in enumerate(rows):
        if len(row) != len(header):
            raise InputError(f"{path} row {i + 1 + skipped}: {len(row)} columns instead of {len(header)}")
        for j, cell in enumerate(row):
            if not _is_number(cell) or not np.isfinite(float(cell)):
                raise InputError(f"{path} row {i + 1 + skipped}: '{header[j]}' must be a finite number, not '{cell.strip()}'")
            table[i, j] = float(cell)
    return dict(zip(header, table.T))


def _frames_of(values, where):
    missing = [c for c in FRAME_COLUMNS if c not in values]
    if missing:
        raise InputError(f"{where}: column '{missing[0]}' is missing: frames need {', '.join(FRAME_COLUMNS)}")
    t1 = np.column_stack([values[c] for c in FRAME_COLUMNS[:3]])
    t2 = np.column_stack([values[c] for c in FRAME_COLUMNS[3:]])
    return np.stack([t1, t2, np.cross(t1, t2)], axis=2)


# ---- TOML

KEYS = ("name", "target", "points", "points_mm", "frames", "pressure_kPa", "pressure_range_kPa", "piece", "base", "material",
        "segment", "vary")  # fmt: skip


def _from_toml(path):
    table = read_toml(path)
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
        pieces=_pieces(table.get("piece", []), where),
        base_direction=direction,
        base_width=width,
        pressure_range=_pressure_range(table, where),
        material=PAPER_TWISTING if material is None else material_from_table(material, f"{where} [material]"),
        start=_start(table.get("segment", {}), f"{where} [segment]"),
        vary=_vary(table["vary"], f"{where} [vary]") if "vary" in table else None,
    )


def _on_shipped(table, path):
    """The tables of the shipped target that `target` names, with the user's own in their place where given."""
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
        raise InputError(f"{where}: give one of 'points' (a CSV file), 'points_mm' (a list of [x, y, z]) or 'target'")
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
        raise InputError(f"{where}: 'pressure_kPa' (fixed) and 'pressure_range_kPa' exclude each other: give one")
    if "pressure_kPa" in table:
        low = high = number(table["pressure_kPa"], "pressure_kPa", where)
        key = "pressure_kPa"
    elif "pressure_range_kPa" in table:
        key = "pressure_range_kPa"
        low, high = _range(table[key], key, where)
    else:
        return None
    if not 0 < low <= high <= 1e3 * PRESSURE_LIMIT:
        raise InputError(f"{where}: {key} = {table[key]} must lie in 0..{1e3 * PRESSURE_LIMIT:g} kPa (above it the chambers leak)")
    return low * MPA_PER_KPA, high * MPA_PER_KPA


def _range(value, key, where):
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where}: '{key}' must be [smallest, largest], not {value!r}")
    low, high = (number(v, key, where) for v in value)
    if low > high:
        raise InputError(f"{where}: '{key}' = {value}: the smallest comes first")
    return low, high


PIECE_KEYS = {
    TWISTING: ("kind", "length_mm", "tau_rad_per_mm"),
    BENDING: ("kind", "length_mm", "curvature_per_m"),
    HELICAL: ("kind", "length_mm", "cylinder_curvature_per_m", "pitch_mm", "curvature_per_m", "torsion_rad_per_m"),
}


def _pieces(rows, where):
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(f"{where}: pieces are written [[piece]], with double brackets")
    return tuple(_piece(row, f"{where} [[piece]] {i}") for i, row in enumerate(rows, start=1))


def _piece(row, where):
    kind = row.get("kind")
    if kind not in PIECE_KEYS:
        raise InputError(f"{where}: kind = {kind!r} is not known: write 'twisting', 'bending' or 'helical'")
    refuse_unknown(row, PIECE_KEYS[kind], where)
    if "length_mm" not in row:
        raise InputError(f"{where}: key 'length_mm' is missing (deformed length)")
    value = {key: number(v, key, where) for key, v in row.items() if key != "kind"}
    if value["length_mm"] <= 0:
        raise InputError(f"{where}: length_mm = {value['length_mm']:g} must be larger than 0")
    twist, curvature = value.get("tau_rad_per_mm"), value.get("curvature_per_m")
    curvature = None if curvature is None else curvature * PER_MM_PER_M
    if kind == HELICAL:
        curvature, twist = _helix(value, curvature, where)
    if curvature is not None and curvature <= 0:
        raise InputError(f"{where}: a curvature must be larger than 0 (its direction follows from the points)")
    return Piece(kind, float(value["length_mm"]), twist, curvature)


def _helix(value, curvature, where):
    """Frenet curvature and torsion from either pair of givens, (None, None) without."""
    cylinder, frenet = ("cylinder_curvature_per_m", "pitch_mm"), ("curvature_per_m", "torsion_rad_per_m")
    given = [key for key in cylinder + frenet if key in value]
    if not given:
        return None, None
    if set(given) == set(cylinder):
        if value[cylinder[0]] <= 0:
            raise InputError(f"{where}: cylinder_curvature_per_m = {value[cylinder[0]]:g} must be larger than 0")
        return helix_frenet(value[cylinder[0]] * PER_MM_PER_M, value["pitch_mm"])
    if set(given) == set(frenet):
        return curvature, value["torsion_rad_per_m"] * PER_MM_PER_M
    raise InputError(f"{where}: a helix is given by {' and '.join(cylinder)}, or by {' and '.join(frenet)} (Frenet), or not at all")


def _base(table, where):
    """(direction, width) unit vectors or None."""
    refuse_unknown(table, ("direction", "width_direction"), where)
    out = []
    for key in ("direction", "width_direction"):
        if key not in table:
            out.append(None)
            continue
        vector = _array([table[key]], key, where, 2)[0]
        if vector.shape != (3,) or not np.isfinite(vector).all() or not np.linalg.norm(vector) > 0:
            raise InputError(f"{where}: '{key}' must be three numbers, not all 0")
        out.append(vector / np.linalg.norm(vector))
    direction, width = out
    if width is None:
        return direction, None
    if direction is None:
        raise InputError(f"{where}: 'width_direction' needs 'direction' too")
    if abs(direction @ width) > 1e-3:
        raise InputError(f"{where}: 'width_direction' must be perpendicular to 'direction'")
    width = width - (width @ direction) * direction
    return direction, width / np.linalg.norm(width)


def _start(table, where):
    refuse_unknown(table, START_KEYS, where)
    return {START_KEYS[key]: float(number(value, key, where)) for key, value in table.items()}


def _vary(table, where):
    refuse_unknown(table, VARY_KEYS, where)
    return {VARY_KEYS[key]: _range(value, key, where) for key, value in table.items()}
