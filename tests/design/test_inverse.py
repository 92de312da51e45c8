from dataclasses import replace

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.design.search.aims import EQ27
from pneunet.design.search.inverse import search
from pneunet.design.search.lookup import count_for
from pneunet.design.search.possible import out_of_reach, reaches
from pneunet.design.search.space import RANGES
from pneunet.design.target.extraction import Extracted, extract
from pneunet.design.target.metrics import compare
from pneunet.design.target.target import Piece, Target
from pneunet.geometry.parameters import ONE_SIDED, Manipulator, Segment
from pneunet.reduced import predict
from tests.design.toy_law import ToyLaw

TWISTING = Segment("twisting", 65.0, 7, gap=2.2, cavity_floor=0.5, chamber_height=5.5)
BENDING = Segment("one-sided", 90.0, 5)
HELICAL = Segment("one-sided", 60.0, 9, chamber_height=4.4)
BASE = {"base_direction": np.array([1.0, 0, 0]), "base_width": np.array([0, 1.0, 0])}
MIRROR = np.array([1.0, -1.0, 1.0])


def made(segments, pressure=0.04, pose=None):
    """(centreline, pieces) of a known manipulator; the pieces have the right kinds and deformed lengths
    only."""
    line = predict(Manipulator(segments), pressure, ToyLaw(), 0.5, pose)
    ends = np.interp(np.append(Manipulator(segments).starts, line.s[-1]), line.s, line.arc_length)
    kinds = [
        "twisting" if s.kind == "twisting" else "bending" if s.angle == 90 else "helical" for s in segments
    ]
    return line, tuple(Piece(kind, length) for kind, length in zip(kinds, np.diff(ends)))


def designed(target, objective="paired", law=None):
    law = law or ToyLaw()
    solution = search(target, extract(target, target.pieces), law, objective, alternatives=0)
    best = solution.best
    line = predict(best.manipulator, best.pressure, law, 0.5, best.base_pose)
    return best, compare(line.points, target.points), line


def test_real_numbers_of_chambers_agree_with_segment_at_whole_ones():
    assert count_for(HELICAL, 1.0, HELICAL.length) == pytest.approx(9)


def test_a_known_design_is_recovered_from_its_centreline():
    line, pieces = made((TWISTING, BENDING, HELICAL))
    solution, errors, _ = designed(Target(line.points, pieces=pieces, **BASE))
    assert errors.rms < 0.1 and errors.hausdorff < 0.3
    assert errors.eq27 <= errors.eq27_points * 0.1**2
    assert [s.chambers for s in solution.manipulator.segments] == pytest.approx([7, 5, 9], abs=1)
    assert [s.angle for s in solution.manipulator.segments] == pytest.approx([65, 90, 60], abs=3)
    assert np.allclose(solution.base_pose, np.eye(4))


def test_the_base_turns_to_a_target_anywhere_in_space():
    pose = se3.exp_pose(np.array([1.0, -0.5, 2.0, 30.0, 40.0, -20.0]))
    line, pieces = made((BENDING, HELICAL), pose=pose)
    solution, errors, _ = designed(Target(line.points, pieces=pieces))
    assert errors.rms < 0.1
    assert np.allclose(solution.base_pose[:3, 3], pose[:3, 3]) and np.allclose(
        solution.base_pose, pose, atol=0.05
    )


def test_a_fixed_direction_leaves_the_roll_free():
    pose = se3.exp_pose(np.array([1.0, 0, 0, 0, 0, 0]))
    line, pieces = made((BENDING, HELICAL), pose=pose)
    solution, errors, _ = designed(Target(line.points, pieces=pieces, base_direction=BASE["base_direction"]))
    assert (
        errors.rms < 0.1
        and np.allclose(solution.base_pose[:3, 0], [1, 0, 0])
        and np.allclose(solution.base_pose, pose, atol=0.05)
    )


def test_mirrored_target_gives_the_mirrored_design():
    line, pieces = made((TWISTING, HELICAL))
    one, _, _ = designed(Target(line.points, pieces=pieces, **BASE))
    other, errors, _ = designed(Target(line.points * MIRROR, pieces=pieces, **BASE))
    assert errors.rms < 0.1 and one.pressure == pytest.approx(other.pressure, rel=0.02)
    for a, b in zip(one.manipulator.segments, other.manipulator.mirrored.segments):
        assert a.chambers == b.chambers and a.angle == pytest.approx(b.angle, abs=0.5)


def test_twist_that_no_point_shows_is_still_built_as_given():
    line, pieces = made((HELICAL, TWISTING))
    pieces = (pieces[0], replace(pieces[1], twist=0.02))
    solution, _, _ = designed(Target(line.points, pieces=pieces))
    segment = solution.manipulator.segments[1]
    turned = ToyLaw().strains(segment, solution.pressure).k[0] * segment.chambers * segment.pitch
    assert turned == pytest.approx(0.02 * pieces[1].length, abs=0.05)


