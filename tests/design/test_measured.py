"""Measured against predicted, with measurements made from exact answers: what was put in is found again."""

from dataclasses import replace

import numpy as np
import pytest

from examples.measured import arm, beam
from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_csv
from pneunet.base.materials.laws import NeoHookean
from pneunet.cli import main
from pneunet.design.design import Design
from pneunet.design.measured.comparison import compare
from pneunet.design.measured.prediction import Change
from pneunet.design.measured.registration import line_of, register, turned_about
from pneunet.design.measured.table import read_measured
from pneunet.design.report.rundata import read_design_folder
from pneunet.geometry.designfile import read_design_file
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced import AnalyticLaw
from pneunet.reduced.rod.clamp import held_lengths
from tests.design.fake_run import PLANE, make_run

MU, FACTOR = 0.2, 1.25
KPA = (0, 8, 16, 24)
POSE = se3.exp_pose([0.4, -0.7, 1.9, 120.0, -300.0, 45.0])
#: on the body at rest: two far off the axis, and the tip
PLACES = {"left": [6.0, 5.0, 2.0], "top": [20.0, 0.0, 6.0], "tip": [None, 0.0, 0.0]}


def body(mu=MU):
    material = NeoHookean(mu=mu)
    helix = Segment("one-sided", 60.0, 6, gap=1.5, material=material)
    return Manipulator((helix, Segment("one-sided", 90.0, 4, gap=1.5, material=material)))


def design(mu=MU, pressure=24.0, **keys):
    return Design.of(body(mu), pressure_kPa=pressure, law=AnalyticLaw(), **keys)


def markers(line, places):
    """Where markers are in space: section frames carry them."""
    out = []
    for x, y, z in places.values():
        s = line.s[-1] if x is None else x
        out.append((line.at([s])[0] @ [0.0, y, z, 1.0])[:3])
    return np.array(out)


def write_markers(path, true, places=PLACES, pose=POSE, unit="mm", per_unit=1.0):
    rows = []
    for p in KPA:
        moved = se3.transform(pose, markers(true.predict(float(p)), places)) / per_unit
        rows.append([float(p), *moved.ravel()])
    write_csv(path, ["pressure_kPa", *(f"{n}_{a}_{unit}" for n in places for a in "xyz")], rows)
    where = [[name, *xyz] for name, xyz in places.items() if xyz[0] is not None]
    write_csv(path.with_name("markers.csv"), ["marker", "x_mm", "y_mm", "z_mm"], where)
    return path


def test_registration_recovers_a_known_pose():
    points = np.random.default_rng(1).normal(size=(5, 3)) * [40.0, 6.0, 3.0]
    found = register(se3.transform(POSE, points), points)
    assert abs(found @ POSE - np.eye(4)).max() < 1e-9


def test_what_a_line_of_markers_leaves_open_is_the_turn_about_it():
    line = np.array([[0.0, 0, 0], [30, 0, 0], [60, 0, 0]])
    bent = np.array([[0.0, 0, 0], [29, 3, 1], [55, 12, 9]])
    pose = register(se3.transform(POSE, line), line)
    rest, moved = (se3.transform(pose @ POSE, each) for each in (line, bent))
    assert abs(rest - line).max() < 1e-9 and abs(moved - bent).max() > 1
    turned = turned_about(line_of(line), moved, bent)
    assert abs(se3.transform(turned, moved) - bent).max() < 1e-9
    # the other way round at rest, too
    assert abs(se3.transform(register(line * [-1, 1, 1], line), line * [-1, 1, 1]) - line).max() < 1e-9
    assert line_of(bent) is None


def test_a_modulus_put_in_is_found(tmp_path):
    path = write_markers(tmp_path / "m.csv", design(FACTOR * MU))
    found = compare(design(), path, markers=tmp_path / "markers.csv")
    assert abs(found.aligned.pose @ POSE - np.eye(4)).max() < 1e-9
    assert found.aligned.off < 1e-9 and found.rms > 1
    assert found.fit.change.modulus == pytest.approx(FACTOR, rel=1e-6)
    assert found.fit.rms < 1e-5 and found.fit.interval == pytest.approx((FACTOR, FACTOR), rel=1e-5)
    # every modulus times f is every pressure over f
    assert found.consequences["pressure_for_the_shape_kPa"] == pytest.approx(24 * FACTOR, rel=1e-6)
    assert found.consequences["tip_off_at_that_pressure_mm"] < 1e-4
    assert found.corrected().manipulator.segments[0].material.mu == pytest.approx(FACTOR * MU, rel=1e-6)


