"""Bad curves, targets, designs and arguments: one line that names the key or file and the fix, exit code 2,
and no file written. (Studies and cells: test_bad_studies.py.)"""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

from pneunet.arguments import design_file, run_folder
from pneunet.cli import main
from tests.pneunet.sayings import changed, files, refused, said

PNEUNET = Path(sys.executable).with_name("pneunet")
DESIGN = """pressure_kPa = 20
mesh_size_mm = 4
[material]
mu_MPa = 0.3
[[segment]]
kind = "one-sided"
angle_deg = 60
chambers = 2
"""
CURVE = ["x_mm,y_mm,z_mm", *(f"{10 * i},{0.1 * i * i},0" for i in range(6))]
TARGET = """points = "curve.csv"
[[piece]]
kind = "bending"
length_mm = 50.3
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The user's working directory, with a good design, a good target and its curve."""
    folder = tmp_path / "a folder"
    folder.mkdir()
    monkeypatch.chdir(folder)
    (folder / "good.toml").write_text(DESIGN)
    (folder / "target.toml").write_text(TARGET)
    (folder / "curve.csv").write_text("\n".join(CURVE))
    return folder


CSV = {
    "text": (["x_mm,y_mm,z_mm", "0,0,0", "1,two,3"], "row 3: 'two' is not a finite number under 'y_mm'"),
    "NaN": ([*CURVE, "60,nan,0"], "row 8: 'nan' is not a finite number under 'y_mm'"),
    "infinite": ([*CURVE, "60,inf,0"], "row 8: 'inf' is not a finite number under 'y_mm'"),
    "an empty cell": ([*CURVE, "60,,0"], "row 8: is empty under 'y_mm'"),
    "a short row": ([*CURVE, "60,1"], "row 8: is empty under 'z_mm'"),
    "lost markers": ([*CURVE, ",,", "60,1,0"], "row 8: is empty under 'x_mm'"),
    "three points": (CURVE[:4], "3 points: a target needs at least 4"),
    "header alone": (CURVE[:1], "holds no rows of numbers"),
    "repeated points": ([*CURVE, CURVE[-1]], "points 6 and 7 are the same: remove one"),
    "metres": (["0,0,0", "0.05,0,0", "0.1,0,0", "0.15,0,0"], "are its coordinates in mm?"),
    "two columns": (["0,0", "1,0", "2,0", "3,0"], "3 columns x, y, z in mm, not 2"),
    "wrong unit": (
        changed("\n".join(CURVE), "y_mm", "y_m").split("\n"),
        "x in mm, y in m, z in mm: write all three in the same unit",
    ),
    "missing column": (["x_mm,z_mm", "0,0", "1,0"], "column 'y_mm' is missing"),
    "nothing": ([], "holds no rows of numbers"),
}


@pytest.mark.parametrize(("rows", "message"), CSV.values(), ids=CSV)
@pytest.mark.parametrize("through", ["csv", "toml"])
def test_curve(folder, capsys, rows, message, through):
    (folder / "curve.csv").write_text("\n".join(rows))
    error = refused(capsys, folder, "design", "curve.csv" if through == "csv" else "target.toml", "-o", "out")
    assert message in error and ("curve.csv" in error or "target.toml" in error)


