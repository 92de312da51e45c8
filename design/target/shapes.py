"""What a target may ask for beside its own curve: further shapes at pressures of their own, and where the tip
is to be as the pressure rises."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.errors import InputError, located
from pneunet.base.quantities import shown
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.target.points import check_curve, checked_weights

PRESSURE_LIMIT = 0.060  # MPa; beyond it silicone pneu-nets leak (Jiang et al. 2021, Sec. IV D)


@dataclass(frozen=True, eq=False)
class TargetShape:
    """A curve that the same body is to follow at other pressures than the target's own.

    points (n, 3) in mm from base to tip, in the target's coordinates; pressures: MPa, one for all segments or
    one a group of segments; frames (n, 3, 3) and weights (n,) as a Target's.
    """

    points: np.ndarray
    pressures: tuple[float, ...]
    frames: np.ndarray | None = None
    weights: np.ndarray | None = None

    def __post_init__(self) -> None:
        check_curve(self)
        object.__setattr__(self, "pressures", checked_pressures(self.pressures))

    @cached_property
    def curve(self) -> Curve:
        """The points' polyline."""
        return Curve(self.points)


@dataclass(frozen=True, eq=False)
class TipPoints:
    """Points (m, 3) in mm that the tip is to pass at pressures (m,) in MPa; weights (m,), by default 1."""

    points: np.ndarray
    pressures: np.ndarray
    weights: np.ndarray | None = None

    def __post_init__(self) -> None:
        points = np.asarray(self.points, float)
        if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
            raise InputError("tip points must be rows of finite x, y, z in mm, at least one")
        pressures = np.asarray(checked_pressures(self.pressures))
        if pressures.shape != (len(points),):
            raise InputError(f"{len(points)} tip points need as many pressures, not {len(pressures)}")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "pressures", pressures)
        if self.weights is not None:
            object.__setattr__(self, "weights", checked_weights(self.weights, len(points)))


def checked_pressures(pressures: object) -> tuple[float, ...]:
    """Pressures in MPa; InputError unless each lies in 0..PRESSURE_LIMIT, and there is one."""
    try:
        values = tuple(float(p) for p in np.atleast_1d(np.asarray(pressures, float)))
    except (TypeError, ValueError):
        raise InputError(f"pressures must be numbers in MPa, not {shown(pressures)}") from None
    for value in values:
        if not 0 <= value <= PRESSURE_LIMIT * (1 + 1e-9):
            told = f"pressure_kPa = {KPA_PER_MPA * value:g}"
            raise InputError(f"{told} must lie in 0..{KPA_PER_MPA * PRESSURE_LIMIT:g} kPa")
    if not values:
        raise InputError("pressure_kPa: give at least one")
    return values


def guide_to(
    points: np.ndarray, base_point: np.ndarray, direction: np.ndarray, count: int = 101
) -> np.ndarray:
    """Points (count, 3) of the circle that leaves `base_point` along the unit vector `direction` and ends at
    the farthest of tip points (m, 3): where a target of tip points alone says nothing of the body between.

    InputError where that point is the base, or straight behind it.
    """
    chords = np.asarray(points, float) - base_point
    chord = chords[np.linalg.norm(chords, axis=1).argmax()]
    size = np.linalg.norm(chord)
    with located("tip_points"):
        if not size > 0:
            raise InputError("all of them are the base's point")
        across = chord - (chord @ direction) * direction
        half = np.arctan2(np.linalg.norm(across), chord @ direction)
        if half > 0.9 * np.pi:
            raise InputError(
                "the farthest lies behind the base: turn the base's direction to where the body goes"
            )
    side = across / np.linalg.norm(across) if half > 1e-9 else across
    angle = 2 * half * np.linspace(0, 1, count)
    # an arc of turn 2 half and chord `size` is size half / sin(half) long
    length = size * (half / np.sin(half) if half > 1e-9 else 1.0)
    along = np.sinc(angle / np.pi) * length * np.linspace(0, 1, count)
    aside = np.sinc(angle / 2 / np.pi) * np.sin(angle / 2) * length * np.linspace(0, 1, count)
    return base_point + along[:, None] * direction + aside[:, None] * side
