"""What the grid of a cell changes: from the coarse grid, on which most designs are computed, to ever finer
ones, for which the law is.

Learned at a leading strain, as the law itself is: what is added to the logarithm of the pressure over it, to
the other strains over it, and to the learned numbers of the stiffness. All are smooth in the design, because
all grids of a size have the same elements.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.reduced.trained.coordinates import Coordinates
from pneunet.reduced.trained.side_by_side import SideBySide


@dataclass(frozen=True)
class MeshDifference:
    """strains, stiffness: processes at Coordinates.lead_inputs of what is added to learned_strains and
    learned_stiffness of a state on the coarse grid; None where too few designs are computed on finer ones:
    nothing is added then. left, stiffness_left: part of that which a state on the fine grid still lacks;
    uncertainty: of strains so found, over themselves: half of a 90 % interval; uncertainty_at_lead: the same
    of pressure and strains at a leading strain, without what a flat path makes of it."""

    kind: str
    strains: SideBySide | None
    stiffness: SideBySide | None
    left: float
    stiffness_left: float
    uncertainty: float
    uncertainty_at_lead: float

    @classmethod
    def none(cls, kind: str) -> "MeshDifference":
        """Of one grid alone."""
        return cls(kind, None, None, 1.0, 1.0, 0.0, 0.0)

    @cached_property
    def coordinates(self) -> Coordinates:
        return Coordinates(self.kind)

    def converged(
        self, numbers: np.ndarray, pressure: np.ndarray, strains: np.ndarray, fine: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """(P/mu (n,), strains (n, 6)) at the same leading strain on ever finer grids, of free states on the
        coarse grid, or on the fine one: numbers (n, 15), P/mu (n,), strains (n, 6). Rest stays as it is."""
        pressure, strains, loaded = pressure.copy(), strains.copy(), pressure > 0
        if self.strains and loaded.any():
            co, some, lead = self.coordinates, numbers[loaded], self.coordinates.leading(strains[loaded])
            added = self.strains(co.lead_inputs(some, lead)) * (self.left if fine else 1.0)
            learned = co.learned_strains(some, pressure[loaded], strains[loaded]) + added
            pressure[loaded] = lead * np.exp(learned[:, 0])
            strains[loaded] = co.strains(some, lead, learned[:, 1:])
        return pressure, strains

    def converged_stiffness(
        self, numbers: np.ndarray, strains: np.ndarray, matrices: np.ndarray, fine: bool = False
    ) -> np.ndarray:
        """(n, 6, 6) of the same states' stiffness."""
        if not self.stiffness:
            return matrices
        co = self.coordinates
        added = self.stiffness(co.lead_inputs(numbers, co.leading(strains)))
        added = added * (self.stiffness_left if fine else 1.0)
        return co.stiffness(numbers, co.learned_stiffness(numbers, matrices) + added)
