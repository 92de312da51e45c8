"""What a target asks for beside its curve: weights, gravity, casting, further shapes, points of the tip."""

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.design.inverse_design import inverse_design
from pneunet.design.target.casting import Casting
from pneunet.design.target.file import read_target
from pneunet.design.target.points import strides
from pneunet.design.target.shapes import guide_to
from pneunet.design.target.target import HELICAL, Target

LINE = "x_mm,y_mm,z_mm\n" + "".join(f"{10 * i},0,0\n" for i in range(6))
TIP = "pressure (bar);x (m);y (m);z (m)\n0,1;0,06;0;0\n0,3;0,05;0;-0,02\n"
POINTS = np.column_stack([10.0 * np.arange(6), np.zeros((6, 2))])


@pytest.fixture
def written(tmp_path):
    (tmp_path / "line.csv").write_text(LINE)
    (tmp_path / "tip.csv").write_text(TIP)
    (tmp_path / "weighted.csv").write_text(LINE.replace("mm\n", "mm,weight\n", 1).replace(",0\n", ",0,2\n"))

    def target(text):
        (tmp_path / "a.toml").write_text(text)
        return read_target(tmp_path / "a.toml")

    return target


def test_all_of_it_in_one_file(written):
    target = written("""
        points = "weighted.csv"
        pressure_kPa = 50
        gravity_m_per_s2 = [0, 0, -9.81]
        tip_points = "tip.csv"
        base = { direction = [1, 0, 0] }
        [casting]
        grid_mm = 0.1
        walls_mm = [0.8, 1.5]
        silicones = ["Dragon Skin 20", "Ecoflex 00-10"]
        allow_steps = true
        [[shape]]
        points_mm = [[0, 0, 0], [20, 0, 0], [40, 0, 0], [60, 0, -5]]
        weights = [0, 1, 1, 3.5]
        pressure_kPa = [20, 30]
    """)
    assert target.weights.tolist() == [2] * 6 and target.pressure_range == pytest.approx((0.05, 0.05))
    assert target.loads.gravity == pytest.approx((0, 0, -9810)) and "fixed in direction" in target.base_told
    assert target.tip.points[1] == pytest.approx([50, 0, -20])
    assert target.tip.pressures == pytest.approx([0.01, 0.03])
    (shape,) = target.shapes
    assert shape.pressures == pytest.approx((0.02, 0.03)) and shape.weights[-1] == 3.5
    casting = target.casting
    assert casting.walls == (0.8, 1.5) and casting.silicones == ("Dragon Skin 20", "Ecoflex 00-10")
    assert (casting.grid, casting.angle_grid, casting.allow_steps, casting.allow_touch) == (
        0.1,
        0.5,
        True,
        False,
    )


def test_a_base_and_a_range_of_pressures_are_checked_from_python_too(written):
    target = Target(POINTS, base_direction=(0, 0, 5), base_width=(3, 0, 0), pressure_range=(0, 0.02))
    assert target.base_rotation == pytest.approx(np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]))
    assert written(LINES + "pressure_range_kPa = [0, 20]").pressure_range == target.pressure_range
    for given, told in (
        ({"base_direction": (0, 0)}, "'base_direction' must be three numbers"),
        ({"base_direction": "up"}, "'base_direction' must be three numbers"),
        ({"base_width": (1, 0, 0)}, "'base_width' needs 'base_direction' too"),
        ({"base_direction": (1, 0, 0), "base_width": (1, 1, 0)}, "must be perpendicular"),
        ({"pressure_range": (0, 30)}, "pressure_kPa = 30000 must lie in 0..60 kPa"),
        ({"pressure_range": (0.03,)}, "must be .lowest, highest. in MPa"),
        ({"pressure_range": "low"}, "must be numbers in MPa, not 'low'"),
        ({"groups": "a"}, "pressure_groups = 'a' must be a whole number"),
        ({"gravity": 9.81}, "gravity must be three finite numbers"),
        ({"material": "Ecoflex 00-30"}, "material must be of Hyperelastic, not 'Ecoflex 00-30'"),
        ({"pieces": "x"}, "pieces must be of Piece"),
        ({"tip": 3}, "tip must be of TipPoints, not 3"),
        ({"weights": ["a"] * len(POINTS)}, "weights must be numbers"),
        ({"frames": [[1, 0], [0]]}, "frames must be three vectors of three numbers each"),
    ):
        with pytest.raises(InputError, match=told):
            Target(POINTS, **given)


def test_defaults_are_what_was_before():
    target = Target(POINTS)
    assert not target.loads and target.casting == Casting() and target.weights is None
    assert "free to turn" in target.base_told and (target.shapes, target.tip, target.pressures) == (
        (),
        None,
        (),
    )


def test_of_shapes_alone_the_first_is_the_one_that_is_split(written):
    row = '[[shape]]\npoints = "line.csv"\npressure_kPa = {}\n'
    target = written(row.format(20) + row.format("[30, 40]"))
    assert target.pressure_range == pytest.approx((0.02, 0.02)) and len(target.points) == 6
    assert [s.pressures for s in target.shapes] == [pytest.approx((0.03, 0.04))]


def test_points_of_the_tip_alone_get_a_guide_of_no_weight(written):
    base = "[base]\npoint_mm = [10, 0, 0]\ndirection = [1, 0, 0]\n"
    target = written('tip_points = "tip.csv"\n' + base)
    assert not target.weights.any() and target.points[0].tolist() == [10, 0, 0]
    assert target.points[-1] == pytest.approx([60, 0, 0]) and target.pieces[0].kind == HELICAL
    longer = written('tip_points = "tip.csv"\n' + base + '[[piece]]\nkind = "bending"\nlength_mm = 80\n')
    assert longer.length == pytest.approx(80)


