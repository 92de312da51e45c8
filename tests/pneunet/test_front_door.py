"""The front door: one import, names that load when asked for, units in arguments, the README's five lines."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pneunet as pn
from pneunet.base.files.results import Results
from pneunet.geometry.parameters import Segment
from pneunet.reduced import choose_law
from tests.design.toy_law import ToyLaw

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples" / "designs"
FINGER = pn.Manipulator((Segment("one-sided", 90.0, 8),))


def fenced(path):
    """The first block of Python in a Markdown file."""
    return re.search(r"```python\n(.*?)```", path.read_text(), re.S).group(1)


@pytest.fixture
def curve(tmp_path):
    """A helix that one segment can follow, as a CSV in an empty folder."""
    points = pn.predict(pn.Manipulator((Segment("one-sided", 65.0, 10),)), pressure_kPa=35).points
    np.savetxt(tmp_path / "curve.csv", points, "%.4f", ",", header="x_mm,y_mm,z_mm", comments="")
    return tmp_path / "curve.csv"


def test_the_readmes_five_lines(curve, monkeypatch, capsys):
    """As they stand there, finite elements included: to a low pressure, on a coarse mesh."""
    monkeypatch.chdir(curve.parent)
    lines = fenced(ROOT / "README.md")
    assert "pn.inverse_design(target)" in lines and 'design.solve("out/mine", ranks=2)' in lines
    names = {}
    exec(lines.replace("ranks=2", "ranks=2, pressure_kPa=5, mesh_size_mm=6, fields=False"), names)
    design, solved = names["design"], names["solved"]
    assert len(names["lines"]) == 3 and design.errors.rms < 1.0 and "design curve" in repr(design).lower()
    assert solved.pressure_kPa == pytest.approx(5) and np.linalg.norm(solved.tip) > 20
    assert solved.steps["pressure_kPa"][-1] == pytest.approx(5)
    assert "step " in capsys.readouterr().out  # progress is shown
    assert (curve.parent / "out/mine/report.html").is_file()
    again = pn.read_run("out/mine")
    assert {"centreline", "solve/steps", "solve/segments"} <= set(again.tables)
    assert again["steps"]["tip_x_mm"][-1] == pytest.approx(solved.tip[0])
    read = pn.read_design("out/mine")
    assert np.allclose(read.prediction.points, design.prediction.points, atol=1e-9)
    assert read.active_bounds == design.active_bounds
    record = read.save("out/again") and pn.read_run("out/again").record
    assert all(record[key] == again.record[key] for key in ("inputs", "evaluations", "wall_seconds"))


def test_inverse_design_writes_and_prints_nothing(curve, monkeypatch, capsys, tmp_path_factory):
    empty = tmp_path_factory.mktemp("empty")
    monkeypatch.chdir(empty)
    design = pn.inverse_design(np.loadtxt(curve, delimiter=",", skiprows=1), law=ToyLaw())
    assert not list(empty.iterdir()) and capsys.readouterr() == ("", "")
    assert design.errors.rms < 1.5 and design.doubts == () and isinstance(design.active_bounds, tuple)
    assert re.fullmatch(r"<Design target: 1 segments, .* kPa; RMS .* mm \(.* %\); 0 doubts>", repr(design))
    assert "target" in design.plot().axes[0].get_legend_handles_labels()[1]


def test_importing_it_costs_nothing():
    code = "import sys, pneunet; print(sorted({n.split('.')[0] for n in sys.modules} & {'numpy', 'scipy'}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_name_is_there_and_has_a_docstring():
    for name in pn.__all__:
        assert getattr(pn, name).__doc__, name
    assert set(pn.__all__) <= set(dir(pn))
    tree = ast.parse(Path(pn.__file__).read_text())
    for_checkers = next(node for node in tree.body if isinstance(node, ast.If)).body
    places = {node.names[0].name: node.module.removeprefix("pneunet.") for node in for_checkers}
    assert places == pn._PLACES
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        pn.nonsense  # noqa: B018


def test_a_bare_number_is_no_pressure():
    """30 could be MPa: the argument's name says kPa, and must be written."""
    with pytest.raises(TypeError):
        pn.predict(FINGER, 30)
    with pytest.raises(pn.InputError, match="pressure_kPa = 30000 must lie in 0..2000 kPa"):
        pn.predict(FINGER, pressure_kPa=30_000)
    from pneunet.reduced import predict, shipped_law

    with pytest.raises(pn.InputError, match="in MPa"):
        predict(FINGER, 30, shipped_law())


