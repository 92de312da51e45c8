"""Parts of a body that run into each other: distances of imposed shapes, the load of first touch, what a run
says about it."""

import csv
import json

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.base import se3
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Manipulator, Segment
from pneunet.geometry.designfile import DesignFile
from pneunet.hifi.contact.body_distance import winding_numbers
from pneunet.hifi.contact.touch import Load, Touch, TouchWatch, first_zero
from pneunet.hifi.runs.solve.solve import solve_design
from tests.hifi.test_manipulator import set_positions

#: mm of undeformed length in one turn of the staircase that the reference body, 44 mm long, is wound to
TURN = 35.0
MESH = {"mesh_size": 4.0, "element": "tetrahedra"}
TALL = Segment(
    "twisting",
    60.0,
    2,
    width=15.0,
    channel_width=4.0,
    channel_height=2.0,
    cavity_floor=0.5,
    chamber_height=7.5,
    gap=1.0,
    material=NeoHookean(0.317),
)


def wind(solve, clear):
    """Wind the body about y, sections staying upright, so that after a turn it passes itself with `clear` mm
    between its sides.

    Returns the distance of two such stairs, whose sides are as steep as at the radius of the axis.
    """
    stretch, rise = 3.0, (solve.manipulator.segments[0].width + clear) / TURN
    screw = np.array([0, 2 * np.pi / TURN, 0, stretch, rise, 0])
    X = solve.problem.nodes
    poses = se3.exp_pose(X[:, :1] * screw)
    set_positions(solve.problem, np.einsum("nij,nj->ni", poses[:, :3, :3], X * [0, 1, 1]) + poses[:, :3, 3])
    return clear * stretch / np.hypot(stretch, rise)


@pytest.mark.parametrize("clear", [3.0, 0.5, -0.5, -2.0])
def test_a_body_wound_into_itself_is_as_deep_in_as_it_was_wound(reference, clear):
    expected = wind(reference, clear)
    touch = reference.measure().touch
    assert touch.body_distance == pytest.approx(expected, rel=0.015)
    assert touch.body_overlap == (clear < 0) and not touch.walls_overlap
    assert touch.warnings == ["body overlap"] * (clear < 0)


def test_straight_and_compressed_bodies_have_no_far_parts_that_meet(reference):
    apart = reference.body_distance.apart
    assert apart <= reference.measure().touch.body_distance < 1.3 * apart
    set_positions(reference.problem, reference.problem.nodes * [0.3, 1.0, 1.0])
    assert 0.3 * apart <= reference.measure().touch.body_distance < 0.4 * apart


def test_load_at_which_coils_touch_is_interpolated(reference):
    """Wound tighter and tighter while the pressure rises by 1 kPa per mm: zero is passed at 4 kPa."""
    for kPa in (0.0, 2.5, 5.5, 6.0):
        reference.pressure.value.value = kPa * 1e-3
        wind(reference, 4.0 - kPa)
        touch = reference.measure().touch
    assert touch.body_from.pressure == pytest.approx(4e-3, rel=1e-3)
    assert (
        touch.table()["first_body_touch_kPa"] == pytest.approx(4.0, rel=1e-3)
        and touch.table()["first_touch_kPa"] is None
    )
    wind(reference, 3.0)
    assert reference.measure().touch.body_overlap  # marked for good: how it came here cannot be


def test_first_zero_lies_between_its_neighbours():
    loads = np.array([[1.0], [2.0], [3.5]])
    distances = np.array([1.5, 0.7, -0.4])
    assert first_zero(3 - distances[:, None] - 0.1 * distances[:, None] ** 2, distances) == pytest.approx(3.0)
    assert first_zero(loads, (2.9 - loads[:, 0]) * 2) == pytest.approx(2.9)
    # no parabola through a turn
    assert first_zero(loads, [1.0, 1.001, -1.0]) == pytest.approx(2.0 + 1.5 * 1.001 / 2.001)
    assert first_zero(loads[:1], [-0.1]) == pytest.approx(1.0)


