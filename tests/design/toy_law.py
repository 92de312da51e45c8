"""A SegmentLaw in closed form with the symmetries of the real ones: fast, and known to the tests."""

import numpy as np

from pneunet.base.errors import ConvergenceError
from pneunet.geometry.shape_numbers import SHAPE
from pneunet.reduced.rod.laws import FreeSection, SegmentLaw
from pneunet.reduced.rod.states import VARIABLES, StatesWithSlopes

#: what its strains depend on besides the pressure, and an imaginary step for derivatives
OF_SHAPE, STEP = ("angle", "chamber_height", "base_thickness"), 1e-30j
MU = 0.317  # MPa, of the paper's silicone: loads are pressures over the modulus


class ToyLaw(SegmentLaw):
    name = "toy"

    def __init__(self, limit=np.inf):
        self.limit = limit  # MPa; no equilibrium beyond

    def of(self, segment):
        return ToySection(segment, self.limit)

    def each_with_slopes(self, segments, pressure, names=SHAPE):
        pressures = np.broadcast_to(pressure, len(segments))
        q, slopes = self.each(segments, pressures).vector, np.zeros((len(segments), 6, len(VARIABLES)))
        places = [VARIABLES.index(name) for name in (*OF_SHAPE, "pressure", "mu")]
        for segment, P, rows in zip(segments, pressures, slopes):
            values = np.array(
                [*(getattr(segment, name) for name in OF_SHAPE), P, segment.material.mu], complex
            )
            for j, place in enumerate(places):
                stepped = values + STEP * np.eye(5)[j]
                rows[:, place] = strains(segment.kind, *stepped).imag / STEP.imag
        return StatesWithSlopes.of_strains(q, slopes, segments, pressures)


def strains(kind, angle, chamber_height, base_thickness, P, mu):
    """(6,)"""
    angle, load = angle * np.pi / 180, P / 0.05 * MU / mu
    if kind == "twisting":
        k1 = 0.035 * load * np.sin(2 * angle) * (chamber_height / 5.5) ** 0.5
        return np.array([1 + 0.1 * load, 0, 0, k1, 0, 0])
    k = 0.04 * load * chamber_height / 4 * (2 / base_thickness) ** 0.5
    lean, k1, k2 = -0.01 * load * np.cos(angle), k * np.sin(angle) * np.cos(angle), k * np.sin(angle) ** 2
    return np.array([1 + 0.04 * load, lean, 0, k1, k2, 0])


class ToySection(FreeSection):
    def __init__(self, segment, limit):
        super().__init__(ToyLaw.name)
        self.segment, self.limit = segment, limit

    def free_strains(self, P):
        if P > self.limit:
            raise ConvergenceError(f"toy law: no equilibrium beyond {1e3 * self.limit:g} kPa")
        segment = self.segment
        return strains(segment.kind, *(getattr(segment, name) for name in OF_SHAPE), P, segment.material.mu)
