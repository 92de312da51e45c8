"""A SegmentLaw in closed form with the symmetries of the real ones: fast, and known to the tests."""

import numpy as np

from pneunet.base.errors import ConvergenceError
from pneunet.reduced.rod.laws import FreeSection, SegmentLaw


class ToyLaw(SegmentLaw):
    name = "toy"

    def __init__(self, limit=np.inf):
        self.limit = limit  # MPa; no equilibrium beyond

    def of(self, segment):
        return ToySection(segment, self.limit)


class ToySection(FreeSection):
    def __init__(self, segment, limit):
        super().__init__(ToyLaw.name)
        self.segment, self.limit = segment, limit

    def free_strains(self, P):
        if P > self.limit:
            raise ConvergenceError(f"toy law: no equilibrium beyond {1e3 * self.limit:g} kPa")
        segment, load = self.segment, P / 0.05
        angle = np.radians(segment.angle)
        if segment.kind == "twisting":
            k1 = 0.035 * load * np.sin(2 * angle) * (segment.chamber_height / 5.5) ** 0.5
            return np.array([1 + 0.1 * load, 0, 0, k1, 0, 0])
        k = 0.04 * load * segment.chamber_height / 4 * (2 / segment.base_thickness) ** 0.5
        lean, k1, k2 = -0.01 * load * np.cos(angle), k * np.sin(angle) * np.cos(angle), k * np.sin(angle) ** 2
        return np.array([1 + 0.04 * load, lean, 0, k1, k2, 0])
