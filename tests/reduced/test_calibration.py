"""Calibration finds the constants that synthetic states were made with."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Segment
from pneunet.reduced.analytic.calibration import calibrate_softness, calibrate_tube, tube_curves
from pneunet.reduced.analytic.helical import HelicalCell
from pneunet.reduced.analytic.twisting import TwistingTube

TUBE = TwistingTube(3.0, 7.0, 0.317, 0.8)
PRESSURES = (0.01, 0.03)


def test_tube_constants_and_convention():
    made = tube_curves(TUBE, (45.0, 75.0), PRESSURES)
    assert (made.tau > 0).all()
    start = replace(TUBE, inner_radius=4.0, outer_radius=6.0, fibre_modulus=0.2)
    found = calibrate_tube(made, start)
    for name in ("inner_radius", "outer_radius", "fibre_modulus"):
        assert getattr(found.tube, name) == pytest.approx(getattr(TUBE, name), rel=5e-3)
    assert found.tau_error < 1e-3 and found.stretch_error < 2e-3
    modulus_only = replace(TUBE, fibre_modulus=0.2)
    assert calibrate_tube(made, modulus_only, radii=False).tube.fibre_modulus == pytest.approx(0.8, rel=1e-3)
    assert calibrate_tube(made, replace(modulus_only, fibre_convention="hoop"), radii=False).tau_error > 0.2


def test_states_beyond_the_limit_load_are_missing():
    burst = tube_curves(replace(TUBE, fibre_modulus=0.008), (60.0,), (0.02, 0.2))
    assert np.isfinite(burst.tau[0, 0]) and np.isnan(burst.tau[0, 1]) and np.isnan(burst.stretch[0, 1])


def test_softness_and_slant():
    bodies = [
        Segment("one-sided", angle, 1, width=10.0, channel_width=2.0, material=NeoHookean(0.2))
        for angle in (45.0, 90.0)
    ]
    softer = [replace(body, material=NeoHookean(0.2 / (1.4 * body.sin**-0.5))) for body in bodies]
    curvature = np.array([np.linalg.norm(HelicalCell(body).strains(PRESSURES).k, axis=1) for body in softer])
    assert calibrate_softness(bodies, PRESSURES, curvature) == pytest.approx((1.4, 0.5), rel=1e-3)
    assert calibrate_softness(bodies[1:], PRESSURES, curvature[1:], slanted=False) == pytest.approx(
        (1.4, 0.0), rel=1e-3
    )
