"""How a hanging rod answers to its dimensions, pressure and base, against differences of whole equilibria."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.materials.laws import of_modulus
from pneunet.geometry.parameters import Segment
from pneunet.reduced import shipped_law
from pneunet.reduced.rod import loaded_slopes
from pneunet.reduced.rod.loaded_slopes import loaded
from pneunet.reduced.rod.piece_slopes import FIELD_AT, FIELDS
from pneunet.reduced.rod.placing import PlacedRod

GRAVITY = np.array([0.0, 2000.0, -9810.0])
SEGMENTS = (Segment("one-sided", 70.0, 1, roll=180), Segment("one-sided", 90.0, 1).plain(12.0))
COUNTS, PRESSURES = np.array([9.3, 0.0]), np.array([0.03, 0.03])
BASE = se3.exp_pose(np.array([0.1, -0.2, 0.3, 1.0, 2.0, 3.0]))
TIP = np.array([1.0])
STEPS = {"pressure": 2e-5, "chambers": 1e-3, "angle": 1e-2, "wall": 1e-3, "end_margin": 1e-3, "mu": 2e-4}


@pytest.fixture(autouse=True)
def one_grid(monkeypatch):
    """Differences need the same elements on both sides: tight enough for them to be the same."""
    monkeypatch.setattr(loaded_slopes, "TOLERANCE", 1e-5)


def found(segments=SEGMENTS, counts=COUNTS, pressures=PRESSURES, base=BASE, names=()):
    return loaded(segments, counts, shipped_law(), pressures, base, GRAVITY, names)


def tip(base=BASE, **changes):
    return PlacedRod(found(base=base, **changes).twists, base).points(TIP)[0]


def test_a_hanging_rod_answers_as_differences_say():
    here = found(names=FIELDS)
    station = PlacedRod(here.twists, BASE).at(TIP)
    moves = (station.moves @ here.by.reshape(station.moves.shape[2], -1)).reshape(3, 2, -1)

    def moved(name, step):
        if name == "pressure":
            return tip(pressures=PRESSURES + [step, 0])
        if name == "chambers":
            return tip(counts=COUNTS + [step, 0])
        if name == "mu":
            material = of_modulus(SEGMENTS[0].material, SEGMENTS[0].material.mu + step)
            return tip(segments=(replace(SEGMENTS[0], material=material), SEGMENTS[1]))
        one = replace(SEGMENTS[0], **{name: getattr(SEGMENTS[0], name) + step})
        return tip(segments=(one, SEGMENTS[1]))

    for name, step in STEPS.items():
        by_differences = (moved(name, step) - moved(name, -step)) / (2 * step)
        assert moves[:, 0, FIELD_AT[name]] == pytest.approx(by_differences, rel=1e-3, abs=1e-3), name


def test_a_turned_base_turns_gravity_the_other_way():
    here = found()
    station = PlacedRod(here.twists, BASE).at(TIP)
    rigid = -se3.hat(station.points[0] - BASE[:3, 3])
    moves = rigid + (station.moves @ here.by_turn.reshape(-1, 3))[0]
    for axis in np.eye(3):
        sides = []
        for sign in (-1, 1):
            base = BASE.copy()
            base[:3, :3] = se3.exp_rotation(sign * 1e-3 * axis) @ base[:3, :3]
            sides.append(tip(base))
        assert moves @ axis == pytest.approx((sides[1] - sides[0]) / 2e-3, rel=1e-3, abs=1e-2)