TARGETS = {
    "curve missing": ('points = "curve.csv"', 'points = "cruve.csv"', ["cruve.csv: no such file"]),
    "no points": ('points = "curve.csv"', "", ["give one of 'points'"]),
    "unknown key": ("[[piece]]", "[[pieces]]", ["unknown key 'pieces'", "did you mean 'piece'?"]),
    "wrong unit": (
        "[[piece]]",
        "pressure_MPa = 0.04\n[[piece]]",
        ["'pressure_MPa'", "wrong unit: write 'pressure_kPa'"],
    ),
    "pressure beyond what holds": (
        "[[piece]]",
        "pressure_kPa = 80\n[[piece]]",
        ["pressure_kPa = 80", "0..60 kPa"],
    ),
    "unknown kind": (
        '"bending"',
        '"bent"',
        ["kind = 'bent'", "write 'passive', 'twisting', 'bending' or 'helical'"],
    ),
    "unit of a piece": (
        "length_mm",
        "length_m",
        ["[[piece]] 1: key 'length_m' has the wrong unit: write 'length_mm'"],
    ),
    "another kind's key": ("length_mm = 50.3", "length_mm = 50.3\npitch_mm = 2", ["unknown key 'pitch_mm'"]),
    "length missing": ("length_mm = 50.3", "", ["key 'length_mm' is missing"]),
    "lengths do not add up": ("50.3", "40", ["length_mm", "add up to 40 mm but the curve is 5"]),
    "single brackets": ("[[piece]]", "[piece]", ["[[piece]], with double brackets"]),
    "not TOML": ("[[piece]]", "[[piece]", ["not valid TOML"]),
    "side wall thicker than the body": (
        "[[piece]]",
        "[segment]\nside_wall_mm = 7\n[[piece]]",
        ["side_wall_mm = 7"],
    ),
    "negative gap": ("[[piece]]", "[segment]\ngap_mm = -1\n[[piece]]", ["gap_mm = -1 must be larger than 0"]),
    "angle out of range": (
        "[[piece]]",
        "[vary]\nangle_deg = [20, 90]\n[[piece]]",
        ["angle_deg = 20", "30..150"],
    ),
    "no room for a chamber": (
        "[[piece]]",
        "[segment]\nend_margin_mm = 30\n[[piece]]",
        ["length_mm", "too short for one"],
    ),
    "not shipped": (
        'points = "curve.csv"',
        'target = "octopuss"',
        ["target = 'octopuss'", "shipped are octopus"],
    ),
}


@pytest.mark.parametrize(("old", "new", "fragments"), TARGETS.values(), ids=TARGETS)
def test_target(folder, capsys, old, new, fragments):
    (folder / "target.toml").write_text(changed(TARGET, old, new))
    error = refused(capsys, folder, "design", "target.toml", "-o", "out")
    assert all(fragment in error for fragment in fragments), error


DESIGNS = {
    "unknown key": (
        "angle_deg",
        "angel_deg",
        "[[segment]] 1: unknown key 'angel_deg': did you mean 'angle_deg'?",
    ),
    "a word of the key": (
        "chambers = 2",
        "chambers = 2\nwall_thickness_mm = 1",
        "unknown key 'wall_thickness_mm': did you mean 'wall_mm'?",
    ),
    "known keys": ("chambers = 2", "chambers = 2\nqqq = 1", ", material, "),
    "wrong unit": (
        "pressure_kPa = 20",
        "pressure_bar = 0.2",
        "'pressure_bar' has the wrong unit: write 'pressure_kPa'",
    ),
    "side wall thicker than the body": (
        "chambers = 2",
        "chambers = 2\nside_wall_mm = 6",
        "side_wall_mm = 6: two side walls",
    ),
    "negative gap": ("chambers = 2", "chambers = 2\ngap_mm = -0.5", "gap_mm = -0.5 must be larger than 0"),
    "angle too small": ("angle_deg = 60", "angle_deg = 29", "angle_deg = 29 must lie in 30..150 deg"),
    "angle too large": ("angle_deg = 60", "angle_deg = 151", "angle_deg = 151 must lie in 30..150 deg"),
    "no chamber": ("chambers = 2", "chambers = 0", "chambers = 0 must be at least 1"),
    "half a chamber": ("chambers = 2", "chambers = 2.5", "'chambers' must be a whole number, not 2.5"),
    "not a number": ("mu_MPa = 0.3", "mu_MPa = nan", "'mu_MPa' must be a finite number, not nan"),
    "modulus in kPa": ("mu_MPa = 0.3", "mu_MPa = 3e4", "is it in kPa?"),
    "modulus of a layer": ("mu_MPa = 0.3", "mu_MPa = 317", "material: mu_MPa = 317 is outside 1e-4..100 MPa"),
    "foam": ("[material]", "[material]\nbulk_modulus_MPa = 1", "1 is less than 5 shear moduli (0.3 MPa)"),
    "density in g/cm3": (
        "[material]",
        "[material]\ndensity_kg_per_m3 = 1.07",
        "density_kg_per_m3 = 1.07 must lie in 50..25000 kg/m3: is it in g/cm3?",
    ),
    "gravity": (
        "[material]",
        "[loads]\ngravity_m_per_s2 = [0, 0, -1e20]\n[material]",
        "[loads]: gravity_m_per_s2 = 1e+20 must lie in 0..10000 m/s2",
    ),
    "tip force": (
        "[material]",
        "[loads]\ntip_force_N = [0, 0, 1e12]\n[material]",
        "[loads]: tip_force_N = 1e+12 must lie in 0..10000 N",
    ),
    "origin": (
        "[material]",
        "[base]\norigin_mm = [1e20, 0, 0]\n[material]",
        "[base]: 'origin_mm' must be numbers up to 1e+06 in size",
    ),
    "no pressure": ("pressure_kPa = 20", "pressure_kPa = 0", "pressure_kPa = 0 leaves nothing to solve"),
    "no material": ("[material]\nmu_MPa = 0.3", "", "key 'material' is missing"),
    "not TOML": ("chambers = 2", "chambers = two", "not valid TOML"),
}


