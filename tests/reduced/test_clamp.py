"""What a clamp takes from a rod's compliance. Finite elements of it: tests/pneunet/test_rod_against_fe.py."""

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.reference_cases import CASES
from pneunet.reduced.rod.clamp import held_lengths, stiffening
from pneunet.reduced.rod.quadratic import QuadraticLaw, passive_law
from pneunet.reduced.rod.rod import Rod, rod_pieces


def test_a_clamp_takes_the_compliance_of_the_held_lengths():
    segment = CASES["twist_w12"](angle=90.0, chambers=2).plain(40.0)
    height = segment.core_top - segment.core_bottom
    held, K = held_lengths(segment.width, height), passive_law(segment).stiffnesses[0]
    rod = Rod(rod_pieces([segment], [QuadraticLaw([0.0], [np.eye(6)[0]], [K])], 0.0))
    for i, moment in enumerate(1e-3 * np.eye(3), start=3):
        tip = rod.equilibrium(DeadLoads(tip_moment=tuple(moment)), tolerance=1e-8).tip
        turn = se3.log_rotation(tip[:3, :3])[i - 3]
        assert turn * K[i, i] / 1e-3 == pytest.approx(40.0 - held[i], rel=1e-4)


def test_a_clamp_holds_no_more_than_its_piece():
    assert stiffening(12.0, 5.0, 0.1)[3:] == pytest.approx([10.0] * 3)
    assert (stiffening(12.0, 5.0, np.inf) == 1.0).all()
