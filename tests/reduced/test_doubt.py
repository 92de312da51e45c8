"""The shipped law's doubt against the exact deviation of its Gaussian process."""

import numpy as np
import pytest

from pneunet.geometry.parameters import TWISTING
from pneunet.geometry.reference_cases import CASES
from pneunet.geometry.shape_numbers import numbers_of
from pneunet.reduced.choice import shipped_law


def test_it_is_the_exact_one_s_and_landmarks_never_hide_it():
    law, random = shipped_law().kinds[TWISTING], np.random.default_rng(0)
    numbers = np.repeat(numbers_of([CASES["twist_w12"](60.0, 5)])[0], 300, axis=0)
    numbers[:, 0] = random.uniform(30, 90, 300)
    numbers[:, 1:13] *= random.uniform(0.5, 1.8, (300, 12))
    _, _, there = law.path.at(numbers, random.uniform(0.01, 0.6, 300))
    exact = law.path.learned.processes[0].deviation(there)[:, 0]
    deviation, bound = law.path.deviation(there), law.path.deviation(there, np.inf)
    assert deviation == pytest.approx(exact, rel=0.15) and (bound >= deviation).all()
    told = deviation > law.known
    assert 20 < told.sum() < 280 and ((law.path.deviation(there, law.known) > law.known) == told).all()
    assert exact[~told].max() < 1.1 * law.doubt and (told == (exact > law.doubt)).mean() > 0.97
