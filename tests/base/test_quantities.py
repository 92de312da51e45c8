"""Quantities: what a field's declaration refuses, in Python and in files alike, in one line."""

from dataclasses import dataclass

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.toml import from_table, to_table
from pneunet.base.quantities import Checked, quantities, quantity


@dataclass(frozen=True)
class Valve(Checked):
    pressure: float = quantity("kPa", 0.02, low=0, high=2000, hint="is it in Pa?")
    bore: float = quantity("mm", 1.0, above=0, low=0.05, high=50)
    turns: int = quantity(None, 2, low=1)
    lift: float = quantity("percent", 1.0, above=0, hint="it opens upwards")
    kind: str = quantity(None, "ball", choices=("ball", "needle", "gate"))
    seconds: float | None = quantity("s", None, key="time_s", above=0)
    tight: bool = quantity(None, True)
    source: str = quantity(None, "")
    maker: object = None


REFUSED = {
    "range": ({"pressure": 2.1}, "pressure_kPa = 2100 must lie in 0..2000 kPa: is it in Pa?"),
    "below": ({"pressure": -0.01}, "pressure_kPa = -10 must lie in 0..2000 kPa: is it in Pa?"),
    "not positive": ({"bore": 0.0}, "bore_mm = 0 must be larger than 0"),
    "too small": ({"bore": 0.01}, "bore_mm = 0.01 must lie in 0.05..50 mm"),
    "nan": ({"bore": float("nan")}, "bore_mm = nan must be larger than 0"),
    "text": ({"bore": "1"}, "bore_mm = '1' must be a number"),
    "count": ({"turns": 0}, "turns = 0 must be at least 1"),
    "half a count": ({"turns": 2.5}, "turns = 2.5 must be a whole number"),
    "percent": ({"lift": -0.1}, "lift_percent = -10 must be larger than 0: it opens upwards"),
    "choice": ({"kind": "cock"}, "kind = 'cock' is not known: write 'ball', 'needle' or 'gate'"),
    "no choice": ({"kind": None}, "kind = None is not known: write 'ball', 'needle' or 'gate'"),
    "key": ({"seconds": 0.0}, "time_s = 0 must be larger than 0"),
}


@pytest.mark.parametrize(("values", "message"), REFUSED.values(), ids=REFUSED)
def test_python_callers_are_refused(values, message):
    with pytest.raises(InputError) as error:
        Valve(**values)
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"pressure_kPa": 2100}, "f: pressure_kPa = 2100 must lie in 0..2000 kPa: is it in Pa?"),
        ({"kind": 3}, "f: kind = 3 is not known: write 'ball', 'needle' or 'gate'"),
        ({"tight": 1}, "f: 'tight' must be true or false, not 1"),
        ({"source": 1}, "f: 'source' must be text in quotes, not 1"),
        ({"time_s": "1"}, "f: 'time_s' must be a finite number, not '1'"),
        ({"time_min": 1}, "f: key 'time_min' has the wrong unit: write 'time_s'"),
    ],
)
def test_files_are_refused(table, message):
    with pytest.raises(InputError) as error:
        from_table(Valve, table, "f")
    assert str(error.value) == message


@pytest.mark.parametrize("pressure_kPa", [0, 0.1, 1, 35.7, 2000])
def test_bounds_belong_to_what_is_allowed_and_nothing_is_lost_on_the_way(pressure_kPa):
    valve = from_table(Valve, {"pressure_kPa": pressure_kPa, "time_s": 3, "tight": False}, "f")
    assert to_table(valve)["pressure_kPa"] == pressure_kPa and valve.seconds == 3.0
    assert from_table(Valve, to_table(valve), "f") == valve
    assert "time_s" not in to_table(Valve(lift=float("inf"))) and Valve(bore=np.float32(2), turns=np.int64(3))


def test_keys_are_in_the_order_of_the_fields():
    keys = ["pressure_kPa", "bore_mm", "turns", "lift_percent", "kind", "time_s", "tight", "source"]
    assert list(quantities(Valve)) == keys