def test_what_is_none_is_refused(tmp_path):
    turned_too_far = np.diag([2.0, 2, 2, 1])
    for pose in (np.eye(3), np.full((4, 4), np.nan), turned_too_far, "here"):
        with pytest.raises(pn.InputError, match=r"base_pose must be \(4, 4\): a rotation"):
            pn.predict(FINGER, pressure_kPa=20, base_pose=pose)
    for body in (FINGER.segments[0], FINGER.segments, None):
        with pytest.raises(pn.InputError, match="manipulator: write pn.Manipulator"):
            pn.predict(body, pressure_kPa=20)
    with pytest.raises(pn.InputError, match="law must be 'trained', .* a SegmentLaw, not 3"):
        pn.rod(FINGER, pressure_kPa=20, law=3)
    with pytest.raises(pn.InputError, match="loads: give what pn.loads"):
        pn.rod(FINGER, pressure_kPa=20).equilibrium([0, 0, 1])
    for target in ("curve.csv", [["a", "b", "c"]] * 5, [[0, 0, 0], [1, 2]]):
        with pytest.raises(pn.InputError, match="points must be rows of x, y, z in mm, not"):
            pn.Target(target)
    with pytest.raises(pn.InputError, match="ranks = 0 must be a whole number, at least 1"):
        pn.Design.of(FINGER, pressure_kPa=20, law=ToyLaw()).solve(tmp_path, ranks=0)


def test_a_law_asked_beyond_its_path_says_so(caplog):
    """It knows no strains there, and gives those at the path's end."""
    from pneunet.reduced import shipped_law

    pn.predict(FINGER, pressure_kPa=20)
    assert not caplog.messages
    pn.predict(FINGER, pressure_kPa=2000)
    assert any("a limit load, or no further, at" in text for text in caplog.messages)
    caplog.clear()
    law, segment = shipped_law(), FINGER.segments[0]
    ends = [law.strains(segment, P).k[1] for P in (0.5, 2.0)]
    assert ends[0] == ends[1] and len(caplog.messages) == 2
    assert all("kPa: strains are those there" in text for text in caplog.messages)


def test_results_show_themselves_in_a_line(curve, tmp_path):
    target, rod = pn.Target.read(curve), pn.rod(FINGER, pressure_kPa=20)
    design = pn.Design.of(FINGER, pressure_kPa=20, law="analytic")
    results = (target, target.curve, design, design.prediction, rod, rod.equilibrium())
    for shown in (*map(repr, results), repr(pn.read_run(design.save(tmp_path)))):
        assert "\n" not in shown and len(shown) < 160 and "array" not in shown
    assert repr(target).startswith("<Target curve: 67 points, ") and "up to 20 kPa" in repr(rod)


def test_a_table_is_called_by_its_name_where_that_is_enough(tmp_path):
    one, two, three = (np.zeros(n, [("x_mm", float)]) for n in (1, 2, 3))
    run = Results(tmp_path, {}, {"a": one, "solve/a": two, "solve/b": two, "shape/b": three, "cell/c": three})
    assert [len(run[name]) for name in ("a", "solve/a", "shape/b", "c")] == [1, 2, 3, 3]
    with pytest.raises(pn.InputError, match="table 'b' stands there 2 times: tables are solve/b, shape/b"):
        run["b"]
    with pytest.raises(pn.InputError, match="table 'd' is not there: tables are a, solve/a"):
        run["d"]


