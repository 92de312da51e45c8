"""From segments to centrelines: passive pieces, signs, mirrors, shapes of arrays, bad input."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.base.strains import RodStrains
from pneunet.geometry import Manipulator, Segment
from pneunet.reduced import AnalyticModel, QuadraticLaw, Rod, predict
from pneunet.reduced.model import SegmentLaw, doubts
from pneunet.reduced.rod.ends import free_manipulator

TWISTING = Segment("twisting", 60.0, 4, cavity_floor=0.5)
BENDING = Segment("one-sided", 90.0, 3)
HELICAL = Segment("one-sided", 60.0, 6)
ARM = Manipulator((TWISTING, BENDING, HELICAL))


def test_shapes_follow_the_pressures_and_calls_agree():
    model = AnalyticModel()
    grid = np.array([[0.0, 0.02], [0.03, 0.01]])
    for segment in (TWISTING, HELICAL):
        strains = model.strains(segment, grid)
        assert strains.k.shape == (2, 2, 3)
        single = model.strains(replace(segment, chambers=9), 0.03)
        np.testing.assert_allclose(single.k, strains.k[1, 0], atol=1e-9)
        np.testing.assert_allclose(single.e, strains.e[1, 0], atol=1e-9)
        np.testing.assert_allclose(strains.k[0, 0], 0.0, atol=1e-12)


def test_twisting_segments_twist_like_their_layers_and_do_not_bend():
    """Chambers on top at angle < 90 shear the upper layer by eps_xy < 0, and twist gives eps_xy = -k1 z/2: k1
    > 0."""
    strains = AnalyticModel().strains(TWISTING, 0.02)
    assert strains.k[0] > 0
    np.testing.assert_array_equal(strains.k[1:], 0.0)
    np.testing.assert_allclose(AnalyticModel().strains(TWISTING.mirrored, 0.02).k, -strains.k, rtol=1e-9)


def test_cells_count_with_whole_pitches_and_frames_are_continuous():
    line = predict(ARM, 0.03, AnalyticModel())
    assert line.s[-1] == pytest.approx(ARM.length)
    ends = np.concatenate([ARM.starts, ARM.starts + [s.length for s in ARM.segments]])
    assert all(np.isclose(line.s, end).any() for end in ends)
    free = AnalyticModel().each(ARM.segments, 0.03)
    lengths, strains = free_manipulator(ARM.segments, free, [s.chambers for s in ARM.segments])
    assert lengths[1::3] == pytest.approx([s.chambers * s.pitch for s in ARM.segments])
    assert sum(lengths) == pytest.approx(ARM.length)
    # bare core: no stretch, no twist, no bending but that of a slanted end
    for ends in (slice(0, None, 3), slice(2, None, 3)):
        np.testing.assert_array_equal(strains.e[ends], np.tile([1.0, 0, 0], (3, 1)))
        np.testing.assert_array_equal(strains.k[ends, :2], 0.0)
        assert [bool(k) for k in strains.k[ends, 2]] == [False, False, True]


def test_a_free_rod_and_a_prediction_are_the_same():
    model = AnalyticModel()
    laws = [
        QuadraticLaw([0.03], [np.hstack([q.e, q.k])], np.eye(6)[None])
        for q in (model.strains(s, 0.03) for s in ARM.segments)
    ]
    np.testing.assert_allclose(
        Rod.of(ARM, laws, 0.03).free().points[-1], predict(ARM, 0.03, model).points[-1], atol=1e-9
    )


def test_no_pressure_no_shape_change():
    line = predict(ARM, 0.0, AnalyticModel())
    np.testing.assert_allclose(line.points, np.stack([line.s, 0 * line.s, 0 * line.s], axis=1), atol=1e-9)


def test_mirrored_manipulators_have_mirrored_centrelines():
    one, other = (predict(arm, 0.03, AnalyticModel()).points for arm in (ARM, ARM.mirrored))
    np.testing.assert_allclose(other, one * [1, -1, 1], atol=1e-8)


def test_any_law_with_strains_can_predict():
    class Law(SegmentLaw):
        name = "constant"

        def strains(self, segment, pressure):
            return RodStrains([1 + pressure, 0, 0], [0, 0, 0])

        def doubts(self, segment, pressure):
            return ("it is made up",) if segment.kind == "one-sided" else ()

    line = predict(ARM, 0.5, Law())
    active = sum(s.chambers * s.pitch for s in ARM.segments)
    assert line.length == pytest.approx(ARM.length + 0.5 * active)
    assert doubts(ARM, 0.5, Law()) == ("segment 2, 3: it is made up",)


@pytest.mark.parametrize("pressure", [-0.01, np.nan])
def test_bad_pressure(pressure):
    with pytest.raises(InputError, match="pressure_kPa"):
        AnalyticModel().strains(HELICAL, pressure)


def test_distance_from_finite_elements():
    """Cell results of the cases one-sided-w10 and twist-w12 (docs/theory-reduced.md): not fitted, so only
    near."""
    model = AnalyticModel()
    size = {"width": 10.0, "channel_width": 2.0, "material": NeoHookean(mu=0.2068)}
    helical = model.strains(Segment("one-sided", 60.0, 5, **size), 0.05)
    bending = model.strains(Segment("one-sided", 90.0, 5, **size), 0.05)
    assert 0.5 < helical.k[1] / 0.0367 < 1.0 and 0.5 < bending.k[1] / 0.040 < 1.0
    assert helical.k[0] / helical.k[1] == pytest.approx(0.70, abs=0.05)
    w12 = Segment(
        "twisting", 60.0, 5, chamber_height=5.5, gap=2.0, cavity_floor=0.5, material=NeoHookean(mu=0.317)
    )
    twist = model.strains(w12, np.array([10, 20, 30, 40, 50]) * 1e-3).twist_per_deformed_length
    ratio = twist / np.array([10.3, 18.3, 24.8, 30.4, 35.3]) * 1e3
    assert (0.5 < ratio).all() and (ratio < 1.3).all()
