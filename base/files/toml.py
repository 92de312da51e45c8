"""Frozen dataclasses in and out of TOML, with the unit in every key.

A field declared with `quantity("mm", 10.0)` is called `width` in Python (mm, MPa, degrees) and `width_mm` in
files. Reading refuses unknown keys and wrong units in one line that names the key and the fix.
"""

import dataclasses
import difflib
import json
import math
import tomllib
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.units import TO_INTERNAL


def quantity(unit, default=dataclasses.MISSING, note=""):
    """A dataclass field that carries a unit (None for numbers without one) and a line of explanation."""
    return dataclasses.field(default=default, metadata={"unit": unit, "note": note})


def file_key(field):
    unit = field.metadata.get("unit")
    return f"{field.name}_{unit}" if unit else field.name


def read_toml(path):
    """The tables of a TOML file; a missing or broken file is an InputError."""
    path = Path(path)
    try:
        return tomllib.loads(path.read_text())
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder, give the TOML file in it") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not valid TOML ({error})") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def as_table(value, where):
    """A copy of a TOML table; InputError when something else stands in its place."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: must be a table of keys, not {value!r}")
    return dict(value)


def refuse_unknown(table, known, where):
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


def number(value, key, where, integer=False):
    """A finite number, or an InputError naming the key."""
    wanted = int if integer else (int, float)
    if isinstance(value, bool) or not isinstance(value, wanted) or not math.isfinite(value):
        kind = "a whole number" if integer else "a finite number"
        raise InputError(f"{where}: '{key}' must be {kind}, not {value!r}")
    return value


def vector(value, key, where):
    """Three finite numbers as a tuple of floats, or an InputError naming the key."""
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InputError(f"{where}: '{key}' must be three numbers, [x, y, z], not {value!r}")
    return tuple(float(number(v, key, where)) for v in value)


def from_table(cls, table, where, **preset):
    """An instance of dataclass `cls` from a TOML table; fields without `unit` metadata come in by
    `preset`."""
    fields = {file_key(f): f for f in dataclasses.fields(cls) if "unit" in f.metadata}
    refuse_unknown(table, fields, where)
    values = dict(preset)
    for key, field in fields.items():
        if key not in table:
            if field.default is dataclasses.MISSING:
                raise InputError(
                    f"{where}: key '{key}' is missing"
                    + (f" ({field.metadata['note']})" if field.metadata["note"] else "")
                )
            continue
        value = table[key]
        if field.type in (float, "float"):
            value = number(value, key, where) * TO_INTERNAL.get(field.metadata["unit"], 1.0)
        elif field.type in (int, "int"):
            value = number(value, key, where, integer=True)
        elif field.type in (tuple, "tuple"):
            value = tuple(v * TO_INTERNAL.get(field.metadata["unit"], 1.0) for v in vector(value, key, where))
        elif field.type in (str, "str") and not isinstance(value, str):
            raise InputError(f"{where}: '{key}' must be text in quotes, not {value!r}")
        values[field.name] = value
    try:
        return cls(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def to_table(instance):
    """The TOML table of a dataclass instance: every field that carries a unit, in file units.

    An infinite value means "none" or "not known" and is left out: the field's default brings it back.
    """
    table = {}
    for field in dataclasses.fields(instance):
        if "unit" not in field.metadata:
            continue
        value, factor = getattr(instance, field.name), TO_INTERNAL.get(field.metadata["unit"], 1.0)
        if isinstance(value, float):
            if math.isinf(value):
                continue
            value = _rounded(value / factor)
        elif isinstance(value, tuple):
            value = [_rounded(v / factor) for v in value]
        table[file_key(field)] = value
    return table


def _rounded(value):
    return float(f"{value:.12g}")


def _value(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's too; JSON lets the delete character stand
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)) or hasattr(value, "tolist"):
        items = value.tolist() if hasattr(value, "tolist") else value
        return (
            "[" + ", ".join(_value(v) for v in items) + "]"
            if isinstance(items, (list, tuple))
            else _value(items)
        )
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, int):
        return str(value)
    raise TypeError(f"no TOML form for {value!r}")


def toml_text(tables):
    """TOML text of nested dicts: plain values first, then [tables] and [[arrays of tables]]. Tested to read
    back."""
    lines = []

    def write(table, path):
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
