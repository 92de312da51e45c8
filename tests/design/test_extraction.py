from dataclasses import replace

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.strains import helix_frenet
from pneunet.design.target.extraction import extract, fit_arc, turn_about_axis
from pneunet.design.target.file import SHIPPED, read_target
from pneunet.design.target.target import Piece, Target


def rod(*pieces, spacing=1.0):
    """Frames (n, 4, 4) along a rod of (length, twist, curvature) pieces."""
    poses = [np.eye(4)]
    for length, twist, curvature in pieces:
        n = round(length / spacing)
        step = se3.exp_pose(length / n * np.array([twist, curvature, 0, 1, 0, 0]))
        for _ in range(n):
            poses.append(poses[-1] @ step)
    return np.array(poses)


def moved(points):
    return se3.transform(se3.exp_pose(np.array([0.4, -1.0, 2.0, 5.0, -6.0, 7.0])), points)


def opened(target):
    """The target with nothing given but the kinds and lengths of its pieces."""
    return replace(target, pieces=tuple(Piece(p.kind, p.length) for p in target.pieces))


@pytest.mark.parametrize("twist", [0.035, -0.035, 0.002, -0.09])
def test_a_helix_gives_its_curvature_torsion_and_pitch(twist):
    points = moved(rod((100, twist, 0.03), spacing=0.2)[:, :3, 3])
    arc = fit_arc(points, "helical")
    assert arc.curvature == pytest.approx(0.03, rel=1e-3) and arc.twist == pytest.approx(twist, rel=1e-3)
    assert arc.rms < 1e-3


def test_a_circle_gives_its_curvature_and_the_frames_at_its_ends():
    poses = rod((60, 0, 0.02), spacing=0.2)
    arc = fit_arc(poses[:, :3, 3], "bending")
    assert arc.curvature == pytest.approx(0.02, rel=1e-3) and arc.twist == 0
    assert np.allclose(arc.start, np.eye(3), atol=2e-3) and np.allclose(arc.end, poses[-1, :3, :3], atol=2e-3)


def test_turn_about_axis_is_signed():
    assert turn_about_axis(np.eye(3), se3.exp_rotation(np.array([-0.7, 0, 0]))) == pytest.approx(-0.7)


def test_octopus_by_fitting_alone():
    target = opened(read_target(SHIPPED / "octopus.toml"))
    twisting, bending, helical = extract(target, target.pieces)
    assert twisting.twist == pytest.approx(0.01 * np.pi, rel=1e-3) and twisting.twist_seen
    assert bending.curvature == pytest.approx(0.018, rel=1e-3)
    curvature, torsion = helix_frenet(0.07, 90)
    assert helical.curvature == pytest.approx(curvature, rel=1e-3) and helical.twist == pytest.approx(
        torsion, rel=1e-3
    )
    table = helical.table()
    assert table["cylinder_curvature_per_m"] == pytest.approx(70, rel=1e-3) and table[
        "pitch_mm"
    ] == pytest.approx(90, rel=1e-3)


@pytest.mark.parametrize("turn", [0.5, -2.5, 3.6])
def test_twist_between_arcs_is_known_modulo_a_turn(turn):
    points = rod((40, 0, 0.03), (50, turn / 50, 0), (40, 0, 0.03), spacing=0.2)[:, :3, 3]
    pieces = (Piece("bending", 40), Piece("twisting", 50), Piece("bending", 40))
    twisting = extract(Target(moved(points), pieces=pieces), pieces)[1]
    smallest = (turn + np.pi) % (2 * np.pi) - np.pi
    assert twisting.twist * 50 == pytest.approx(smallest, abs=5e-3) and twisting.twist_seen
    assert "modulo 360" in twisting.note


def test_a_given_twist_settles_the_turns():
    points = rod((40, 0, 0.03), (50, 0.15, 0), (40, 0, 0.03))[:, :3, 3]
    pieces = (Piece("bending", 40), Piece("twisting", 50, twist=0.15), Piece("bending", 40))
    twisting = extract(Target(points, pieces=pieces), pieces)[1]
    assert twisting.twist == 0.15 and "as given" in twisting.note


def test_twist_at_an_end_is_not_seen_and_that_is_said():
    points = rod((40, 0.02, 0), (40, 0, 0.03), (40, 0.02, 0))[:, :3, 3]
    pieces = (Piece("twisting", 40), Piece("bending", 40), Piece("twisting", 40))
    first, _, last = extract(Target(points, pieces=pieces), pieces)
    for piece in (first, last):
        assert piece.twist == 0 and not piece.twist_seen and "do not show" in piece.note


def test_frames_show_every_twist():
    poses = rod((40, 0.02, 0), (40, 0, 0.03), (40, -0.03, 0))
    pieces = (Piece("twisting", 40), Piece("bending", 40), Piece("twisting", 40))
    first, _, last = extract(Target(poses[:, :3, 3], frames=poses[:, :3, :3], pieces=pieces), pieces)
    assert first.twist == pytest.approx(0.02, abs=1e-4) and last.twist == pytest.approx(-0.03, abs=1e-4)
    assert first.twist_seen and last.twist_seen
