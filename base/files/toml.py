"""Frozen dataclasses in and out of TOML, with the unit in every key.

A field declared with `base.quantities.quantity("mm", 10.0)` is called `width` in Python (mm, MPa, degrees)
and `width_mm` in files. Reading refuses unknown keys, wrong units and values that are not allowed in one line
that names the key and the fix.
"""

import difflib
import json
import math
import tomllib
from collections.abc import Collection
from dataclasses import MISSING, Field
from pathlib import Path
from typing import Any, TypeVar

from pneunet.base.errors import InputError, located
from pneunet.base.quantities import quantities, rounded
from pneunet.base.units import TO_INTERNAL

Instance = TypeVar("Instance")


def read_toml(path: str | Path) -> dict:
    """The tables of a TOML file; a missing or broken file is an InputError."""
    path = Path(path)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder, give the TOML file in it") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not valid TOML ({error})") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def as_table(value: object, where: str) -> dict:
    """A copy of a TOML table; InputError when something else stands in its place."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: must be a table of keys, not {value!r}")
    return dict(value)


def refuse_unknown(table: object, known: Collection[str], where: str) -> None:
    """InputError for the first key of `table` that is not in `known`, with the nearest known one."""
    for key in as_table(table, where):
        if key in known:
            continue
        same_quantity = [
            k for k in known if k.rsplit("_", 1)[0] == key.rsplit("_", 1)[0] or k.startswith(key + "_")
        ]
        near = same_quantity or difflib.get_close_matches(key, known, n=1, cutoff=0.5)
        if same_quantity:
            raise InputError(f"{where}: key '{key}' has the wrong unit: write '{near[0]}'")
        hint = f"did you mean '{near[0]}'?" if near else f"known keys: {', '.join(sorted(known))}"
        raise InputError(f"{where}: unknown key '{key}': {hint}")


def number(value: Any, key: str, where: str, integer: bool = False) -> Any:
    """A finite number, or an InputError naming the key."""
    wanted = int if integer else (int, float)
    if isinstance(value, bool) or not isinstance(value, wanted) or not math.isfinite(value):
        kind = "a whole number" if integer else "a finite number"
        raise InputError(f"{where}: '{key}' must be {kind}, not {value!r}")
    return value


def vector(value: object, key: str, where: str) -> tuple[float, ...]:
    """Three finite numbers as a tuple of floats, or an InputError naming the key."""
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InputError(f"{where}: '{key}' must be three numbers, [x, y, z], not {value!r}")
    return tuple(float(number(v, key, where)) for v in value)


def from_table(cls: type[Instance], table: dict, where: str, **preset: Any) -> Instance:
    """An instance of dataclass `cls` from a TOML table; fields that are no quantities come in by `preset`.

    InputError for unknown, missing or wrong keys, and for values that `cls` refuses.
    """
    fields, values = quantities(cls), dict(preset)
    refuse_unknown(table, fields, where)
    for key, field in fields.items():
        if key in table:
            values[field.name] = _read(table[key], key, field, where)
        elif field.default is MISSING:
            note = f" ({field.metadata['note']})" if field.metadata["note"] else ""
            raise InputError(f"{where}: key '{key}' is missing{note}")
    with located(where):
        return cls(**values)


def _read(value: object, key: str, field: Field, where: str) -> Any:
    """The value of a key, checked by the type of its field and in inner units."""
    factor = TO_INTERNAL.get(field.metadata["unit"], 1.0)
    if field.type in (float, float | None):
        return number(value, key, where) * factor
    if field.type is int:
        return number(value, key, where, integer=True)
    if field.type is tuple:
        return tuple(v * factor for v in vector(value, key, where))
    for kind, words in ((bool, "true or false"), (str, "text in quotes")):
        if field.type is kind and not isinstance(value, kind) and not field.metadata["allowed"]:
            raise InputError(f"{where}: '{key}' must be {words}, not {value!r}")
    return value


def to_table(instance: Any) -> dict:
    """The TOML table of a dataclass instance: every quantity in file units.

    None or an infinite value means "none" or "not known" and is left out: the field's default brings it back.
    """
    table = {}
    for key, field in quantities(type(instance)).items():
        value, factor = getattr(instance, field.name), TO_INTERNAL.get(field.metadata["unit"], 1.0)
        if isinstance(value, float):
            value = None if math.isinf(value) else rounded(value / factor)
        elif isinstance(value, tuple):
            value = [rounded(v / factor) for v in value]
        if value is not None:
            table[key] = value
    return table


def _value(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's too; JSON lets the delete character stand
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if hasattr(value, "tolist"):  # numpy's
        return _value(value.tolist())
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, int):
        return str(value)
    raise TypeError(f"no TOML form for {value!r}")


def toml_text(tables: dict) -> str:
    """TOML text of nested dicts: plain values first, then [tables] and [[arrays of tables]]. Tested to read
    back."""
    lines = []

    def write(table: dict, path: str) -> None:
        for key, value in table.items():
            if not isinstance(value, dict) and not _is_table_array(value):
                lines.append(f"{key} = {_value(value)}")
        for key, value in table.items():
            name = f"{path}.{key}" if path else key
            if isinstance(value, dict):
                lines.extend(["", f"[{name}]"])
                write(value, name)
            elif _is_table_array(value):
                for row in value:
                    lines.extend(["", f"[[{name}]]"])
                    write(row, name)

    write(tables, "")
    return "\n".join(lines).lstrip("\n") + "\n"


def _is_table_array(value):
    return isinstance(value, (list, tuple)) and len(value) > 0 and all(isinstance(v, dict) for v in value)
