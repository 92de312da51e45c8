"""Which designs a law is judged on: those it has not seen, each once."""

from dataclasses import fields, replace

import numpy as np
import pytest

from pneunet.geometry.parameters import ONE_SIDED
from pneunet.reduced.trained.coordinates import REST
from pneunet.reduced.training.judging import stiffness_error, strain_error, tip_error
from pneunet.reduced.training.states import ENOUGH, PARTS, Sample, States, splits


def sample(designs):
    """Two states of each design, the second one with strains prescribed around it twofold and in some
    direction."""
    n = len(designs)
    values = {
        "numbers": np.ones((2 * n, 15)),
        "pressure": np.tile([0.0, 0.1], n),
    }
    values |= {"size": np.ones(2 * n), "closing": np.full(2 * n, np.nan), "touching": np.zeros(2 * n, bool)}
    values |= {
        "strains": REST + np.outer(np.tile([0.0, 0.1], n), [1, 0, 0, 0, 1, 0]),
        "matrices": np.tile(np.eye(6), (2 * n, 1, 1)),
    }
    values |= {
        "strain_slopes": np.full((2 * n, 9, 6), np.nan),
        "matrix_slopes": np.full((2 * n, 9, 6, 6), np.nan),
    }
    values |= {"pressure_slopes": np.zeros((2 * n, 9)), "directions": np.zeros((9, 15))}
    values |= {"stretch": np.ones(2 * n), "volume": np.ones(2 * n)}
    free = States(
        ONE_SIDED, *(({"design": np.repeat(designs, 2)} | values)[f.name] for f in fields(States)[1:])
    )
    around = free.of(np.repeat(np.flatnonzero(free.pressure > 0), 2))
    change = np.where(np.arange(2 * n)[:, None] % 2, 0.3 * np.eye(6)[5], around.strains - REST)
    return Sample(free, around, change, change, np.arange(2 * n) % 2 == 0)


def test_few_held_out_designs_are_joined_by_every_training_design_once():
    training, held_out = sample(np.arange(37)), sample(np.arange(100, 110))
    pairs = splits(training, held_out)
    assert len(pairs) == 1 + PARTS and pairs[0] == (training, held_out)
    judged = np.concatenate([there.designs for _, there in pairs[1:]])
    assert sorted(judged) == list(range(37))
    for learned, there in pairs[1:]:
        assert (
            not set(learned.designs) & set(there.designs) and len(learned.designs) + len(there.designs) == 37
        )
        assert set(there.around.design) == set(there.designs)
    assert len(splits(training, sample(np.arange(100, 100 + ENOUGH)))) == 1


def test_fewer_designs_than_parts_are_a_part_each():
    _, *parts = splits(replace(sample(np.arange(37)), drawn=4), sample(np.arange(100, 110)))
    assert sorted(judged.designs.tolist() for _, judged in parts) == [[0], [1], [2], [3]]


def test_designs_that_were_chosen_teach_and_do_not_judge():
    _, *parts = splits(replace(sample(np.arange(37)), drawn=20), sample(np.arange(100, 110)))
    assert sorted(np.concatenate([judged.designs for _, judged in parts])) == list(range(20))
    assert all(set(learned.designs) == set(range(37)) - set(judged.designs) for learned, judged in parts)


def test_errors_of_known_differences():
    states = sample(np.arange(2)).free
    off = states.strains + 0.03 * np.eye(6)[4]
    assert strain_error(states, off) == pytest.approx(0.03)
    assert stiffness_error(states, 1.05 * states.matrices) == pytest.approx(0.05)
    # at rest, 0.03 a normal pitch of 5 mm bends 100 mm by 0.6 rad: the tip of an arc
    arc = np.array([100 * np.sin(0.6) / 0.6 - 100, 100 * (1 - np.cos(0.6)) / 0.6])
    assert tip_error(states, off)[0] == pytest.approx(np.linalg.norm(arc) / 100)
