"""Curves and bodies as people bring them: read as they are meant; a body that runs through itself is said."""

from pathlib import Path

import numpy as np
import pytest

from pneunet import Design
from pneunet.base.curve import Curve
from pneunet.design.shape import run_shape
from pneunet.design.target.file import read_target
from pneunet.design.target.metrics import compare
from pneunet.reduced.rod.overlap import overlap_doubts

PEOPLE = Path(__file__).parents[1] / "data" / "people"
#: points, length in mm, last point
CURVES = {
    "byte_order_mark_bare.csv": (4, 97.785, [60, 0, 60]),
    "semicolon.csv": (5, 147.571, [35.908, 0, 108.069]),
    "five_markers_on_an_arc.csv": (5, 147.571, [35.908, 0, 108.069]),
    "one_and_a_half_flat_circles.csv": (301, 282.728, [0, 0, 60]),
    "s_curve_in_a_plane.csv": (61, 149.989, None),
    "noisy_arc.csv": (200, None, None),
}


@pytest.mark.parametrize(("name", "right"), CURVES.items())
def test_curves_are_read_as_they_are(name, right):
    count, length, tip = right
    target = read_target(PEOPLE / name)
    assert len(target.points) == count
    assert length is None or target.length == pytest.approx(length, abs=0.01)
    assert tip is None or target.points[-1] == pytest.approx(tip, abs=0.1)


@pytest.mark.parametrize(
    "text",
    [
        "x_m;y_m;z_m\n0,00;0;0\n0,01;0;0\n0,02;0;0,001\n0,03;0;0\n",
        "X [m]\tY [m]\tZ [m]\n0\t0\t0\n.01\t0\t0\n.02\t0\t.001\n.03\t0\t0\n",
        "marker trail\nx,y,z\nm,m,m\n0,0,0\n.01,0,0\n.02,0,.001\n.03,0,0\n",
        "t_s,x (cm),y (cm),z (cm)\n0,0,0,0\n1,1,0,0\n2,2,0,0.1\n3,3,0,0\n",
        "x (mm),y,z in mm\n0,0,0\n10,0,0\n20,0,1\n30,0,0\n",
    ],
)
def test_names_units_and_dialects(tmp_path, text):
    (tmp_path / "curve.txt").write_text(text)
    points = read_target(tmp_path / "curve.txt").points
    assert points == pytest.approx(np.array([[0, 0, 0], [10, 0, 0], [20, 0, 1], [30, 0, 0]]))


def test_a_coil_through_itself_is_said_by_shape_and_by_design(tmp_path):
    path = PEOPLE / "coil_through_itself.toml"
    design = Design.read(path)
    assert "runs through itself" in design.doubts[-1]
    assert overlap_doubts(design.manipulator, design.predict(10)) == ()
    with pytest.raises(ValueError, match="refused.*from 20 kPa on the body runs through itself"):
        run_shape(path, [10, 20, 40], tmp_path, outside="refuse")
    assert not list(tmp_path.iterdir())


def test_a_target_that_folds_back_or_has_a_corner_is_not_followed():
    straight = Curve(np.array([[0, 0, 0], [50, 0, 0], [100.0, 0, 0]]))
    folded = Curve(np.array([[0, 0, 0], [50, 0, 0], [0.0, 0, 0]]))
    assert compare(straight, straight).not_followed == 0 and compare(straight, straight).doubt == ""
    errors = compare(straight, folded)
    assert errors.not_followed == pytest.approx(0.49, abs=0.02)
    assert errors.doubt == "not followed: 49 % of length (farther than 2.0 mm away)"
    assert errors.doubt in errors.lines() and errors.table()["not_followed_percent"] > 48
