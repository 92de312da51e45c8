"""From segments to shapes: the analytic law of a segment, and the prediction of a manipulator."""

from functools import lru_cache
from typing import Protocol

import numpy as np

from base.errors import InputError
from base.strains import RodStrains
from geometry.parameters import TWISTING
from reduced.centreline import centreline
from reduced.helical import HelicalCell
from reduced.section import equivalent_radii
from reduced.twisting import TwistingTube


class SegmentLaw(Protocol):
    """What predicts the free strains of the middle of a long segment."""

    name: str

    def strains(self, segment, pressure):
        """RodStrains with e, k of shape pressure.shape + (3,); pressure in MPa, a number or an array."""


class AnalyticModel:
    """The two analytic laws: the twisting tube and the one-sided minimum-potential-energy cell.

    Nothing in them is fitted to finite elements. The twisting tube's E_t is 3 mu, the modulus of the solid walls along
    the chambers; Ri and Ro are the equivalent radii.
    """

    name = "analytic"

    def __init__(self):
        self._law = lru_cache(maxsize=256)(_law)
        self._solved = lru_cache(maxsize=4096)(self._solve)

    def strains(self, segment, pressure):
        """RodStrains (e, k of shape pressure.shape + (3,)) at `pressure` in MPa, a number or an array.

        ConvergenceError, with the pressure reached, where the model has no stable equilibrium.
        """
        pressure = np.asarray(pressure, float)
        if not (np.isfinite(pressure).all() and (pressure >= 0).all()):
            raise InputError("pressure_kPa: give finite values >= 0")
        key = segment.key
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
        # Seen from outside, a chamber at angle theta runs along (cos, -sin) on (Z, Psi): y points against the hoop
        # direction on top. The chambers are fibres of angle -theta, whose tau is the opposite.
        _, stretch, tau = tube.solve(segment.angle, pressures)
        e, k = np.zeros((2, len(pressures), 3))
        e[:, 0], k[:, 0] = stretch, -tau * stretch
        return e, k

    return strains


def manipulator_strains(manipulator, pressure, model):
    """RodStrains (pieces, 3) of `Manipulator.pieces`: the model's for active ones, unstrained for passive ones."""
    by_segment = [model.strains(s, float(pressure)) for s in manipulator.segments]
    rest = RodStrains.unstrained()
    by_piece = [rest if i is None else by_segment[i] for i, _ in manipulator.pieces]
    return RodStrains([s.e for s in by_piece], [s.k for s in by_piece])


def predict(manipulator, pressure, model=None, spacing=1.0, base_pose=None):
    """The Centreline of a free manipulator at `pressure` (MPa) by a SegmentLaw, by default the AnalyticModel.

    spacing in mm; base_pose (4, 4) the base frame, default the identity.
    """
    lengths = [length for _, length in manipulator.pieces]
    return centreline(lengths, manipulator_strains(manipulator, pressure, model or AnalyticModel()), spacing, base_pose)
