"""The chain as a user types it, in a folder of its own with spaces in its name: outputs are there and
agree."""

import csv
import json
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from pneunet.base.files.schemas import CELL as CELL_COLUMNS
from pneunet.base.files.schemas import CENTRELINE, CENTRELINES, POINT, SEGMENTS, SHAPES, STEPS
from pneunet.geometry.cad.mesh import segment_tables
from pneunet.geometry.designfile import read_design_file

PNEUNET = Path(sys.executable).with_name("pneunet")
#: 25 mm of an arc of curvature 20 1/m that bends away from the chambers' side
S = np.linspace(0, 25, 13)
ARC = np.column_stack([np.sin(0.02 * S), 0 * S, np.cos(0.02 * S) - 1]) / 0.02 + [3.0, 2.0, 1.0]
TARGET = """points = "my arc.csv"
pressure_kPa = 40.0
[segment]
width_mm = 8.0
channel_width_mm = 2.0
[base]
direction = [1.0, 0.0, 0.0]
width_direction = [0.0, 1.0, 0.0]
[[piece]]
kind = "bending"
length_mm = 25.0
"""
COMMANDS = (
    "design",
    "shape",
    "workspace",
    "mesh",
    "solve",
    "report",
    "view",
    "compare",
    "fit-material",
    "run",
    "doctor",
)


