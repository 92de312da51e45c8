"""Dataclasses in and out of TOML: what is written reads back, what is wrong is named with its fix."""

import tomllib
from dataclasses import dataclass

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.toml import from_table, read_toml, refuse_unknown, to_table, toml_text
from pneunet.base.materials.laws import PAPER_HELICAL, NeoHookean, material_from_table, material_to_table
from pneunet.base.quantities import Checked, quantity


@dataclass(frozen=True)
class Tube(Checked):
    angle: float = quantity("deg", note="of the fibres")
    radius: float = quantity("mm", 3.0, "inner", above=0)
    pressure: float = quantity("kPa", 0.02)
    fibres: int = quantity(None, 4)
    label: str = quantity(None, "a tube")
    law: object = None


def test_nested_tables_read_back():
    tables = {
        "name": 'a "quoted" \\ path\nand\ta tab, \x07 a bell, \x7f, \u00e4\u00f6\u03b8, \U0001f40d',
        "flag": True,
        "count": -3,
        "tiny": 1e-05,
        "huge": 1e22,
        "third": 1 / 3,
        "empty": [],
        "inner": {"words": ["a", 'b"c'], "deeper": {"x": 1.5, "rows": [{"y": 1}, {"y": 2, "z": {"w": 3.0}}]}},
        "segment": [{"kind": "one", "material": {"mu": 0.3}}, {"kind": "two"}],
        "after": {"x": 1},
    }
    assert tomllib.loads(toml_text(tables)) == tables


def test_numpy_numbers_and_arrays_are_written_as_plain_ones():
    tables = {"matrix": np.eye(2), "float": np.float64(0.1), "int": np.int64(7), "flag": np.bool_(True)}
    plain = {"matrix": [[1.0, 0.0], [0.0, 1.0]], "float": 0.1, "int": 7, "flag": True}
    assert tomllib.loads(toml_text(tables)) == plain


def test_what_has_no_toml_form_is_refused():
    with pytest.raises(TypeError, match="None"):
        toml_text({"nothing": None})


def test_dataclass_reads_back_in_internal_units():
    tube = from_table(Tube, {"radius_mm": 2, "pressure_kPa": 35.0, "angle_deg": 60}, "file", law="preset")
    assert tube == Tube(radius=2.0, pressure=0.035, angle=60.0, law="preset")
    assert to_table(tube) == {
        "radius_mm": 2.0,
        "pressure_kPa": 35.0,
        "fibres": 4,
        "label": "a tube",
        "angle_deg": 60.0,
    }
    assert from_table(Tube, to_table(tube), "file", law="preset") == tube


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"radius_cm": 2, "angle_deg": 1}, "file: key 'radius_cm' has the wrong unit: write 'radius_mm'"),
        ({"radius": 2, "angle_deg": 1}, "file: key 'radius' has the wrong unit: write 'radius_mm'"),
        ({"radios_mm": 2, "angle_deg": 1}, "file: unknown key 'radios_mm': did you mean 'radius_mm'?"),
        (
            {"zzz": 2, "angle_deg": 1},
            "file: unknown key 'zzz': known keys: angle_deg, fibres, label, pressure_kPa",
        ),
        ({"law": 2, "angle_deg": 1}, "file: unknown key 'law'"),
        ({}, "file: key 'angle_deg' is missing (of the fibres)"),
        ({"angle_deg": "60"}, "file: 'angle_deg' must be a finite number, not '60'"),
        ({"angle_deg": float("nan")}, "file: 'angle_deg' must be a finite number, not nan"),
        ({"angle_deg": True}, "file: 'angle_deg' must be a finite number, not True"),
        ({"angle_deg": 1, "fibres": 2.5}, "file: 'fibres' must be a whole number, not 2.5"),
        ({"angle_deg": 1, "label": 5}, "file: 'label' must be text in quotes, not 5"),
        ({"angle_deg": 1, "radius_mm": -1}, "file: radius_mm = -1 must be larger than 0"),
        ([1, 2], "file: must be a table of keys, not [1, 2]"),
    ],
)
def test_wrong_tables_are_named_with_their_fix(table, message):
    with pytest.raises(InputError) as error:
        from_table(Tube, table, "file")
    assert str(error.value).startswith(message)


def test_known_keys_pass():
    refuse_unknown({"a_mm": 1}, ["a_mm", "b"], "file")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"a = ", "not valid TOML"),
        (b"\xff\xfe", "not valid TOML"),
        ("folder", "is a folder"),
    ],
)
def test_unreadable_files_are_named(tmp_path, content, message):
    path = tmp_path / "file.toml"
    if content == "folder":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message) as error:
        read_toml(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_material_reads_back_with_its_law():
    table = material_to_table(PAPER_HELICAL)
    assert table["law"] == "neo-Hookean" and table["density_kg_per_m3"] == 1070.0
    assert table["mu_MPa"] == pytest.approx(0.619 / 2.98)
    back = material_from_table(table, "file")
    assert back == NeoHookean(table["mu_MPa"], name=PAPER_HELICAL.name, source=PAPER_HELICAL.source)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"mu_MPa": 317e3}, "file: mu_MPa = 317000 is outside .* is it in kPa"),
        ({"mu_MPa": 0.3, "density_kg_per_m3": -1}, "file: density_kg_per_m3 = -1 "),
        ({"mu_kPa": 317}, "file: key 'mu_kPa' has the wrong unit: write 'mu_MPa'"),
        (
            {"mu_MPa": 0.3, "law": "Fung"},
            "file: unknown law 'Fung': known laws are neo-Hookean, Mooney-Rivlin, Yeoh, Gent, Ogden",
        ),
        ({}, "file: key 'mu_MPa' is missing"),
        ({"youngs_modulus_MPa": 6500}, "file: key 'poisson_ratio' is missing"),
        (
            {"youngs_modulus_MPa": 6500, "poisson_ratio": 0.1},
            "poisson_ratio = 0.1 must lie in 0.2..0.5",
        ),
        (
            {"youngs_modulus_MPa": 6500, "poisson_ratio": 0.2, "mu_MPa": 1},
            "file: 'mu_MPa' and 'youngs_modulus_MPa' exclude each other: give one",
        ),
    ],
)
def test_wrong_materials_are_named(table, message):
    with pytest.raises(InputError, match=message):
        material_from_table(table, "file")