def test_what_is_marked_depends_on_contact():
    for contact in (False, True):
        watch = TouchWatch(contact)
        watch.see(Load(0.0), 1.0, np.inf)
        before = watch.see(Load(0.01), 0.5, np.inf)
        touch = watch.see(Load(0.03), -0.5, np.inf)
        assert (
            touch.walls_from.pressure == pytest.approx(0.02, abs=1e-3) and touch.walls_overlap is not contact
        )
        assert (
            len(list(touch.news(before))) == 1
            and not list(touch.news(touch))
            and not list(before.news(Touch()))
        )
        assert ("without contact" in touch.text) is not contact
    dead = TouchWatch()
    dead.see(Load(0.0, 0.0), 1.0, np.inf)
    assert str(dead.see(Load(0.0, 0.5), -1.0, np.inf).walls_from) == "25 % of the dead loads"


def test_winding_number_tells_inside_from_outside():
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    faces = corners[[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]]
    inside, outside = np.zeros(3), np.array([2.0, 0.3, 0.1])
    assert np.abs(winding_numbers(np.array([inside, outside]), faces)) == pytest.approx([1.0, 0.0], abs=1e-12)
    assert np.abs(winding_numbers(np.array([inside, outside]), faces[:3]))[1] < 0.5  # open: still outside


def rows(path):
    with open(path, newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_run_marks_all_it_writes_from_first_touch_on(shared_directory, caplog):
    """Tall chambers a millimetre apart: touching at about 7.5 kPa; the run goes on later and does not
    forget."""
    caplog.set_level("INFO", "pneunet")
    design = DesignFile(Manipulator((TALL,)), pressure=0.009, contact="none", **MESH)
    last = solve_design(design, shared_directory, fields=False)
    assert (
        last.touch.walls_overlap
        and not last.touch.body_overlap
        and 6 < last.touch.walls_from.pressure * 1e3 < 9
    )
    again = solve_design(design, shared_directory, pressure=0.010, fields=False, resume=True)
    assert again.touch.walls_from.pressure == pytest.approx(last.touch.walls_from.pressure, rel=1e-9)
    if MPI.COMM_WORLD.rank == 0:
        assert sum("touch at" in text for text in caplog.messages) == 1
        last_line = caplog.messages[-1]
        assert "WALLS OVERLAP from" in last_line and last_line.startswith("done: 10 kPa")
        out = shared_directory / "solve"
        record, steps = json.loads((out / "run.json").read_text()), rows(out / "steps.csv")
        first = record["first_touch_kPa"]
        assert (
            record["walls_overlap"] and not record["body_overlap"] and record["first_body_touch_kPa"] is None
        )
        for row in [*steps, *rows(out / "segments.csv"), *rows(out / "centrelines.csv")]:
            assert (
                row["walls_overlap"] == str(int(float(row["pressure_kPa"]) > first))
                and row["body_overlap"] == "0"
            )
        assert all(
            (float(row["smallest_wall_distance_mm"]) < 0) == (row["walls_overlap"] == "1") for row in steps
        )
        assert [step["walls_overlap"] for step in record["steps"]] == [
            row["walls_overlap"] == "1" for row in steps
        ]


def test_contact_holds_walls_apart_on_any_number_of_ranks_and_after_a_resumption(shared_directory, caplog):
    caplog.set_level("INFO", "pneunet")
    design = DesignFile(Manipulator((TALL,)), pressure=0.009, **MESH)
    last = solve_design(design, shared_directory, fields=False)
    again = solve_design(design, shared_directory, pressure=0.012, fields=False, resume=True)
    for m in (last, again):
        assert m.touch.contact and not m.touch.walls_overlap and 6 < m.touch.walls_from.pressure * 1e3 < 9
        assert abs(m.touch.wall_distance) < 0.03 * TALL.gap
    assert 0 < last.touch.contact_force < again.touch.contact_force
    assert again.touch.walls_from.pressure == pytest.approx(last.touch.walls_from.pressure, rel=1e-9)
    if MPI.COMM_WORLD.rank == 0:
        out = shared_directory / "solve"
        assert float(rows(out / "steps.csv")[-1]["contact_force_N"]) == pytest.approx(
            again.touch.contact_force, rel=1e-9
        )
        assert (
            not json.loads((out / "run.json").read_text())["walls_overlap"]
            and "held apart by contact" in caplog.text
        )
