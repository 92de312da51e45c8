"""Fig. 7: the octopus tentacle and a second one, designed for their targets at 50 kPa."""

import numpy as np

from examples.paper.common import Statement
from examples.paper.designs import angles_of, designed, draw_designs, followed
from pneunet.design.design import Design
from pneunet.geometry.parameters import TWISTING

NAMES = ("octopus", "tentacle2")
#: the paper's second tentacle (those of the octopus stand in the supplement, which is lost); -45 is 135
PAPER_ANGLES = (60.0, 135.0, 60.0)


def compute() -> dict[str, Design]:
    return designed(NAMES)


def statements(found: dict[str, Design]) -> list[Statement]:
    octopus, second = (found[name] for name in NAMES)
    kinds = [s.kind == TWISTING for s in octopus.manipulator.segments]
    hands = [np.sign(90 - s.angle) for s in second.manipulator.segments]
    return [
        Statement(
            "a twisting, a bending and a helical segment follow the octopus tentacle at one pressure, 50 kPa",
            f"{angles_of(octopus)} deg at {octopus.pressure_kPa:.1f} kPa",
            bool(kinds == [True, False, False] and abs(octopus.pressure_kPa - 50) < 1e-6),
        ),
        Statement(
            "the second tentacle has a twisting segment of 60 and two others of -45 and 60 degrees",
            f"{angles_of(second)} deg; the target's numbers are fixed here, since the paper prints none",
            bool(hands == [np.sign(90 - a) for a in PAPER_ANGLES]),
        ),
        *(followed(name, design) for name, design in found.items()),
    ]


def draw(found: dict[str, Design]):
    return draw_designs(found, [10.0, 20.0, 30.0, 40.0, 50.0])
