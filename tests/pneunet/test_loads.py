"""[loads], control and [measure] of a design as `pneunet solve` takes them, on one thin-walled chamber."""

import json
import subprocess
import sys

import numpy as np
import pytest

from pneunet.base.files.atomic import read_columns
from pneunet.cli import main

BODY = """mesh_size_mm = 5
element = "tetrahedra"
[material]
mu_MPa = 0.208
[[segment]]
kind = "one-sided"
angle_deg = 90
chambers = 1
chamber_height_mm = 8
wall_mm = 0.5
top_wall_mm = 0.5
side_wall_mm = 0.5
"""
COLUMNS = [
    "pressure_kPa",
    "volume_mm3",
    "tip_x_mm",
    "tip_y_mm",
    "tip_z_mm",
    "dead_load_fraction",
    "unstable_directions",
]


def solve(folder, top, *options, tables="", exit_code=0):
    """(steps.csv of COLUMNS, run.json) of a design with these keys on top and these tables at its end."""
    folder.mkdir(exist_ok=True)
    (folder / "design.toml").write_text(top + "\n" + BODY + tables)
    assert main(["solve", str(folder / "design.toml"), "--no-fields", *options]) == exit_code
    return read_columns(folder / "solve" / "steps.csv", COLUMNS), json.loads(
        (folder / "solve" / "run.json").read_text()
    )


