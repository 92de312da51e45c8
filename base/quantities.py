"""Quantities of frozen dataclasses: declared once with their unit, file key and allowed values.

A field declared with `quantity("mm", 10.0)` is called `width` in Python (mm, MPa, degrees) and `width_mm` in
files (`base.files.toml`); a `Checked` dataclass refuses what is not allowed.
"""

import dataclasses
import functools
import math
from numbers import Real
from typing import Any

from pneunet.base.errors import InputError
from pneunet.base.units import TO_INTERNAL

#: no quantity in any unit is larger, and powers of smaller ones do not overflow
LARGEST_NUMBER = 1e30


@dataclasses.dataclass(frozen=True)
class Allowed:
    """The values that a quantity may take, in the unit of files: one of `choices` if there are any, else a
    number larger than `above` in low..high, for a vector its magnitude. hint: what is probably wrong with
    another one."""

    choices: tuple = ()
    above: float = -math.inf
    low: float = -math.inf
    high: float = math.inf
    hint: str = ""

    def __contains__(self, value: Any) -> bool:
        if self.choices:
            return isinstance(value, type(self.choices[0])) and value in self.choices
        try:
            return self.above < value and self.low <= value <= self.high
        except TypeError:
            return False

    def refusal(self, value: Any, unit: str | None = None) -> str:
        """What a value that is not allowed must be, to be read after "KEY = VALUE "."""
        if self.choices:
            return f"is not known: write {listed(self.choices)}"
        numeric = isinstance(value, Real)
        if not numeric:
            return "must be a number"
        hint = f": {self.hint}" if self.hint else ""
        if self.above > -math.inf and not value > self.above:
            return f"must be larger than {self.above:g}" + hint * (self.low == -math.inf)
        if self.high == math.inf:
            return f"must be at least {self.low:g}"
        words = f" {unit.replace('_per_', '/').replace('_', ' ')}" if unit else ""
        return f"must lie in {self.low:g}..{self.high:g}{words}{hint}"


def listed(choices: tuple) -> str:
    """'a', 'b' or 'c'."""
    *others, last = map(repr, choices)
    return f"{', '.join(others)} or {last}" if others else last


def quantity(
    unit: str | None, default: Any = dataclasses.MISSING, note: str = "", key: str = "", **allowed: Any
) -> Any:
    """A dataclass field that carries a unit (None for what has none), a line of explanation, the key it has
    in files (default: NAME_UNIT) and, as further keywords, the values `Allowed`."""
    metadata = {"unit": unit, "note": note, "key": key, "allowed": Allowed(**allowed) if allowed else None}
    return dataclasses.field(default=default, metadata=metadata)


def quantities(cls: type) -> dict[str, dataclasses.Field]:
    """{file key: field} of the fields that a dataclass declares with `quantity`, in order."""
    found = {}
    for field in dataclasses.fields(cls):
        if "unit" in field.metadata:
            unit = field.metadata["unit"]
            found[field.metadata["key"] or (f"{field.name}_{unit}" if unit else field.name)] = field
    return found


@functools.cache
def _limited(cls: Any) -> list[tuple]:
    """[(key, field, factor to the inner unit, Allowed)] of the quantities that do not take any value."""
    return [
        (key, f, TO_INTERNAL.get(f.metadata["unit"], 1.0), f.metadata["allowed"])
        for key, f in quantities(cls).items()
        if f.metadata["allowed"]
    ]


class Checked:
    """A dataclass that refuses quantities with values that are not allowed, whoever makes the instance:
    Python's callers and files are told the same."""

    def __post_init__(self) -> None:
        """InputError with key, value and fix of the first quantity whose value is not allowed.

        What is None by default need not be given.
        """
        cls: Any = type(self)
        for key, field, factor, allowed in _limited(cls):
            value = getattr(self, field.name)
            if value is None and field.default is None:
                continue
            if (
                hasattr(value, "__len__")
                and not isinstance(value, str)
                and all(isinstance(v, Real) for v in value)
            ):
                value = math.hypot(*value)
            if factor != 1.0 and isinstance(value, Real):
                value = rounded(value / factor)
            if field.type is int and isinstance(value, Real) and value % 1:
                raise InputError(f"{key} = {value:g} must be a whole number")
            if value not in allowed:
                told = f"{value:g}" if isinstance(value, float) else shown(value)
                raise InputError(f"{key} = {told} {allowed.refusal(value, field.metadata['unit'])}")


def shown(value: object) -> str:
    """A value as a message quotes it: not more of it than tells what it is."""
    text = repr(value)
    return text if len(text) <= 100 else f"{text[:80]} ..."


def rounded(value: Any) -> float:
    """To 12 digits: what a change of units adds behind them is taken off."""
    return float(f"{value:.12g}")
