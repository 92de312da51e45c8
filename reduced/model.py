"""From segments to shapes: what a law of a segment is, the analytic one, and the prediction of a
manipulator."""

from abc import ABC, abstractmethod
from functools import lru_cache

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import TWISTING
from pneunet.reduced.analytic.helical import HelicalCell
from pneunet.reduced.analytic.twisting import TwistingTube
from pneunet.reduced.rod.areas import equivalent_radii
from pneunet.reduced.rod.centreline import centreline
from pneunet.reduced.rod.ends import free_manipulator


class SegmentLaw(ABC):
    """What predicts the free strains of the middle of a long segment; `name`: what --law calls it."""

    @abstractmethod
    def strains(self, segment, pressure):
        """RodStrains with e, k of shape pressure.shape + (3,); pressure in MPa, a number or an array."""

    def each(self, segments, pressure):
        """RodStrains (n, 3) of n segments at one pressure in MPa."""
        found = [self.strains(s, float(pressure)) for s in segments]
        return RodStrains([q.e for q in found], [q.k for q in found])

    def table(self, segments, pressures):
        """RodStrains (n, m, 3) of n segments at increasing pressures (m,) in MPa; nan from where there is no
        equilibrium."""
        e, k = np.full((2, len(segments), len(pressures), 3), np.nan)
        for i, segment in enumerate(segments):
            for j, pressure in enumerate(pressures):
                try:
                    found = self.strains(segment, float(pressure))
                except ConvergenceError:
                    break
                e[i, j], k[i, j] = found.e, found.k
        return RodStrains(e, k)

    def excess(self, segment, pressure):
        """How far (0: not at all) the segment lies outside what the law knows, (d,) in widths of that."""
        return np.zeros(1)

    def doubts(self, segment, pressure):
        """Reasons, as text, not to trust the law for a segment at a pressure or several; () when there are
        none."""
        return ()


def checked_pressure(pressure):
    """Pressure as an array; InputError where it is not finite or negative."""
    pressure = np.asarray(pressure, float)
    if not ((pressure >= 0) & (pressure < np.inf)).all():
        raise InputError("pressure_kPa: give finite values >= 0")
    return pressure


class AnalyticModel(SegmentLaw):
    """The two analytic laws: the twisting tube and the one-sided minimum-potential-energy cell.

    Nothing in them is fitted to finite elements. The twisting tube's E_t is 3 mu, the modulus of the solid
    walls along the chambers; Ri and Ro are the equivalent radii.
    """

    name = "analytic"

    def __init__(self):
        self._law = lru_cache(maxsize=256)(_law)
        self._solved = lru_cache(maxsize=4096)(self._solve)

    def strains(self, segment, pressure):
        """RodStrains (e, k of shape pressure.shape + (3,)) at `pressure` in MPa, a number or an array.

        ConvergenceError, with the pressure reached, where the model has no stable equilibrium.
        """
        pressure, key = checked_pressure(pressure), segment.key
        levels, where = np.unique(pressure, return_inverse=True)
        e, k = self._solved(key, tuple(levels.tolist()))
        where = where.reshape(pressure.shape)
        return RodStrains(e[where], k[where])

    def _solve(self, key, levels):
        return self._law(key)(np.array(levels))


def _law(key):
    return _twisting_law(key) if key.kind == TWISTING else HelicalCell(key).strains


def segment_tube(segment):
    """The TwistingTube that stands for a twisting segment."""
    Ri, Ro = equivalent_radii(segment)
    return TwistingTube(Ri, Ro, segment.material.mu, 3 * segment.material.mu)


def _twisting_law(segment):
    tube = segment_tube(segment)

    def strains(pressures):
        # Seen from outside, a chamber at angle theta runs along (cos, -sin) on (Z, Psi): y points against the
        # hoop direction on top. The chambers are fibres of angle -theta, whose tau is the opposite.
        _, stretch, tau = tube.solve(segment.angle, pressures)
        e, k = np.zeros((2, len(pressures), 3))
        e[:, 0], k[:, 0] = stretch, -tau * stretch
        return e, k

    return strains


def predict(manipulator, pressure, law, spacing=1.0, base_pose=None):
    """The Centreline of a free manipulator at `pressure` (MPa) by a SegmentLaw, end effects included
    (reduced.rod.ends).

    spacing in mm; base_pose (4, 4) the base frame, default the identity.
    """
    segments = manipulator.segments
    pieces = free_manipulator(segments, law.each(segments, pressure), [s.chambers for s in segments])
    return centreline(*pieces, spacing, base_pose)


def doubts(manipulator, pressure, law):
    """Lines of text, one a reason, not to trust a SegmentLaw for the manipulator at a pressure (MPa) or
    several."""
    who = {}
    for i, segment in enumerate(manipulator.segments, start=1):
        for reason in law.doubts(segment, pressure):
            who.setdefault(reason, []).append(str(i))
    return tuple(f"segment {', '.join(numbers)}: {reason}" for reason, numbers in who.items())