def test_dead_loads_come_first_then_pressure(tmp_path, capsys):
    """Weight along the target's -x is along the body's y when the base is turned about z; resumed without
    pressure, then with."""
    loads = (
        "[loads]\ngravity_m_per_s2 = [-98.1, 0, 0]\n[base]\nrotation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]\n"
    )
    hanging, record = solve(tmp_path, "pressure_kPa = 0", tables=loads)
    assert record["status"] == "reached the loads asked for" and record["loads"] == {
        "gravity_m_per_s2": [-98.1, 0.0, 0.0]
    }
    assert hanging[0, 5] == 0.0 and hanging[-1, 5] == 1.0 and (hanging[:, 0] == 0.0).all()
    moved = hanging[-1, 2:5] - hanging[0, 2:5]
    assert moved[1] > 0.02 and abs(moved[[0, 2]]).max() < 0.1 * moved[1]
    assert main(["report", str(tmp_path)]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "gravity (-98.1, 0, 0) m/s2" in page and "At 0 kPa the finite element solution" in page
    capsys.readouterr()
    both, record = solve(tmp_path, "pressure_kPa = 2", "--resume", tables=loads)
    told = capsys.readouterr().out
    assert "resumed after step" in told and "100 % of the dead loads" in told and "done: 2 kPa" in told
    assert both[: len(hanging)] == pytest.approx(hanging) and both[-1, [0, 5]] == pytest.approx([2.0, 1.0])
    assert record["stability_factorisations"] == 2  # once for either stage
    at_once, _ = solve(tmp_path, "pressure_kPa = 2", tables=loads)
    assert both == pytest.approx(at_once, rel=1e-8, abs=1e-8)


@pytest.fixture(scope="module")
def ballooned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("volume")
    return folder, *solve(folder, 'pressure_kPa = 60\ncontrol = "volume"\nvolume_factor = 8')


def test_volume_control_passes_and_names_the_limit_point(ballooned):
    _, steps, record = ballooned
    pressure, volume = steps[:, 0], steps[:, 1]
    assert (
        volume[-1] == pytest.approx(8 * volume[0])
        and record["control"] == "volume"
        and record["volume_factor"] == 8.0
    )
    [limit] = record["limit_points"]
    top = pressure.argmax()
    assert 0 < top < len(steps) - 1 and limit["kind"] == "maximum"
    assert limit["pressure_kPa"] == pytest.approx(pressure[top], rel=0.01)
    assert volume[top - 1] < limit["volume_mm3"] < volume[top + 1]
    assert steps[0, 6] == 0 and steps[-1, 6] == 1


def test_arc_length_walks_the_same_curve_and_pressure_stops_below_it(ballooned, tmp_path, capsys):
    _, steps, record = ballooned
    [limit] = record["limit_points"]
    arc, again = solve(tmp_path / "arc", 'pressure_kPa = 60\ncontrol = "arc length"\narc_length_mm = 3')
    assert arc[-1, 1] > limit["volume_mm3"] and again["limit_points"][0]["pressure_kPa"] == pytest.approx(
        limit["pressure_kPa"], rel=5e-3
    )
    inside = arc[:, 1] < steps[-1, 1]
    assert arc[inside, 0] == pytest.approx(
        np.interp(arc[inside, 1], steps[:, 1], steps[:, 0]), abs=0.03 * limit["pressure_kPa"]
    )
    capsys.readouterr()
    stopped, _ = solve(tmp_path / "pressure", "pressure_kPa = 60", exit_code=2)
    error = capsys.readouterr().err
    assert stopped[-1, 0] == pytest.approx(limit["pressure_kPa"], rel=0.01) and error.count("\n") == 1
    assert "a limit point of the load is likely" in error and 'try control = "volume"' in error


def test_a_resumed_volume_walk_ends_at_the_same_state_and_knows_its_limit_point(ballooned, tmp_path):
    folder, steps, record = ballooned
    code = """import os, sys
from pneunet.cli import main
from pneunet.hifi.runs.solve.checkpoint import Checkpoint
save = Checkpoint.accepted
def last(self, measured):
    save(self, measured)
    if measured.limit_points:
        os.kill(os.getpid(), 9)
Checkpoint.accepted = last
main(sys.argv[1:])"""
    (tmp_path / "design.toml").write_text((folder / "design.toml").read_text())
    command = ["solve", str(tmp_path / "design.toml"), "--no-fields"]
    assert (
        subprocess.run(
            [sys.executable, "-c", code, *command], stdout=subprocess.DEVNULL, timeout=100
        ).returncode
        == -9
    )
    assert len(read_columns(tmp_path / "solve" / "steps.csv", COLUMNS)) < len(steps)
    assert main([*command, "--resume"]) == 0
    assert read_columns(tmp_path / "solve" / "steps.csv", COLUMNS) == pytest.approx(steps, rel=1e-8, abs=1e-7)
    again = json.loads((tmp_path / "solve" / "run.json").read_text())
    assert again["limit_points"] == [pytest.approx(record["limit_points"][0])] and again["resumed_after_step"]


def test_what_is_measured_at_the_end_is_recorded_and_not_twice(tmp_path, capsys):
    measure = "[measure]\ntip_stiffness = true\nblocked_force = true\n"
    solve(tmp_path, "pressure_kPa = 1")
    _, record = solve(tmp_path, "pressure_kPa = 1", "--resume", tables=measure)
    assert np.shape(record["tip_stiffness"]["matrix"]) == (6, 6) and record["tip_stiffness"][
        "pressure_kPa"
    ] == pytest.approx(1.0)
    assert len(record["blocked_force"]["force_N"]) == 3 and record["blocked_force"][
        "pressure_kPa"
    ] == pytest.approx(1.0)
    assert record["status"] == "reached the pressure asked for"
    capsys.readouterr()
    solve(tmp_path, "pressure_kPa = 1", "--resume", tables=measure)
    assert "there is nothing to resume" in capsys.readouterr().out


BAD = {
    "gravity's unit": (
        "pressure_kPa = 1",
        "[loads]\ngravity = [0, 0, 1]",
        "key 'gravity' has the wrong unit: write 'gravity_m_per_s2'",
    ),
    "not a vector": (
        "pressure_kPa = 1",
        "[loads]\ntip_force_N = 3",
        "[loads]: 'tip_force_N' must be three numbers, [x, y, z], not 3",
    ),
    "not a number": (
        "pressure_kPa = 1",
        "[loads]\ntip_moment_N_mm = [0, 0, nan]",
        "[loads]: 'tip_moment_N_mm' must be a finite number",
    ),
    "nothing to do": (
        "pressure_kPa = 0",
        "[loads]\ntip_force_N = [0, 0, 0]",
        "pressure_kPa = 0 leaves nothing to solve",
    ),
    "control": (
        'pressure_kPa = 1\ncontrol = "flow"',
        "",
        "control = 'flow' is not known: write 'pressure', 'volume' or 'arc length'",
    ),
    "factor": (
        'pressure_kPa = 1\ncontrol = "volume"\nvolume_factor = 0.5',
        "",
        "volume_factor = 0.5 must lie in 1.001..100",
    ),
    "another control's key": (
        "pressure_kPa = 1\nvolume_factor = 3",
        "",
        'volume_factor goes with control = "volume"',
    ),
    "measure": (
        "pressure_kPa = 1",
        "[measure]\nblocked_force = 1",
        "[measure]: 'blocked_force' must be true or false, not 1",
    ),
    "measure what": ("pressure_kPa = 1", "[measure]\nblockedforce = true", "did you mean 'blocked_force'?"),
}


@pytest.mark.parametrize(("top", "tables", "message"), BAD.values(), ids=BAD)
def test_bad_input(tmp_path, capsys, top, tables, message):
    (tmp_path / "design.toml").write_text(top + "\n" + BODY + tables)
    assert main(["solve", str(tmp_path / "design.toml")]) == 2
    error = capsys.readouterr().err
    assert message in error and "design.toml" in error and error.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["design.toml"]


def test_a_pressure_does_not_go_with_volume_control(tmp_path, capsys):
    (tmp_path / "design.toml").write_text('pressure_kPa = 1\ncontrol = "volume"\n' + BODY)
    assert main(["solve", str(tmp_path / "design.toml"), "--pressure-kPa", "3"]) == 2
    assert '--pressure-kPa does not go with the design\'s control = "volume"' in capsys.readouterr().err
