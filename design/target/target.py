"""`Target`: what the user wants. Points in space, and what the user says about them beyond that."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.errors import InputError
from pneunet.base.materials.laws import PAPER_TWISTING, Hyperelastic
from pneunet.geometry.designfile import FARTHEST

#: kinds of pieces beside TWISTING, which is straight and turns about itself; PASSIVE: straight, no twist wanted
BENDING, HELICAL, PASSIVE = "bending", "helical", "passive"
LENGTH_TOLERANCE = 0.02  # the pieces' lengths may miss the curve's by this fraction
PRESSURE_LIMIT = 0.060  # MPa; beyond it silicone pneu-nets leak (Jiang et al. 2021, Sec. IV D)


@dataclass(frozen=True)
class Piece:
    """A part of the target that one segment is to follow; lengths and rates per *deformed* length.

    length in mm; twist in rad/mm: the twist tau of a twisting piece, the torsion of a helical one; curvature
    in 1/mm (Frenet's). None = to be extracted from the points. roll in degrees: by how much the piece is
    turned about the axis against the section frame that runs through all pieces; 180 bends to the other side.
    """

    kind: str
    length: float
    twist: float | None = None
    curvature: float | None = None
    roll: float = 0.0


@dataclass(frozen=True, eq=False)
class Target:
    """points (n, 3) in mm from base to tip, and optionally

    frames (n, 3, 3): section frames at the points, columns t1 (along), t2 (width), t3 (height); pieces: the
    split; base_direction, base_width (3,): unit vectors that fix the base (width None = its roll stays free);
    pressure_range (low, high) in MPa, equal = fixed; material; start: {field of Segment: mm}; vary: {field of
    Segment: (low, high)} or None for the default choice; source: name of the file that it was read from.
    """

    points: np.ndarray
    name: str = "target"
    frames: np.ndarray | None = None
    pieces: tuple[Piece, ...] = ()
    base_direction: np.ndarray | None = None
    base_width: np.ndarray | None = None
    pressure_range: tuple[float, float] | None = None
    material: Hyperelastic = PAPER_TWISTING
    start: dict = field(default_factory=dict)
    vary: dict[str, tuple[float, float]] | None = None
    source: str = ""

    @classmethod
    def read(cls, path: str | Path) -> "Target":
        """The Target in a CSV of points or a TOML (docs/use-design.md), or a shipped one by its name:
        'octopus'. InputError that names key and fix otherwise."""
        from pneunet.design.target.file import read_target

        return read_target(path)

    def __post_init__(self) -> None:
        points = np.asarray(self.points, float)
        object.__setattr__(self, "points", points)
        check_points(points)
        if self.frames is not None:
            object.__setattr__(self, "frames", _checked_frames(np.asarray(self.frames, float), points))
        if self.pieces:
            object.__setattr__(self, "pieces", _fitted_to(self.pieces, self.length))

    def __repr__(self) -> str:
        told = f"{len(self.points)} points{' with frames' * (self.frames is not None)}, {self.length:.1f} mm"
        return f"<Target {self.name}: {told}{f', {len(self.pieces)} pieces' if self.pieces else ''}>"

    @property
    def length(self) -> float:
        """Arc length of the points' polyline, mm."""
        return self.curve.length

    @cached_property
    def curve(self) -> Curve:
        """The points' polyline."""
        return Curve(self.points)

    @property
    def base_rotation(self) -> np.ndarray | None:
        """Rotation (3, 3) of a base that is fixed altogether, else None."""
        along, across = self.base_direction, self.base_width
        if along is None or across is None:
            return None
        return np.column_stack([along, across, np.cross(along, across)])


def check_points(points: np.ndarray) -> None:
    """InputError unless points are (n >= 4, 3), finite, without repeats and of a length that can be built."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must be rows of x, y, z in mm, not an array of shape {points.shape}")
    if len(points) < 4:
        raise InputError(f"{len(points)} points: a target needs at least 4")
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
    if not 10 <= length <= 2000:
        raise InputError(
            f"the curve is {length:.4g} mm long, outside 10..2000 mm: are its coordinates in mm?"
        )


def _checked_frames(frames, points):
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
    if (
        np.sum(chords * (frames[:-1, :, 0] + frames[1:, :, 0]) / 2)
        < 0.5 * np.linalg.norm(chords, axis=1).sum()
    ):
        raise InputError("frames: t1 does not point along the curve, from base to tip")
    return frames


def _fitted_to(pieces, length):
    """The pieces with lengths scaled to add up to the curve's; more than a rounding apart is the user's
    mistake."""
    total = sum(p.length for p in pieces)
    if abs(total - length) > LENGTH_TOLERANCE * length:
        raise InputError(
            f"[[piece]] length_mm: the pieces add up to {total:.4g} mm but the curve is {length:.4g} mm long"
            " (lengths are deformed ones)"
        )
    return tuple(replace(p, length=p.length * length / total) for p in pieces)
