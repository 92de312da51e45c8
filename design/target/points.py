"""What points of a target must be: checks of points, frames and weights, whoever gives them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.quantities import shown
from pneunet.geometry.designfile import FARTHEST

#: more are not needed by any curve that a body can follow
MOST_POINTS = 200_000
#: mm of chord between the points that a fold and a closed curve are looked for by: about a body's width, so
#: that noise is none
STRIDE = 10.0
#: cosine of the turn from one such chord to the next that no body makes
FOLD = np.cos(np.radians(150.0))


def check_curve(curve: Any) -> None:
    """Put checked arrays in the place of a frozen instance's own points (n, 3) in mm, frames (n, 3, 3) and
    weights (n,); of the last two None stays. InputError as below."""
    points = checked_points(curve.points)
    checked = {"points": points}
    if curve.frames is not None:
        checked["frames"] = checked_frames(curve.frames, points)
    if curve.weights is not None:
        checked["weights"] = checked_weights(curve.weights, len(points))
    for name, values in checked.items():
        object.__setattr__(curve, name, values)


def checked_vector(vector: object, name: str) -> tuple[float, float, float]:
    """Three finite numbers; InputError by this name for anything else."""
    found = _floats(vector, f"{name} must be three numbers")
    if found.shape != (3,) or not np.isfinite(found).all():
        raise InputError(f"{name} must be three finite numbers, not {shown(vector)}")
    x, y, z = found.tolist()
    return x, y, z


def held_base(
    direction: object, width: object, names: Sequence[str] = ("base_direction", "base_width")
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Unit vectors (3,) along a base and across it, from vectors of any length; None stays. InputError, by
    these names, for vectors that are none or not perpendicular, and for the second one without the first."""
    along, across = (None if v is None else _unit(v, name) for v, name in zip((direction, width), names))
    if across is None:
        return along, None
    if along is None:
        raise InputError(f"'{names[1]}' needs '{names[0]}' too")
    if abs(along @ across) > 1e-3:
        raise InputError(f"'{names[1]}' must be perpendicular to '{names[0]}'")
    across = across - (across @ along) * along
    return along, across / np.linalg.norm(across)


def _unit(vector, name):
    wanted = f"'{name}' must be three numbers, not all 0"
    found = _floats(vector, wanted)
    if found.shape != (3,) or not 0 < np.linalg.norm(found) < np.inf:
        raise InputError(f"{wanted}, not {shown(vector)}")
    return found / np.linalg.norm(found)


def _floats(values: object, wanted: str) -> np.ndarray:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise InputError(f"{wanted}, not {shown(values)}") from None


def checked_points(points: object) -> np.ndarray:
    """Points as floats; InputError unless they are (n >= 4, 3), finite, without repeats, of a length that can
    be built, and neither closed nor folded back."""
    points = _floats(points, "points must be rows of x, y, z in mm")
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must be rows of x, y, z in mm, not an array of shape {points.shape}")
    if len(points) < 4:
        raise InputError(f"{len(points)} points: a target needs at least 4")
    if len(points) > MOST_POINTS:
        every = -(-len(points) // 10_000)
        raise InputError(
            f"{len(points)} points are over {MOST_POINTS}: keep every {every}th, which is enough for a curve"
        )
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(f"point {bad[0] + 1} is not finite: every coordinate must be a number")
    far = np.flatnonzero((abs(points) > FARTHEST).any(axis=1))
    if len(far):
        raise InputError(f"point {far[0] + 1} is over {FARTHEST:g} mm away: are its coordinates in mm?")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = steps.sum()
    repeated = np.flatnonzero(steps <= 1e-9 * length)
    if len(repeated):
        more = f", and {len(repeated) - 1} more such pairs" if len(repeated) > 1 else ""
        same = f"points {repeated[0] + 1} and {repeated[0] + 2} are the same{more}"
        raise InputError(f"{same}: remove one of each")
    if length < 10:
        raise InputError(f"the curve is {length:.4g} mm long, less than 10 mm: are its coordinates in mm?")
    _check_strides(points)
    return points


def _check_strides(points):
    """InputError for a curve that is too long, closed or folded: seen in chords, since noise lengthens a
    curve and turns its steps."""
    at = strides(points, STRIDE)
    chords = np.diff(points[at], axis=0)
    lengths = np.linalg.norm(chords, axis=1, keepdims=True)
    if lengths.sum() > 2000:
        told = f"the curve is {lengths.sum():.4g} mm long"
        raise InputError(f"{told}, outside 10..2000 mm: are its coordinates in mm?")
    chords /= lengths
    folds = np.flatnonzero(np.sum(chords[:-1] * chords[1:], axis=1) < FOLD)
    if len(folds):
        raise InputError(
            f"the curve folds back on itself at point {at[folds[0] + 1] + 1}: no body does; are its points in"
            " order from base to tip?"
        )
    gap = np.linalg.norm(points[-1] - points[0])
    if gap < STRIDE / 2 and len(at) > 3:
        raise InputError(
            f"the curve is closed: its last point lies {gap:.3g} mm from its first, and base and tip of a"
            f" body are at least {STRIDE / 2:g} mm apart: leave out its end"
        )


def strides(points: np.ndarray, stride: float) -> np.ndarray:
    """Indices (m,) of points (n, 3) that follow one another, each the first that is at least `stride` from
    the one before."""
    picked = [0]
    window = 64
    while True:
        start = picked[-1] + 1
        found = None
        while start < len(points) and found is None:
            away = np.linalg.norm(points[start : start + window] - points[picked[-1]], axis=1)
            beyond = np.flatnonzero(away >= stride)
            found = start + beyond[0] if len(beyond) else None
            start += window
            window = max(window, 2 * (start - picked[-1]) if found is None else 64)
        if found is None:
            return np.array(picked)
        picked.append(int(found))


def checked_weights(weights: object, count: int) -> np.ndarray:
    """Weights (count,) as floats; InputError unless they are finite and >= 0."""
    weights = _floats(weights, "weights must be numbers")
    if weights.shape != (count,):
        raise InputError(f"weights have shape {weights.shape}: {count} points need as many")
    bad = np.flatnonzero(~(np.isfinite(weights) & (weights >= 0)))
    if len(bad):
        raise InputError(f"weight {bad[0] + 1} = {weights[bad[0]]:g} must be a finite number >= 0")
    return weights


def checked_frames(frames: object, points: np.ndarray) -> np.ndarray:
    """Frames (n, 3, 3) as floats; InputError unless they are right-handed, orthonormal and t1 points
    along."""
    frames = _floats(frames, "frames must be three vectors of three numbers each")
    if frames.shape != (len(points), 3, 3):
        raise InputError(f"frames have shape {frames.shape}: {len(points)} points need ({len(points)}, 3, 3)")
    if not np.isfinite(frames).all():
        raise InputError("frames: every component must be a finite number")
    wrong = abs(np.swapaxes(frames, 1, 2) @ frames - np.eye(3)).max(axis=(1, 2)) > 1e-3
    wrong |= np.linalg.det(frames) < 0
    if wrong.any():
        raise InputError(
            f"frame {np.argmax(wrong) + 1} is not a right-handed set of orthogonal unit vectors t1, t2, t3"
        )
    chords = np.diff(points, axis=0)
    ahead = np.sum(chords * (frames[:-1, :, 0] + frames[1:, :, 0]) / 2)
    # of chords that are not lengthened by noise
    if ahead < 0.5 * np.linalg.norm(np.diff(points[strides(points, STRIDE / 4)], axis=0), axis=1).sum():
        raise InputError("frames: t1 does not point along the curve, from base to tip")
    return frames
