"""From segments to centrelines: passive pieces, signs, mirrors, shapes of arrays, bad input."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Manipulator, Segment
from pneunet.geometry.loading import DeadLoads
from pneunet.reduced import (
    AnalyticLaw,
    QuadraticLaw,
    Rod,
    SectionLaw,
    SegmentLaw,
    doubts,
    predict,
    shipped_law,
)
from pneunet.reduced.rod.ends import free_pieces
from pneunet.reduced.rod.laws import FreeSection

TWISTING = Segment("twisting", 60.0, 4, cavity_floor=0.5)
BENDING = Segment("one-sided", 90.0, 3)
HELICAL = Segment("one-sided", 60.0, 6)
ARM = Manipulator((TWISTING, BENDING, HELICAL))
QUADRATIC = QuadraticLaw([0.0, 0.05], [[1, 0, 0, 0, 0, 0], [1.1, -0.02, 0, 0.02, 0.03, 0]], [np.eye(6)] * 2)
#: every law that there is
LAWS = {"trained": shipped_law, "analytic": AnalyticLaw, "quadratic": lambda: QUADRATIC}


def test_shapes_follow_the_pressures_and_calls_agree():
    model = AnalyticLaw()
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
    strains = AnalyticLaw().strains(TWISTING, 0.02)
    assert strains.k[0] > 0
    np.testing.assert_array_equal(strains.k[1:], 0.0)
    np.testing.assert_allclose(AnalyticLaw().strains(TWISTING.mirrored, 0.02).k, -strains.k, rtol=1e-9)


def test_cells_count_with_whole_pitches_and_frames_are_continuous():
    line = predict(ARM, 0.03, AnalyticLaw())
    assert line.s[-1] == pytest.approx(ARM.length)
    ends = np.concatenate([ARM.starts, ARM.starts + [s.length for s in ARM.segments]])
    assert all(np.isclose(line.s, end).any() for end in ends)
    free = AnalyticLaw().each(ARM.segments, 0.03)
    lengths, strains = free_pieces(ARM.segments, free)
    assert lengths[1::3] == pytest.approx([s.chambers * s.pitch for s in ARM.segments])
    assert sum(lengths) == pytest.approx(ARM.length)
    # bare core: no stretch, no twist, no bending but that of a slanted end
    for ends in (slice(0, None, 3), slice(2, None, 3)):
        np.testing.assert_array_equal(strains.e[ends], np.tile([1.0, 0, 0], (3, 1)))
        np.testing.assert_array_equal(strains.k[ends, :2], 0.0)
        assert [bool(k) for k in strains.k[ends, 2]] == [False, False, True]


@pytest.mark.parametrize("name", LAWS)
def test_a_free_rod_and_a_prediction_are_the_same(name):
    law, base = LAWS[name](), np.diag([-1.0, -1.0, 1.0, 1.0])
    assert isinstance(law, SegmentLaw) and law.name == name
    assert all(isinstance(law.of(segment), SectionLaw) for segment in ARM.segments)
    rod, line = Rod.of(ARM, law, 0.03, base), predict(ARM, 0.03, law, 2.0, base)
    np.testing.assert_allclose(rod.free(2.0).s, line.s, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rod.free(2.0).poses, line.poses, rtol=0, atol=1e-12)
    known = [piece.law.free_strains(piece.pressure) for piece in rod.pieces]
    np.testing.assert_allclose(rod.free_strains.vector, known, rtol=0, atol=1e-10)


def test_laws_may_be_one_for_each_segment():
    laws = [shipped_law(), QUADRATIC, AnalyticLaw()]
    free = Rod.of(ARM, laws, [0.01, 0.02, 0.03]).free_strains.vector[1::3]
    expected = [law.strains(s, P).vector for law, s, P in zip(laws, ARM.segments, (0.01, 0.02, 0.03))]
    assert free == pytest.approx(np.array(expected))


def test_a_law_of_free_shapes_alone_says_so_when_it_is_asked_for_more():
    section = AnalyticLaw().of(HELICAL)
    q = section.free_strains(0.02)
    for ask in (section.psi, section.force, section.stiffness):
        with pytest.raises(InputError, match="'analytic' knows free shapes alone.*take the trained law"):
            ask(q, 0.02)
    with pytest.raises(InputError, match="knows free shapes alone"):
        Rod.of(ARM, AnalyticLaw(), 0.02).equilibrium(DeadLoads((0.0, 0.0, -9810.0)))


def test_no_pressure_no_shape_change():
    line = predict(ARM, 0.0, AnalyticLaw())
    np.testing.assert_allclose(line.points, np.stack([line.s, 0 * line.s, 0 * line.s], axis=1), atol=1e-9)


def test_mirrored_manipulators_have_mirrored_centrelines():
    one, other = (predict(arm, 0.03, AnalyticLaw()).points for arm in (ARM, ARM.mirrored))
    np.testing.assert_allclose(other, one * [1, -1, 1], atol=1e-8)


def test_any_law_with_strains_can_predict():
    class Section(FreeSection):
        def free_strains(self, P):
            return np.array([1 + P, 0, 0, 0, 0, 0])

    class Law(SegmentLaw):
        name = "constant"

        def of(self, segment):
            return Section(self.name)

        def doubts(self, segment, pressure):
            return ("it is made up",) if segment.kind == "one-sided" else ()

    line = predict(ARM, 0.5, Law())
    active = sum(s.chambers * s.pitch for s in ARM.segments)
    assert line.length == pytest.approx(ARM.length + 0.5 * active)
    assert doubts(ARM, 0.5, Law()) == ("segment 2, 3: it is made up",)


@pytest.mark.parametrize("pressure", [-0.01, np.nan])
def test_bad_pressure(pressure):
    with pytest.raises(InputError, match="pressure_kPa"):
        AnalyticLaw().strains(HELICAL, pressure)


def test_distance_from_finite_elements():
    """Cell results of the cases one-sided-w10 and twist-w12 (docs/theory-reduced.md): not fitted, so only
    near."""
    model = AnalyticLaw()
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
