"""A material's stiffening in the two ratios that the rod law is learned for."""

import numpy as np
import pytest

from pneunet.base.materials.hyperelastic import MODES, nominal_stress
from pneunet.base.materials.laws import Gent, MooneyRivlin, NeoHookean, Ogden, Yeoh
from pneunet.base.materials.stiffening import LARGEST, stiffening


def test_yeohs_law_has_its_own_and_others_the_nearest():
    assert stiffening(Yeoh(c10=0.05, c20=0.004, c30=0.0001)) == pytest.approx((0.08, 0.002, 0.0))
    assert stiffening(NeoHookean(mu=0.1)) == stiffening(Ogden(mu1=0.1, alpha1=2.0)) == (0.0, 0.0, 0.0)


def test_the_nearest_has_the_stresses_of_a_law_of_i1_and_tells_its_misfit():
    law = Gent(mu=0.1, jm=20.0)
    found = stiffening(law)
    own = Yeoh(c10=0.05, c20=0.05 * found.c20, c30=0.05 * found.c30)
    stretch = np.linspace(1.1, LARGEST, 8)
    pairs = [[nominal_stress(m, mode, stretch) for m in (own, law)] for mode in MODES]
    missed, size = (np.linalg.norm(a) for a in (np.diff(pairs, axis=1), np.array(pairs)[:, 1]))
    assert missed / size == pytest.approx(found.misfit, rel=0.5) and 0 < found.misfit < 1e-3
    assert found.c20 > 0 and found.c30 > 0


def test_what_no_law_of_i1_can_do_is_misfit():
    assert stiffening(MooneyRivlin(c10=0.03, c01=0.02)).misfit > 0.05
    softening = stiffening(Ogden(mu1=0.1, alpha1=1.2))
    assert softening.c20 < 0 and softening.c30 >= 0
