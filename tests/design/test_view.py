"""A run to turn by hand: what the scene holds, and that a browser shows it and its slider moves it."""

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.cli import main
from pneunet.design.report import viewing
from pneunet.design.report.loadsteps import load_steps
from pneunet.design.report.report import write_report
from pneunet.design.report.rundata import read_design_folder
from pneunet.design.report.viewing import page_bytes, scene
from pneunet.reduced import AnalyticLaw
from tests.browser import CHROMIUM, Browser
from tests.design.fake_run import PLANE, POSE, make_run

#: a picture of the plot, made by its own page
SHOT = (
    "Plotly.toImage(document.querySelector('.js-plotly-plot'), {width: 400, height: 500})"
    ".then(url => new Promise(done => {const image = new Image(); image.onload = () => {"
    "const sheet = document.createElement('canvas'); sheet.width = 400; sheet.height = 500;"
    "const c = sheet.getContext('2d'); c.drawImage(image, 0, 0);"
    "const d = c.getImageData(0, 0, 400, 500).data; let n = 0;"
    "for (let i = 0; i < d.length; i += 4) {const rgb = [d[i], d[i+1], d[i+2]];"
    "n += Math.max(...rgb) - Math.min(...rgb) > 20;} done(n + ' ' + url)};"
    "image.src = url}))"
)
RAIL = "document.querySelector('.slider-rail-touch-rect')"
LABEL = "document.querySelector('.slider-label').textContent"


def test_the_outside_of_the_finite_elements_moves_with_them(tmp_path):
    make_run(tmp_path / "run", segments=(PLANE,))
    run = read_design_folder(tmp_path / "run")
    steps = load_steps(run, AnalyticLaw())
    assert steps.solved and set(steps.fields) == {"mean_stretch", "wall_distance_mm", "pressure"}
    # a bar of 59 x 4 x 3 bricks: its outside alone, closed, and every point on it
    assert len(steps.triangles) == 2 * 2 * (59 * 4 + 59 * 3 + 4 * 3)
    edges = np.sort(steps.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert np.array_equal(np.unique(steps.triangles), np.arange(len(steps.points[0])))
    # at the base the section stands where the design puts it
    base = se3.transform(np.linalg.inv(POSE), steps.points[0])
    assert np.isclose(base[:, 0].min(), 0, atol=1e-5)
    low, high = steps.limits("wall_distance_mm")
    assert low == -high


def test_a_closed_cavity_is_left_out():
    import pyvista

    from pneunet.design.report.loadsteps import outer_surface

    grid = pyvista.ImageData(dimensions=(6, 6, 6)).cast_to_unstructured_grid()
    centre = np.linalg.norm(grid.cell_centers().points - 2.5, axis=1) > 0.1
    triangles, nodes = outer_surface(grid.extract_cells(centre))
    assert len(triangles) == 2 * 6 * 25 and len(nodes) == 6**3 - 4**3


def test_a_design_alone_is_shown_by_the_reduced_model(tmp_path):
    make_run(tmp_path / "run", segments=(PLANE,), solve=False)
    steps = load_steps(read_design_folder(tmp_path / "run"), AnalyticLaw())
    assert not steps.solved and steps.labels[0] == "0 kPa" and steps.labels[-1] == "20 kPa"
    figure = scene(steps)
    assert [trace.name for trace in figure.data] == ["body", "centreline", "target"]
    assert len(figure.frames) == len(figure.layout.sliders[0].steps) == len(steps.labels)
    few = steps.of_steps([0, 8])
    assert few.labels == ("0 kPa", "20 kPa") and page_bytes(few) < page_bytes(steps)


def test_a_page_that_would_be_too_large_shows_fewer_steps(tmp_path, monkeypatch):
    make_run(tmp_path / "run", segments=(PLANE,), solve=False)
    run = read_design_folder(tmp_path / "run")
    whole = load_steps(run, AnalyticLaw())
    monkeypatch.setattr(viewing, "LARGEST_PAGE", (viewing.SCRIPT + page_bytes(whole)) / 2)
    few = viewing._that_fit(run, AnalyticLaw())
    assert page_bytes(few) <= 1.1 * viewing.LARGEST_PAGE and 2 <= len(few.labels) < len(whole.labels)
    assert (few.labels[0], few.labels[-1]) == (whole.labels[0], whole.labels[-1])


def test_the_page_is_in_the_report_and_bad_input_is_one_line(tmp_path, capsys):
    make_run(tmp_path / "run", segments=(PLANE,), solve=False)
    assert main(["view", str(tmp_path / "run"), "--film", "gif"]) == 0
    page = tmp_path / "run" / "view.html"
    assert 4e6 < page.stat().st_size < 15e6 and (tmp_path / "run" / "inflation.gif").stat().st_size > 1e4
    write_report(tmp_path / "run", AnalyticLaw())
    assert 'src="view.html"' in (tmp_path / "run" / "report.html").read_text()
    assert main(["view", str(tmp_path)]) == 2
    assert "holds no design.toml" in capsys.readouterr().err


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium: apt-get install chromium")
def test_a_browser_shows_it_and_the_slider_moves_it(tmp_path):
    make_run(tmp_path / "run", segments=(PLANE,), solve=False)
    assert main(["view", str(tmp_path / "run")]) == 0
    with Browser() as browser:
        browser.open(tmp_path / "run" / "view.html")
        browser.wait_for(f"!!{RAIL} && !!document.querySelector('canvas')")
        coloured, last = browser.evaluate(SHOT).split()
        assert browser.evaluate(LABEL) == "load step: 20 kPa"
        place = browser.evaluate(f"(r => [r.left, r.top, r.height])({RAIL}.getBoundingClientRect())")
        browser.click(place[0] + 8, place[1] + place[2] / 2)
        browser.wait_for(f"{LABEL} == 'load step: 0 kPa'")
        assert browser.evaluate(SHOT).split()[1] != last
        browser.evaluate(
            "Plotly.restyle(document.querySelector('.js-plotly-plot'), 'visible', false, [0]).then(() => 1)"
        )
        without = browser.evaluate(SHOT).split()[0]
        assert int(coloured) > 3000 + int(without)  # no blank canvas: that is the body
        # nothing was fetched: the page brings everything along
        assert browser.evaluate("performance.getEntriesByType('resource').length") == 0
