"""Designs that would teach a law most."""

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.geometry.parameters import TWISTING
from pneunet.geometry.shape_numbers import numbers_of
from pneunet.hifi.runs.campaign.sample import RANGES, segments
from pneunet.reduced import shipped_law
from pneunet.reduced.training.regression import fit
from pneunet.reduced.training.suggestion import greedy, most_telling


def test_the_first_of_them_is_the_one_that_lowers_the_weighed_variance_most():
    rng = np.random.default_rng(0)
    x, offered = rng.uniform(-1, 0.5, (15, 2)), rng.uniform(-1, 1, (20, 2))
    y = np.sin(2 * x[:, :1]) + x[:, 1:] ** 2
    process = fit(x, y, np.arange(15))
    blocks = [np.arange(i, i + 2) for i in range(0, 20, 2)]
    before = process.deviation(offered)[:, 0] ** 2
    left = []
    for block in blocks:
        rows, group = np.vstack([x, offered[block]]), np.append(np.arange(15), [99, 99])
        after = fit(rows, np.append(y, [[1.0], [2.0]], axis=0), group, like=process)
        left.append((before * np.diag(after.covariance(offered))).sum())
    chosen = greedy(process, offered, blocks, 4)
    assert chosen[0] == np.argmin(left) and len(set(chosen)) == 4


def test_touching_designs_touch_and_are_no_more_than_are_on_offer():
    law = shipped_law().kinds[TWISTING]
    shape, _ = numbers_of(segments(TWISTING, RANGES[TWISTING], 40, 9))
    rows = most_telling(law, shape, 3, 0.3, 0.9, touching=True)
    pressure = np.full(3, 0.3)
    _, beyond, _ = law.path.at(shape[rows], pressure)
    pressure *= np.where(beyond > 0, 0.9, 1) * np.exp(-beyond)
    assert len(set(rows)) == 3
    assert (law.closed(shape[rows], pressure, law.path.strains(shape[rows], pressure)) > 1).all()
    with pytest.raises(InputError, match="41 designs are asked for, 40 are on offer"):
        most_telling(law, shape, 41, 0.3, 0.9)
    with pytest.raises(InputError, match="40 designs are asked for, [0-9]+ whose walls touch are on offer"):
        most_telling(law, shape, 40, 0.3, 0.9, touching=True)