def test_a_manipulator_made_by_hand_goes_the_same_way(tmp_path):
    design = pn.Design.of(FINGER, pressure_kPa=20, name="finger")
    one, two = design.predict([10, 20])
    assert np.allclose(two.points, design.prediction.points) and not np.allclose(one.points, two.points)
    assert np.array_equal(design.predict(10).points, next(iter(design.predict(p for p in [10]))).points)
    assert design.errors is None and design.pressure_kPa == pytest.approx(20)
    assert pn.read_design(design.save(tmp_path / "a b")).manipulator == FINGER


def test_a_number_is_the_largest_of_several_pressures():
    bend = pn.segment(kind="one-sided", angle_deg=90, chambers=6)
    below = pn.segment(kind="one-sided", angle_deg=90, chambers=6, roll_deg=180, pressure_group=2)
    body = pn.Manipulator((bend.plain(15.0), bend, below))
    arm = pn.Design.of(body, pressure_kPa=(30, 20))
    lines = arm.predict([15, (30, 0)])
    expected = [pn.predict(body, pressure_kPa=p).points for p in ([15, 10], [30, 0])]
    assert all(np.array_equal(line.points, points) for line, points in zip(lines, expected))
    assert arm.pressure_kPa == pytest.approx(30) and arm.strains.k[2, 1] < 0 < arm.strains.k[1, 1]
    assert np.array_equal(pn.rod(body, pressure_kPa=[30, 0]).free().points, lines[1].points)
    for wrong in ([30, 20, 10], [30, -1], [30, "x"]):
        with pytest.raises(pn.InputError, match="pressure_kPa"):
            pn.Design.of(body, pressure_kPa=wrong)
    passive = pn.segment(kind="passive", plain_length_mm=15)
    assert passive == pn.segment(kind="one-sided", angle_deg=60, chambers=1).plain(15.0)
    for law in ("analytic", "trained"):
        with pytest.raises(pn.InputError, match="kind = 'passive'"):
            choose_law(law).strains(passive, 0.01)


def test_the_example_of_an_s_ends_parallel_to_its_base_on_the_side_it_bends_to():
    line = pn.read_design(EXAMPLES / "s_curve.toml").prediction
    assert line.poses[-1, :3, :3] == pytest.approx(np.eye(3), abs=1e-9) and line.points[-1, 2] < -10
    assert abs(line.points[:, 1]).max() < 1e-9
    two = pn.read_design(EXAMPLES / "two_groups.toml")
    assert two.content.pressure == (0.04, 0.025) and len(two.manipulator.groups) == 2


def test_file_keys_are_arguments():
    segment = pn.segment(kind="one-sided", angle_deg=60, chambers=5, material=pn.silicone("Ecoflex 00-30"))
    stiff = pn.silicone("Dragon Skin 30")
    layered = pn.segment(stiff, stiff, kind="one-sided", angle_deg=60, chambers=5, layer_thickness_mm=0.5)
    assert layered.layer_material is stiff and layered.layer_thickness == 0.5
    assert segment.angle == 60 and segment.material.mu == pytest.approx(pn.silicone("Ecoflex 00-30").mu)
    assert pn.loads(gravity_m_per_s2=[0, 0, -9.81]).gravity == (0.0, 0.0, -9810.0)
    with pytest.raises(pn.InputError, match="unknown key 'angel_deg'.*did you mean 'angle_deg'"):
        pn.segment(kind="one-sided", angel_deg=60, chambers=5)


def test_a_rod_carries_load():
    rod = pn.rod(FINGER, pressure_kPa=20)
    free = pn.predict(FINGER, pressure_kPa=20)
    assert np.allclose(rod.free().points[-1], free.points[-1], atol=1e-9)
    loaded = rod.equilibrium(pn.loads(tip_force_N=[0, 0, -0.02]))
    assert loaded.tip[2, 3] < free.points[-1, 2]


def test_the_examples_script_runs(tmp_path):
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "tour.py")], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
