"""The modulus, and if asked how thick the walls are, that a measurement speaks for."""

from dataclasses import dataclass

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.design.measured.prediction import Change, Predicted, align

#: between which factors on the modulus, and shares of the thinnest cavity or wall, are sought
FACTORS, SHARE = (0.2, 5.0), 0.4
#: relative, of the differences that slopes are found by
STEP = 1e-4
CONFIDENCE = 0.9
#: mm or degrees: what a body that cannot be is off by
FAR = 1e3


@dataclass(frozen=True)
class CastingFit:
    """change: the best one. half (p,): half of the 90 % intervals of log(modulus), wall in mm, from the
    scatter of whole pressure levels about the fit; half_of_law (p,): from the errors that the law admits.
    None where there are too few levels, or where the law admits none. rms: of the fit, mm or degrees."""

    change: Change
    half: np.ndarray | None
    half_of_law: np.ndarray | None
    rms: float

    @property
    def interval_of_measurement(self) -> tuple[float, float] | None:
        """90 %, of the factor on the modulus, as if the law were exact; None where it is not known."""
        return None if self.half is None else self._around(self.half[0])

    @property
    def interval(self) -> tuple[float, float] | None:
        """90 %, of the factor on the modulus, the law's own errors included; None where it is not known."""
        half = self._both(0)
        return None if half is None else self._around(half)

    def _around(self, half):
        return float(self.change.modulus / np.exp(half)), float(self.change.modulus * np.exp(half))

    @property
    def wall_interval(self) -> tuple[float, float] | None:
        """90 %, of the walls' offset, mm; None where it is not known or was not fitted."""
        half = self._both(1)
        return None if half is None else (self.change.wall - half, self.change.wall + half)

    def _both(self, i):
        if self.half is None or i >= len(self.half):
            return None
        law = 0.0 if self.half_of_law is None else self.half_of_law[i]
        return float(np.hypot(self.half[i], law))

    @property
    def at_the_edge(self) -> bool:
        """Whether the modulus is the last one that was tried: another body, or another unit, was measured."""
        low, high = FACTORS
        return not 1.01 * low < self.change.modulus < 0.99 * high

    def table(self) -> dict:
        """By file key."""
        out: dict = {"modulus_factor": self.change.modulus, "rms": self.rms}
        if self.interval and self.interval_of_measurement:
            out["modulus_factor_90_percent"] = list(self.interval)
            out["modulus_factor_90_percent_of_measurement"] = list(self.interval_of_measurement)
        if self.half is not None and len(self.half) > 1:
            out |= {
                "wall_offset_mm": self.change.wall,
                "wall_offset_90_percent_mm": list(self.wall_interval or ()),
            }
        return out


def fit_casting(predicted: Predicted, with_wall: bool = False, as_is: bool = False) -> CastingFit:
    """The CastingFit of a measurement: least squares over all levels above rest, each counting alike, the
    registration made anew for each trial. InputError where the measurement says nothing of the modulus."""
    from scipy.optimize import least_squares
    from scipy.stats import t

    first = 1 if predicted.measured.at_rest else 0
    x_of = (np.log(FACTORS[0]), np.log(FACTORS[1]))
    low, high = [x_of[0]], [x_of[1]]
    if with_wall:
        most = SHARE * _room(predicted)
        low, high = [*low, -most], [*high, most]

    def off(x):
        change = Change(float(np.exp(x[0])), float(x[1]) if with_wall else 0.0)
        try:
            shapes = predicted.observed(predicted.lines(change))
        except (InputError, ConvergenceError):
            return np.full(predicted.plain[first:].size, FAR)
        moved = align(predicted.measured, shapes, as_is).values
        return np.nan_to_num((shapes - moved)[first:]).ravel()

    start = np.zeros(len(low))
    found = least_squares(off, start, bounds=(low, high), diff_step=STEP, x_scale=[0.3, 0.2][: len(low)])
    J, r, levels = found.jac, found.fun, len(predicted.plain) - first
    change = Change(float(np.exp(found.x[0])), float(found.x[1]) if with_wall else 0.0)
    if not np.linalg.norm(J[:, 0]) > 0 or np.linalg.matrix_rank(J, tol=1e-6 * np.linalg.norm(J)) < len(low):
        raise InputError(
            f"{predicted.measured.path}: says nothing of the modulus"
            + (" and the walls apart: leave out --fit-wall" if with_wall else ": the body does not move")
        )
    A, freedom = np.linalg.inv(J.T @ J), levels - len(low)
    half = None
    if freedom > 0:  # levels, not their points, are independent
        scores = np.einsum("lmp,lm->lp", J.reshape(levels, -1, len(low)), r.reshape(levels, -1))
        variance = levels / freedom * A @ (scores.T @ scores) @ A
        half = t.ppf((1 + CONFIDENCE) / 2, freedom) * np.sqrt(np.diag(variance))
    of_law = None
    if len(predicted.moves):
        seen = np.isfinite(predicted.measured.values[first:])  # a marker that was not seen says nothing
        by = (predicted.moves[:, first:] * seen).reshape(len(predicted.moves), -1) @ J @ A
        of_law = np.sqrt(np.sum(by**2, axis=0))
    count = np.isfinite(predicted.measured.values[first:]).all(axis=2).sum()
    return CastingFit(change, half, of_law, float(np.sqrt(np.sum(r**2) / count)))


def _room(predicted):
    """mm: the thinnest of the walls and half cavities."""
    chambers = [s for s in predicted.design.manipulator.segments if s.chambers]
    if not chambers:
        raise InputError("--fit-wall: the body has no chambers")
    return min(min(s.cavity_thickness / 2, s.wall, s.top_wall, s.side_wall) for s in chambers)
