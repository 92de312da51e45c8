"""containers/compare.py: what the image test says of two results."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

COMPARE = Path(__file__).parents[2] / "containers" / "compare.py"
ONE = {"tip_mm": [1.0, 2.0], "steps": [{"load": 3.0}], "zero": 0.0, "ranks": 2}


@pytest.mark.parametrize(
    ("two", "code", "named"),
    [
        (ONE | {"tip_mm": [1.0, 2.000001], "zero": 1e-15}, 0, "0 of 5"),
        (ONE | {"tip_mm": [1.0, 2.001]}, 1, "tip_mm[1]"),
        (ONE | {"steps": [{"load": -3.0}]}, 1, "steps[0].load"),
        ({"tip_mm": [1.0, 2.0]}, 1, "ranks: only in one"),
        (ONE | {"zero": float("nan")}, 1, "zero"),
    ],
)
def test_differences_are_named(tmp_path, two, code, named):
    paths = [tmp_path / "one.json", tmp_path / "two.json"]
    for path, value in zip(paths, (ONE, two), strict=True):
        path.write_text(json.dumps(value))
    done = subprocess.run([sys.executable, COMPARE, *paths, "--rtol", "1e-6"], capture_output=True, text=True)
    assert done.returncode == code, done.stdout + done.stderr
    assert named in done.stdout
