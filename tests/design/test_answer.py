"""What a design says of itself: casting grid, shapes at several pressures, tolerances, followed or not."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.files.toml import to_table
from pneunet.base.materials.laws import PAPER_TWISTING, of_modulus, silicone
from pneunet.cli import NOT_FOLLOWED, main
from pneunet.design.design import Design
from pneunet.design.inverse_design import answer, describe, inverse_design, summary, weight_told, wrapped
from pneunet.design.search.groups import divided
from pneunet.design.search.inverse import _Search, search
from pneunet.design.target.casting import Casting
from pneunet.design.target.extraction import Extracted, extract
from pneunet.design.target.shapes import TargetShape
from pneunet.design.target.target import Target
from pneunet.geometry.designfile import read_design_file
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced import predict
from pneunet.reduced.rod.clearance import gap_left, wall_stretch
from tests.design.test_inverse import BASE, made
from tests.design.toy_law import ToyLaw

PAIR = (
    Segment("one-sided", 90.0, 7, base_thickness=2.4),
    Segment("one-sided", 60.0, 9, chamber_height=4.4, base_thickness=1.6),
)


def test_dimensions_land_on_the_grid_with_a_flush_underside():
    line, pieces = made(PAIR)
    target = Target(line.points, pieces=pieces, **BASE)
    found = search(target, extract(target, pieces), ToyLaw())
    a, b = found.best.manipulator.segments
    for segment in (a, b):
        sizes = np.array([segment.chamber_height, segment.gap, segment.wall, segment.end_margin])
        assert np.allclose(sizes / 0.05, np.round(sizes / 0.05)) and segment.angle % 0.5 == 0
    assert a.base_thickness == b.base_thickness and found.flush_costs >= 0
    stepped = replace(target, casting=Casting(allow_steps=True))
    a, b = search(stepped, extract(stepped, pieces), ToyLaw(), alternatives=0).best.manipulator.segments
    assert a.base_thickness != b.base_thickness
    assert len(found.alternatives) and all(c.differs(found.best) for c in found.alternatives)
    assert all(c.rms >= 0.9 * found.best.rms for c in found.alternatives)


def test_walls_and_touching_are_the_casters_to_allow():
    line, pieces = made(PAIR, 0.05)
    target = Target(line.points, pieces=pieces, pressure_range=(0.05, 0.05), **BASE)
    target = replace(target, casting=Casting(walls=(0.6, 0.7), allow_touch=False))
    kept = search(target, extract(target, pieces), ToyLaw(), alternatives=0).best.manipulator.segments
    assert all(0.6 <= s.wall <= 0.7 and gap_left(s, 0.05) > -0.05 for s in kept)
    allowed = replace(target, casting=Casting(walls=(0.6, 0.7), allow_touch=True))
    touching = search(allowed, extract(allowed, pieces), ToyLaw(), alternatives=0).best.manipulator.segments
    assert any(gap_left(s, 0.05) < -0.05 for s in touching)


def test_walls_of_a_brittle_silicone_stay_below_half_of_its_elongation_at_break():
    line, pieces = made(PAIR, 0.05)
    brittle = replace(PAPER_TWISTING, elongation_at_break=0.03)
    target = Target(line.points, pieces=pieces, casting=Casting(allow_touch=True, walls=(1.0, 1.0)), **BASE)
    tough = search(target, extract(target, pieces), ToyLaw(), alternatives=0)
    of_tough = [wall_stretch(s, tough.best.pressure) for s in tough.best.manipulator.segments]
    assert max(of_tough) > 1.015 and not any("stretch of walls" in text for text in tough.active)
    target = replace(target, material=brittle)
    kept = search(target, extract(target, pieces), ToyLaw(), alternatives=0)
    of_kept = [wall_stretch(s, kept.best.pressure) for s in kept.best.manipulator.segments]
    assert max(of_kept) < 1.015
    most = int(np.argmax(of_kept))
    told = f"segment {most + 1} stretch of walls (estimate: {of_kept[most]:.3f} of 1.015 allowed)"
    assert told in kept.active
    fixed = replace(target, vary={}, start={"end_margin": 3.0})  # the pressure alone gives in
    assert "stretch of walls" in search(fixed, extract(fixed, pieces), ToyLaw(), alternatives=0).stopped_by


def test_a_body_that_runs_through_itself_wins_only_where_the_curve_does(monkeypatch):
    line, pieces = made(PAIR)
    target = Target(line.points, pieces=pieces, **BASE)
    turn = np.linspace(0, 4 * np.pi, 101)  # twice around a circle of 20 mm
    twice = np.column_stack([20 * np.sin(turn), 20 - 20 * np.cos(turn), 0 * turn])

    def coiled(best, wanted):
        """A better one that is a coil, where `wanted` is the curve."""
        (shape, *_), (aim, *_) = best.at.shapes, best.problem.aims
        poses = np.tile(np.eye(4), (len(turn), 1, 1))
        poses[:, :3, :3] = se3.exp_rotation(turn[:, None] * [0.0, 0.0, 1.0])
        poses[:, :3, 3] = twice
        at = replace(best.at, shapes=(replace(shape, placed=replace(shape.placed, poses=poses)),))
        problem = replace(best.problem, aims=(replace(aim, points=aim.points if wanted is None else wanted),))
        return replace(best, rms=best.rms / 2, at=at, problem=problem)

    for wanted in (None, twice):
        found = lambda self, best, *others, wanted=wanted: (coiled(best, wanted),)  # noqa: E731
        monkeypatch.setattr(_Search, "_alternatives", found)
        found = search(target, extract(target, pieces), ToyLaw())
        (other,) = found.alternatives
        better, worse = sorted((found.best, other), key=lambda c: c.rms)
        assert better.overlaps == (wanted is None) and not worse.overlaps
        assert found.best is (worse if wanted is None else better)


def test_one_body_meets_two_shapes_at_their_pressures():
    body = Manipulator(PAIR)
    high, pieces = made(PAIR, 0.04)
    low = predict(body, 0.02, ToyLaw(), 0.5)
    shape = TargetShape(low.points, (0.02,))
    target = Target(high.points, pieces=pieces, pressure_range=(0.04, 0.04), shapes=(shape,), **BASE)
    design = inverse_design(target, law=ToyLaw())
    assert design.errors.rms < 0.005 * design.errors.reference_length
    assert design.further_errors[0].rms < 0.005 * design.errors.reference_length
    assert design.content.result["shape_error"][0]["rms_mm"] == design.further_errors[0].rms


def test_points_of_the_tip_are_told_each_at_its_pressure(tmp_path):
    rows = [(P, *predict(Manipulator(PAIR[:1]), P / 1e3, ToyLaw()).points[-1]) for P in (20.0, 40.0)]
    np.savetxt(tmp_path / "tip.csv", rows, "%.6f", ",", header="pressure_kPa,x_mm,y_mm,z_mm", comments="")
    (tmp_path / "a.toml").write_text('tip_points = "tip.csv"\nbase = { direction = [1, 0, 0] }\n')
    design = inverse_design(tmp_path / "a.toml", law=ToyLaw())
    away = [
        np.linalg.norm(
            predict(design.manipulator, P / 1e3, ToyLaw(), base_pose=design.content.base_pose).points[-1]
            - end
        )
        for P, *end in rows
    ]
    assert design.tip_errors == pytest.approx(away, abs=1e-5) and design.followed
    lines = list(summary(design))
    first = lines.index("points of the tip:") + 1
    assert lines[first].startswith("  at 20 kPa: ") and lines[first + 1].startswith("  at 40 kPa: ")
    assert next(answer(design)).startswith("followed: tip at most ")
    assert "given by the user" not in design.content.result["split"]
    flat = Extracted("helical", 95.0, 1e-12, 0.01, 0.0)
    assert describe(flat).startswith("bending") and "pitch" not in describe(flat)
    missed = replace(design.target.tip, points=design.target.tip.points + 9.0)
    far = Design(design.content, ToyLaw(), replace(design.target, tip=missed), tolerances=design.tolerances)
    assert not far.followed and next(answer(far)).startswith("NOT followed: tip at most ")


def test_weight_is_named_where_without_it_the_curve_is_followed():
    line, pieces = made(PAIR)
    target = Target(line.points, pieces=pieces, gravity=(0.0, 0.0, -9810.0), **BASE)
    told = weight_told(target, extract(target, pieces), ToyLaw())
    assert told.startswith("its own weight is the cause: without gravity a body comes within 0.")
    weak = replace(target, pressure_range=(0.005, 0.005))  # never near, with or without it
    assert weight_told(weak, extract(weak, pieces), ToyLaw()) == ""


def test_that_another_candidate_won_is_said(monkeypatch, caplog):
    line, pieces = made(PAIR)
    target = Target(line.points, pieces=pieces, **BASE)
    better = lambda self, best, *others: (replace(best, rms=best.rms / 2),)  # noqa: E731
    monkeypatch.setattr(_Search, "_alternatives", better)
    with caplog.at_level("INFO", "pneunet"):
        found = search(target, extract(target, pieces), ToyLaw())
    assert found.alternatives[0].rms == 2 * found.best.rms
    assert f"another candidate wins:  {found.best}" in caplog.messages


def test_tolerances_are_what_small_changes_do():
    line, pieces = made(PAIR)
    design = inverse_design(Target(line.points, pieces=pieces, **BASE), law=ToyLaw())
    # alternatives say what differs from the design alone
    for one, told in zip(design.alternatives, design.content.result["alternative"], strict=True):
        for own, best, table in zip(one.manipulator.segments, design.manipulator.segments, told["segment"]):
            assert to_table(best) | table == to_table(own) and "width_mm" not in table
    effects = {(e.name, e.segment): e for e in design.tolerances.effects}
    one = design.manipulator.segments[0]
    thicker = Manipulator(
        (replace(one, base_thickness=one.base_thickness + 1e-3), *design.manipulator.segments[1:])
    )
    moved = predict(thicker, design.content.pressure, ToyLaw(), base_pose=design.content.base_pose)
    away = np.linalg.norm(moved.points[-1] - design.prediction.points[-1])
    assert effects["base_thickness_mm", 1].tip == pytest.approx(100 * away, rel=0.02)
    soft = of_modulus(PAPER_TWISTING, 0.999 * PAPER_TWISTING.mu)
    softer = tuple(replace(s, material=soft) for s in design.manipulator.segments)
    moved = predict(
        Manipulator(softer), design.content.pressure, ToyLaw(), base_pose=design.content.base_pose
    )
    away = np.linalg.norm(moved.points[-1] - design.prediction.points[-1])
    assert effects["mu_MPa", None].tip == pytest.approx(10 * away, rel=0.02)
    told = Casting()
    expected = 0.0
    for e in effects.values():
        scale = {"angle_deg": told.angle_tolerance, "mu_MPa": told.modulus_tolerance / 0.01}
        scale["pressure_kPa"] = 1e3 * told.pressure_tolerance
        expected += (e.tip * scale.get(e.name, told.tolerance / 0.1)) ** 2
    assert design.tolerances.tip == pytest.approx(np.sqrt(expected), rel=1e-6)


def test_an_answer_in_plain_words(tmp_path, capsys):
    t = np.linspace(0, 1, 80)
    # 160 1/m: nothing bends so much
    tight = np.column_stack([5 * np.sin(12 * t), 30 * t, 5 * np.cos(12 * t)])
    np.savetxt(tmp_path / "coil.csv", tight, "%.4f", ",", header="x_mm,y_mm,z_mm", comments="")
    assert main(["design", str(tmp_path / "coil.csv"), "-o", str(tmp_path / "out")]) == NOT_FOLLOWED
    result = read_design_file(tmp_path / "out" / "design.toml").result
    assert "NOT followed: " in capsys.readouterr().out
    assert not result["followed"] and result["tolerances"]["casting_rms_mm"] > 0
    line, pieces = made(PAIR)
    design = inverse_design(Target(line.points, pieces=pieces, **BASE), law=ToyLaw())
    lines = list(wrapped((*summary(design), *answer(design))))
    assert max(map(len, lines)) <= 100
    assert lines[lines.index("what moves it most:") + 1].startswith("  segment ")
    last = list(answer(design))
    assert last[0].startswith("followed: RMS") and "law 'toy' does not know" in last[1]
    assert last[2].startswith("ASSUMED silicone: paper, twisting theory, mu = 0.317 MPa")


def test_the_silicone_is_chosen_from_a_list_or_a_range():
    soft, stiff = silicone("Dragon Skin 10 MEDIUM"), silicone("Dragon Skin 30")
    line, pieces = made(tuple(replace(s, material=stiff) for s in PAIR), 0.05)
    target = Target(line.points, pieces=pieces, pressure_range=(0.05, 0.05), **BASE)
    listed = replace(target, casting=Casting(silicones=(soft.name, stiff.name)))
    design = inverse_design(listed, law=ToyLaw())
    assert {s.material for s in design.manipulator.segments} == {stiff}
    assert design.content.result["silicone"] == stiff.name
    assert list(answer(design))[2].startswith("chosen of 2 silicones: Dragon Skin 30, mu = ")
    # dimensions fixed: the modulus alone makes up for the pressure
    dimensions = {"base_thickness": 2.0, "chamber_height": 4.0}
    body = tuple(replace(s, **dimensions, material=of_modulus(PAPER_TWISTING, 0.2)) for s in PAIR)
    line, pieces = made(body, 0.03)
    target = Target(line.points, pieces=pieces, pressure_range=(0.03, 0.03), vary={}, **BASE)
    ranged = replace(target, casting=Casting(moduli=(0.1, 0.5)))
    found = search(ranged, extract(ranged, pieces), ToyLaw(), alternatives=0).best.manipulator.segments
    assert [s.material.mu for s in found] == pytest.approx([0.2, 0.2], rel=0.02)


def test_a_limit_below_the_pressure_is_said():
    weak = replace(PAPER_TWISTING, elongation_at_break=0.001)
    line, pieces = made(PAIR, 0.05)
    fixed = {"pressure_range": (0.05, 0.05), "vary": {}}  # no dimension can make up for it
    target = Target(line.points, pieces=pieces, material=weak, **fixed, **BASE)
    told = inverse_design(target, law=ToyLaw(limit=0.06)).content.result["pressure_limits"]
    assert "(EXCEEDED): walls of segment " in told[0] and "elongation at break" in told[0]
    gives_way = next(text for text in told if text.endswith("the law finds no equilibrium beyond"))
    assert float(gives_way.split()[0]) == pytest.approx(60, abs=0.6)


def test_walls_are_within_what_is_cast():
    line, pieces = made(PAIR)
    target = Target(line.points, pieces=pieces, casting=Casting(walls=(1.4, 1.8)), **BASE)
    for s in search(target, extract(target, pieces), ToyLaw(), alternatives=0).best.manipulator.segments:
        assert all(1.4 <= wall <= 1.8 for wall in (s.wall, s.top_wall, s.side_wall, s.roof))


def test_each_group_of_segments_has_a_pressure_of_its_own(tmp_path):
    body = (PAIR[0], replace(PAIR[1], chamber_height=4.0, base_thickness=2.4, group=2))
    line, pieces = made(body, (0.045, 0.02))
    pieces = (pieces[0], replace(pieces[1], group=2))
    low = predict(Manipulator(body), (0.02, 0.03), ToyLaw(), 0.5)
    # the dimensions are known: only pressures make up for it
    target = Target(line.points, pieces=pieces, vary={}, start={"base_thickness": 2.4}, **BASE)
    target = replace(target, shapes=(TargetShape(low.points, (0.02, 0.03)),))
    # which segments share one is found where nobody says
    unsaid = replace(target, pieces=tuple(replace(p, group=1) for p in pieces), groups=2)
    free = inverse_design(unsaid, law=ToyLaw())
    assert free.content.pressure == pytest.approx((0.045, 0.02), rel=0.01)
    fixed = inverse_design(replace(target, pressures=(0.045, 0.02)), law=ToyLaw())
    for design in (free, fixed):
        assert design.errors.rms < 0.3 and design.further_errors[0].rms < 0.3
    assert fixed.content.pressure == (0.045, 0.02)
    names = [e.name for e in free.tolerances.effects][-3:]
    assert names == ["pressure_group_1_kPa", "pressure_group_2_kPa", "mu_MPa"]
    folder = free.save(tmp_path / "out")
    assert [p.group for p in Target.read(folder / "split.toml").pieces] == [1, 2]
    with pytest.raises(InputError, match="3 pressures need as many pieces that bend or twist, not 2"):
        inverse_design(replace(unsaid, pressures=(0.03, 0.02, 0.01)), law=ToyLaw())
    with pytest.raises(InputError, match=r"^arm.toml: pressure_kPa: "):
        inverse_design(replace(unsaid, pressures=(0.03, 0.02, 0.01), source="arm.toml"), law=ToyLaw())
    five = [Extracted("bending", 30.0, 0.0, 0.01, 0.0)] * 2 + [Extracted("passive", 9.0, 0.0, 0.0, 0.0)]
    found = divided(replace(unsaid, groups=2), five + five[:1] * 2)
    groups = [[p.group for p in parts] for parts in found]
    assert groups == [[1, 2, 2, 2, 2], [1, 1, 1, 2, 2], [1, 1, 1, 1, 2]]
