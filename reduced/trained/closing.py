"""How far the walls of one kind of cell have come nearer in free states, as if they could go on when they
touch.

Where walls touch, strains over the pressure have a kink along the path of free states, each design's at its
own place, and from there on depend on how far the walls would overlap. So a law knows first how walls close,
and is told the overlap.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.geometry.parameters import ONE_SIDED
from pneunet.geometry.shape_numbers import SHAPE
from pneunet.reduced.trained.along_inputs import AlongInputs
from pneunet.reduced.trained.coordinates import GAP, SMALLEST, Coordinates
from pneunet.reduced.trained.side_by_side import SideBySide

#: of a normal pitch, over the load: a smaller closing is learned as it is, since it may be negative, of a
#: larger one its logarithm is. (Soft cells close a hundred times as far as stiff ones. Measured, on training
#: designs by cross-validation: the median error of the closing falls from 6.1 to 2.6 % of the gap in twisting
#: and from 4.7 to 3.6 % in one-sided segments.)
SMALL_CLOSING = 0.25
#: of what is learned; beyond it a closing stays
FARTHEST = 5.0
#: of a load, at which it is looked whether walls have touched on the way: far beyond touch nothing was seen,
#: and what is learned may turn back
ON_THE_WAY = (1.0, 0.75, 0.5, 0.25)


@dataclass(frozen=True)
class Closing:
    """process: of `learned_closing` at Coordinates.closing_inputs; None where too few designs were seen to
    touch: walls are apart then.

    Walls close almost in proportion to a load, Coordinates.closing_load: overlap = closing(numbers, load)
    load - gap.
    """

    kind: str
    process: SideBySide | None

    @cached_property
    def coordinates(self) -> Coordinates:
        return Coordinates(self.kind)

    @cached_property
    def _along(self):
        assert self.process
        return AlongInputs(self.process.processes[0], [-1])

    @property
    def _by_strain(self):
        """Whether the load changes along a search for the leading strain at a pressure."""
        return self.process is not None and self.kind == ONE_SIDED

    def overlap(self, numbers: np.ndarray, pressure: np.ndarray, lead: np.ndarray) -> np.ndarray:
        """(n,) of walls, over the normal pitch, in free states of numbers (n, 15) at P/mu (n,) and the
        leading strain (n,); less than 0 while they are apart."""
        if self.process is None:
            return -np.ones(len(numbers))
        load = self.coordinates.closing_load(pressure, lead)
        return self._closing(self.coordinates.closing_inputs(numbers, load)) * load - numbers[:, GAP]

    def _closing(self, inputs):
        assert self.process
        return _back(self.process(inputs)[:, 0])[0]

    def closed(self, numbers: np.ndarray, pressure: np.ndarray, strains: np.ndarray) -> np.ndarray:
        """(n,) part of the gap that walls have closed in free states with these strains (n, 6): from 1 on
        they touch."""
        return 1 + self.overlap(numbers, pressure, self.coordinates.leading(strains)) / np.maximum(
            numbers[:, GAP], SMALLEST
        )

    def overlap_and_slopes(
        self, numbers: np.ndarray, pressure: np.ndarray, lead: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(overlap (n,), its derivatives by the shape numbers and P/mu (n, 14) and by the leading strain
        (n,))."""
        if self.process is None:
            return -np.ones(len(numbers)), np.zeros((len(numbers), len(SHAPE) + 1)), np.zeros(len(numbers))
        co, load = self.coordinates, self.coordinates.closing_load(pressure, lead)
        learned, slopes = self.process.with_slopes(co.closing_inputs(numbers, load))
        closing, steep = _back(learned[:, 0])
        slopes = slopes * steep[:, None, None]
        by = co.by_shape(numbers, slopes)[:, 0] * load[:, None]
        by[:, GAP] -= 1
        by_load = closing + slopes[:, 0, -1] * load
        by[:, -1] = 0 if self._by_strain else by_load
        return closing * load - numbers[:, GAP], by, by_load * self._by_strain

    def closed_on_the_way(
        self, numbers: np.ndarray, pressure: np.ndarray, lead: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(largest part of the gap that walls have closed (n,) on the way to free states, its derivatives by
        the shape numbers and P/mu (n, 14) and by the leading strain (n,)); arguments as for `overlap`."""
        shares, n = np.array(ON_THE_WAY), len(numbers)
        on_the_way = ((shares[:, None] * load).ravel() for load in (pressure, lead))
        found = self.overlap_and_slopes(np.tile(numbers, (len(shares), 1)), *on_the_way)
        overlaps, by, by_lead = (values.reshape(len(shares), n, -1) for values in found)
        by[:, :, -1] *= shares[:, None]
        by_lead *= shares[:, None, None]
        best = overlaps[:, :, 0].argmax(axis=0), np.arange(n)
        overlap, gap = overlaps[best][:, 0], np.maximum(numbers[:, GAP], SMALLEST)
        by = by[best] / gap[:, None]
        by[:, GAP] -= overlap / gap**2
        return 1 + overlap / gap, by, by_lead[best][:, 0] / gap

    def along(
        self, inputs: np.ndarray, numbers: np.ndarray, pressure: np.ndarray, lead: np.ndarray
    ) -> tuple[np.ndarray, float | np.ndarray, float | np.ndarray]:
        """(overlap (n,), its first and second derivative by the leading strain, (n,) or 0); inputs:
        Coordinates.inputs (n, .), of which those of the shape are taken."""
        if self.process is None:
            return -np.ones(len(numbers)), 0.0, 0.0
        load = self.coordinates.closing_load(pressure, lead)
        x = self.coordinates.with_load(inputs, load)
        if not self._by_strain:
            return self._closing(x) * load - numbers[:, GAP], 0.0, 0.0
        learned, by, by_by = self._along.at(x)
        closing, steep = _back(learned)
        slope = steep * by[:, 0]
        curvature = steep * by_by[:, 0, 0] + (steep > 0) * closing * by[:, 0] ** 2
        return closing * lead - numbers[:, GAP], closing + slope * lead, 2 * slope + curvature * lead


def learned_closing(closing: np.ndarray) -> np.ndarray:
    """(n,) what is learned of States.closing (n,)."""
    return np.arcsinh(closing / SMALL_CLOSING)


def _back(learned):
    """(closing (n,), its derivative by what is learned (n,))."""
    bounded = np.clip(learned, -FARTHEST, FARTHEST)
    return SMALL_CLOSING * np.sinh(bounded), SMALL_CLOSING * np.cosh(bounded) * (bounded == learned)
