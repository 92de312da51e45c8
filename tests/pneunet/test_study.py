"""`pneunet study` with real finite elements, as a user starts it."""

import csv
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CELLS = """kind = "cell"
levels = 2
[base]
pressure_kPa = 10
mesh_size_mm = 3
[base.material]
mu_MPa = 0.3
[base.segment]
kind = "one-sided"
[grid]
angle_deg = [60, 90]
side_wall_mm = [1, 7]
"""
SEGMENTS = """kind = "segment"
levels = 1
[base]
pressure_kPa = 5
mesh_size_mm = 5
material.mu_MPa = 0.3
[base.segment]
kind = "one-sided"
angle_deg = 90
chambers = 2
[[case]]
[[case]]
mu_MPa = 0.001
chambers = 1
"""


def command(ranks, file, output):
    line = [sys.executable, "-m", "pneunet", "study", str(file), "-o", str(output)]
    return line if ranks == 1 else [sys.executable, "-m", "pneunet", "run", "-n", str(ranks), "--", *line]


def study(ranks, file, output):
    """(standard output, rows of study.csv) of a study that must end well."""
    done = subprocess.run(command(ranks, file, output), capture_output=True, text=True, timeout=200, cwd=ROOT)
    assert done.returncode == 0 and "Warning" not in done.stderr, done.stderr
    with open(output / "study.csv", newline="") as stream:
        return done.stdout, list(csv.DictReader(stream))


def numbers(rows, column):
    return [float(row[column]) for row in rows if row["status"] == "done"]


@pytest.fixture
def file(tmp_path):
    (tmp_path / "study.toml").write_text(CELLS)
    return tmp_path / "study.toml"


def test_cells_on_ranks_and_a_killed_study_goes_on(tmp_path, file):
    """On three ranks, killed after its first case; then on two; then there is nothing left to do for one."""
    process = subprocess.Popen(
        command(3, file, tmp_path / "out"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT
    )
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("out/cases/*/record.json")) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.kill()
    process.wait()
    text, rows = study(2, file, tmp_path / "out")
    assert (
        "4 cell cases over angle_deg, side_wall_mm; 1 at once" in text and "of 2 cases are finished" in text
    )
    assert [(row["angle_deg"], row["side_wall_mm"], row["status"], row["pressure_kPa"]) for row in rows] == [
        *(("60", "1", "done", p) for p in ("0", "5", "10")),
        ("60", "7", "refused", ""),
        *(("90", "1", "done", p) for p in ("0", "5", "10")),
        ("90", "7", "refused", ""),
    ]
    slanted, straight = rows[2], rows[6]
    assert float(slanted["k1_rad_per_mm"]) > 3e-3 > 1e-3 > abs(float(straight["k1_rad_per_mm"]))
    assert float(straight["k2_per_mm"]) > 3e-3 and float(straight["largest_stretch"]) > 1.05
    assert int(straight["steps"]) >= 2 and int(straight["factorisations"]) >= 1
    assert (tmp_path / "out" / "study.png").stat().st_size > 10_000
    text, again = study(1, file, tmp_path / "out")
    assert again == rows and "2 of 2 cases are finished" in text and "ETA" not in text
    # the same numbers as the plain command's, from the file that the case left
    case = tmp_path / "out" / "cases" / slanted["case"]
    shutil.copy(case / "cell.toml", tmp_path)
    subprocess.run(
        [sys.executable, "-m", "pneunet", "cell", str(tmp_path / "cell.toml")],
        check=True,
        capture_output=True,
        cwd=ROOT,
    )
    with open(tmp_path / "cell" / "cell.csv", newline="") as stream:
        last = list(csv.DictReader(stream))[-1]
    for column in ("k1_rad_per_mm", "k2_per_mm", "volume_mm3", "largest_stretch"):
        assert float(last[column]) == pytest.approx(float(slanted[column]), rel=1e-8)


def test_segments_one_of_which_cannot_reach_its_pressure(tmp_path, file):
    file.write_text(SEGMENTS)
    text, rows = study(3, file, tmp_path / "out")
    good, stopped = ([row for row in rows if row["status"] == status] for status in ("done", "stopped"))
    assert numbers(good, "pressure_kPa") == [0, 5] and float(good[1]["tip_z_mm"]) < -0.1
    assert 0 < float(good[1]["smallest_wall_distance_mm"]) < 1
    assert [good[1][name] for name in ("walls_overlap", "body_overlap", "first_touch_kPa", "warnings")] == [
        "0",
        "0",
        "",
        "",
    ]
    assert {row["mu_MPa"] for row in good} == {"0.3"} and {row["mu_MPa"] for row in stopped} == {"0.001"}
    assert 0 < float(stopped[-1]["pressure_kPa"]) < 5  # how far it came
    assert (
        "was not reached" in stopped[0]["reason"]
        and f"cases/{stopped[0]['case']}/solve" in stopped[0]["reason"]
    )
    assert "1 done, 1 stopped" in text
