"""Bad studies and cells: one line that names the key and the fix, exit code 2, and no file written."""

import pytest

from tests.pneunet.sayings import changed, refused


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    """The user's working directory."""
    monkeypatch.chdir(tmp_path)


STUDY = """kind = "cell"
levels = 1
[base]
pressure_kPa = 10
mesh_size_mm = 3
[base.material]
mu_MPa = 0.3
[base.segment]
kind = "one-sided"
angle_deg = 60
[grid]
wall_mm = [1, 1.2]
"""
STUDIES = {
    "no kind": ('kind = "cell"\n', "", "key 'kind' is missing: write 'cell', 'segment' or 'manipulator'"),
    "kind": (
        'kind = "cell"',
        'kind = "cells"',
        "kind = 'cells' is not known: write 'cell', 'segment' or 'manipulator'",
    ),
    "no base": ("[base", "[bass", "key 'base' is missing: write the body as [base], or base = \"FILE.toml\""),
    "unknown key": ("[grid]", "[gird]", "unknown key 'gird': did you mean 'grid'?"),
    "body without a key": ("pressure_kPa = 10\n", "", "key 'pressure_kPa' is missing"),
    "body's unknown key": ("pressure_kPa = 10", "pressure_kPa = 10\nmesh_mm = 3", "'mesh_mm'"),
    "nothing varied": (
        "[grid]\nwall_mm = [1, 1.2]",
        "",
        "nothing is varied: write [grid] with key = [values], or [[case]] tables",
    ),
    "unknown variable": ("wall_mm", "wal_mm", "[grid]: unknown key 'wal_mm': did you mean 'wall_mm'?"),
    "variable's unit": ("wall_mm", "wall_m", "[grid]: key 'wall_m' has the wrong unit: write 'wall_mm'"),
    "one value": ("[1, 1.2]", "1.2", "wall_mm = 1.2 must be a list of values: write wall_mm = [1.2, ...]"),
    "no value": ("[1, 1.2]", "[]", "wall_mm = [] must be a list of values"),
    "path": ("wall_mm", "segment.2.wall_mm", "'segment.2.wall_mm' leads nowhere in the body"),
    "unknown silicone": (
        "wall_mm = [1, 1.2]",
        'silicone = ["Ecoflex"]',
        "silicone = 'Ecoflex' is not in the table",
    ),
    "listed case that is no body": (
        "[grid]\nwall_mm = [1, 1.2]",
        "[[case]]\nwall_mm = 1\n[[case]]\nwall_mm = -1",
        "wall_mm = -1 must be",
    ),
    "listed twice": ("[grid]", "[[case]]\nwall_mm = 1\n[grid]", "'wall_mm' is in the list of cases too"),
    "no valid body": ("[1, 1.2]", "[-1, 0]", "wall_mm = -1 must be larger than 0"),
    "levels": ("levels = 1", "levels = 0", "levels = 0 must lie in 1..1000"),
    "limit": (
        "[grid]",
        "[limits]\nmemory_GB = 2\n[grid]",
        "[limits]: key 'memory_GB' has the wrong unit: write 'memory_MB'",
    ),
    "memory too small": (
        "[grid]",
        "[limits]\nmemory_MB = 1e-9\n[grid]",
        "[limits]: memory_MB = 1e-09 must lie in 10..1e+08 MB",
    ),
    "memory too large": ("[grid]", "[limits]\nmemory_MB = 1e13\n[grid]", "memory_MB = 1e+13 must lie in"),
    "grid too large": (
        "[1, 1.2]",
        f"{list(range(1, 1001))}\ngap_mm = {list(range(1, 1001))}",
        "1000000 cases are more than the 10000 of one study: vary less, or coarser",
    ),
    "limit's value": ("[grid]", "[limits]\ntime_s = 0\n[grid]", "time_s = 0 must be larger than 0"),
    "no segment": ("[base.segment]\n", "[[base.segmnt]]\n", "key 'segment' is missing"),
    "one by two names": (
        "wall_mm = [1, 1.2]",
        'wall_mm = [1]\n"segment.wall_mm" = [2]',
        "are the same: leave one",
    ),
    "a number alone": ("wall_mm", '"segment.1"', "'segment.1' leads nowhere in the body"),
    "two segments": ("[base.segment]", "[[base.segment]]", "a cell has one segment"),
}


@pytest.mark.parametrize(("old", "new", "message"), STUDIES.values(), ids=STUDIES)
def test_study(tmp_path, capsys, old, new, message):
    (tmp_path / "study.toml").write_text(STUDY.replace(old, new))
    assert message in refused(capsys, tmp_path, "study", "study.toml")


CELL = """pressure_kPa = 10
mesh_size_mm = 3
levels = 2
[material]
mu_MPa = 0.3
[segment]
kind = "one-sided"
angle_deg = 60
"""
CELLS = {
    "held curvature": (
        "[material]",
        "[held]\nk1_per_mm = 1e20\n[material]",
        "k1_per_mm = 1e+20 must lie in -2..2",
    ),
    "held stretch": (
        "[material]",
        "[held]\ne1 = 0\n[material]",
        "[held]: e1 = 0 must lie in 0.2..5: it is a stretch",
    ),
    "unit": ("pressure_kPa = 10", "pressure_MPa = 0.01", "write 'pressure_kPa'"),
    "no pressure": ("pressure_kPa = 10\n", "", "'pressure_kPa' is missing"),
    "control": ("levels = 2", "control = 'force'", "write 'pressure' or 'volume'"),
    "contact": ("levels = 2", "contact = 'glue'", "write 'auto', 'third-medium' or 'none'"),
    "contact and volume": (
        "levels = 2",
        "control = 'volume'\ncontact = 'third-medium'",
        "goes with control = 'pressure'",
    ),
    "levels": ("levels = 2", "levels = 2.5", "'levels' must be a whole number"),
    "mesh": ("mesh_size_mm = 3", "mesh_size_mm = 0", "mesh_size_mm = 0 must lie in 0.1..20"),
    "held": ("angle_deg = 60", "angle_deg = 60\n[held]\nk1 = 0.1", "k1_per_mm"),
    "held and volume": (
        "levels = 2",
        "control = 'volume'\n[held]\nk1_per_mm = 0.1",
        "go with control = 'pressure'",
    ),
}


@pytest.mark.parametrize(("old", "new", "message"), CELLS.values(), ids=CELLS)
def test_cell(tmp_path, capsys, old, new, message):
    text = changed(CELL, old, new)
    (tmp_path / "cell.toml").write_text(text)
    assert message in refused(capsys, tmp_path, "cell", "cell.toml")