def test_a_design_beyond_the_limit_load_of_what_was_cast_is_compared_all_the_same(tmp_path):
    """The analytic law has no equilibrium beyond P/mu = 0.61."""
    for factor, off in ((3.5, pytest.approx(30, abs=20)), (0.4, None)):
        path = write_markers(tmp_path / "m.csv", design(factor * MU))
        found = compare(design(pressure=60.0), path, markers=tmp_path / "markers.csv")
        assert found.consequences["pressure_for_the_shape_kPa"] == pytest.approx(60 * factor, rel=1e-6)
        assert found.consequences["tip_off_at_design_pressure_mm"] == off
        assert ("no equilibrium" in found.lines()[-1]) == (off is None)


def test_its_own_prediction_is_measured_without_error(tmp_path):
    path = write_markers(tmp_path / "m.csv", design(), unit="in", per_unit=25.4)
    found = compare(design(), path, markers=tmp_path / "markers.csv")
    assert found.rms < 1e-8 and found.fit.change.modulus == pytest.approx(1, abs=1e-8)


def test_walls_put_in_are_found_beside_the_modulus(tmp_path):
    true = Design.of(Change(wall=0.1).of_body(body(1.1 * MU)), pressure_kPa=24.0, law=AnalyticLaw())
    path = write_markers(tmp_path / "m.csv", true)
    found = compare(design(), path, markers=tmp_path / "markers.csv", fit_wall=True)
    assert found.fit.change.wall == pytest.approx(0.1, abs=1e-4)
    assert found.fit.change.modulus == pytest.approx(1.1, rel=1e-4)
    assert found.corrected().manipulator.segments[0].wall == pytest.approx(1.1, abs=1e-4)


def test_a_centreline_is_turned_about_itself_and_fitted(tmp_path):
    true, rows = design(FACTOR * MU), []
    for p in KPA:
        points = se3.transform(POSE, true.predict(float(p)).points)
        rows += [[float(p), *point] for point in points]
    write_csv(tmp_path / "line.csv", ["pressure_kPa", "x_mm", "y_mm", "z_mm"], rows)
    found = compare(design(), tmp_path / "line.csv")
    assert found.measured.what == "centreline" and found.aligned.turned
    # chords of two samplings, 1 and 2 mm, are what is left
    assert found.fit.change.modulus == pytest.approx(FACTOR, rel=2e-3) and found.fit.rms < 0.01


@pytest.mark.parametrize("what", ["angle_deg", "displacement_mm", "tip"])
def test_numbers_of_the_tip_alone_are_enough(tmp_path, what):
    true, rows = design(FACTOR * MU), []
    rest = true.predict(0.0)
    for p in KPA:
        line = true.predict(float(p))
        angle = np.degrees(np.arccos(np.clip(line.poses[-1, :3, 0] @ line.poses[0, :3, 0], -1, 1)))
        moved = np.linalg.norm(line.points[-1] - rest.points[-1])
        tip = se3.transform(POSE, line.points[-1:])[0]
        rows.append([float(p), *{"angle_deg": [angle], "displacement_mm": [moved], "tip": tip}[what]])
    names = ["tip_x_mm", "tip_y_mm", "tip_z_mm"] if what == "tip" else [what]
    write_csv(tmp_path / "m.csv", ["pressure_kPa", *names], rows)
    found = compare(design(), tmp_path / "m.csv")
    assert found.fit.change.modulus == pytest.approx(FACTOR, rel=1e-5)


def test_dead_loads_are_predicted_with(tmp_path):
    """The trained law bears loads. A body that is stiffer by f is one under loads and pressures over f."""
    segment = Segment("one-sided", 90.0, 6, gap=1.5, material=NeoHookean(mu=MU))
    content = Design.of(Manipulator((segment,)), pressure_kPa=20).content
    hanging = replace(content, loads=DeadLoads(tip_force=(0.0, 0.0, 0.004)))
    write_csv(
        tmp_path / "m.csv",
        ["pressure_kPa", "tip_x_mm", "tip_y_mm", "tip_z_mm"],
        [[0, 0, 0, 0], [20, 1, 0, 0]],
    )
    rod = compare(Design(hanging), tmp_path / "m.csv", as_is=True).predicted
    half = replace(segment, material=NeoHookean(mu=MU / 2))
    softer = replace(rod, design=replace(hanging, manipulator=Manipulator((half,))))
    assert np.allclose(rod.lines(Change(modulus=0.5))[1].points, softer.lines()[1].points, atol=1e-6)
    free = replace(rod, design=content)
    assert rod.lines()[1].points[-1, 2] > free.lines()[1].points[-1, 2] + 0.1
    # the loads stay as they are: no pressure gives the shape of another modulus back
    tips = [line.points[-1] for line in softer.lines()]
    names = ["pressure_kPa", "tip_x_mm", "tip_y_mm", "tip_z_mm"]
    write_csv(tmp_path / "s.csv", names, np.column_stack([[0, 20], tips]))
    found = compare(Design(hanging), tmp_path / "s.csv", as_is=True)
    assert found.fit.change.modulus == pytest.approx(0.5, rel=0.01)
    assert "pressure_for_the_shape_kPa" not in found.consequences and "no pressure gives" in found.lines()[-1]
    assert found.corrected().pressure == hanging.pressure


