from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.design.segmentation.fit import Observations, RodFit, refined
from pneunet.design.segmentation.rod import PiecewiseRod, advance
from pneunet.design.segmentation.segment import fitted, segment
from pneunet.design.segmentation.windows import arc_lengths
from pneunet.design.target.file import SHIPPED, read_target
from pneunet.design.target.target import Piece, SplitOptions, Target

PEOPLE = Path(__file__).parents[1] / "data" / "people"

ROD = PiecewiseRod(
    se3.exp_pose(np.array([0.4, -1.0, 2.0, 5.0, -6.0, 7.0])),
    np.array([40.0, 75.0, 110.0]),
    np.array([[0.0, 0.03], [0.02, 0.0], [0.0, 0.0], [-0.015, -0.02]]),
)
STATIONS = np.array([-3.0, 10, 39, 41, 60, 90, 109, 111, 150, 400])


def screws(strains):
    k1, k2 = np.moveaxis(np.asarray(strains), -1, 0)
    return np.stack([k1, k2, 0 * k1, 1 + 0 * k1, 0 * k1, 0 * k1], axis=-1)


@pytest.mark.parametrize("u", [-70.0, -2.0, 1e-3, 0.5, 3.0, 90.0])
def test_a_piece_leads_where_the_exponential_does(u):
    strains = np.array([[0.0, 0.0], [0.03, 0.0], [0.0, -0.04], [-0.02, 0.03], [1e-6, 1e-5]])
    points, frames, *_ = advance(strains, np.full(5, u))
    poses = se3.exp_pose(u * screws(strains))
    assert np.allclose(points, poses[:, :3, 3], atol=1e-11, rtol=1e-11)
    assert np.allclose(frames, poses[:, :3, :3], atol=1e-13)


def moved(rod, parameter, step):
    """The rod with one parameter changed."""
    n = len(rod.strains)
    x = np.concatenate([np.zeros(6), rod.joints, rod.strains.ravel()])
    x[parameter] += step
    start = rod.start.copy()
    start[:3, :3] = se3.exp_rotation(x[:3]) @ start[:3, :3]
    start[:3, 3] += x[3:6]
    return PiecewiseRod(start, x[6 : 5 + n], x[5 + n :].reshape(n, 2))


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_slopes_agree_with_differences(scale):
    """Points and frames at given arc lengths, by every parameter; small strains go through the series."""
    rod = PiecewiseRod(ROD.start, ROD.joints, scale * ROD.strains)
    station = rod.at(STATIONS)
    velocities, rotations = rod.slopes(station)
    back = np.swapaxes(station.frames, 1, 2)
    for parameter in range(velocities.shape[2]):
        step = 1e-5 if parameter < 9 else 1e-7
        ahead, behind = (moved(rod, parameter, sign * step).at(STATIONS) for sign in (1, -1))
        change = (back @ ((ahead.points - behind.points) / (2 * step))[..., None])[..., 0]
        turn = back @ (ahead.frames - behind.frames) / (2 * step)
        size = max(1.0, abs(change).max())
        assert np.allclose(change, velocities[:, :, parameter], atol=3e-8 * size)
        spin = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
        assert np.allclose(spin, rotations[:, :, parameter], atol=3e-8 * max(1.0, abs(spin).max()))


def test_cuts_change_nothing():
    cut = ROD.cut(np.array([20.0, 50.0, 130.0]))
    assert len(cut.strains) == 7
    assert np.allclose(cut.at(STATIONS).points, ROD.at(STATIONS).points, atol=1e-12)


# ---- the fit


def observed(rod, length, noise=0.0, count=150, seed=0, frames=False):
    """Points and frames of a rod at uneven arc lengths with noise: turns of frames at a lever of 5 mm."""
    random = np.random.default_rng(seed)
    steps = np.concatenate([[0.0], np.cumsum(random.uniform(0.2, 1.8, count - 1))])
    station = rod.at(steps / steps[-1] * length)
    points = station.points + noise * random.standard_normal((count, 3))
    turns = se3.exp_rotation(noise / 5 * random.standard_normal((count, 3)))
    return points, station.frames @ turns if frames else None


