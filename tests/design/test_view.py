"""A run to turn by hand: what the scene holds, and that a browser shows it and its slider moves it."""

import html
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.cli import main
from pneunet.design.report import viewing
from pneunet.design.report.loadsteps import load_steps
from pneunet.design.report.report import write_report
from pneunet.design.report.rundata import read_design_folder
from pneunet.design.report.viewing import page_bytes, scene
from pneunet.design.report.window import window
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
#: the same, drawn on a sheet of this page, of the page in the report's frame
FRAME = "document.querySelector('iframe').contentWindow"
#: `pneunet view RUN --window`, with hands that move the slider and close the window
AT_THE_WINDOW = """import sys
import numpy, pyvista
from pneunet.cli import main
show = pyvista.Plotter.show
def hands(plotter):
    assert not plotter.off_screen
    show(plotter, interactive=False, auto_close=False)
    numpy.save(sys.argv[2] + "/last.npy", plotter.screenshot(return_img=True))
    slider = plotter.slider_widgets[0]
    slider.GetRepresentation().SetValue(0)
    slider.InvokeEvent("EndInteractionEvent")
    numpy.save(sys.argv[2] + "/first.npy", plotter.screenshot(return_img=True))
    plotter.close()
pyvista.Plotter.show = hands
sys.exit(main(["view", sys.argv[1], "--window", "-o", sys.argv[2]]))
"""
LISTED_TWICE = (
    '<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>'
    '<DataSet timestep="0" part="0" file="solution_0.vtu"/>'
    '<DataSet timestep="20" part="0" file="solution_0.vtu"/></Collection></VTKFile>'
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


@pytest.fixture(scope="module")
def finger(tmp_path_factory):
    """A folder with a design, its page, a film of its inflation and a report."""
    folder = tmp_path_factory.mktemp("view") / "run"
    make_run(folder, segments=(PLANE,), solve=False)
    assert main(["view", str(folder), "--film", "gif"]) == 0
    write_report(folder, AnalyticLaw())
    return folder


def test_the_page_is_in_the_report_and_bad_input_is_one_line(finger, tmp_path, capsys):
    page = (finger / "view.html").read_text()
    assert 4e6 < len(page) < 15e6
    report = (finger / "report.html").read_text()
    assert report.count("<iframe") == 1 == report.count("srcdoc=")
    [inside] = re.findall(r'srcdoc="([^"]*)"', report)
    assert html.unescape(inside).count("<script") == page.count("<script") and len(report) < 15e6
    assert main(["view", str(tmp_path)]) == 2
    assert "holds no design.toml" in capsys.readouterr().err


def of_the_body(image):
    """(number of coloured pixels, mean column and row of them) of an image (h, w, 3)."""
    coloured = np.ptp(np.asarray(image, int), axis=2) > 20
    return coloured.sum(), *(np.mean(each) for each in np.nonzero(coloured)[::-1])


def test_the_frames_of_a_film_show_a_body_that_moves(finger):
    from PIL import Image, ImageSequence

    frames = [
        np.array(f.convert("RGB")) for f in ImageSequence.Iterator(Image.open(finger / "inflation.gif"))
    ]
    assert len(frames) == 9
    seen = [of_the_body(frame) for frame in frames]
    assert min(number for number, *_ in seen) > 2000  # none is blank
    assert seen[-1][2] - seen[0][2] > 10  # it bends down
    assert all((frame[:60, :200] < 100).any() for frame in frames)  # each says its pressure


def test_an_mp4_shows_the_same(finger, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="no imageio-ffmpeg: it is large, and optional")
    assert main(["view", str(finger), "--film", "mp4", "-o", str(tmp_path)]) == 0
    reader = ffmpeg.read_frames(str(tmp_path / "inflation.mp4"))
    width, height = next(reader)["size"]
    frames = [np.frombuffer(each, np.uint8).reshape(height, width, 3) for each in reader]
    assert len(frames) == 9 and min(of_the_body(frame)[0] for frame in frames) > 2000
    assert of_the_body(frames[-1])[2] - of_the_body(frames[0])[2] > 10


def test_the_window_has_a_slider_and_changes_its_colours(tmp_path):
    make_run(tmp_path / "run", segments=(PLANE,))
    (tmp_path / "run/solve/solution.pvd").write_text(LISTED_TWICE)
    plotter = window(load_steps(read_design_folder(tmp_path / "run"), AnalyticLaw()), off_screen=True)
    plotter.show(interactive=False, auto_close=False)

    def picture():
        plotter.render()
        return plotter.screenshot(return_img=True)[:450]  # without the slider

    first = picture()
    assert of_the_body(first)[0] > 2000
    plotter.iren.interactor.SetKeySym("c")
    plotter.iren.interactor.InvokeEvent("KeyPressEvent")
    second = picture()
    assert list(plotter.scalar_bars.keys()) == ["distance of facing walls, mm"]
    assert (first != second).any()
    plotter.close()


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no display can be made: apt-get install xvfb")
def test_the_command_opens_a_window_on_a_display_and_its_slider_moves_the_body(finger, tmp_path):
    ours, theirs = os.pipe()
    screen = subprocess.Popen(
        ["Xvfb", "-displayfd", str(theirs), "-screen", "0", "1200x900x24"], pass_fds=[theirs]
    )
    try:
        display = os.read(ours, 16).decode().strip()
        line = [sys.executable, "-c", AT_THE_WINDOW, str(finger), str(tmp_path)]
        env = {**os.environ, "DISPLAY": f":{display}"}
        subprocess.run(line, env=env, check=True, timeout=300)
    finally:
        screen.terminate()
        screen.wait()
    last, first = (np.load(tmp_path / f"{name}.npy") for name in ("last", "first"))
    assert last.shape == first.shape and min(of_the_body(last)[0], of_the_body(first)[0]) > 2000
    assert np.any(last != first, axis=2).sum() > 5000


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium: apt-get install chromium")
def test_a_browser_shows_it_and_the_slider_moves_it(finger):
    with Browser() as browser:
        browser.open(finger / "view.html")
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


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium: apt-get install chromium")
def test_a_browser_shows_it_within_the_report_and_not_in_print(finger):
    with Browser() as browser:
        browser.open(finger / "report.html")
        browser.wait_for("!!document.querySelector('iframe')")
        browser.evaluate("document.querySelector('iframe').scrollIntoView()")

        def inside(script):
            return script.replace("document.", f"{FRAME}.document.").replace("Plotly.", f"{FRAME}.Plotly.")

        browser.wait_for(inside(f"!!{RAIL} && !!document.querySelector('canvas') && !!Plotly.newPlot"))
        assert int(browser.evaluate(inside(SHOT)).split()[0]) > 3000
        place = browser.evaluate(
            f"((f, r) => [f.left + r.left, f.top + r.top + r.height / 2])"
            "(document.querySelector('iframe').getBoundingClientRect(),"
            f" {inside(RAIL)}.getBoundingClientRect())"
        )
        browser.click(place[0] + 8, place[1])
        browser.wait_for(f"{inside(LABEL)} == 'load step: 0 kPa'")
        browser.call("Emulation.setEmulatedMedia", media="print")
        hidden = browser.evaluate("getComputedStyle(document.querySelector('iframe')).display")
        assert hidden == "none" and browser.evaluate("document.images.length") >= 3
