"""What a law says of segments, with derivatives by what a designer changes: an optimiser's one call."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import Segment
from pneunet.geometry.shape_numbers import PITCH_BY, SHAPE, by_dimensions
from pneunet.reduced.rod.clearance import closed_and_slopes, wall_stretch_and_slopes

#: by which derivatives are taken, in the order of their last axis: Segment's dimensions (degrees, mm), the
#: pressure and the initial shear modulus (MPa)
VARIABLES = (*SHAPE, "pressure", "mu")
#: values (n, p) or (n,), derivatives with one more axis
Slopes = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class StatesWithSlopes:
    """Of n segments; derivatives by VARIABLES, others held (also those that a campaign ties together).

    strains (n, 6): (e, k) of the free state, 1/mm for k. excess (n, r): how far each lies outside what the
    law knows, 0 inside, KindLaw.excess with zeros at the end of a kind that has fewer: its squares are
    smooth enough to be minimised. closed (n,): part of the gap that facing walls have closed, they touch from
    1 on; stretch (n,): the silicone's largest. strains_by (n, 6, 15), excess_by (n, r, 15), closed_by,
    stretch_by (n, 15).
    """

    strains: np.ndarray
    strains_by: np.ndarray
    excess: np.ndarray
    excess_by: np.ndarray
    closed: np.ndarray
    closed_by: np.ndarray
    stretch: np.ndarray
    stretch_by: np.ndarray

    @classmethod
    def of_strains(
        cls, strains: np.ndarray, strains_by: np.ndarray, segments: Sequence[Segment], pressures: np.ndarray
    ) -> "StatesWithSlopes":
        """Of a law that knows neither doubt nor walls: those are estimated as plates."""
        n, by = len(strains), strains_by.shape[2]
        closed, stretch = (
            _plates(e, segments, pressures) for e in (closed_and_slopes, wall_stretch_and_slopes)
        )
        return cls(strains, strains_by, np.zeros((n, 0)), np.zeros((n, 0, by)), *closed, *stretch)

    def with_plates(self, segments: Sequence[Segment], pressures: np.ndarray) -> "StatesWithSlopes":
        """With walls estimated as plates where the law does not know their stretch."""
        unknown = np.isnan(self.stretch)
        if not unknown.any():
            return self
        found = self.of_strains(self.strains, self.strains_by, segments, pressures)
        names, known = ("closed", "stretch", "closed_by", "stretch_by"), ~unknown
        for name in names:
            getattr(found, name)[known] = getattr(self, name)[known]
        return replace(self, **{name: getattr(found, name) for name in names})

    @property
    def rod_strains(self) -> RodStrains:
        return RodStrains.of_vector(self.strains)

    @classmethod
    def of(
        cls,
        found: Sequence[tuple[list[int], tuple[Slopes, Slopes, Slopes, Slopes]]],
        shape: np.ndarray,
        pitch: np.ndarray,
        pressure: np.ndarray,
        mu: np.ndarray,
    ) -> "StatesWithSlopes":
        """From [(places, KindLaw.with_slopes there)] of segments with shape numbers (n, 13), normal pitches
        (n,), pressures (n,) and moduli (n,)."""
        n, r = len(shape), max(excess.shape[1] for _, (_, (excess, _), *_) in found)
        values, slopes = np.zeros((n, 8 + r)), np.zeros((n, 8 + r, len(SHAPE) + 1))
        for rows, ((strains, strains_by), (excess, excess_by), *others) in found:
            end = 8 + excess.shape[1]
            more, more_by = (np.stack(both, axis=1) for both in zip(*others))
            values[rows, :end] = np.concatenate([strains, more, excess], axis=1)
            slopes[rows, :end] = np.concatenate([strains_by, more_by, excess_by], axis=1)
        by = np.empty((n, 8 + r, len(VARIABLES)))
        by[:, :, :-2] = by_dimensions(slopes[:, :, :-1], shape, pitch)
        by[:, :, -2] = slopes[:, :, -1] / mu[:, None]
        by[:, :, -1] = -by[:, :, -2] * (pressure / mu)[:, None]
        # curvatures are those times the normal pitch over the normal pitch
        values[:, 3:6] /= pitch[:, None]
        by[:, 3:6] /= pitch[:, None, None]
        by[:, 3:6, :-2] -= (values[:, 3:6] / pitch[:, None])[:, :, None] * PITCH_BY
        return cls(
            *(values[:, :6], by[:, :6]),
            *(values[:, 8:], by[:, 8:]),
            *(values[:, 6], by[:, 6]),
            *(values[:, 7], by[:, 7]),
        )


def _plates(estimate, segments, pressures):
    """(values (n,), derivatives (n, 15)) of one of reduced.rod.clearance's estimates."""
    found = [estimate(s, P) for s, P in zip(segments, pressures.tolist())]
    return (
        np.array([value for value, _ in found]),
        np.array([slopes for _, slopes in found]).reshape(len(found), len(VARIABLES)),
    )
