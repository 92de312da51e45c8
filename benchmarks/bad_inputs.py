"""Inputs that are bad for certain, made from good ones by a seed: for every door of the command line.

Each is a command and the files that differ from `good_files`; no change may leave them valid.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from benchmarks.bad_archives import changed_archive
from benchmarks.bad_arguments import changed_arguments
from benchmarks.strange_files import Content, Random, pick, strange
from pneunet.base.files.toml import toml_text


@dataclass(frozen=True)
class BadInput:
    """arguments of `pneunet`; files: those that differ from the good ones; what is wrong, for people."""

    door: str
    arguments: tuple[str, ...]
    files: dict[str, Content] = field(default_factory=dict)
    what: str = ""


MATERIAL = {"law": "neo-Hookean", "mu_MPa": 0.3, "density_kg_per_m3": 1070.0}
SEGMENT = {"kind": "one-sided", "angle_deg": 60.0, "chambers": 2, "wall_mm": 1.2, "gap_mm": 1.5}
BODY = {"pressure_kPa": 10.0, "mesh_size_mm": 3.0, "contact": "auto"}
GOOD_TABLES: dict[str, dict] = {
    "design.toml": BODY
    | {
        "schema": "pneunet-design-1",
        "name": "finger",
        "control": "pressure",
        "material": MATERIAL,
        "loads": {"gravity_m_per_s2": [0.0, 0.0, -9.81], "tip_force_N": [0.0, 0.0, 0.01]},
        "base": {
            "origin_mm": [0.0, 1.0, 2.0],
            "rotation": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        },
        "measure": {"tip_stiffness": False},
        "segment": [SEGMENT, SEGMENT | {"kind": "twisting"}],
    },
    "target.toml": {
        "points": "curve.csv",
        "pressure_range_kPa": [5.0, 40.0],
        "weights": [1.0, 1.0, 1.0, 1.0, 1.0, 0.0],
        "gravity_m_per_s2": [0.0, 0.0, -9.81],
        "casting": {
            "grid_mm": 0.1,
            "walls_mm": [1.0, 1.5],
            "allow_touch": False,
            "silicones": ["Ecoflex 00-10"],
        },
        "shape": [{"points": "curve.csv", "pressure_kPa": 20.0}],
        "base": {"direction": [1.0, 0.0, 0.0], "width_direction": [0.0, 0.0, 1.0]},
        "material": MATERIAL,
        "segment": {"width_mm": 10.0, "wall_mm": 1.2},
        "vary": {"gap_mm": [1.0, 2.0]},
        "piece": [{"kind": "bending", "length_mm": 50.3, "curvature_per_m": 4.0}],
    },
    "cell.toml": BODY
    | {
        "levels": 2,
        "control": "pressure",
        "material": MATERIAL,
        "segment": SEGMENT,
        "held": {"k1_per_mm": 0.001},
    },
    "study.toml": {
        "kind": "cell",
        "levels": 2,
        "base": BODY
        | {"material": MATERIAL, "segment": {k: v for k, v in SEGMENT.items() if k != "wall_mm"}},
        "grid": {"wall_mm": [1.0, 1.2]},
        "limits": {"time_s": 100.0, "memory_MB": 900.0},
    },
    "campaign.toml": {
        "designs": 8,
        "seed": 1,
        "levels": 2,
        "top_pressure_over_mu": 0.1,
        "kinds": ["one-sided"],
        "mesh": [{"name": "coarse", "mesh_size_mm": 3.0, "every": 1, "slopes": False}],
        "ranges": {"one-sided": {"wall_mm": [1.0, 1.5]}},
        "limits": {"time_s": 100.0},
    },
}
#: keys that a file cannot do without
NEEDED = {
    "design.toml": ("pressure_kPa", "material", "segment"),
    "target.toml": ("points",),
    "cell.toml": ("pressure_kPa", "material", "segment"),
    "study.toml": ("kind", "base", "grid"),
    "campaign.toml": (),
}
#: texts of which only some are known
CHOICES = ("kind", "law", "contact", "control", "schema")
CURVE = ["x_mm,y_mm,z_mm", *(f"{10 * i},{0.1 * i * i:.1f},0" for i in range(6))]
TENSILE = ["strain_percent,stress_MPa", *(f"{10 * i},{0.03 * i:.3f}" for i in range(30))]
TABLES_OF_NUMBERS = {"curve.csv": CURVE, "tensile.csv": TENSILE}
#: what reads a file
DOORS: dict[str, tuple[tuple[str, ...], ...]] = {
    "design.toml": (("shape",), ("mesh",), ("solve",)),
    "target.toml": (("design",),),
    "cell.toml": (("cell",),),
    "study.toml": (("study",),),
    "campaign.toml": (("campaign",), ("suggest", "--kind", "one-sided")),
    "curve.csv": (("design",),),
    "tensile.csv": (("fit-material",),),
}
LONG = 131_073


@cache
def good_files() -> dict[str, bytes]:
    """Files by name that the commands take as they are."""
    tables = {name: toml_text(table).encode() for name, table in GOOD_TABLES.items()}
    rows = {name: "\n".join(lines).encode() for name, lines in TABLES_OF_NUMBERS.items()}
    folder = {"folder/design.toml": tables["design.toml"]}
    return tables | rows | folder


def bad_inputs(number: int, seed: int = 1) -> Iterator[BadInput]:
    """`number` of them, the same for the same seed, all doors in turn."""
    random = np.random.default_rng(seed)
    makers: list[Callable[[Random], BadInput]] = [
        *(lambda r, name=name: _bad_toml(r, name) for name in GOOD_TABLES),
        *(lambda r, name=name: _bad_numbers(r, name) for name in TABLES_OF_NUMBERS),
        lambda r: _bad_archive(r, "law.npz"),
        lambda r: _bad_archive(r, "data.npz"),
        _bad_folder,
        _bad_arguments,
    ]
    for i in range(number):
        yield makers[i % len(makers)](random)


# ---- TOML

#: in the place of a number
NO_NUMBERS = (
    *("true", "[1.0, 2.0]", "{a = 1}", "nan", "inf", "-inf", "1e300", "-1e300", "1979-05-27", '""', '"1"'),
    *(
        "1" * 5000,
        "1" + "0" * 400,
        "0x" + "f" * 5000,
        "[" * 2000 + "]" * 2000,
        "1__0",
        "01",
        "1.",
        "٣",
        "--1",
    ),
    *('"\\u0000"', "[]", "[[[]]]", "1 2", "=", '"' + "x" * LONG + '"'),
)
NO_TEXTS = (
    "1",
    "true",
    "nan",
    "[]",
    '["a"]',
    "{a = 1}",
    "07:32:00",
    '"a\\u0000b"',
    '"\\u001b[2J"',
    '"x',
    "x",
)
NO_BOOLEANS = ("1", "0.5", '"true"', "True", "[true]", "yes", "nan")
NO_LISTS = (
    "1",
    '"x"',
    "true",
    "[true, true, true]",
    '["a", "b"]',
    "[nan, nan]",
    "{a = 1}",
    "[1e300, 2e300]",
    "[[]]",
)
KEYS = ("zzz", '"\\u001b[31m"', '"a b"', '""', "pressure", "x" * 5000, '"ключ"', "wall_m", "1")
PLACE = "@BAD@"


def _leaves(table: Any, path: tuple = ()) -> Iterator[tuple[tuple, Any]]:
    """(path, value) of everything in nested tables that is no table."""
    for key, value in table.items() if isinstance(table, dict) else enumerate(table):
        tables = isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict))
        if tables:
            yield from _leaves(value, (*path, key))
        else:
            yield (*path, key), value


def _copy(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _copy(each) for key, each in value.items()}
    return [_copy(each) for each in value] if isinstance(value, list) else value


def _bad_value(random: Random, key: Any, value: Any) -> str:
    if isinstance(value, bool):
        return pick(random, NO_BOOLEANS)
    if isinstance(value, (int, float)):
        return pick(random, NO_NUMBERS)
    if isinstance(value, list):
        return pick(random, NO_LISTS)
    return pick(random, (*NO_TEXTS, '"nonsense"', '""') if key in CHOICES else NO_TEXTS)


def _bad_toml(random: Random, name: str) -> BadInput:
    content, what = _changed_toml(random, name)
    arguments = list(pick(random, DOORS[name]))
    arguments.insert(1, name)
    return BadInput(name, tuple(arguments), {name: content}, what)


def _changed_toml(random: Random, name: str) -> tuple[Content, str]:
    tables, way = _copy(GOOD_TABLES[name]), random.random()
    if way < 0.55:
        path, value = pick(random, list(_leaves(tables)))
        parent = tables
        for step in path[:-1]:
            parent = parent[step]
        parent[path[-1]] = PLACE
        bad = _bad_value(random, path[-1], value)
        told = f"{'.'.join(map(str, path))} = {bad[:40]}"
        return toml_text(tables).replace(f'"{PLACE}"', bad).encode(), told
    text = toml_text(tables)
    if way < 0.7:
        key = pick(random, KEYS)
        places = [0, *(i + 1 for i, c in enumerate(text) if c == "\n" and text[i - 1] == "]")]
        at = pick(random, [p for p in places if "result" not in text[:p].rpartition("[")[2]])
        return f"{text[:at]}{key} = 1\n{text[at:]}".encode(), f"key {key[:40]}"
    if way < 0.78 and NEEDED[name]:
        key = pick(random, NEEDED[name])
        return toml_text({k: v for k, v in tables.items() if k != key}).encode(), f"no {key}"
    if way < 0.88:
        at = pick(random, [i for i, c in enumerate(text) if c == "="])
        end = pick(random, (b"", b'"', b"'''", b"[", b"\x00", b"\xff\xfe", b"= ="))
        return text[: at + 1].encode() + end, f"ends after byte {at}"
    if way < 0.92:
        return text.encode(pick(random, ("utf-16", "utf-32"))), "another encoding"
    return strange(random)


# ---- CSV

NO_CELLS = (
    *(
        "two",
        "1_0",
        "٣",
        "nan",
        "inf",
        "-inf",
        "1e999",
        "1e300",
        "0x10",
        "--5",
        "1.2.3",
        "True",
        "#REF!",
        "1e",
        "=A1",
    ),
    *('"' + "x" * LONG + '"', '"1', "\x00", "\x1b[2J", "1;2", "1 2", "5 mm", "-", "1" * 5000),
)


def _bad_numbers(random: Random, name: str) -> BadInput:
    content, what = _changed_numbers(random, TABLES_OF_NUMBERS[name])
    through = name if name == "tensile.csv" or random.random() < 0.5 else "target.toml"
    return BadInput(name, (*pick(random, DOORS[name]), through), {name: content}, what)


def _changed_numbers(random: Random, lines: list[str]) -> tuple[Content, str]:
    rows, way = [line.split(",") for line in lines], random.random()
    if way < 0.55:
        i, j = int(random.integers(2, len(rows) - 1)), int(random.integers(len(rows[0])))
        cell = rows[i][j] = pick(random, NO_CELLS)
        what = f"cell {cell[:20]!r}"
    elif way < 0.65:
        rows[0] = pick(random, (["a"] * len(rows[0]), ["x_m", *rows[0][1:]], [rows[0][0]] * len(rows[0])))
        what = f"header {rows[0]}"
    elif way < 0.72:
        rows, what = rows[:3], "two rows"
    elif way < 0.8:
        i = int(random.integers(2, len(rows)))
        rows[i], what = [*rows[i], "7", "8"], "a long row"
    elif way < 0.85:
        return "\n".join(lines).encode("utf-16-le"), "UTF-16 without a mark"
    else:
        return strange(random)
    return "\n".join(map(",".join, rows)).encode(), what


# ---- archives

OF_ARCHIVES = {
    "law.npz": (
        ("design", "target.toml", "--law", "law.npz"),
        ("shape", "design.toml", "--law", "law.npz"),
        ("report", "folder", "--law", "law.npz"),
        ("suggest", "campaign.toml", "--kind", "one-sided", "--law", "law.npz"),
    ),
    "data.npz": (("train", "data.npz"), ("campaign", "campaign.toml", "--extend", "data.npz")),
}


def _bad_archive(random: Random, name: str) -> BadInput:
    content, what = changed_archive(random, name)
    return BadInput(name, pick(random, OF_ARCHIVES[name]), {name: content}, what)


# ---- arguments


def _bad_arguments(random: Random) -> BadInput:
    line, what = changed_arguments(random)
    return BadInput("arguments", line, {}, what)


# ---- folders


def _bad_folder(random: Random) -> BadInput:
    """A folder of a design whose design.toml is bad, or none."""
    if random.random() < 0.2:
        place = pick(random, ("nowhere", "target.toml", "folder/none", "x" * 300, "/dev/null"))
        return BadInput("report", ("report", place), {}, f"folder {place[:20]}")
    content, what = _changed_toml(random, "design.toml")
    return BadInput("report", ("report", "folder"), {"folder/design.toml": content}, what)
