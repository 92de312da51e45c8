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

import numpy as np
from numpy.typing import NDArray

from pneunet.base.errors import InputError, located
from pneunet.base.files.reading import LARGEST_TOML, read_bytes
from pneunet.base.quantities import LARGEST_NUMBER, quantities, rounded, shown
from pneunet.base.units import TO_INTERNAL

Instance = TypeVar("Instance")
#: levels of tables and lists; characters of a text
DEEPEST, LONGEST_TEXT = 20, 10_000


def read_toml(path: str | Path) -> dict:
    """The tables of a TOML file; a missing, broken or outlandish file is an InputError."""
    try:
        tables = tomllib.loads(read_bytes(path, LARGEST_TOML).decode("utf-8-sig"))
    except InputError:  # a ValueError too
        raise
    except RecursionError:
        raise InputError(f"{path}: not valid TOML (brackets within brackets without end)") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not valid TOML (not text in UTF-8): save it as UTF-8") from None
    except ValueError as error:  # of dates and whole numbers, too
        raise InputError(f"{path}: not valid TOML ({error})") from None
    _refuse_outlandish(tables, path)
    return tables


def _refuse_outlandish(tables, path):
    """InputError for what TOML can say and no quantity, name or path is."""
    todo = [(tables, "", 0)]
    for value, key, depth in todo:
        if depth > DEEPEST:
            raise InputError(f"{path}: '{key}' is nested more than {DEEPEST} deep")
        if isinstance(value, dict):
            todo += [(each, name, depth + 1) for name, each in value.items()]
            todo += [(name, name, depth) for name in value]
        elif isinstance(value, list):
            todo += [(each, key, depth + 1) for each in value]
        elif isinstance(value, str):
            if len(value) > LONGEST_TEXT:
                raise InputError(f"{path}: '{key[:80]}' is a text of over {LONGEST_TEXT} characters")
            if not value.replace("\n", " ").replace("\t", " ").isprintable():
                raise InputError(f"{path}: '{key[:80]}' holds control characters: write plain text")
        elif isinstance(value, (int, float)) and LARGEST_NUMBER < abs(value) < math.inf:
            raise InputError(f"{path}: '{key}' is larger than any number can be here ({LARGEST_NUMBER:g})")


def as_table(value: object, where: str) -> dict:
    """A copy of a TOML table; InputError when something else stands in its place."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: must be a table of keys, not {shown(value)}")
    return dict(value)


def refuse_unknown(table: object, known: Collection[str], where: str) -> None:
    """InputError for the first key of `table` that is not in `known`, with the nearest known one."""
    for key in as_table(table, where):
        if key in known:
            continue
        for k in known:
            if k.rsplit("_", 1)[0] == key.rsplit("_", 1)[0] or k.startswith(key + "_"):
                raise InputError(f"{where}: key '{key}' has the wrong unit: write '{k}'")
        nearness, near = max((_nearness(key, k), k) for k in known)
        hint = f"did you mean '{near}'?" if nearness >= 0.5 else f"known keys: {', '.join(sorted(known))}"
        raise InputError(f"{where}: unknown key '{key}': {hint}")


def _nearness(key, known):
    """Of two keys, 0 to 3: whole words in common count twice as much as letters."""
    own, other = set(key.split("_")), set(known.split("_"))
    words = len(own & other) / len(own | other)
    return 2 * words + difflib.SequenceMatcher(None, key, known).ratio()


def number(value: Any, key: str, where: str, integer: bool = False) -> Any:
    """A finite number, or an InputError naming the key."""
    wanted = int if integer else (int, float)
    if isinstance(value, bool) or not isinstance(value, wanted) or not math.isfinite(value):
        kind = "a whole number" if integer else "a finite number"
        raise InputError(f"{where}: '{key}' must be {kind}, not {shown(value)}")
    return value


def vector(value: object, key: str, where: str) -> tuple[float, ...]:
    """Three finite numbers as a tuple of floats, or an InputError naming the key."""
    return tuple(array(value, key, where, "three numbers, [x, y, z]", (3,)).tolist())


def array(
    value: object, key: str, where: str, form: str, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """Finite numbers in lists of this shape, None for any length; InputError naming the key and the `form`
    wanted."""

    def flat(value, sizes):
        if not sizes:
            return [float(number(value, key, where))]
        if not isinstance(value, (list, tuple)) or sizes[0] not in (None, len(value)):
            raise InputError(f"{where}: '{key}' must be {form}, not {shown(value)}")
        return [each for row in value for each in flat(row, sizes[1:])]

    lengths = [-1 if size is None else size for size in shape]
    return np.array(flat(value, shape)).reshape(lengths)


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
    if field.type == float | tuple[float, ...]:
        if not isinstance(value, list):
            return number(value, key, where) * factor
        return tuple((array(value, key, where, "numbers", (None,)) * factor).tolist())
    if field.type is tuple:
        return tuple(v * factor for v in vector(value, key, where))
    for kind, words in ((bool, "true or false"), (str, "text in quotes")):
        if field.type is kind and not isinstance(value, kind) and not field.metadata["allowed"]:
            raise InputError(f"{where}: '{key}' must be {words}, not {shown(value)}")
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