def pneunet(*arguments, cwd):
    """What the command prints; it must succeed in silence on standard error."""
    done = subprocess.run([PNEUNET, *arguments], cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    return done.stdout


def table(path, header):
    with open(path, newline="") as stream:
        first, *rows = csv.reader(stream)
    assert first == list(header)
    return np.array(rows, float)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a design in 'run 1' and its solution to 10 kPa on one rank."""
    folder = tmp_path_factory.mktemp("my work")
    np.savetxt(folder / "my arc.csv", ARC, delimiter=",", header="x_mm,y_mm,z_mm", comments="")
    (folder / "arc.toml").write_text(TARGET)
    told = pneunet("design", "arc.toml", "-o", "run 1", cwd=folder)
    assert "RMS, paired by arc length" in told and "active bounds" in told
    told = pneunet("solve", "run 1/design.toml", "--mesh-size-mm", "6", "--pressure-kPa", "10", cwd=folder)
    assert re.search(r"step +1 .* kPa .* iterations .* ETA", told) and "done: 10 kPa" in told
    return folder


@pytest.mark.parametrize("program", [[PNEUNET], [sys.executable, "-m", "pneunet"]], ids=["command", "module"])
def test_help_names_every_command(program, tmp_path):
    done = subprocess.run([*program, "--help"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0
    for command in COMMANDS:
        assert re.search(rf"^ +{command}\s", done.stdout, re.M), command


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_its_help(command, tmp_path):
    assert pneunet(command, "--help", cwd=tmp_path).startswith(f"usage: pneunet {command}")


def test_design_writes_what_it_found(folder):
    run = folder / "run 1"
    names = {"design.toml", "target.csv", "split.toml", "centreline.csv", "design.png", "run.json"}
    assert names <= {p.name for p in run.iterdir()}
    design = read_design_file(run / "design.toml")
    assert design.pressure == pytest.approx(0.040) and len(design.manipulator.segments) == 1
    assert table(run / "target.csv", POINT) == pytest.approx(ARC)
    line = table(run / "centreline.csv", CENTRELINE)
    # in the target's coordinates, from its first point on, as long as the body at rest
    assert line[0] == pytest.approx([0.0, 3.0, 2.0, 1.0], abs=1e-9)
    assert line[-1, 0] == pytest.approx(design.manipulator.length)
    error = design.result["target_error"]
    assert np.linalg.norm(line[-1, 1:] - ARC[-1]) == pytest.approx(error["tip_mm"], rel=1e-6)
    assert error["rms_percent_of_length"] < 5
    assert (run / "design.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((run / "run.json").read_text())["command"] == "pneunet design arc.toml -o run 1"


def test_design_of_a_bare_csv_says_that_its_split_is_simple(folder, tmp_path):
    told = pneunet("design", folder / "my arc.csv", cwd=tmp_path)
    assert "automatic split" in told
    design = read_design_file(tmp_path / "out" / "my arc" / "design.toml")  # where it goes without -o
    assert "automatic split" in design.result["split"]


def test_a_design_can_be_run_again_by_hand(folder, tmp_path):
    text = (folder / "run 1" / "design.toml").read_text()
    (tmp_path / "design.toml").write_text(re.sub(r"chambers = \d+", "chambers = 6", text))
    pneunet("mesh", "design.toml", "--mesh-size-mm", "6", cwd=tmp_path)
    facts = json.loads((tmp_path / "mesh" / "mesh.json").read_text())
    assert facts["segments"][0]["chambers"] == 6 and facts["cavity_closed"]


def test_shape_agrees_with_the_design(folder):
    pytest.importorskip("pyvista")
    import pyvista
    from PIL import Image

    pneunet("shape", "run 1/design.toml", "--pressure-kPa", "40,20", "-o", "shapes of it", cwd=folder)
    out = folder / "shapes of it" / "shape"
    lines = table(out / "centrelines.csv", SHAPES)
    assert sorted(set(lines[:, 0])) == [20.0, 40.0]
    designed = table(folder / "run 1" / "centreline.csv", CENTRELINE)
    assert lines[lines[:, 0] == 40.0][:, 1:] == pytest.approx(designed, abs=1e-6)
    names = {"centrelines.csv", "body_20kPa.vtp", "body_40kPa.vtp", "bodies.png", "inflation.gif", "run.json"}
    assert {p.name for p in out.iterdir()} == names
    body = pyvista.read(out / "body_40kPa.vtp")
    nearest = np.linalg.norm(body.points[:, None] - designed[None, :, 1:], axis=2).min(axis=0)
    assert nearest.max() < 6.0  # the body is around its line
    assert Image.open(out / "inflation.gif").n_frames > 10


def test_mesh_stands_beside_the_design(folder):
    out = folder / "run 1" / "mesh"  # made by solve, as `pneunet mesh` makes it
    facts = json.loads((out / "mesh.json").read_text())
    design = read_design_file(folder / "run 1" / "design.toml")
    assert facts["segments"] == segment_tables(design.manipulator) and facts["mesh_size_mm"] == 6.0
    told = pneunet("mesh", "run 1/design.toml", "--mesh-size-mm", "6", "-o", "a mesh", cwd=folder)
    again = json.loads((folder / "a mesh" / "mesh" / "mesh.json").read_text())
    assert facts.pop("seconds") and again.pop("seconds") and facts == again
    assert f"cavity {facts['cavity_mm3']:.1f} mm3" in told and "cavity closed" in told
    assert {p.name for p in out.iterdir()} == {
        "manipulator.npz",
        "manipulator.msh",
        "manipulator.step",
        "mesh.json",
    }


def test_tables_of_a_solve_agree_with_each_other(folder):
    out = folder / "run 1" / "solve"
    manipulator = read_design_file(folder / "run 1" / "design.toml").manipulator
    steps, lines = table(out / "steps.csv", STEPS), table(out / "centrelines.csv", CENTRELINES)
    assert steps[:, 0] == pytest.approx(np.arange(len(steps)))
    assert steps[0, 1] == 0.0 and steps[-1, 1] == pytest.approx(10.0) and (np.diff(steps[:, 1]) > 0).all()
    facts = json.loads((folder / "run 1" / "mesh" / "mesh.json").read_text())
    assert steps[0, 4] == pytest.approx(facts["cavity_mm3"], rel=1e-8) and (np.diff(steps[:, 4]) > 0).all()
    for number, pressure, tip in zip(steps[:, 0], steps[:, 1], steps[:, 5:8]):
        line = lines[lines[:, 0] == number]
        assert (line[:, 1] == pressure).all() and (np.diff(line[:, 2]) > 0).all()
        assert line[0, 2:] == pytest.approx(0.0, abs=1e-12)  # the base at the origin
        assert line[-1, 2] == pytest.approx(manipulator.length) and line[-1, 3:6] == pytest.approx(tip)
    assert steps[0, 5:8] == pytest.approx([manipulator.length, 0, 0], abs=1e-9)
    assert (steps[:, STEPS.index("unstable_directions")] == 0).all()  # stable
    assert steps[-1, 7] < -0.5  # it bends away from its chambers
    segments = table(out / "segments.csv", SEGMENTS)
    assert segments[:, 0] == pytest.approx(steps[:, 0]) and (segments[:, 2] == 1).all()
    assert segments[0, 3:9] == pytest.approx([1, 0, 0, 0, 0, 0], abs=1e-9)
    assert segments[-1, 7] > 0.001 and abs(segments[-1, [6, 8]]).max() < 0.05 * segments[-1, 7]
    with open(out / "walls.csv", newline="") as stream:
        walls = list(csv.DictReader(stream))
    assert len(walls) == manipulator.chambers - 1
    assert min(float(w["distance_mm"]) for w in walls) == pytest.approx(steps[-1, 8])
    assert steps[0, 8] == pytest.approx(manipulator.segments[0].gap)
    # nothing overlaps
    assert not steps[:, [9, 11]].any() and not lines[:, -2:].any() and not segments[:, -2:].any()


def test_record_of_a_solve_is_complete(folder):
    record = json.loads((folder / "run 1" / "solve" / "run.json").read_text())
    assert record["status"] == "reached the pressure asked for" and record["ranks"] == 1
    assert record["pressure_reached_kPa"] == record["pressure_kPa"] == pytest.approx(10.0)
    libraries = {"dolfinx", "petsc", "mumps", "gmsh", "mpi", "numpy", "scipy", "python", "pneunet"}
    assert libraries <= set(record["versions"])
    steps = table(folder / "run 1" / "solve" / "steps.csv", STEPS)
    assert [s["pressure_kPa"] for s in record["steps"]] == pytest.approx(steps[:, 1])
    assert str(folder) not in json.dumps(record)


def test_paraview_files_hold_the_fields(folder):
    pyvista = pytest.importorskip("pyvista")
    out = folder / "run 1" / "solve"
    steps = table(out / "steps.csv", STEPS)
    listed = ElementTree.parse(out / "solution.pvd").findall(".//DataSet")
    assert [float(d.get("timestep")) for d in listed] == pytest.approx(steps[:, 1])
    assert all((out / d.get("file")).is_file() for d in listed)
    assert len(list(out.glob("*.vtu"))) == len(listed)
    reader = pyvista.get_reader(out / "solution.pvd")
    reader.set_active_time_value(reader.time_values[-1])
    grid = reader.read()[0]
    assert {"displacement", "pressure", "mean_stretch"} <= set(grid.point_data)
    u, x = grid["displacement"], grid.points[:, 0]
    assert abs(u[x < 1e-6]).max() < 1e-6
    on_tip = x > x.max() - 1e-6
    assert (grid.points + u)[on_tip].mean(axis=0) == pytest.approx(steps[-1, 5:8], abs=0.3)
    assert 1.0 < grid["mean_stretch"].max() and 1.0 < steps[-1, STEPS.index("largest_stretch")]
    distance = grid["wall_distance_mm"]
    assert np.nanmin(distance) == pytest.approx(steps[-1, 8]) and 0 < np.isfinite(distance).sum() < 0.5 * len(
        distance
    )
    assert abs(grid["pressure"]).max() > 0.005
    assert grid.n_points > 0 and (grid.celltypes == pyvista.CellType.TRIQUADRATIC_HEXAHEDRON).all()
    rest = pyvista.read(out / listed[0].get("file"))
    assert abs(rest["displacement"]).max() == 0.0 and rest["mean_stretch"] == pytest.approx(1.0)


def test_two_ranks_give_the_same_result(folder):
    arguments = [
        "solve",
        "run 1/design.toml",
        "--mesh-size-mm",
        "4",
        "--pressure-kPa",
        "10",
        "-o",
        "two ranks",
    ]
    told = pneunet("run", "-n", "2", *arguments, cwd=folder)
    assert "2 ranks" in told and told.count("done: 10 kPa") == 1
    one, two = folder / "run 1" / "solve", folder / "two ranks" / "solve"
    assert {p.name for p in one.iterdir()} == {p.name for p in two.iterdir()}
    for name, header in (("steps.csv", STEPS), ("centrelines.csv", CENTRELINES), ("segments.csv", SEGMENTS)):
        a, b = (table(d / name, header) for d in (one, two))
        if name == "steps.csv":
            a, b = a[:, :-1], b[:, :-1]  # all but the seconds
        assert b == pytest.approx(a, rel=1e-6, abs=1e-6), name


def test_solve_without_fields_writes_tables_alone(folder, tmp_path):
    design = folder / "run 1" / "design.toml"
    pneunet(
        "solve",
        design,
        "--mesh-size-mm",
        "4",
        "--pressure-kPa",
        "1",
        "--no-fields",
        "-o",
        tmp_path,
        cwd=tmp_path,
    )
    names = {"steps.csv", "centrelines.csv", "segments.csv", "walls.csv", "run.json", "checkpoint.npz"}
    assert {p.name for p in (tmp_path / "solve").iterdir()} == names


def test_report_shows_target_prediction_and_solution(folder):
    pytest.importorskip("pyvista")
    told = pneunet("report", "run 1", cwd=folder)
    assert told.count("run 1/report.html") == 1
    page = re.sub(r' srcdoc="[^"]*"', "", (folder / "run 1" / "report.html").read_text())
    pictures = list((folder / "run 1" / "report").glob("*.png"))
    assert len(pictures) >= 8 and page.count("data:image/png;base64,") == len(pictures)
    assert not re.search(r"(src|href)=\"(?!data:)", page) and str(folder) not in page
    assert "was asked for less than the design pressure" in page  # 10 of 40 kPa, and it says so


def test_fit_material_as_typed(tmp_path):
    """neo-Hookean data of 0.2 MPa: nominal stress 0.2 (l - 1/l^2)."""
    l = np.linspace(1.05, 2.0, 20)
    np.savetxt(
        tmp_path / "pull.csv",
        np.column_stack([100 * (l - 1), 200 * (l - l**-2)]),
        delimiter=",",
        comments="",
        header="strain_percent,stress_kPa",
    )
    told = pneunet("fit-material", "pull.csv", "--law", "neo-hookean", cwd=tmp_path)
    assert "mu_MPa = 0.2" in told and "warning: uniaxial data alone" in told
    out = tmp_path / "out" / "fit-pull"
    assert {p.name for p in out.iterdir()} == {"material.toml", "fit.png"}
    assert (out / "material.toml").read_text().startswith('[material]\nlaw = "neo-Hookean"\nmu_MPa = 0.2\n')


CELL = """pressure_kPa = 100
levels = 200
mesh_size_mm = 6
contact = "none"
[material]
mu_MPa = 0.3
[segment]
kind = "one-sided"
angle_deg = 90
"""


def test_an_interrupted_cell_keeps_its_levels_and_says_where(tmp_path):
    (tmp_path / "c.toml").write_text(CELL)
    line, rows = [PNEUNET, "cell", "c.toml"], tmp_path / "cell" / "cell.csv"
    process = subprocess.Popen(
        line, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 200
    while not rows.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    told = process.communicate(timeout=60)[1]
    record = json.loads((tmp_path / "cell" / "run.json").read_text())
    reached = table(rows, CELL_COLUMNS)[:, CELL_COLUMNS.index("pressure_kPa")][-1]
    assert process.returncode == 130 and record["status"] == f"interrupted after {reached:.4g} kPa"
    assert told.startswith(f"pneunet: {record['status']}; ") and len(told.splitlines()) == 1
    assert not list((tmp_path / "cell").glob(".*"))