def test_the_laws_bars_are_those_of_its_strains(tmp_path):
    """One bending segment: the angle's bar is the curvature's interval times the length."""
    segment = Segment("one-sided", 90.0, 6, gap=1.5, material=NeoHookean(mu=MU))
    one = Design.of(Manipulator((segment,)), pressure_kPa=20)
    write_csv(tmp_path / "m.csv", ["pressure_kPa", "angle_deg"], [[0, 0], [10, 5], [20, 10]])
    found = compare(one, tmp_path / "m.csv")
    length = segment.chambers * segment.pitch
    half = np.degrees(one.law.half_width(segment, 0.020)[4] * length)
    assert found.bars[2, 0] == pytest.approx(half, rel=0.01)
    assert found.inside is not None


def test_another_body_or_unit_is_not_taken_for_a_modulus(tmp_path):
    write_csv(tmp_path / "m.csv", ["p_kPa", "displacement_mm"], [[0, 0], [12, 0.01], [24, 0.02]])
    assert "in these units?" in compare(design(), tmp_path / "m.csv").lines()[-1]


def test_rows_of_a_ramp_become_levels_with_their_scatter(tmp_path):
    rng = np.random.default_rng(3)
    p = np.concatenate([np.full(50, -0.02), np.linspace(0.5, 30, 900)])
    tip = np.column_stack([100 - p, 0 * p, p]) + rng.normal(0, 0.05, (len(p), 3))
    rows = [[i / 120, pressure, *point] for i, (pressure, point) in enumerate(zip(p, tip))]
    rows[10][3] = ""  # a marker that was lost
    write_csv(tmp_path / "m.csv", ["Time (s)", "Pressure (kPa)", "tip X", "tip Y", "tip Z"], rows)
    found = read_measured(tmp_path / "m.csv")
    assert len(found.pressures) <= 42 and found.rows.sum() == len(p) and found.at_rest
    assert found.pressures[0] == pytest.approx(0, abs=1e-12) and found.rows[0] == 50
    assert np.allclose(found.values[:, 0, 2], 1e3 * found.pressures, atol=0.05)
    assert found.spread[0, 0] == pytest.approx(0.05 * np.sqrt(3), rel=0.2)


def test_names_of_markers_in_a_row_above_are_numbered(tmp_path):
    text = "Name,,base,base,base,tip,tip,tip\nFrame,p [bar],X,Y,Z,X,Y,Z\n,bar,m,m,m,m,m,m\n"
    text += "1,0,0,0,0,0.05,0,0\n2,0.2,0,0,0,0.04,0,0.02\n"
    (tmp_path / "m.csv").write_text(text)
    found = read_measured(tmp_path / "m.csv")
    assert found.names == ("1", "2") and found.pressures[1] == pytest.approx(0.02)
    assert found.values[1, 1] == pytest.approx([40, 0, 20])


def test_the_tip_is_the_tip_in_capitals_too(tmp_path):
    columns = [f"{name}_{axis}_mm" for name in ("Left", "Tip") for axis in "xyz"]
    write_csv(tmp_path / "m.csv", ["p_kPa", *columns], [[0, *range(6)], [10, *range(6)]])
    assert read_measured(tmp_path / "m.csv").names == ("Left", "tip")


def test_finite_elements_of_the_folder_stand_beside_it(tmp_path):
    """Those of the made-up run are the model with every strain times a factor: measured is half of that."""
    make_run(tmp_path / "run", segments=(PLANE,), fields=False)
    steps = read_design_folder(tmp_path / "run").solve.steps
    tips = np.column_stack([steps[f"tip_{axis}_mm"] for axis in "xyz"])
    way = np.linalg.norm(tips - tips[0], axis=1)
    write_csv(
        tmp_path / "m.csv", ["p_kPa", "displacement_mm"], np.column_stack([steps["pressure_kPa"], way / 2])
    )
    found = compare(tmp_path / "run", tmp_path / "m.csv")
    assert found.solved_rms == pytest.approx(np.sqrt(np.mean((way[1:] / 2) ** 2)), rel=1e-6)
    assert any("finite elements" in line for line in found.lines())
    # a marker at the tip is the tip wherever its columns stand: here before those of the base
    names = ["p_kPa", *(f"{name}_{axis}_mm" for name in ("tip", "base") for axis in "xyz")]
    write_csv(tmp_path / "m.csv", names, np.column_stack([steps["pressure_kPa"], tips, 0 * tips]))
    assert compare(tmp_path / "run", tmp_path / "m.csv").solved_rms == pytest.approx(0, abs=1e-6)


