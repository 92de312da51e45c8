"""The twisting tube: recomputed reference numbers, an exact solution, symmetries, and the paper's printed
form."""

import numpy as np
import pytest

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.geometry import Segment
from pneunet.reduced.analytic.printed import largest_twist, printed_equations
from pneunet.reduced.analytic.twisting import TubePotential, TwistingTube
from pneunet.reduced.rod.areas import empty_area, equivalent_radii, occupied_area

REFERENCE = TwistingTube(3.0, 7.0, 0.317, 0.8)  # physics of the consistent form, angle 60 deg


def test_reference_numbers():
    ri, stretch, tau = REFERENCE.solve(60.0, np.array([0.02, 0.05]))
    np.testing.assert_allclose(ri, [3.2825413, 3.8358185], rtol=0, atol=5e-8)
    np.testing.assert_allclose(stretch, [1.0061530, 1.0302474], rtol=0, atol=5e-8)
    np.testing.assert_allclose(tau, [-0.00574541, -0.01702099], rtol=0, atol=5e-9)


@pytest.mark.parametrize("ratio, a, stretch", [(0.1, 1.07309642, 1.00088533), (0.3, 1.27865588, 1.01267626)])
def test_without_fibres_it_is_the_capped_neo_hookean_tube(ratio, a, stretch):
    tube = TwistingTube(1.0, 2.0, 1.0, 1e-12, isotropic_fraction=1.0)
    np.testing.assert_allclose(tube.solve(60.0, ratio), [a, stretch, 0.0], atol=1e-8)


def test_derivatives(assert_derivatives):
    potential = TubePotential(REFERENCE, 60.0)
    x = np.array([1.2, 1.1, -0.1])
    assert_derivatives(potential.energy, x)
    assert_derivatives(potential.volume, x)


def test_symmetries():
    ri, stretch, tau = REFERENCE.solve(60.0, 0.04)
    np.testing.assert_allclose(REFERENCE.solve(-60.0, 0.04), [ri, stretch, -tau], rtol=1e-9)
    np.testing.assert_allclose(REFERENCE.solve(120.0, 0.04), [ri, stretch, -tau], rtol=1e-9)
    assert REFERENCE.solve(90.0, 0.04)[2] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(REFERENCE.solve(60.0, 0.0), [3.0, 1.0, 0.0], atol=1e-12)


def test_the_two_fibre_conventions_are_complementary_angles():
    other = TwistingTube(3.0, 7.0, 0.317, 0.8, fibre_convention="hoop")
    np.testing.assert_allclose(other.solve(30.0, 0.04), REFERENCE.solve(60.0, 0.04), rtol=1e-12)
    with pytest.raises(InputError, match="fibre_convention"):
        TwistingTube(3.0, 7.0, 0.317, 0.8, fibre_convention="radial")


def test_the_limit_load_is_named():
    # of the tube without fibres: below the thin-wall estimate, above what test_without_fibres reaches
    tube = TwistingTube(1.0, 2.0, 1.0, 1e-12, isotropic_fraction=1.0)
    with pytest.raises(ConvergenceError, match=r"beyond [56]\d\d(\.\d)? kPa \(asked for 1000 kPa\)"):
        tube.solve(60.0, 1.0)


def test_printed_constants_bound_the_twist():
    """With E_t = 0.008 MPa the tube twists a tenth of the paper's 0.033 rad/mm at most, up to its limit
    load."""
    tau, _, _ = largest_twist(TwistingTube(3.0, 7.0, 0.317, 0.008), range(30, 90, 10), 4e-3)
    assert 0 < tau < 0.003


@pytest.mark.parametrize("multiplier", ["unknown", "pressure"])
def test_printed_equations_have_no_solution(multiplier):
    result = printed_equations(REFERENCE, 60.0, 0.02, multiplier)
    assert not result.solved
    assert np.linalg.norm(result.residual) > 0.5
    assert "no solution" in str(result)


def test_section_areas_are_the_closed_forms():
    s = Segment("twisting", 60.0, 5, cavity_floor=0.5, chamber_height=5.5, gap=2.0)
    # per chamber: thickness x ..., over 6 mm of pitch
    channel, cavity, shared = 4 * 2, 2 * 10 * 5.5, 2 * 4 * 0.5
    assert empty_area(s) == pytest.approx(channel + 2 * (cavity - shared) / 6)
    assert occupied_area(s) + empty_area(s) == pytest.approx(12 * 4 + 2 * 4 * 12 * (7 - 2) / 6)
    Ri, Ro = equivalent_radii(s)
    assert np.pi * Ri**2 == pytest.approx(empty_area(s))
    assert np.pi * (Ro**2 - Ri**2) == pytest.approx(occupied_area(s))