@pytest.mark.parametrize("frames", [False, True])
def test_gradient_agrees_with_differences(frames):
    """Of half the cost by every parameter, the feet sliding along: points, weights, frames, a fixed base."""
    random = np.random.default_rng(1)
    points, seen = observed(ROD, 150.0, noise=0.5, frames=frames)
    base = ROD.start[:3, :3] @ se3.exp_rotation(np.array([0.02, 0.01, -0.03]))
    more = {"frames": seen, "base": base, "weights": random.uniform(0.5, 1.5, 150), "shortest": 37.0}
    data = Observations(points, 0.3, np.linspace(0, 150, 150), **more)
    rod = PiecewiseRod(ROD.start, ROD.joints + 1.0, ROD.strains * 1.02)
    fit = RodFit(data, rod, np.ones((4, 2), bool), np.linspace(0, 150, len(points)))

    def settled(at):
        for _ in range(60):
            at = at.settled()
        return at

    fit = settled(fit)
    _, gradient = fit.normal
    for parameter in range(len(gradient)):
        step = 1e-5 if parameter < 9 else 1e-7
        costs = [settled(replace(fit, rod=moved(rod, parameter, sign * step))).cost for sign in (1.0, -1.0)]
        slope = -(costs[0] - costs[1]) / (4 * step)
        # turns of frames are taken at first order in the misfit's own angle
        near = 2e-2 if frames else 1e-6
        assert slope == pytest.approx(gradient[parameter], rel=near, abs=near * abs(gradient).max())


def test_standard_errors_are_those_of_repeated_noise():
    rod = PiecewiseRod(ROD.start, np.array([60.0]), np.array([[0.0, 0.02], [0.015, 0.01]]))
    off = []
    for seed in range(40):
        points, _ = observed(rod, 130.0, noise=0.3, count=80, seed=seed)
        free, s = np.array([[False, True], [True, True]]), np.linspace(0, 130, 80)
        fit = refined(RodFit(Observations(points, 0.3, s), rod, free, s), 40, 1e-4)
        errors = np.sqrt(np.diag(fit.covariance))[-3:]
        off.append((fit.rod.strains[free] - rod.strains[free]) / errors)
    assert np.mean(np.array(off) ** 2) == pytest.approx(1.0, abs=0.35)  # 120 numbers, some correlated


def test_the_first_arc_length_is_not_that_of_the_noise():
    points, _ = observed(ROD, 150.0, noise=0.3, count=400)
    raw = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert raw > 220 and arc_lengths(points)[1][-1] == pytest.approx(150, abs=1.5)


# ---- the split


def kinds(split):
    return [p.kind for p in split.pieces]


def lengths(split):
    return [p.length for p in split.pieces]


def target_of(rod, length, **more):
    options = {key: more.pop(key) for key in ("noise", "count", "seed", "frames") if key in more}
    points, frames = observed(rod, length, **options)
    return Target(points, frames=frames, **more)


@pytest.mark.parametrize(
    "name, wanted",
    [
        ("five_markers_on_an_arc", [("bending", 150.0, 0.0)]),
        ("semicolon", [("bending", 150.0, 0.0)]),
        ("noisy_arc", [("bending", 150.0, 0.0)]),
        ("s_curve_in_a_plane", [("bending", 75.0, 0.0), ("bending", 75.0, 180.0)]),
        ("one_and_a_half_flat_circles", [("bending", 3 * np.pi * 30, 0.0)]),
    ],
)
def test_curves_of_people(name, wanted):
    split = segment(read_target(PEOPLE / f"{name}.csv"))
    assert [(p.kind, p.roll) for p in split.pieces] == [(kind, roll) for kind, _, roll in wanted]
    assert lengths(split) == pytest.approx([length for _, length, _ in wanted], abs=0.5)
    assert split.noise == pytest.approx(0.3 if name == "noisy_arc" else 0.0, abs=0.02)
    curvature = 1 / 30 if "circles" in name else 1 / 60
    assert [p.curvature for p in split.pieces] == pytest.approx([curvature] * len(wanted), rel=0.01)