BAD = {
    "tip_x_mm,tip_y_mm,tip_z_mm\n1,2,3\n": "pressure_kPa' is missing",
    "pressure,angle_deg\n0,0\n1,2\n": "says no unit",
    "pressure_kPa,mass\n0,0\n1,2\n": "nothing to compare",
    "pressure_kPa,angle_deg\n0,0\n10,200\n": "over 180",
    "pressure_kPa,angle_deg\n10,1\n10,2\n": "one pressure only",
    "pressure_kPa,angle_deg\n0,\n10,\n": "holds one pressure only",
    "pressure_kPa,angle_deg\n-20,1\n10,2\n": "gauge pressures",
    "pressure_kPa,angle_deg\n5,1\n10,2\n": "at rest",
    "pressure_kPa,displacement_psi\n0,1\n10,2\n": "no unit of length",
    "pressure_kPa,tip_x_mm,tip_y_mm\n0,1,1\n10,2,2\n": "'tip_z_mm' is missing",
    "pressure_kPa,a_x,a_y,a_z,tip_x,tip_y,tip_z\n0,0,0,0,1,0,0\n9,0,0,0,2,1,1\n": "--markers",
    "pressure_kPa,x_mm,y_mm,z_mm\n0,0,0,0\n0,1,0,0\n9,0,0,0\n9,1,1,1\n": "no centreline",
}


@pytest.mark.parametrize("text", BAD, ids=BAD.values())
def test_bad_measurements_are_one_line(tmp_path, text):
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(InputError, match=BAD[text]) as told:
        compare(design(), tmp_path / "m.csv")
    assert "\n" not in str(told.value) and str(tmp_path / "m.csv") in str(told.value)


def test_the_command_writes_everything_or_nothing(tmp_path, caplog):
    design().save(tmp_path / "run")
    path = write_markers(tmp_path / "m.csv", design(FACTOR * MU))
    command = ["compare", str(tmp_path / "run"), str(path), "--law", "analytic"]
    assert main(command) == 2 and not (tmp_path / "run" / "compare").exists()
    assert main([*command, "--markers", str(tmp_path / "markers.csv")]) == 0
    written = {each.name for each in (tmp_path / "run" / "compare").iterdir()}
    assert written >= {"compare.csv", "compare.png", "run.json", "fitted.toml"}
    fitted = read_design_file(tmp_path / "run" / "compare" / "fitted.toml")
    assert fitted.largest_pressure == pytest.approx(0.024 * FACTOR, rel=1e-5)


def test_the_beam_of_the_public_measurement_is_timoshenkos():
    """Small drops: Euler and Bernoulli's and that of the shear, less what the clamp holds of the bending
    within half a depth. Finite elements of it: `make bench ONLY=compare`."""
    weight, shear = beam.DENSITY * beam.SIDE**2 * 9810, 5 / 6 * beam.MU * beam.SIDE**2
    held, beyond = held_lengths(beam.SIDE, beam.SIDE)[4], beam.LENGTH - beam.SIDE / 4
    held_drop = weight * beyond**3 / 2 * held / (beam.E * beam.SIDE**4 / 12)
    drop = beam.euler_bernoulli(0.0) + weight * beam.LENGTH**2 / (2 * shear) - held_drop
    assert beam.rod_drop(0.0) == pytest.approx(drop, rel=0.01)
    told = beam.lines()
    assert "does not agree" in told[0] and all("rod" in line for line in told)
    low, high = beam.MEASURED[0.991]
    assert low < beam.rod_drop(0.991) < high


def test_the_arm_of_the_public_measurement_is_no_one_arc():
    t = np.radians(arm.TILT_DEG)
    length = arm.arc_lengths()
    x, z = length * np.sin(t) / t - length, length * (1 - np.cos(t)) / t
    assert np.allclose(np.hypot(x, z), arm.DISPLACEMENT_MM)
    assert np.ptp(length) > 5 and "not published" in arm.lines()[-1]
