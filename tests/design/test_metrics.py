import numpy as np
import pytest

from pneunet.base.curve import Curve
from pneunet.design.target.metrics import compare, eq27, hausdorff, paired_rms


def line(length, offset=0.0, n=50):
    x = np.linspace(0, length, n)
    return Curve(np.column_stack([x, np.full(n, offset), np.zeros(n)]))


def circle(radius, n=4001):
    t = np.linspace(0, 2 * np.pi, n)
    return Curve(radius * np.column_stack([np.cos(t), np.sin(t), 0 * t]))


def test_parallel_lines_differ_by_their_offset_in_every_way():
    errors = compare(line(100, 3.0), line(100, n=30))
    assert (
        errors.rms == pytest.approx(3)
        and errors.hausdorff == pytest.approx(3)
        and errors.tip == pytest.approx(3)
    )
    assert errors.eq27 == pytest.approx(30 * 9) and errors.eq27_points == 30
    assert errors.length_mismatch == pytest.approx(0, abs=1e-12)


def test_concentric_circles():
    a, b = circle(20), circle(25)
    assert paired_rms(a, b) == pytest.approx(5, rel=1e-6)
    assert hausdorff(Curve(a.points[::4]), Curve(b.points[::4])) == pytest.approx(5, rel=1e-4)
    assert compare(b.points[::4], a.points[::4]).length_mismatch == pytest.approx(2 * np.pi * 5, rel=1e-4)


def test_a_curve_that_is_too_long_lowers_neither_rms_nor_hausdorff_though_eq27_is_blind_to_it():
    errors = compare(line(110), line(100))
    assert errors.eq27 == pytest.approx(0, abs=1e-20)
    assert errors.rms == pytest.approx(10 * np.sqrt(np.mean(np.linspace(0, 1, 201) ** 2)))
    assert errors.hausdorff == pytest.approx(10) and errors.tip == pytest.approx(10)
    assert errors.table()["length_mismatch_mm"] == pytest.approx(10)
    assert errors.table()["length_mismatch_percent"] == pytest.approx(10)


def test_hausdorff_sees_both_sides():
    spike = Curve([[0, 0, 0], [50, 0, 0], [50, 8, 0], [50, 0, 0], [100, 0, 0.0]])
    assert hausdorff(spike, line(100)) == hausdorff(line(100), spike) == pytest.approx(8)


def test_distances_are_to_segments_not_to_vertices():
    assert eq27(np.array([[50.0, 2.0, 0.0]]), Curve([[0, 0, 0], [100, 0, 0.0]])) == pytest.approx(4)