#: bending, twisting by 1.2 rad, helical, bent to the other side
MIXED = PiecewiseRod(
    ROD.start,
    np.array([50.0, 90.0, 150.0]),
    np.array([[0.0, 0.025], [0.03, 0.0], [-0.02, 0.02], [0.0, -0.03]]),
)


def test_pieces_of_every_kind_are_found():
    split = segment(target_of(MIXED, 200.0, noise=0.1))
    assert kinds(split) == ["bending", "twisting", "helical", "bending"]
    assert lengths(split) == pytest.approx([50, 40, 60, 50], abs=1.5)
    assert split.strains[:, :2] == pytest.approx(MIXED.strains, abs=1e-3)
    assert split.length == pytest.approx(200, abs=0.5) and split.noise == pytest.approx(0.1, abs=0.015)
    assert np.allclose(split.base_pose, ROD.start, atol=0.3)
    assert "half turns" in split.notes[0]


def test_the_curve_moved_mirrored_and_reversed():
    """Moved: the same; mirrored: twists change sign; reversed: the pieces in reverse."""
    points = observed(MIXED, 200.0, noise=0.1)[0]
    split = segment(Target(points))
    turned = segment(Target(se3.transform(se3.exp_pose(np.array([1.0, 2, -1, 9, 8, 7])), points)))
    assert np.allclose(turned.strains, split.strains, atol=1e-6)
    mirrored = segment(Target(points * [1, -1, 1]))
    assert np.allclose(mirrored.strains, split.strains * [-1, 1, 1], atol=1e-6)
    back = segment(Target(points[::-1]))
    assert kinds(back) == kinds(split)[::-1] and lengths(back) == pytest.approx(lengths(split)[::-1], abs=0.3)


TWIST_FIRST = PiecewiseRod(
    np.eye(4), np.array([50.0, 80.0]), np.array([[0.0314, 0.0], [0.0, 0.018], [0.035, 0.0349]])
)


def test_frames_or_a_fixed_base_show_a_twist_at_the_end():
    without = segment(target_of(TWIST_FIRST, 180.0))
    assert kinds(without) == ["passive", "bending", "helical"] and "no point shows" in without.notes[0]
    framed = segment(target_of(TWIST_FIRST, 180.0, noise=0.2, frames=True))
    held = segment(
        target_of(TWIST_FIRST, 180.0, base_direction=np.array([1.0, 0, 0]), base_width=np.array([0, 1.0, 0]))
    )
    for split in (framed, held):
        assert kinds(split) == ["twisting", "bending", "helical"]
        assert abs(split.pieces[0].twist) == pytest.approx(0.0314, abs=6e-4)


def test_uncertain_frames_do_not_split_what_the_points_show():
    target = target_of(TWIST_FIRST, 180.0, noise=0.2, frames=True)
    random = np.random.default_rng(2)
    shaken = target.frames @ se3.exp_rotation(0.2 * random.standard_normal((150, 3)))
    assert len(segment(replace(target, frames=shaken)).pieces) == 3


@pytest.mark.parametrize("points", [4, 50])
def test_a_straight_line_is_passive(points):
    line = np.linspace([0, 0, 0], [60, 60, 30], points)
    split = segment(Target(line))
    assert kinds(split) == ["passive"] and lengths(split) == pytest.approx([90.0])


def test_curves_of_other_sorts_keep_to_the_tolerance():
    target = read_target(SHIPPED / "pear.csv")
    fine, coarse = (segment(target, options=SplitOptions(tolerance=t * target.length)) for t in (2e-4, 1e-3))
    assert fine.rms < 2e-4 * target.length and coarse.rms < 1e-3 * target.length
    assert len(coarse.pieces) < len(fine.pieces)


