"""The tangent stiffness of the free states of one kind of cell, as a trained law knows it.

Where walls meet it jumps, that of bending most, and from there on depends on how far they would overlap. So
what it is without contact, and what contact adds, are learned apart, each from the states that tell.
(Measured: a sixth off the error of one process that is told whether walls touch.)
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.reduced.trained.coordinates import TINY, Coordinates
from pneunet.reduced.trained.side_by_side import SideBySide


@dataclass(frozen=True)
class FreeStiffness:
    """smooth: process of Coordinates.learned_stiffness without contact; contact: of what that adds, in
    `order`, or None where too few designs were seen to touch and smooth has learned from all of them."""

    kind: str
    smooth: SideBySide
    contact: SideBySide | None

    @cached_property
    def coordinates(self) -> Coordinates:
        return Coordinates(self.kind)

    def at(self, numbers: np.ndarray, strains: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """(n, 6, 6) of free states with these strains (n, 6) whose walls have closed so much of their gap
        (n,)."""
        co = self.coordinates
        learned = self.smooth(co.stiffness_inputs(numbers, strains))
        touch = co.touch(closed)
        some = touch > TINY
        if self.contact and some.any():
            added = self.contact(co.contact_inputs(numbers[some], strains[some], closed[some]))
            learned[np.flatnonzero(some)[:, None], order(co)] += touch[some, None] * added
        return co.stiffness(numbers, learned)


def order(coordinates: Coordinates) -> list[int]:
    """The learned stiffnesses in the order in which contact's part is learned: that of bending, with a metric
    of its own, and the rest."""
    return [
        coordinates.bending,
        *np.delete(np.arange(len(coordinates.stiffness_parity)), coordinates.bending),
    ]