@pytest.mark.parametrize(("old", "new", "message"), DESIGNS.values(), ids=DESIGNS)
@pytest.mark.parametrize("command", ["shape", "mesh", "solve"])
def test_design(folder, capsys, command, old, new, message):
    (folder / "bad.toml").write_text(changed(DESIGN, old, new))
    error = refused(capsys, folder, command, "bad.toml", "-o", "out")
    assert "bad.toml" in error and message in error
    assert not (folder / "out").exists()


def test_a_design_goes_by_its_file_or_its_folder(tmp_path):
    (tmp_path / "design.toml").write_text(DESIGN)
    for given in (tmp_path, tmp_path / "design.toml"):
        assert design_file(str(given)) == tmp_path / "design.toml"
        assert run_folder(str(given)) == tmp_path
    assert (
        design_file("other.toml") == Path("other.toml")
        and run_folder("none/design.toml").name == "design.toml"
    )


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (["design", "none.csv"], ["none.csv: no such file"]),
        (["design", "none.toml"], ["none.toml: no such file"]),
        (["design", "none.xyz"], ["none.xyz: no such file"]),
        (["design", "."], ["."]),
        (["shape", "none.toml"], ["none.toml: no such file"]),
        (["mesh", "."], [".: is a folder: give the file in it"]),
        (["solve", "none.toml"], ["none.toml: no such file"]),
        (
            ["solve", "curve.csv"],
            ["is a table, perhaps a target: run pneunet design curve.csv first"],
        ),
        (["solve", "target.toml"], ["target.toml: is a target, not a design: run pneunet design first"]),
        (["design", "good.toml"], ["good.toml: is a design, not a target: run pneunet shape, mesh or solve"]),
        (["cell", "good.toml"], ["good.toml: is a design, not a unit cell"]),
        (["study", "target.toml"], ["target.toml: is a target, not a study: run pneunet design"]),
        (["campaign", "curve.csv"], ["curve.csv: is a table, not a campaign"]),
        (["report", "none"], ["none: holds no design.toml", "pneunet design -o"]),
        (["report", "."], ["holds no design.toml"]),
        (
            ["shape", "good.toml", "--pressure-kPa", "10,ten"],
            ["--pressure-kPa: 'ten' is not a number", "10,20,30"],
        ),
        (["shape", "good.toml", "--pressure-kPa", "10,,20"], ["--pressure-kPa: '' is not a number"]),
        (["shape", "good.toml", "--pressure-kPa", "nan"], ["--pressure-kPa: 'nan' is not a number"]),
        (["shape", "good.toml", "--pressure-kPa=-5"], ["--pressure-kPa: -5 must lie in"]),
        (["shape", "good.toml", "--pressure-kPa", "0"], ["0 must lie in 0..2000 kPa, 0 left out"]),
        (["shape", ""], ["argument design: the name is empty"]),
        (["shape", "good.toml", "-o", " "], ["argument -o/--output: the name is empty"]),
        (["solve", "good.toml", "--pressure-kPa", "10,20"], ["--pressure-kPa: one number"]),
        (["solve", "good.toml", "--pressure", "10"], ["unrecognized arguments: --pressure", "--help"]),
        (["mesh", "good.toml", "--mesh-size-mm", "0"], ["--mesh-size-mm: '0' must be a number in 0.1..20"]),
        (
            ["mesh", "good.toml", "--mesh-size-mm", "fine"],
            ["--mesh-size-mm: 'fine' must be a number in 0.1..20"],
        ),
        (["mesh", "good.toml", "--mesh-size-mm", "0.1"], ["mesh_size_mm = 0.1", "choose a coarser mesh"]),
        (["mesh", "good.toml", "-o", "curve.csv"], ["curve.csv/mesh: cannot be written to", "-o"]),
        (["design", "target.toml", "-o", "curve.csv"], ["curve.csv: cannot be written to", "-o"]),
        (["design", "target.toml", "-o", f"/proc/{2**22}/out"], ["out: cannot be written to (", "-o"]),
        (["fit-material", "none.csv"], ["none.csv: no such file"]),
        (["fit-material", "curve.csv"], ["curve.csv: no header with a strain"]),
        (
            ["fit-material", "curve.csv", "--law", "Fung"],
            ["--law Fung: known laws are neo-Hookean,", "or all"],
        ),
        (
            ["fit-material", "curve.csv", "--to-strain-percent", "-5"],
            ["--to-strain-percent: '-5' must be a number larger than 0"],
        ),
        (["run", "-n", "0", "solve", "good.toml"], ["-n 0: the number of ranks must be at least 1"]),
        (["run", "-n", "two", "solve", "good.toml"], ["-n", "'two'"]),
        (["run", "-n", "2"], ["no command given", "pneunet run -n 2 solve DESIGN.toml"]),
        (["desing", "target.toml"], ["'desing'", "design"]),
        (["mesh"], ["required: design", "pneunet mesh --help"]),
        ([], ["required: COMMAND", "pneunet --help"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_arguments(folder, capsys, arguments, fragments):
    error = refused(capsys, folder, *arguments)
    assert all(fragment in error for fragment in fragments), error


def test_as_typed_and_on_two_ranks(folder):
    (folder / "bad.toml").write_text(changed(DESIGN, "chambers = 2", "chambers = 0"))
    before = files(folder)
    for ranks in ([], ["run", "-n", "2"]):
        done = subprocess.run(
            [PNEUNET, *ranks, "solve", "bad.toml"], capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 2, done.stderr
        assert said(done.stderr) == ["pneunet: bad.toml [[segment]] 1: chambers = 0 must be at least 1"]
        assert done.stdout == "" and "Traceback" not in done.stderr
        assert ranks or len(done.stderr.splitlines()) == 1  # mpirun may add words of its own
    assert files(folder) == before


def test_a_folder_that_cannot_be_written_to_is_refused(folder, capsys):
    error = refused(capsys, folder, "shape", "good.toml", "-o", folder / "good.toml" / "deeper")
    assert "good.toml/deeper" in error and "choose another folder with -o" in error
    done = subprocess.run(
        [PNEUNET, "solve", "good.toml", "-o", "curve.csv"], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "curve.csv/solve: cannot be written to" in done.stderr and "-o" in done.stderr


def test_pressure_beyond_what_converges_keeps_what_did(folder):
    """A soft chamber balloons far below the pressure asked for."""
    (folder / "soft.toml").write_text(
        changed(DESIGN, "mu_MPa = 0.3", "mu_MPa = 0.05").replace("chambers = 2", "chambers = 1")
    )
    arguments = ["solve", "soft.toml", "--mesh-size-mm", "8", "--pressure-kPa", "200", "-o", "out"]
    done = subprocess.run([PNEUNET, *arguments], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr
    with open("out/solve/steps.csv", newline="") as stream:
        steps = list(csv.DictReader(stream))
    reached = float(steps[-1]["pressure_kPa"])
    assert 1 < reached < 100
    for fragment in (
        "pressure_kPa = 200 was not reached",
        f"stopped at {reached:.4g} kPa",
        "is in out/solve",
        "less pressure",
    ):
        assert fragment in done.stderr
    record = json.loads(Path("out/solve/run.json").read_text())
    assert "stopped at" in record["status"] and record["pressure_reached_kPa"] == pytest.approx(reached)
    listed = Path("out/solve/solution.pvd").read_text()
    assert listed.count("<DataSet") == len(steps) and f"step_{len(steps) - 1:04d}.vtu" in listed


def test_shapes_beyond_the_reduced_models_limit_keep_the_others(folder, capsys, monkeypatch):
    from pneunet.design import shape

    monkeypatch.setattr(shape, "_pictures", lambda *a: None)
    assert main(["shape", "good.toml", "--law", "analytic", "--pressure-kPa", "5,1900", "-o", "out"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "no shape at 1900 kPa" in error and "kept in out/shape: 5 kPa" in error
    assert (folder / "out" / "shape" / "centrelines.csv").is_file()


@pytest.mark.parametrize("command", ["design", "shape", "report"])
def test_a_law_that_is_none_is_one_line(folder, capsys, command):
    assert main([command, "good.toml", "--law", "best"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "--law best: write 'trained', 'analytic' or the .npz file" in error