def test_what_cannot_be_reached_is_given_up_and_that_is_said():
    target = target_of(MIXED, 200.0)
    reach = {"bending": (0.0, 0.028), "helical": (0.015, 0.028), "twisting": (0.028, 0.0)}
    split = segment(target, reach=reach)
    for piece in split.pieces:
        assert piece.twist in (0.0, None) or abs(piece.twist) <= reach[piece.kind][0]
        assert piece.curvature <= reach[piece.kind][1] + 1e-15
    assert any("given up" in note for note in split.notes)
    assert not any("given up" in note for note in segment(target, reach={"bending": (0.0, 0.04)}).notes)


def test_pieces_that_are_too_short_or_too_many_are_given_up():
    kink = PiecewiseRod(np.eye(4), np.array([50.0, 58.0]), np.array([[0.0, 0.0], [0.0, 0.15], [0.0, 0.0]]))
    split = segment(target_of(kink, 108.0, noise=0.1, count=60))
    assert min(lengths(split)) > 19 and any("not followed" in note for note in split.notes)
    split = segment(target_of(MIXED, 200.0), options=SplitOptions(most_pieces=2))
    assert len(split.pieces) == 2 and any("most that are allowed" in note for note in split.notes)


def test_very_many_points_are_thinned_and_that_is_said():
    split = segment(target_of(MIXED, 200.0, noise=0.3, count=20_000))
    assert kinds(split) == ["bending", "twisting", "helical", "bending"]
    assert split.noise == pytest.approx(0.3, abs=0.03) and "20000 points" in split.notes[0]


def test_points_without_weight_do_not_count():
    target = target_of(MIXED, 200.0, noise=0.1)
    points, weights = target.points.copy(), np.ones(150)
    points[40:150:30] += 4.0
    weights[40:150:30] = 0.0
    split = segment(replace(target, points=points, weights=weights))
    assert split.strains[:, :2] == pytest.approx(MIXED.strains, abs=1.5e-3)


def test_a_split_is_edited_and_given_back(tmp_path):
    """Rolled pieces and all; [split] refine lets the places and rates of given pieces settle anew."""
    target = target_of(MIXED, 200.0)
    split = segment(target)
    np.savetxt(tmp_path / "c.csv", target.points, delimiter=",", fmt="%.6f")
    text = 'points = "c.csv"\n[split]\nrefine = true\n' + split.toml()
    (tmp_path / "c.toml").write_text(text)
    back = read_target(tmp_path / "c.toml")
    assert [replace(p, length=0.0) for p in back.pieces] == [
        Piece(
            p.kind,
            0.0,
            pytest.approx(p.twist, rel=1e-5) if p.twist else None,
            pytest.approx(p.curvature, rel=1e-4) if p.curvature else None,
            p.roll,
        )
        for p in split.pieces
    ]
    moved_joint = [replace(p, length=p.length + d) for p, d in zip(back.pieces, (4.0, -4.0, 0.0, 0.0))]
    given = segment(replace(back, pieces=tuple(moved_joint)))
    assert given.joints == pytest.approx(MIXED.joints, abs=0.05)
    assert given.strains == pytest.approx(split.strains, abs=1e-4)


def test_the_criterion_prefers_the_true_split():
    """To that with a piece more and that with a piece less."""
    target = target_of(MIXED, 200.0, noise=0.2)
    fit, _ = fitted(target)
    more = refined(
        RodFit(fit.data, fit.rod.cut(np.array([25.0])), np.insert(fit.free, 0, fit.free[0], axis=0), fit.feet)
    )
    fewer, _ = fitted(target, SplitOptions(most_pieces=3))
    assert fit.criterion < replace(fewer, data=fit.data).criterion - 10 and fit.criterion < more.criterion - 5