def test_frames_are_followed():
    line, pieces = made((HELICAL, TWISTING))
    target = Target(line.points, frames=line.poses[:, :3, :3], pieces=pieces)
    solution, errors, found = designed(target)
    assert errors.rms < 0.2
    assert np.allclose(found.poses[-1, :3, :3], line.poses[-1, :3, :3], atol=0.05)
    # frames that lean cannot be met: they are in what is minimised, not in the centreline's error
    leaning = replace(target, frames=target.frames @ se3.exp_rotation(np.array([0, 0, 0.05])))
    solution, errors, _ = designed(leaning)
    assert solution.rms > 2 * errors.rms and solution.centreline_rms == pytest.approx(errors.rms, rel=0.05)


def test_active_bounds_are_named_with_what_they_cost():
    line, pieces = made((replace(BENDING, chambers=8),), pressure=0.05)
    target = Target(
        line.points, pieces=pieces, pressure_range=(0.01, 0.02), vary={"chamber_height": (3.0, 4.0)}
    )
    found = search(target, extract(target, target.pieces), ToyLaw(), alternatives=0)
    assert found.best.pressure == pytest.approx(0.02, rel=1e-2) and found.best.rms > 0.5
    of_pressure = next(text for text in found.active if text.startswith("pressure = 20 kPa (upper bound); "))
    assert any(text.startswith("segment 1 chamber_height = 4 mm (upper bound); ") for text in found.active)
    assert found.stopped_by == found.active[0]
    # 1 kPa more saves what it says, to first order
    wider = replace(target, pressure_range=(0.01, 0.0205))
    saved = found.best.rms - search(wider, extract(target, target.pieces), ToyLaw(), alternatives=0).best.rms
    told = float(of_pressure.split("would save ")[1].split()[0])
    assert 2 * saved == pytest.approx(told, rel=0.1)


def test_eq27_objective_is_the_papers_sum():
    line, pieces = made((BENDING, HELICAL))
    points = line.points + np.column_stack([0 * line.s, 0 * line.s, 0.5 * np.sin(line.s / 15)])
    target = Target(points, pieces=pieces)
    _, paired, _ = designed(target)
    _, nearest, _ = designed(target, EQ27)
    assert nearest.eq27 <= 1.001 * paired.eq27


def test_a_law_that_ends_at_a_limit_load_is_kept_within():
    line, pieces = made((BENDING, HELICAL), pressure=0.03)
    solution, errors, _ = designed(Target(line.points, pieces=pieces), law=ToyLaw(limit=0.032))
    assert solution.pressure <= 0.032 and errors.rms < 0.2
    with pytest.raises(ConvergenceError, match="no equilibrium for these dimensions"):
        designed(Target(line.points, pieces=pieces), law=ToyLaw(limit=0.001))


def test_what_cannot_be_built_is_said():
    line, pieces = made((BENDING, HELICAL))
    with pytest.raises(InputError, match=r"\[\[piece\]\] 1: length_mm = 4 is too short"):
        designed(
            Target(
                line.points,
                pieces=(Piece("bending", 4.0), Piece("helical", sum(p.length for p in pieces) - 4)),
            )
        )
    with pytest.raises(InputError, match=r"\[segment\].*side_wall_mm"):
        designed(Target(line.points, pieces=pieces, start={"side_wall": 6.0}))
    with pytest.raises(InputError, match=r"\[vary\].*angle_deg = 10"):
        designed(Target(line.points, pieces=pieces, vary={"angle": (10.0, 20.0)}))
    with pytest.raises(InputError, match="objective = 'best' is not known"):
        designed(Target(line.points, pieces=pieces), objective="best")


def test_what_no_allowed_dimensions_reach_is_said():
    law = ToyLaw()
    target = Target(np.column_stack([10.0 * np.arange(9), np.zeros((9, 2))]), pressure_range=(0.02, 0.02))
    like = Extracted("bending", 40.0, 0.0, 0.0, 0.0)
    most = 0.01 / min(float(found.share(0.01, 0.0)) for found in reaches(target, like, law))
    # the toy bends with height over the root of the base: the largest height at the thinnest base
    heights, bases = (RANGES[ONE_SIDED][name][0] for name in ("chamber_height", "base_thickness"))
    toy = 0.04 * 0.4 * heights[1] / 4 * (2 / bases[0]) ** 0.5
    assert most == pytest.approx(toy / (1 + 0.04 * 0.4), rel=1e-9)
    pieces = [replace(like, curvature=c) for c in (0.9 * most, 1.5 * most)]
    pieces.append(Extracted("helical", 40.0, 0.03, 0.001, 0.0))
    assert list(out_of_reach(target, pieces, law)) == [
        "piece 2 alone is out of reach: it asks for 150 % of the most that allowed dimensions do at 20 kPa",
        "piece 3 alone is out of reach: no allowed angle twists so much for its curvature",
    ]
