"""What a trained law knows of one kind of cell, without dimension (base.files.dataset)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.geometry.shape_numbers import SHAPE
from pneunet.reduced.rod.states import Slopes
from pneunet.reduced.trained.coordinates import REST, Coordinates, cosine
from pneunet.reduced.trained.enthalpy import Anharmonic, Tensors
from pneunet.reduced.trained.free_path import NEARER, FreePath
from pneunet.reduced.trained.free_stiffness import FreeStiffness
from pneunet.reduced.trained.mesh import MeshDifference
from pneunet.reduced.trained.recorded import Recorded

#: far from all that was learned the deviation that inducing points give may be too small, so it counts times
#: this when it comes to doubts
FAR = 1.04
#: lowest P/mu, whose logarithm is taken
LOWEST = 1e-9


@dataclass(frozen=True)
class KindLaw:
    """The law of one kind, for ever finer grids as far as its data tell. path, stiffness: of the free states;
    anharmonic: of the enthalpy around them; recorded: what else is known of them, None where the data do
    not tell; mesh: what changes from the coarse grid, all of which the rest has in it, and how far that is
    uncertain; quantile (6,): what a standard deviation of each strain is multiplied by for a 90 % interval;
    low, high (r,): range of Coordinates.ranged; doubt: largest deviation of the free states' pressure that
    counts as known."""

    kind: str
    path: FreePath
    stiffness: FreeStiffness
    anharmonic: Anharmonic
    recorded: Recorded | None
    mesh: MeshDifference
    quantile: np.ndarray
    low: np.ndarray
    high: np.ndarray
    doubt: float

    @cached_property
    def coordinates(self) -> Coordinates:
        return Coordinates(self.kind)

    @cached_property
    def stiffens(self) -> bool:
        """Whether it has learned how a silicone's stiffening matters."""
        places = self.coordinates.stiffening
        return bool((self.high[places] > self.low[places]).any())

    def ranged(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, r) what the ranges are of."""
        return self.coordinates.ranged(numbers, pressure)

    def free_strains(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, 6) free strains of numbers (n, 15) at P/mu (n,); beyond the end of their path, as at a
        limit load, those there."""
        return self.path.strains(numbers, np.maximum(pressure, LOWEST))

    def free_strains_and_slopes(
        self, numbers: np.ndarray, pressure: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(strains (n, 6), slopes (n, 6, 14)): derivatives by the 13 shape numbers (the angle in degrees) and
        P/mu."""
        return self.path.strains_and_slopes(numbers, np.maximum(pressure, LOWEST))

    def free_stiffness(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, 6, 6) tangent stiffness of the free states."""
        strains = self.free_strains(numbers, pressure)
        return self.stiffness_at(numbers, strains, self.closed(numbers, pressure, strains))

    def stiffness_at(self, numbers: np.ndarray, strains: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """(n, 6, 6) the same, of free states with these strains (n, 6) whose walls have closed so much of
        their gap (n,)."""
        return self.stiffness.at(numbers, strains, closed)

    def closed(self, numbers: np.ndarray, pressure: np.ndarray, strains: np.ndarray) -> np.ndarray:
        """(n,) part of the gap that walls have closed in free states with these strains (n, 6), as if they
        could go on: from 1 on they touch."""
        return self.path.closing.closed(numbers, pressure, strains)

    def closed_on_the_way(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n,) largest part of the gap that walls have closed on the way to free states."""
        pressure = np.maximum(pressure, LOWEST)
        lead = self.coordinates.leading(self.free_strains(numbers, pressure))
        return self.path.closing.closed_on_the_way(numbers, pressure, lead)[0]

    def anharmonic_at(self, numbers: np.ndarray, strains: np.ndarray, closed: np.ndarray) -> Tensors:
        """What reduced.trained.enthalpy's anharmonic forms are made of around free states with these strains
        (n, 6)."""
        return self.anharmonic.at(self.coordinates.around_inputs(numbers, strains, closed), cosine(numbers))

    def half_width(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, 6) half of the 90 % interval of each free strain, what is uncertain of the grid included."""
        strains, spread, steep = self.path.strains_and_spread(numbers, np.maximum(pressure, LOWEST))
        # where the pressure hardly rises, a small error of it is a large one of the strains
        grid = self.mesh.uncertainty_at_lead / np.minimum(steep, 1)
        return np.hypot(self.quantile * spread, grid[:, None] * (strains - REST))

    def strains_and_own_half_width(
        self, numbers: np.ndarray, pressure: np.ndarray, exact: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """(free strains (n, 6), half of their 90 % intervals (n, 6)) without what is uncertain of the grid;
        exact: as for FreePath.strains_and_spread."""
        strains, spread, _ = self.path.strains_and_spread(numbers, np.maximum(pressure, LOWEST), exact)
        return strains, self.quantile * spread

    def recorded_at(self, numbers: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As Recorded.at, of numbers (n, 15) at P/mu (n,); nan where the data did not tell."""
        if self.recorded is None:
            return np.full(len(numbers), np.nan), np.full(len(numbers), np.nan)
        lead, _, inputs = self.path.at(numbers, np.maximum(pressure, LOWEST))
        return self.recorded.at(inputs, lead)

    def excess(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, r + 2) how far a design lies outside what the law was taught: of each of Coordinates.ranged in
        widths of its range, of the free states' deviation in units of the largest that counts as known, and
        of log P beyond the end of their path; 0 inside."""
        pressure = np.maximum(pressure, LOWEST)
        _, beyond, there = self.path.at(numbers, pressure)
        return self.excess_there(numbers, pressure, there, beyond)

    def excess_there(
        self, numbers: np.ndarray, pressure: np.ndarray, there: np.ndarray, beyond: np.ndarray
    ) -> np.ndarray:
        """The same of free states whose path_inputs (n, d) and log P beyond the path's end (n,) are known."""
        return self._excess(self.ranged(numbers, pressure), self.path.deviation(there, self.known), beyond)

    @property
    def known(self) -> float:
        """Largest deviation, from inducing points, that counts as known."""
        return self.doubt / FAR

    def _excess(self, ranged, deviation, beyond):
        outside = np.maximum(np.maximum(self.low - ranged, ranged - self.high) - 1e-9, 0) / self._width
        unknown = np.maximum(deviation / self.known - 1, 0)
        return np.concatenate([outside, unknown[:, None], beyond[:, None]], axis=1)

    @cached_property
    def _width(self):
        width = self.high - self.low
        return np.where(width > 0, width, 1.0)  # of a silicone's stiffening it may be 0

    def with_slopes(self, numbers: np.ndarray, pressure: np.ndarray) -> tuple[Slopes, Slopes, Slopes, Slopes]:
        """(`free_strains` (n, 6), `excess` (n, r + 2), `closed_on_the_way` (n,), largest stretch (n,)), each
        with its derivatives (..., 14) by the 13 shape numbers (the angle in degrees) and P/mu: everything
        from one search. A stretch of which the data did not tell is nan."""
        pressure = np.maximum(pressure, LOWEST)
        state = self.path.state_and_slopes(numbers, pressure, NEARER)
        x = self.ranged(numbers, pressure)
        deviation, by_inputs = self.path.deviation_and_slopes(state.inputs, self.known)
        excess = self._excess(x, deviation, state.beyond)
        by = np.zeros((*excess.shape, len(SHAPE) + 1))
        if excess.any():  # mostly there is none
            side = np.sign(2 * x - self.low - self.high) * (excess[:, :-2] > 0) / self._width
            by[:, :-2] = side[:, :, None] * self.coordinates.ranged_slopes(numbers, pressure)
            by[:, -2], by[:, -1] = state.of_inputs(by_inputs) / self.known, state.beyond_by
        unknown = np.full(len(numbers), np.nan), np.full((len(numbers), len(SHAPE) + 1), np.nan)
        stretch = self.recorded.stretch_and_slopes(state) if self.recorded else unknown
        closed, closed_by, by_lead = self.path.closing.closed_on_the_way(numbers, pressure, state.chain.lead)
        closed_by += by_lead[:, None] * state.lead_by
        return state.strains_and_slopes(), (excess, by), (closed, closed_by), stretch
