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


@dataclass(frozen=True)
class Closing:
    """process: of States.closing at Coordinates.closing_inputs; None where too few designs were seen to
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
        return self.process(self.coordinates.closing_inputs(numbers, load))[:, 0] * load - numbers[:, GAP]

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
        closing, slopes = self.process.with_slopes(co.closing_inputs(numbers, load))
        by = co.by_shape(numbers, slopes)[:, 0] * load[:, None]
        by[:, GAP] -= 1
        by_load = closing[:, 0] + slopes[:, 0, -1] * load
        by[:, -1] = 0 if self._by_strain else by_load
        return closing[:, 0] * load - numbers[:, GAP], by, by_load * self._by_strain

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
            return self.process(x)[:, 0] * load - numbers[:, GAP], 0.0, 0.0
        closing, slope, curvature = self._along.at(x)
        slope = slope[:, 0]
        return closing * lead - numbers[:, GAP], closing + slope * lead, 2 * slope + curvature[:, 0, 0] * lead
