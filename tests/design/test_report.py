"""The report: what it says about runs whose numbers are known, whole and with parts missing."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_columns
from pneunet.base.se3 import transform
from pneunet.design.design import Design
from pneunet.design.report.comparison import Comparison, overlaps, smooth, stopped_short, verdict
from pneunet.design.report.rundata import read_design_folder
from pneunet.design.target.metrics import compare
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import Manipulator
from pneunet.reduced import AnalyticLaw, shipped_law
from tests.design.fake_run import FACTOR, HELIX, PLANE, POSE, make_run


def judged(directory):
    run = read_design_folder(directory)
    return run, Comparison.of(run, AnalyticLaw())


def test_comparison_is_made_in_target_coordinates(tmp_path):
    make_run(tmp_path, fields=False)
    run, c = judged(tmp_path)
    assert c.solved[0] == pytest.approx(POSE[:3, 3])
    stations = read_columns(tmp_path / "solve" / "centrelines.csv", ["x_mm", "y_mm", "z_mm"])
    assert c.solved[-1] == pytest.approx(transform(POSE, stations)[-1])
    assert c.reduced_target == compare(c.reduced, run.target)
    assert np.allclose(run.solve.strains.k, FACTOR * c.strains.k)
    assert not stopped_short(run) and c.notes == ()


def test_dead_loads_act_in_the_prediction_too(tmp_path):
    content = DesignFile(Manipulator((HELIX,)), 0.02, base_pose=POSE, loads=DeadLoads((0.0, 0.0, -9810.0)))
    hanging = Design(content, shipped_law())
    run = read_design_folder(hanging.save(tmp_path))
    c = Comparison.of(run, shipped_law())
    assert c.reduced == pytest.approx(hanging.prediction.points, abs=1e-9) and c.notes == ()
    free = Comparison.of(replace(run, design=replace(run.design, loads=DeadLoads())), shipped_law())
    assert "it was edited" in free.notes[0]
    with pytest.raises(InputError, match=r"knows free shapes alone.*\[loads\] of a design, take the trained"):
        Comparison.of(run, AnalyticLaw())


def test_smooth_follows_an_arc_between_stations():
    angle = np.linspace(0, 2, 12)
    arc = smooth(30 * angle, 30 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]))
    assert np.linalg.norm(arc, axis=1) == pytest.approx(30.0, abs=0.02)


def test_solution_that_stopped_short_is_compared_at_its_own_pressure(tmp_path):
    make_run(tmp_path, reached=0.6, fields=False)
    run, c = judged(tmp_path)
    assert stopped_short(run)
    assert np.allclose(run.solve.strains.k, FACTOR * c.strains.k)
    assert "stops at 12 kPa" in c.notes[0] and "stopped short" in verdict(run, c)


def test_groups_are_compared_at_pressures_in_the_designs_proportions_and_rolled_strains_in_one_frame(
    tmp_path,
):
    segments = PLANE, replace(PLANE, roll=180, group=2)
    make_run(tmp_path, segments, (0.02, 0.01), reached=0.5, fields=False)
    run, c = judged(tmp_path)
    assert np.allclose(run.solve.strains.k, FACTOR * c.strains.k)
    own = [AnalyticLaw().strains(PLANE, p).k[1] for p in (0.01, 0.005)]
    assert c.strains.k[:, 1] == pytest.approx([own[0], -own[1]])
    assert "At 10 / 5 kPa" in verdict(run, c) and "design pressure of 20 / 10 kPa" in c.notes[0]
    path = tmp_path / "design.toml"
    path.write_text(path.read_text().replace("[20.0, 10.0]", "[20.0, 20.0]"))
    assert read_design_folder(tmp_path).stale


def test_solution_of_another_body_is_left_out_and_told(tmp_path):
    make_run(tmp_path, fields=False)
    assert not read_design_folder(tmp_path).stale
    path = tmp_path / "design.toml"
    text = path.read_text()
    width = next(line for line in text.splitlines() if line.startswith("width_mm"))
    path.write_text(text.replace(width, "width_mm = 13.5"))
    run, c = judged(tmp_path)
    assert run.stale and run.solve is None and c.solved is None
    assert any("another body" in note for note in c.notes)


def test_step_nearest_to_the_target_is_named(tmp_path):
    make_run(tmp_path, fields=False)
    run, c = judged(tmp_path)
    pressure, errors = c.nearest
    assert errors.rms <= c.solved_target.rms
    assert pressure in [row[0] for row in run.solve.history]


def test_verdict_tells_numbers_bars_and_possible_causes(tmp_path, monkeypatch):
    make_run(tmp_path / "a", (PLANE,), pressure=0.001, fields=False)
    told = verdict(*judged(tmp_path / "a"))
    assert f"|k| of a segment by up to {100 * (1 / FACTOR - 1):.0f} % (bar 5 %). Beyond the bar" in told
    assert "possible causes: the mesh (1.5 mm; " in told and "in doubt" not in told
    record = tmp_path / "a" / "solve" / "run.json"
    record.write_text(record.read_text().replace('"ranks": 2', '"ranks": 2, "mesh_size_mm": 3.5'))
    run, c = judged(tmp_path / "a")
    told = verdict(run, replace(c, doubted=True))
    assert "a coarse mesh (3.5 mm; " in told and "in doubt" in told
    monkeypatch.setattr("tests.design.fake_run.FACTOR", 0.99)
    make_run(tmp_path / "e", (PLANE,), pressure=0.001, fields=False)
    told = verdict(*judged(tmp_path / "e"))
    assert "by up to 1 % (bar 5 %)" in told and "cause" not in told and "(0 %" not in told


def test_verdict_tells_overlap(tmp_path):
    make_run(tmp_path / "b", (HELIX, HELIX), pressure=0.04, fields=False, overlap=0.2)
    run, c = judged(tmp_path / "b")
    assert verdict(run, c).startswith("NOT PROVEN") and "bar" not in verdict(run, c)
    assert overlaps(run) == [
        "Walls overlap from 36.00 kPa on, by up to 0.20 mm at the end; contact is not part of this solution"
    ]
    make_run(tmp_path / "d", (HELIX, HELIX), pressure=0.04, fields=False, overlap=0.01, contact=True)
    run, c = judged(tmp_path / "d")
    assert overlaps(run) == [] and "Beyond the bar" in verdict(run, c)
    make_run(tmp_path / "c", (PLANE,), solve=False)
    assert "there is no finite element solution to compare it with yet" in verdict(*judged(tmp_path / "c"))


def test_an_edited_design_is_noticed(tmp_path):
    make_run(tmp_path, solve=False)
    text = (tmp_path / "design.toml").read_text()
    (tmp_path / "design.toml").write_text(text.replace("pressure_kPa = 20.0", "pressure_kPa = 30.0"))
    assert "centreline.csv differs" in judged(tmp_path)[1].notes[0]


def test_rest_state_alone_is_no_solution(tmp_path):
    make_run(tmp_path, fields=False)
    steps = tmp_path / "solve" / "steps.csv"
    steps.write_text("\n".join(steps.read_text().splitlines()[:2]) + "\n")
    assert read_design_folder(tmp_path).solve is None


def _cell(row, column, value):
    def change(text):
        rows = [line.split(",") for line in text.splitlines()]
        rows[row][column] = value
        return "\n".join(map(",".join, rows)) + "\n"

    return change


#: file -> what becomes of its text; what is said; what is left
DAMAGED = {
    "a list": ("run.json", lambda text: "[1, 2]", "run.json: must hold a JSON object", "solve"),
    "a record's law": ("run.json", lambda text: '{"inputs": {"law": 5}}', "'inputs.law' is 5", "solve"),
    "no mesh.json": ("mesh/mesh.json", lambda text: text[:20], "mesh.json: not valid JSON", "solve"),
    "limit points": (
        "solve/run.json",
        lambda text: '{"limit_points": [3]}',
        "run.json: 'limit_points' holds 3",
        "solve",
    ),
    "nan in steps": (
        "solve/steps.csv",
        _cell(3, 1, "nan"),
        "steps.csv row 4: 'pressure_kPa' is not",
        "target",
    ),
    "nan in a centreline": (
        "solve/centrelines.csv",
        _cell(-1, 3, "inf"),
        "'x_mm' is not a finite number",
        "target",
    ),
    "arc length": ("solve/centrelines.csv", _cell(-1, 2, "0"), "'s_mm' of a step does not rise", "target"),
    "segments": (
        "solve/segments.csv",
        lambda text: text[: text.rindex("\n", 0, -1) + 1],
        "holds 2 segments in the last step",
        "target",
    ),
    "walls": ("solve/walls.csv", _cell(1, 0, "9"), "walls.csv: names a segment or a gap", "solve"),
    "an open quotation": ("solve/walls.csv", lambda text: text + '"1', "quotation mark", "solve"),
    "target": ("target.csv", _cell(2, 1, "x"), "target.csv: column 'y_mm' holds words", "solve"),
    "two columns": ("centreline.csv", lambda text: "s_mm,s_mm\n1,2", "two columns have the same", "solve"),
}


@pytest.mark.parametrize(("name", "change", "told", "left"), DAMAGED.values(), ids=DAMAGED)
def test_what_is_damaged_is_named_and_the_rest_read(tmp_path, name, change, told, left):
    make_run(tmp_path, fields=False)
    path = tmp_path / name
    path.write_text(change(path.read_text()))
    folder = read_design_folder(tmp_path)
    assert len(folder.damaged) == 1 and told in folder.damaged[0] and str(tmp_path) not in folder.damaged[0]
    assert getattr(folder, left) is not None and (folder.solve is None) == (left == "target")
    with pytest.raises(InputError, match=name):
        folder.require_whole()


def test_a_report_of_damaged_parts_shows_the_others(tmp_path, caplog):
    pytest.importorskip("pyvista")
    from pneunet.design.report.bodies import read_solution
    from pneunet.design.report.report import write_report

    caplog.set_level("INFO", "pneunet")
    make_run(tmp_path, (PLANE,))
    solution = tmp_path / "solve" / "solution.pvd"
    step = next(solution.parent.glob("*.vtu"))
    whole = step.read_bytes()
    for content in (whole[: len(whole) // 2], b"", whole.replace(b'Name="displacement"', b'Name="movement"')):
        step.write_bytes(content)
        with pytest.raises(InputError, match=f"{step.name}: is damaged"):
            read_solution(solution)
    (tmp_path / "target.csv").write_bytes(bytes(300))
    page = write_report(tmp_path).read_text()
    assert page.count("Damaged, and left out") == 2 == sum("left out" in text for text in caplog.messages)
    assert "finite element solution of the whole manipulator" in page and f"{step.name}: is damaged" in page
    solution.write_text(solution.read_text().replace(step.name, f"../../{step.name}"))
    with pytest.raises(InputError, match="does not lie beside it"):
        read_solution(solution)


def without_scene(page):
    """(a report without the body to turn, that)"""
    [scene] = re.findall(r' srcdoc="([^"]*)"', page)
    return page.replace(scene, ""), scene


def test_report_page_is_whole_and_self_contained(tmp_path):
    pytest.importorskip("pyvista")
    from pneunet.design.report.report import write_report

    make_run(tmp_path, overlap=0.13)
    page, scene = without_scene(write_report(tmp_path).read_text())
    assert "Plotly.newPlot" in scene and len(page) + len(scene) < 15e6
    names = {p.name for p in (tmp_path / "report").iterdir()}
    assert names == {
        "curves.png",
        "drawing.png",
        "fe.png",
        "fe_displacement.png",
        "fe_stretch.png",
        "fe_walls.png",
        "history.png",
        "reduced.png",
        "reference.png",
        "target.png",
        "walls.png",
    }
    assert page.count("data:image/png;base64,") == len(names)
    assert not re.search(r"(src|href)=\"(?!data:)", page) and str(tmp_path) not in page
    assert "WALLS OVERLAP in 1 of" in page and page.count("OVERLAP, not proven: Walls overlap from") == 3
    assert "mpirun -n 2 pneunet solve" in page
    assert f"{FACTOR:.3f}" in page  # FE / reduced of a curvature
    assert page.count("<details>") == 3 and "entries" not in page and ">None<" not in page
    assert "mean principal stretch, at most 1.4" in page and "it is 1.1 on average (largest_stretch" in page


def test_report_of_a_design_alone_says_what_is_missing(tmp_path):
    pytest.importorskip("pyvista")
    from pneunet.design.report.report import write_report

    make_run(tmp_path, solve=False)
    page = write_report(tmp_path).read_text()
    assert "There is no finite element solution in this folder yet" in page
    with pytest.raises(InputError, match="design.toml"):
        write_report(tmp_path / "report")
