"""Pictures: the geometry behind them; that each is drawn for what it must hold."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.atomic import read_columns
from pneunet.design.report.dimensions import spread
from pneunet.design.report.drawing import section_groups, segment_table
from pneunet.design.report.labels import kPa, plain, segment_name, significant
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.geometry.sections import chamber_plan
from pneunet.reduced import AnalyticLaw
from tests.design.fake_run import HELIX, PLANE, POSE, TWIST, make_run

NARROW = replace(HELIX, width=10.0, channel_width=2.0, chambers=4)
EVERYTHING = NARROW.plain(15.0), NARROW, replace(NARROW, roll=180), replace(NARROW, roll=90, group=2)


def test_spread_keeps_order_and_distance_and_moves_least():
    free = [0.0, 2.0, 5.0]
    assert spread(free, 1.0) == pytest.approx(free)
    assert spread([1.0, 1.0], 1.0) == pytest.approx([0.5, 1.5])
    crowded = spread([3.0, 0.1, 0.0, 0.2], 1.0)
    assert np.diff(np.sort(crowded)).min() >= 1 - 1e-12
    assert list(np.argsort(crowded)) == [2, 1, 3, 0]


def test_numbers_and_names():
    assert [plain(v) for v in (2.0, 5.7735, -0.001, 40.0)] == ["2", "5.77", "0", "40"]
    assert [significant(v) for v in (0.0, 193812.3, 0.0123456, 625.13)] == ["0", "193800", "0.01235", "625.1"]
    assert [segment_name(s) for s in (TWIST, PLANE, HELIX)] == [
        "twisting 60° × 4",
        "bending 90° × 4",
        "helical 60° × 9",
    ]
    others = PLANE.plain(12.5), replace(PLANE, roll=180)
    assert [segment_name(s) for s in others] == ["passive 12.5 mm", "bending 90° × 4, rolled 180°"]
    assert kPa(0.035) == "35 kPa" and kPa((0.03, 0.0)) == "30 / 0 kPa"


def test_chamber_plan_is_thick_normal_to_the_chamber_and_turned_below():
    corners = np.array(chamber_plan(TWIST, 10.0, 4.0, 6.0, 1))
    along = (corners[3] - corners[0]) / np.linalg.norm(corners[3] - corners[0])
    assert along == pytest.approx([np.cos(np.radians(60)), np.sin(np.radians(60))])
    across = corners[1] - corners[0]
    assert np.linalg.norm(across - (across @ along) * along) == pytest.approx(4.0)
    below = np.array(chamber_plan(TWIST, 10.0, 4.0, 6.0, -1))
    assert sorted(map(tuple, below.round(9))) == sorted(map(tuple, (corners * [1, -1]).round(9)))


def test_equal_sections_are_drawn_once():
    taller = Segment("one-sided", 75.0, 3, chamber_height=5.0, gap=1.5)
    assert section_groups(Manipulator((TWIST, PLANE, HELIX, taller))) == [[0], [1, 2], [3]]
    table = dict(segment_table(Manipulator((TWIST, PLANE))))
    assert table["chambers"] == ["4 pairs", "4"] and "pressure group" not in table
    table = dict(segment_table(Manipulator(EVERYTHING)))
    assert table["wall, normal"] == ["-", "1", "1", "1"] and table["length"][0] == "15"
    assert table["roll about the axis, deg"] == ["0", "0", "180", "90"]
    assert table["pressure group"] == ["1", "1", "1", "2"]


@pytest.mark.parametrize(
    "segments",
    [
        (Segment("twisting", 60.0, 1, chamber_height=5.5),),
        (
            TWIST,
            Segment("one-sided", 90.0, 2),
            HELIX,
            Segment("one-sided", 135.0, 20, chamber_height=5.0),
            TWIST.mirrored,
        ),
        EVERYTHING,
    ],
)
def test_drawing_keeps_every_text_on_the_sheet_and_apart(segments):
    pytest.importorskip("matplotlib")
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from pneunet.design.report.drawing import drawing_figure

    figure = drawing_figure(DesignFile(Manipulator(segments), 0.05, name="arm"))
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    sheet = figure.bbox
    texts = [t for ax in figure.axes for t in ax.texts if t.get_text()] + figure.texts
    boxes = [t.get_window_extent(renderer) for t in texts]
    for text, box in zip(texts, boxes):
        assert sheet.x0 <= box.x0 and box.x1 <= sheet.x1 and sheet.y0 <= box.y0 and box.y1 <= sheet.y1, (
            text.get_text()
        )
    for i, a in enumerate(boxes):
        for j in range(i):
            width = min(a.x1, boxes[j].x1) - max(a.x0, boxes[j].x0)
            height = min(a.y1, boxes[j].y1) - max(a.y0, boxes[j].y0)
            assert width < 2 or height < 2, (texts[i].get_text(), texts[j].get_text())


def test_view_holds_all_points_and_is_orthonormal():
    pytest.importorskip("matplotlib")
    from pneunet.base.pictures.rendering import PIXELS, view_of

    points = np.random.default_rng(1).normal(size=(50, 3)) * [80, 20, 10]
    view = view_of(points)
    towards = np.cross(view.right, view.up)
    assert np.column_stack([view.right, view.up, towards]).T @ np.column_stack(
        [view.right, view.up, towards]
    ) == pytest.approx(np.eye(3))
    assert np.abs((points - view.focus) @ view.up).max() < view.half_height
    assert np.abs((points - view.focus) @ view.right).max() < view.half_height * PIXELS[0] / PIXELS[1]


def test_rendered_scale_is_the_views_scale():
    pyvista = pytest.importorskip("pyvista")
    from pneunet.base.pictures.rendering import render, view_of

    view = view_of(np.array([[-30.0, 0, 0], [30, 0, 0], [0, 20, 20]]))
    image = render(
        view,
        [
            (
                pyvista.Sphere(radius=10.0, center=view.focus),
                {"color": "black", "ambient": 1.0, "diffuse": 0.0},
            )
        ],
    )
    rows = np.flatnonzero((image < 128).all(axis=2).any(axis=1))
    assert np.ptp(rows) * view.millimetres_per_pixel == pytest.approx(20.0, rel=0.02)


def test_curves_in_front_lie_where_bodies_are_rendered():
    pyvista = pytest.importorskip("pyvista")
    from pneunet.base.pictures.rendering import render, view_of

    view, place = view_of(np.array([[-30.0, 0, 0], [30, 0, 0], [0, 20, 20]])), np.array([15.0, 4, 6])
    ball = pyvista.Sphere(radius=2.0, center=place), {"color": "black", "ambient": 1.0, "diffuse": 0.0}
    rows, columns = np.nonzero((render(view, [ball]) < 128).all(axis=2))
    assert view.pixels(place[None])[0] == pytest.approx([columns.mean(), rows.mean()], abs=1.0)


def test_an_s_that_rises_is_not_seen_along_its_plane():
    """Sideways it goes 18 mm to either side, of which 25 degrees from above show no 3 mm."""
    from pneunet.base.pictures.rendering import view_of

    s = np.linspace(0, 1, 200)
    points = np.column_stack([150 * s, 18 * np.sin(2 * np.pi * s), 20 * (1 - np.cos(np.pi * s))])
    view = view_of(points)
    image = (points - points.mean(axis=0)) @ np.column_stack([view.right, view.up])
    along = np.linalg.svd(image, full_matrices=False)[2][1]
    assert np.ptp(image @ along) > 15
    straight = view_of(np.outer(s, [100.0, 0, 0]))
    assert np.degrees(np.arcsin(np.cross(straight.right, straight.up)[2])) == pytest.approx(25)


@pytest.mark.parametrize("size", [(100, 10, 10), (10, 100, 50), (10, 10, 100)])
def test_curves_in_3d_fill_their_place(size):
    pytest.importorskip("matplotlib")
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    from pneunet.base.pictures.rendering import figure
    from pneunet.design.report.pictures import FILLED, curve_panels

    fig = figure(11.0, 6.2)
    points = np.random.default_rng(1).random((200, 3)) * size
    curve_panels(fig, [("target", points, "target")])
    fig.draw_without_rendering()
    ax = fig.axes[0]
    x, y, _ = proj_transform(*points.T, ax.get_proj())
    place = ax.get_position(original=True).transformed(fig.transFigure)
    seen = np.ptp(ax.transData.transform(np.column_stack([x, y])), axis=0) / [place.width, place.height]
    assert 0.6 * FILLED < seen.max() < FILLED


def test_a_design_of_many_segments_is_named_without_overlap():
    pytest.importorskip("matplotlib")
    from pneunet.design.design import Design
    from pneunet.design.report.pictures import design_figure

    design = Design.of(Manipulator((HELIX, replace(HELIX, roll=180)) * 3), pressure_kPa=20, law=AnalyticLaw())
    fig = design_figure(design.content, design.predict(20))
    fig.draw_without_rendering()
    boxes = [t.get_window_extent() for t in (*fig.texts, *fig.legends)] + [ax.bbox for ax in fig.axes[1:]]
    assert len(fig.legends) == 2
    assert not [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]


def test_design_picture(tmp_path):
    pytest.importorskip("matplotlib")
    from pneunet.design.design import Design

    make_run(tmp_path, solve=False)
    for folder in ("with", "without"):
        assert (Design.read(tmp_path).save(tmp_path / folder) / "design.png").stat().st_size > 20_000
        (tmp_path / "target.csv").unlink(missing_ok=True)


def test_shape_files(tmp_path):
    pytest.importorskip("pyvista")
    from pneunet.design.shape import run_shape

    make_run(tmp_path, solve=False)
    folder = run_shape(tmp_path / "design.toml", [20.0, 10.0], tmp_path, AnalyticLaw())
    rows = read_columns(folder / "centrelines.csv", ["pressure_kPa", "s_mm", "x_mm", "y_mm", "z_mm"])
    at_design = rows[rows[:, 0] == 20.0][:, 1:]
    assert at_design == pytest.approx(
        read_columns(tmp_path / "centreline.csv", ["s_mm", "x_mm", "y_mm", "z_mm"])
    )
    assert rows[rows[:, 0] == 10.0][0, 2:] == pytest.approx(POSE[:3, 3])
    assert {p.name for p in folder.iterdir()} == {
        "centrelines.csv", "body_10kPa.vtp", "body_20kPa.vtp", "bodies.png", "inflation.gif", "run.json",
    }  # fmt: skip
    assert (folder / "inflation.gif").stat().st_size < 3e6


class Limited(AnalyticLaw):
    """A law that has no solution above 15 kPa."""

    name = "limited"

    def strains(self, segment, pressure):
        if np.max(pressure) > 0.015:
            raise ConvergenceError("limit at 15 kPa")
        return super().strains(segment, pressure)


def test_shape_beyond_the_limit_keeps_and_names_the_rest(tmp_path):
    pytest.importorskip("pyvista")
    from pneunet.design.shape import run_shape

    make_run(tmp_path, (PLANE,), pressure=0.01, solve=False)
    with pytest.raises(ConvergenceError, match=r"no shape at 20 kPa.*kept in .*: 10 kPa"):
        run_shape(tmp_path / "design.toml", [10.0, 20.0], tmp_path, law=Limited())
    assert (tmp_path / "shape" / "body_10kPa.vtp").exists()


def test_shape_refuses_bad_pressures(tmp_path):
    from pneunet.design.shape import run_shape

    make_run(tmp_path, (PLANE,), solve=False)
    for pressures in ([], [-10.0], [float("nan")], [50_000.0]):
        with pytest.raises(InputError, match="pressure.kPa"):
            run_shape(tmp_path / "design.toml", pressures, tmp_path)
    assert not (tmp_path / "shape").exists()
