"""The paper's figures as examples: their numbers, what agrees with its statements, and what does not.

Figs 7 and 9(b), (e) search for designs: `python -m examples.paper 7 9_wraps`; shipped targets are designed
for in other tests."""

import numpy as np
import pytest

from examples.paper import eq27, fig3, fig4, fig5, fig6, fig7, fig8, fig9, fig9_wraps
from examples.paper.__main__ import section
from pneunet.geometry.parameters import ONE_SIDED, TWISTING
from pneunet.geometry.reference_cases import CASES
from pneunet.reduced.choice import shipped_law


def verdicts(module, found):
    """Of every statement, each with numbers on both sides."""
    said = module.statements(found)
    assert all(each.says and each.here for each in said)
    assert len(section("0", module, found)) > len(said)
    return [each.agrees for each in said]


def test_fig_3_twist_over_pressure_and_angle():
    found = fig3.compute()
    # tau's rise, the tube's 53 degrees; not its slopes nor the law's largest angle, nor E_t = 0.008 MPa
    assert verdicts(fig3, found) == [True, False, False, True, None, False, None]
    # unit cells of twist-w15 with contact (docs/paper-models.md) lie within the law's bars
    assert not found["doubts"]
    for angle, tau in ((60.0, 40.7), (45.0, 46.2)):
        state = shipped_law().of(CASES["twist_w15"](angle, 1))
        bar = (state.half_width(0.05) / state.free_strains(0.05)[0])[3]
        assert abs(found["tau"][list(fig3.ANGLES).index(angle), -1] - 1e-3 * tau) < bar
    assert np.nanmax(found["printed"]) < fig3.PAPER_MOST / 20


@pytest.mark.xfail(
    strict=True,
    reason="the law twists twist-w15 at 60 degrees by 6 % less than its cells, whose walls touch early; the"
    " law's own table has such errors (95th percentile of twisting strains: 7 %)",
)
def test_fig_3_the_law_twists_as_cells_do():
    at = [list(fig3.ANGLES).index(a) for a in (60.0, 45.0)]
    # unit cells of twist-w15 with contact (docs/paper-models.md), which the law has 2 % to know by
    assert 1e3 * fig3.compute()["tau"][at, -1] == pytest.approx([40.7, 46.2], rel=0.03)


def test_fig_4_segments_make_curvature_vary():
    found = fig4.compute()
    assert verdicts(fig4, found) == [True, True, True, None]
    curvature = {name: row["curvature"][-1] for name, row in found.items()}
    # equal angles are equal segments, whatever stands before them; slant makes the cylinder narrower
    assert curvature["iv"][0] == pytest.approx(curvature["i"][0]) == pytest.approx(curvature["ii"][1])
    by_angle = dict(zip(found["iv"]["angles"], curvature["iv"]))
    assert by_angle[45] > by_angle[60] > by_angle[75] > by_angle[90]


def test_fig_5_angles_programme_the_trajectory():
    found = fig5.compute()
    assert verdicts(fig5, found) == [True, True]
    assert all(len(row["shapes"]) == 5 for row in found.values())


def test_fig_6_softer_bends_more_until_a_limit_load():
    found = fig6.compute()
    assert verdicts(fig6, found) == [True, True, None]
    assert any("pressure / mu" in text for text in found["iii"]["doubts"])
    # P/mu alone decides: 0.4 MPa in (a) and in the middle of (c), at the same angle
    assert found["i"]["curvature"][1] == pytest.approx(found["a"]["curvature"][-1, 1], rel=1e-6)


def test_fig_7_two_tentacles_are_designed():
    found = fig7.compute()
    assert verdicts(fig7, found) == [True, True, None, None]
    assert all(design.errors.rms <= 0.7 and design.pressure_kPa == 50 for design in found.values())


def test_fig_9_wraps_are_designed():
    found = fig9_wraps.compute()
    assert verdicts(fig9_wraps, found) == [None] * 4
    assert all(design.errors.percent(design.errors.rms) <= 0.2 for design in found.values())
    assert [len(design.manipulator.segments) for design in found.values()] == [3, 2]  # as the paper's


def test_fig_8_extraction_finds_the_printed_numbers():
    found = fig8.compute()
    assert verdicts(fig8, found) == [True, True, True]
    twisting, bending, helical = (piece.table() for piece in found)
    assert twisting["tau_rad_per_mm"] == pytest.approx(0.0314159, rel=1e-3)
    assert bending["curvature_per_m"] == pytest.approx(18, rel=1e-3)
    assert (helical["cylinder_curvature_per_m"], helical["pitch_mm"]) == pytest.approx((70, 90), rel=1e-3)


def test_fig_9_workspace_and_wraps_within_reach():
    found = fig9.compute()
    assert verdicts(fig9, found) == [True, True, None, None, True, None, None, True, None]
    both = [found["reach"][kind] for kind in (ONE_SIDED, TWISTING)]
    for reach in both:  # 45 and 135 degrees are mirror images
        assert reach.twist == pytest.approx(-reach.twist[::-1], abs=1e-7)
    assert len(found["curves"]) == 6 and all(len(lines) == fig9.CURVES for lines in found["curves"].values())
    straight = found["curves"][0.01][-1]  # 90 degrees does not twist: the first 60 mm lie on the x axis
    assert straight[:10, 1:] == pytest.approx(np.zeros((10, 2)), abs=1e-6)


def test_both_readings_of_the_printed_errors():
    summed, mean = eq27.root_mean_square("octopus")
    assert summed == pytest.approx(np.sqrt(386 / 201)) and mean == pytest.approx(19.647, abs=1e-3)
    text = eq27.readings("octopus", 180.0)
    assert "1.39 mm (0.77 % of length)" in text and "19.6 mm (10.9 %)" in text
