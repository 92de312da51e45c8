"""Free states on the path of one kind of cell with their derivatives by shape numbers and P/mu.

What is learned depends on path_inputs: the numbers, the leading strain and the overlap of walls, which
depends on both. The leading strain in turn depends on shape and P/mu, since log P = learned + log(leading
strain).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.reduced.trained.coordinates import LEAD, OVERLAP, SMALL_STRAIN, Coordinates


@dataclass(frozen=True)
class PathChain:
    """How path_inputs change with the numbers (n, 15), P/mu and the leading strain (n,).

    overlap (n,): of walls, overlap_by (n, 14): by the shape numbers and P/mu; overlap_by_lead (n,).
    """

    coordinates: Coordinates
    numbers: np.ndarray
    lead: np.ndarray
    overlap: np.ndarray
    overlap_by: np.ndarray
    overlap_by_lead: np.ndarray

    def _by_overlap(self, slopes):
        return slopes[:, :, OVERLAP] * self.coordinates.overlap_input_slope(self.overlap)[:, None]

    def at_lead(self, slopes: np.ndarray) -> np.ndarray:
        """(n, p, 14) derivatives by the shape numbers and P/mu, at a leading strain, of what has the
        derivatives (n, p, d) by path_inputs."""
        by = self.coordinates.by_shape(self.numbers, slopes)
        return by + self._by_overlap(slopes)[:, :, None] * self.overlap_by[:, None]

    def by_lead(self, slopes: np.ndarray) -> np.ndarray:
        """(n, p) those by the leading strain."""
        direct = slopes[:, :, LEAD] / (self.lead + SMALL_STRAIN)[:, None]
        return direct + self._by_overlap(slopes) * self.overlap_by_lead[:, None]


@dataclass(frozen=True)
class StateOnPath:
    """n free states. chain: with their shapes and leading strains; inputs (n, d): their path_inputs; learned
    (n, p): what is learned there, by (n, p, 14) and by_lead (n, p): how it changes at a leading strain and
    with it; steep (n,): d log P/d log(leading strain); beyond (n,): log P beyond the path's end, missing_by
    (n, 14): how log P less its value on the path changes at a leading strain.
    """

    chain: PathChain
    inputs: np.ndarray
    learned: np.ndarray
    by: np.ndarray
    by_lead: np.ndarray
    steep: np.ndarray
    beyond: np.ndarray
    missing_by: np.ndarray

    @cached_property
    def lead_by(self) -> np.ndarray:
        """(n, 14) derivatives of the leading strain by the shape numbers and P/mu; beyond the path's end it
        counts as constant."""
        return (self.chain.lead / self.steep * (self.beyond == 0))[:, None] * self.missing_by

    def strains_and_slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """(strains (n, 6), their derivatives (n, 6, 14))."""
        co, numbers, lead, ratios = (
            self.chain.coordinates,
            self.chain.numbers,
            self.chain.lead,
            self.learned[:, 1:],
        )
        by = self.by[:, 1:] + self.by_lead[:, 1:, None] * self.lead_by[:, None]
        return co.strains(numbers, lead, ratios), co.strain_slopes(numbers, lead, ratios, by, self.lead_by)

    def of_inputs(self, slopes: np.ndarray) -> np.ndarray:
        """(n, 14) derivatives of a function of the path_inputs that has the derivatives (n, d) by them."""
        alone = slopes[:, None]
        return self.chain.at_lead(alone)[:, 0] + self.chain.by_lead(alone) * self.lead_by

    @property
    def beyond_by(self) -> np.ndarray:
        """(n, 14) derivatives of `beyond`: at the path's end the leading strain does not count."""
        return (self.beyond > 0)[:, None] * self.missing_by