def test_a_guide_is_an_arc_from_the_base_to_the_farthest_point():
    end = np.array([3.0, 30.0, 10.0])
    points = guide_to(np.array([[1.0, 0, 0], end]), np.zeros(3), np.array([1.0, 0, 0]))
    steps = np.diff(points, axis=0)
    assert points[-1] == pytest.approx(end) and steps[0] / np.linalg.norm(steps[0]) == pytest.approx(
        [1, 0, 0], abs=0.02
    )
    turns = np.sum(steps[:-1] * steps[1:], axis=1) / np.sum(steps[0] ** 2)
    assert np.ptp(turns) < 1e-9  # the same from each chord to the next
    assert guide_to(np.array([[5.0, 0, 0]]), np.zeros(3), np.array([1.0, 0, 0]))[-1] == pytest.approx(
        [5, 0, 0]
    )


def test_strides_see_a_curve_behind_its_noise():
    x = np.linspace(0, 300, 20001)
    noisy = np.column_stack([x, *np.random.default_rng(1).normal(0, 0.3, (2, len(x)))])
    assert len(strides(noisy, 10.0)) == pytest.approx(31, abs=1)
    Target(noisy)  # neither folded nor 16 m long


@pytest.mark.parametrize(
    "points, words",
    [
        (
            np.column_stack([50 * np.cos(a := np.linspace(0, 2 * np.pi, 60)), 50 * np.sin(a), 0 * a]),
            "is closed",
        ),
        (np.vstack([POINTS, POINTS[-2::-1] + [0, 0.1, 0]]), "folds back on itself at point 6"),
        (POINTS[:3], "3 points: a target needs at least 4"),
        (np.zeros((1_000_000, 3)), "1000000 points are over 200000: keep every 100th"),
        (100 * POINTS, "is 5000 mm long, outside 10..2000 mm"),
    ],
)
def test_curves_that_no_body_follows(points, words):
    with pytest.raises(InputError, match=words):
        Target(points)


def test_a_straight_line_leaves_nothing_to_inflate():
    with pytest.raises(InputError, match="the curve is straight and no twist is asked for"):
        inverse_design(Target(POINTS))


def test_half_a_million_rows_are_refused_at_once(tmp_path):
    (tmp_path / "a.csv").write_text("0,0,0\n" * 500_000)
    with pytest.raises(InputError, match="has over 200000 rows: thin it out"):
        read_target(tmp_path / "a.csv")


LINES = 'points = "line.csv"\n'


@pytest.mark.parametrize(
    "text, words",
    [
        (LINES + "weights = [1, 1]", "weights have shape (2,): 6 points need as many"),
        (LINES + "weights = [1, 1, 1, nan, 1, 1]", "weight 4 = nan must be a finite number"),
        (LINES + "weights = [1, 1, 1, -1, 1, 1]", "weight 4 = -1 must be a finite number >= 0"),
        (LINES + "weights = [0, 0, 0, 0, 0, 0]", "weights: all are 0"),
        (LINES + 'weights = "heavy"', "'weights' must be a list of numbers"),
        (LINES + "gravity_m_per_s2 = [0, -9.81]", "three numbers"),
        (LINES + "gravity_m_per_s2 = [0, 0, -9.81e9]", "gravity_m_per_s2"),
        (LINES + "[casting]\nwalls_mm = [2, 1]", "the smallest comes first"),
        (LINES + "[casting]\nwalls_mm = [0, 1]", "must be [smallest, largest] within 0.3..10"),
        (LINES + "[casting]\nwall_mm = [1, 2]", "did you mean 'walls_mm'"),
        (LINES + "[casting]\ngrid_mm = -1", "grid_mm = -1 must lie in 0..2 mm"),
        (LINES + '[casting]\nallow_touch = "yes"', "must be true or false"),
        (LINES + '[casting]\nsilicones = ["Ecoflux"]', "'Ecoflux' is not in the table"),
        (
            LINES + '[casting]\nsilicones = ["Dragon Skin 20"]\nmu_range_MPa = [0.1, 0.2]',
            "exclude each other",
        ),
        (LINES + "[base]\npoint_mm = [0, 0, 0]", "goes with tip_points alone"),
        (LINES + "tip_points = 3", "'tip_points' names a CSV file"),
        (LINES + 'tip_points = "line.csv"', "column 'pressure_kPa' is missing"),
        (LINES + 'tip_points = "high.csv"', "pressure_kPa = 90 must lie in 0..60 kPa"),
        (LINES + 'tip_points = "unit.csv"', "column 'pressure' says no unit: write 'pressure_kPa'"),
        ('tip_points = "tip.csv"', "[base]: key 'direction' is missing"),
        (LINES + '[[shape]]\npoints = "line.csv"', "[[shape]] 1: key 'pressure_kPa' is missing"),
        (LINES + '[[shape]]\npoints = "line.csv"\npressure_kPa = []', "must lie in 0..60 kPa"),
        (LINES + "[[shape]]\npoints_mm = [[0, 0, 0]]\npressure_kPa = 9", "[[shape]] 1: 1 points: a target"),
        (LINES + '[shape]\npoints = "line.csv"', "with double brackets"),
        (LINES + "[[shape]]\nkind = 1\npressure_kPa = 9", "unknown key 'kind'"),
    ],
)
def test_bad_requests(written, tmp_path, text, words):
    (tmp_path / "high.csv").write_text("pressure_kPa,x,y,z\n90,1,2,3\n")
    (tmp_path / "unit.csv").write_text("pressure,x,y,z\n9,1,2,3\n")
    with pytest.raises(InputError) as error:
        written(text)
    assert words in str(error.value) and "\n" not in str(error.value)
