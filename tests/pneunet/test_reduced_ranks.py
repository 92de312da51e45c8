"""`pneunet workspace` and `pneunet design` on several ranks: the same as in one process."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pneunet.design.inverse_design import inverse_design
from pneunet.design.workspace import workspace
from pneunet.geometry.parameters import ONE_SIDED, TWISTING

PNEUNET = Path(sys.executable).with_name("pneunet")


def test_all_ranks_compute_the_same(tmp_path):
    (tmp_path / "small.toml").write_text("angle_step_deg = 15\npressures_kPa = [10, 20]\nshapes = 12000\n")
    command = [PNEUNET, "run", "-n", "3", "workspace", "small.toml", "--law", "trained", "-o", "three"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "shapes in" in done.stdout, done.stdout + done.stderr
    alone = workspace(tmp_path / "small.toml")
    alone.save(tmp_path / "alone")
    one, three = (np.load(tmp_path / name / "tips.npz") for name in ("alone", "three"))
    assert {*one.files} == {*three.files} and all(np.array_equal(one[n], three[n]) for n in one.files)
    assert len(alone.clouds[2].tips) > 500  # more than a rank's share
    with open(tmp_path / "three" / "reach.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 2 * 7 * 2 and {r["kind"] for r in rows} == {ONE_SIDED, TWISTING}
    bending = next(r for r in rows if r["kind"] == ONE_SIDED and r["angle_deg"] == "90")
    assert (
        float(bending["torsion_rad_per_m"]) == pytest.approx(0, abs=1e-6) and bending["tau_rad_per_mm"] == ""
    )


def test_a_design_is_the_same_on_any_ranks(tmp_path):
    (tmp_path / "vase.toml").write_text('target = "vase"\npressure_range_kPa = [5, 20]\n')
    command = [PNEUNET, "run", "-n", "3", "design", "vase.toml", "-o", "three"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stdout.count("ASSUMED silicone") == 1, done.stdout + done.stderr
    inverse_design(tmp_path / "vase.toml").save(tmp_path / "alone")
    one, three = ((tmp_path / name / "design.toml").read_text() for name in ("alone", "three"))
    assert one == three
