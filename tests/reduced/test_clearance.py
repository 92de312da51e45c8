"""Plate estimate of the walls' bulge."""

from types import SimpleNamespace

import pytest

from pneunet.geometry.reference_cases import CASES
from pneunet.reduced.rod.clearance import gap_left, wall_bulge


def plate(short, long, thickness, modulus):
    material = SimpleNamespace(mu=modulus / 3)
    return SimpleNamespace(
        chamber_height=short, cavity_width=long, sin=1.0, wall=thickness, material=material, gap=1.0
    )


def test_small_deflection_is_timoshenko():
    """w = alpha P a^4 / D; alpha = 0.00126 (square) and 0.00254 (2 : 1), clamped edges."""
    for long, alpha in ((1.0, 0.00126), (2.0, 0.00254)):
        D = 1e-3 / (12 * 0.91)
        assert wall_bulge(plate(1.0, long, 0.1, 1.0), 1e-6) == pytest.approx(alpha * 1e-6 / D, rel=1e-3)


@pytest.mark.parametrize("load, deflection", [(25, 0.32), (50, 0.59), (100, 0.95), (150, 1.19), (250, 1.54)])
def test_large_deflection_is_roark_s(load, deflection):
    """P a^4/(E t^4) -> w/t of a square plate with held edges: Roark, Table 11.12; the fit is within 7 %."""
    assert wall_bulge(plate(1.0, 1.0, 1.0, 1.0), load) == pytest.approx(deflection, rel=0.07)


def test_known_contacts():
    """The case that touches from 7 kPa on is expected to overlap well before 50 kPa, the one that stays open
    is not."""
    assert gap_left(CASES["twist_w15"](angle=60.0, chambers=3), 0.05) < 0
    assert gap_left(CASES["twist_w12"](angle=60.0, chambers=3), 0.05) > 0
