"""The analytic law: the twisting tube and the one-sided cell of minimum potential energy, for any Segment."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import KINDS, TWISTING, Segment
from pneunet.reduced.analytic.helical import HelicalCell
from pneunet.reduced.analytic.twisting import TwistingTube
from pneunet.reduced.rod.areas import equivalent_radii
from pneunet.reduced.rod.laws import FreeSection, SegmentLaw, checked_pressure


class AnalyticLaw(SegmentLaw):
    """Free strains by the two analytic models; nothing in them is fitted to finite elements."""

    name = "analytic"

    def __init__(self) -> None:
        self._sections = lru_cache(maxsize=256)(AnalyticSection)

    def of(self, segment: Segment) -> "AnalyticSection":
        """InputError for a one-sided segment whose cavity does not rise above the core, and for a passive
        one."""
        if segment.kind not in KINDS:
            raise InputError(
                f"kind = '{segment.kind}': laws are of chambers; a rod takes this one as bare core"
            )
        return self._sections(segment.key)


class AnalyticSection(FreeSection):
    """The free strains of one Segment's section."""

    def __init__(self, segment: Segment) -> None:
        super().__init__(AnalyticLaw.name)
        solve = _tube_strains(segment) if segment.kind == TWISTING else HelicalCell(segment).strains
        self._solved = lru_cache(maxsize=64)(lambda levels: solve(np.array(levels)).vector)

    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) at P in MPa, a number or (...,); ConvergenceError, with the pressure reached, where there
        is no stable equilibrium."""
        P = checked_pressure(P)
        levels, where = np.unique(P, return_inverse=True)
        return self._solved(tuple(levels.tolist()))[where.reshape(P.shape)]


def segment_tube(segment: Segment) -> TwistingTube:
    """The TwistingTube that stands for a twisting segment: equivalent radii, and for E_t 3 mu, the modulus of
    the solid walls along the chambers."""
    Ri, Ro = equivalent_radii(segment)
    return TwistingTube(Ri, Ro, segment.material.mu, 3 * segment.material.mu)


def _tube_strains(segment: Segment) -> Callable[[np.ndarray], RodStrains]:
    tube = segment_tube(segment)

    def strains(pressures: np.ndarray) -> RodStrains:
        # Seen from outside, a chamber at angle theta runs along (cos, -sin) on (Z, Psi): y points against the
        # hoop direction on top. The chambers are fibres of angle -theta, whose tau is the opposite.
        _, stretch, tau = tube.solve(segment.angle, pressures)
        q = np.zeros((len(pressures), 6))
        q[:, 0], q[:, 3] = stretch, -tau * stretch
        return RodStrains.of_vector(q)

    return strains
