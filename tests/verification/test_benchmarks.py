"""Published problems without exact solutions, orders of convergence, patch tests and the balance of
energy."""

import pytest

from pneunet.hifi.verification import cook, energy_balance, land, manufactured, patch


def test_land_problem_1():
    z, _ = land.beam((24, 4, 4))
    assert land.RANGE[0] <= z <= land.RANGE[1]


def test_cook_s_membrane():
    rises = [cook.rise(cells)[0] for cells in (4, 8, 16)]
    assert rises[-1] == pytest.approx(cook.converged(*rises), rel=5e-3)
    assert rises[-1] == pytest.approx(cook.PUBLISHED, rel=1e-2)


def test_manufactured_solution_converges_with_full_order():
    errors = [manufactured.errors(cells) for cells in (2, 4, 8)]
    for coarse, fine in zip(errors, errors[1:]):
        order_u, order_p = manufactured.orders(coarse, fine)
        assert order_u >= 2.8 and order_p >= 1.8


def test_affine_deformation_is_exact_on_a_distorted_mesh():
    assert max(patch.affine()) < 1e-10


def test_constant_pressure_is_exact_on_a_distorted_mesh():
    assert max(patch.squeezed()) < 1e-12


def test_work_of_the_pressure_is_stored():
    """To 1e-5, and the rule's own error is smaller: it falls 16 times as its step is halved."""
    (_, coarse), (_, middle), (_, fine) = energy_balance.balance()[0]
    assert abs(fine) < 1e-5
    assert 10 < (coarse - middle) / (middle - fine) < 30
