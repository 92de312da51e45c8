"""The trained law on made-up cells."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.dataset import write_dataset
from pneunet.base.materials.laws import NeoHookean, Ogden, Yeoh
from pneunet.base.strains import MIRROR
from pneunet.geometry.parameters import KINDS, ONE_SIDED, TWISTING, Segment
from pneunet.geometry.shape_numbers import numbers_of
from pneunet.reduced.choice import shipped_law
from pneunet.reduced.rod.states import VARIABLES
from pneunet.reduced.trained.closing import Closing
from pneunet.reduced.trained.coordinates import REST
from pneunet.reduced.trained.file import read_law
from pneunet.reduced.trained.law import TrainedLaw
from pneunet.reduced.training.suggestion import most_telling
from pneunet.reduced.training.train import run_training
from tests.reduced.made_up_cells import design, made_up_data, true_free, true_stiffness


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("law")
    write_dataset(folder / "cells.npz", made_up_data())
    law = run_training(folder / "cells.npz", folder / "law.npz", compare=False)
    return law, folder


@pytest.mark.parametrize("kind", KINDS)
def test_a_design_it_has_not_seen(trained, kind):
    law, segment = trained[0].of(design(kind)), design(kind)
    P = 0.05  # MPa
    scale = np.array([1, 1, 1, 4, 4, 4])
    expected = true_free(kind, numbers_of([segment])[0][0], P / 0.25) / scale
    assert law.free_strains(P) == pytest.approx(expected, abs=3e-3 * np.linalg.norm(expected - REST))
    K = true_stiffness(kind, numbers_of([segment])[0][0], P / 0.25) * np.outer(scale, scale) * 0.25 * 4.0**2
    assert law.stiffness(law.free_strains(P), P) == pytest.approx(K, rel=0.02, abs=0.02 * abs(K).max())
    assert law.doubts(P) == ()


@pytest.mark.parametrize("kind", KINDS)
def test_force_and_stiffness_are_slopes_of_psi_and_vanish_at_the_free_state(trained, kind):
    law, P, h = trained[0].of(design(kind)), np.array([0.03, 0.06]), 1e-5
    free = law.free_strains(P)
    assert law.force(free, P) == pytest.approx(np.zeros((2, 6)), abs=1e-9)
    q = free + np.array([0.02, -0.01, 0.015, 0.004, -0.01, 0.006])
    for i in range(6):
        step = h * np.eye(6)[i]
        assert (law.psi(q + step, P) - law.psi(q - step, P)) / (2 * h) == pytest.approx(
            law.force(q, P)[:, i], rel=1e-5, abs=1e-7
        )
        slope = (law.force(q + step, P) - law.force(q - step, P)) / (2 * h)
        assert slope == pytest.approx(law.stiffness(q, P)[:, i], rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_mirror_images_and_sizes(trained, kind):
    law = trained[0]
    one, other = law.of(design(kind)), law.of(design(kind).mirrored)
    q = one.free_strains(0.05) + [0.02, 0.01, 0.01, 0.003, 0.002, 0.001]
    assert other.free_strains(0.05) == pytest.approx(one.free_strains(0.05) * MIRROR, abs=1e-12)
    assert other.force(q * MIRROR, 0.05) == pytest.approx(one.force(q, 0.05) * MIRROR, abs=1e-9)
    large = law.of(design(kind, pitch=8.0))
    assert large.free_strains(0.05)[3:] == pytest.approx(one.free_strains(0.05)[3:] / 2)


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_of_the_free_strains(trained, kind):
    law, shape, P = trained[0].kinds[kind], numbers_of([design(kind)])[0], np.array([0.2])
    q, slopes = law.free_strains_and_slopes(shape, P)
    assert q == pytest.approx(law.free_strains(shape, P))
    for i in range(14):
        h = 1e-5 * (shape[0, i] if i < 13 else P[0])
        ends = []
        for sign in (1, -1):
            s, p = shape.copy(), P.copy()
            if i < 13:
                s[0, i] += sign * h
            else:
                p[0] += sign * h
            ends.append(law.free_strains(s, p)[0])
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(slopes[0, :, i], rel=1e-4, abs=1e-7)


def test_each_with_slopes_has_the_derivatives_of_many_segments_by_dimensions_pressure_and_modulus(trained):
    """Also of how far they lie outside: by pressure, by an input, and because nothing near is known."""
    law, P = trained[0], np.array([0.03, 0.05, 0.16, 0.05])
    law = replace(law, kinds=law.kinds | {TWISTING: replace(law.kinds[TWISTING], doubt=2e-4)})
    far = replace(design(TWISTING, 50.0), width=20.0, top_wall=2.2, side_wall=2.2)
    segments = [design(ONE_SIDED, 120.0, pitch=7.0), design(TWISTING), design(ONE_SIDED), far]
    found = law.each_with_slopes(segments, P)
    assert found.strains == pytest.approx(law.each(segments, P).vector, rel=1e-4)
    for excess, segment, pressure in zip(found.excess, segments, P):
        one = law.excess(segment, pressure)
        assert excess[: len(one)] == pytest.approx(one, abs=1e-5) and not excess[len(one) :].any()
    assert not found.excess[0].any() and (found.excess[2:] > 0).any(axis=1).all()
    assert (found.excess[3] > 0).sum() > 2 and found.excess[3, -2] > 0
    for i, name in enumerate(VARIABLES):
        ends, steps = [], []
        for sign in (1, -1):
            pairs = [changed_by(name, s, p, sign * 1e-4) for s, p in zip(segments, P)]
            steps.append([change for _, _, change in pairs])
            ends.append(law.each_with_slopes([s for s, _, _ in pairs], [p for _, p, _ in pairs]))
        width = np.subtract(*steps)
        for what in ("strains", "excess", "closed", "stretch"):
            slope = (getattr(ends[0], what) - getattr(ends[1], what)).T / width
            size = 1e-4 * abs(getattr(found, f"{what}_by")).max()
            assert slope.T == pytest.approx(getattr(found, f"{what}_by")[..., i], rel=1e-4, abs=size), name


def changed_by(name, segment, pressure, part):
    """(Segment, pressure, change) with one of VARIABLES larger by so much of itself, where there is such a
    segment."""
    if name == "pressure":
        return segment, pressure * (1 + part), pressure * part
    if name == "mu":
        mu = segment.material.mu
        return replace(segment, material=NeoHookean(mu=mu * (1 + part))), pressure, mu * part
    value = getattr(segment, name)
    try:
        return replace(segment, **{name: value * (1 + part)}), pressure, value * part
    except InputError:  # the cavity's floor lies as high as the channel allows
        return segment, pressure, 0.0


def test_held_out_figures_of_an_easy_law_are_small_and_its_intervals_honest(trained):
    for figures in trained[0].about["figures"].values():
        assert figures["law_strain_median_rel"] < 2e-3 and figures["law_strain_p95_rel"] < 0.02
        assert figures["law_stiffness_p95_rel"] < 0.02 and figures["law_force_p95_rel"] < 0.05
        assert figures["force_in_other_directions_p95_rel"] < 0.05
        assert figures["law_interval_coverage_90"] > 0.7


def test_it_says_when_it_is_asked_outside_and_by_how_much(trained):
    law, segment = trained[0], design(ONE_SIDED)
    for kind in KINDS:
        assert law.doubts(design(kind), [0.01, 0.05]) == () and (law.excess(design(kind), 0.05) == 0).all()
    assert any("pressure / mu = 0.5 is outside" in text for text in law.doubts(segment, [0.01, 0.25 * 0.5]))
    assert law.excess(segment, 0.2).max() > law.excess(segment, 0.15).max() > 0
    wide = replace(segment, width=40.0)
    assert any("width / normal pitch = 10 is outside" in text for text in law.doubts(wide, 0.01))
    # the core is as high as before
    thin = replace(segment, base_thickness=0.4, channel_height=2.6, cavity_floor=1.3)
    assert any("base_thickness / normal pitch = 0.1 is outside" in text for text in law.doubts(thin, 0.01))
    assert law.doubts(design(ONE_SIDED, material=Yeoh(c10=0.125, c20=0.01)), 0.05) == ()
    stiff = design(ONE_SIDED, material=Yeoh(c10=0.125, c20=0.03))
    assert any("c20/c10 of Yeoh's law = 0.24 is outside" in text for text in law.doubts(stiff, 0.05))
    other = design(ONE_SIDED, material=Ogden(mu1=0.25, alpha1=3.0))
    assert any("miss those of Ogden by 10" in text for text in law.doubts(other, 0.05))
    with pytest.raises(InputError, match="knows one-sided segments only: take --law analytic"):
        TrainedLaw({ONE_SIDED: law.kinds[ONE_SIDED]}, {}, "half").strains(design(TWISTING), 0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_the_design_that_teaches_most_is_the_one_it_knows_least_of(trained, kind):
    """Without a limit load on the way; the other is one that it was trained on."""
    data = made_up_data()
    numbers = np.hstack([data.shape, data.stiffening]).astype(float)
    known = numbers[(data.kind == data.about["kinds"].index(kind)) & ~data.held_out][0]
    far = known + 0.6 * (known - numbers.mean(axis=0))
    far[13:] = known[13:]
    law = trained[0].kinds[kind]
    assert (law.path.at(np.array([known, far]), np.full(2, 0.1))[1] == 0).all()
    assert most_telling(law, np.array([known, far]), 1, 0.1, 0.9).tolist() == [1]


def test_a_table_of_designs_holds_what_single_calls_give(trained):
    law, P = trained[0], [0.0, 0.03, 0.06]
    segments = [design(ONE_SIDED, 50.0), design(TWISTING, 120.0), design(ONE_SIDED, 90.0, pitch=7.0)]
    found = law.table(segments, P)
    for i, segment in enumerate(segments):
        one = law.strains(segment, P)
        assert found.e[i] == pytest.approx(one.e) and found.k[i] == pytest.approx(one.k)


@pytest.mark.parametrize("kind", KINDS)
def test_many_states_at_once_are_those_one_by_one(trained, kind):
    law = trained[0].kinds[kind]
    numbers = np.repeat(numbers_of([design(kind)])[0], 300, axis=0)
    P = np.linspace(0.0, 0.3, 300)
    q = law.free_strains(numbers, P)
    assert law.path.strains(numbers[1:], P[1:]) == pytest.approx(q[1:], abs=1e-12)
    for i in (0, 1, 140, 299):
        assert law.free_strains(numbers[i : i + 1], P[i : i + 1])[0] == pytest.approx(q[i], abs=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_an_uncertain_grid_widens_error_bars_where_the_pressure_hardly_rises(trained, kind):
    """By as much as strains change between the pressures that it may be wrong by."""
    known, numbers, off = trained[0].kinds[kind], numbers_of([design(kind)])[0], 0.01
    law = replace(known, quantile=np.zeros(6), mesh=replace(known.mesh, uncertainty_at_lead=off))
    leading = law.coordinates.leading
    for P in (np.array([0.1]), np.array([0.25])):
        ends = [leading(law.free_strains(numbers, P * np.exp(sign * off))) for sign in (1, -1)]
        steep = 2 * off / np.log(ends[0] / ends[1])
        half = leading(law.half_width(numbers, P) + np.eye(6)[0] * (kind == TWISTING))
        assert half / leading(law.free_strains(numbers, P)) == pytest.approx(
            off / np.minimum(steep, 1), rel=1e-2
        )


def test_a_point_that_is_missing_in_a_file_is_seen(trained, tmp_path):
    """Weights are as many as points and shifts: sizes that are sums."""
    with np.load(trained[1] / "law.npz") as stored:
        arrays = dict(stored)
    name = f"{TWISTING}/path/inducing"
    np.savez(tmp_path / "law.npz", **(arrays | {name: arrays[name][:-1]}))
    with pytest.raises(InputError, match="weights': has shape .* make it again with pneunet train"):
        read_law(tmp_path / "law.npz")


def test_a_file_gives_the_same_law(trained):
    law, folder = trained
    again = read_law(folder / "law.npz")
    assert again.name == law.name != "trained"  # as the shipped one is called
    for kind in KINDS:
        segment = design(kind)
        q = law.of(segment).free_strains(0.05) + 0.01
        assert (again.of(segment).force(q, 0.05) == law.of(segment).force(q, 0.05)).all()
        assert again.of(segment).half_width(0.05) == pytest.approx(
            law.of(segment).half_width(0.05), rel=0.05, abs=1e-5
        )
    with pytest.raises(InputError, match="not a trained law"):
        (folder / "bad.npz").write_text("")
        read_law(folder / "bad.npz")
    assert "law_strain_p95_rel" in (folder / "law.md").read_text()


def test_on_the_same_data_the_metrics_of_a_law_give_it_again(trained):
    law, folder = trained
    settings = {"compare": False, "like": folder / "law.npz"}
    again = run_training(folder / "cells.npz", folder / "again.npz", **settings)
    for kind in KINDS:
        segment = design(kind)
        assert again.of(segment).free_strains(0.05) == pytest.approx(
            law.of(segment).free_strains(0.05), rel=1e-9, abs=1e-12
        )
        assert again.kinds[kind].quantile == pytest.approx(law.kinds[kind].quantile, rel=1e-6)
    assert "like_sha256" in again.about and "like_sha256" not in law.about


@pytest.mark.parametrize("kind", KINDS)
def test_walls_that_have_touched_on_the_way_count_as_touching(kind):
    """Whatever is learned of loads far beyond touch: the closing there is turned back by hand."""
    known = shipped_law().kinds[kind]
    numbers, P = numbers_of([Segment(kind, 60.0, 1, chamber_height=6.0)])[0], np.array([0.15])

    class Back(Closing):
        def overlap_and_slopes(self, numbers, pressure, lead):
            overlap, by, by_lead = super().overlap_and_slopes(numbers, pressure, lead)
            return np.where(pressure > 0.14, -1.0, overlap), by, by_lead

    turned = replace(known, path=replace(known.path, closing=Back(kind, known.path.closing.process)))
    earlier, there = (law.closed_on_the_way(numbers, P) for law in (turned, known))
    assert 1 < earlier < there
