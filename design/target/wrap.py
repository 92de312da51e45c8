"""Curves around a body that is to be held: a path on its surface, a standoff outside of it along the normal.

The surface is one of revolution, r(z), or any that a ray from the z axis leaves once: triangles of an STL. On
the path z is linear in the angle about the axis."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.errors import InputError
from pneunet.base.quantities import Checked, quantity

#: of a wrap, as of the shipped targets
POINTS = 201
#: points of a path before it is sampled evenly; the chords of the shipped wraps then miss their arc length by
#: less than 1e-6 mm
DENSE = 20001
#: the same on triangles, where every point is a ray through all of them and facets are flat in any case
DENSE_ON_TRIANGLES = 1001


@dataclass(frozen=True)
class WrapPath(Checked):
    """The way around: from z_range[0] to z_range[1] in `turns` turns (negative: clockwise from above), from
    the angle `start` about z (degrees; 0 is the direction x), `standoff` mm outside the surface."""

    standoff: float = quantity("mm", note="half the body's width lies on the surface", low=-100, high=100)
    turns: float = quantity(None, low=-50, high=50)
    start: float = quantity("deg", 0.0, low=-1e4, high=1e4)
    z_range: tuple[float, float] = (0.0, 0.0)

    def along(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """(angles in rad, heights in mm) of `count` stations, evenly spaced in both."""
        t = np.linspace(0, 1, count)
        angle = np.radians(self.start) + 2 * np.pi * self.turns * t
        return angle, self.z_range[0] + (self.z_range[1] - self.z_range[0]) * t


class Surface(Protocol):
    """What a path is laid on."""

    @property
    def stations(self) -> int:
        """Of a path, before it is sampled evenly."""

    def offset(self, angle: np.ndarray, z: np.ndarray, standoff: float) -> np.ndarray:
        """(n, 3) points `standoff` mm outside of where the surface is at angles (n,) and heights (n,)."""


@dataclass(frozen=True)
class Revolution:
    """Surface of revolution about z: radius (mm) and its slope, functions of heights (n,) in low..high mm."""

    radius: Callable[[np.ndarray], np.ndarray]
    slope: Callable[[np.ndarray], np.ndarray]
    low: float = -np.inf
    high: float = np.inf
    stations: int = DENSE

    @classmethod
    def through(cls, z: np.ndarray, r: np.ndarray) -> "Revolution":
        """Through a profile (n >= 4,): z rising, in mm, r > 0, by a cubic spline. InputError for another."""
        from scipy.interpolate import CubicSpline

        z, r = np.asarray(z, float), np.asarray(r, float)
        if len(z) < 4:
            raise InputError(f"{len(z)} rows of r and z: a profile needs at least 4")
        if z[0] > z[-1]:
            z, r = z[::-1], r[::-1]
        wrong = np.flatnonzero(np.diff(z) <= 0)
        if len(wrong):
            raise InputError(f"z = {z[wrong[0]]:g} and {z[wrong[0] + 1]:g} mm: z must rise from row to row")
        if not (r > 0).all():
            raise InputError(f"r = {r.min():g} mm: radii must be larger than 0")
        spline = CubicSpline(z, r)
        return cls(spline, spline.derivative(), float(z[0]), float(z[-1]))

    def offset(self, angle: np.ndarray, z: np.ndarray, standoff: float) -> np.ndarray:
        if min(z[0], z[-1]) < self.low or max(z[0], z[-1]) > self.high:
            raise InputError(f"z_mm must lie within the profile's {self.low:g}..{self.high:g} mm")
        slope = self.slope(z)
        normal = np.hypot(1, slope)
        r = self.radius(z) + standoff / normal
        if not (r > 0).all():
            raise InputError(f"standoff_mm = {standoff:g} takes the curve through the axis")
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z - standoff * slope / normal])


@dataclass(frozen=True, eq=False)
class Triangulated:
    """Triangles (m, 3, 3) in mm around the z axis; between corners the normal is interpolated."""

    triangles: np.ndarray
    stations: int = DENSE_ON_TRIANGLES

    def offset(self, angle: np.ndarray, z: np.ndarray, standoff: float) -> np.ndarray:
        normals = _corner_normals(self.triangles)
        low, high = self.triangles[:, :, 2].min(axis=1), self.triangles[:, :, 2].max(axis=1)
        out = np.empty((len(z), 3))
        for i, (a, height) in enumerate(zip(angle, z)):
            direction = np.array([np.cos(a), np.sin(a), 0.0])
            near = np.flatnonzero((low <= height) & (height <= high))
            found = _outermost(self.triangles[near], np.array([0.0, 0.0, height]), direction)
            if found is None:
                told = f"angle {np.degrees(a):.4g} deg, z = {height:.4g} mm"
                raise InputError(
                    f"no surface at {told}: does the z axis run through the body, and is z_mm on it?"
                )
            face, weights = near[found[0]], found[1]
            normal = weights @ normals[face]
            normal /= np.linalg.norm(normal)
            outward = 1 if normal @ direction > 0 else -1  # whichever way the triangles are turned
            out[i] = weights @ self.triangles[face] + standoff * outward * normal
        return out


def wrap(surface: Surface, path: WrapPath, count: int = POINTS) -> np.ndarray:
    """Points (count, 3) in mm of a path around a surface, evenly spaced in arc length. InputError where it
    leaves the surface, or has no length."""
    angle, z = path.along(surface.stations)
    if path.turns == 0 and path.z_range[0] == path.z_range[1]:
        raise InputError("turns = 0 and z_mm of no height: the path has no length")
    return Curve(surface.offset(angle, z, path.standoff)).evenly(count)


def _corner_normals(triangles):
    """(m, 3, 3) normals at the corners: of the faces that meet there, by area."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.ptp(triangles.reshape(-1, 3), axis=0).max()
    # corners of neighbours are the same but for rounding
    keys = np.round(triangles.reshape(-1, 3) / (1e-6 * size)).astype(np.int64)
    _, which = np.unique(keys, axis=0, return_inverse=True)
    which = which.ravel()
    sums = np.zeros((which.max() + 1, 3))
    np.add.at(sums, which, np.repeat(across, 3, axis=0))
    return sums[which].reshape(-1, 3, 3)


def _outermost(triangles, origin, direction):
    """(face, barycentric weights (3,)) of the farthest triangle that a ray meets, None where it meets none
    (Moeller & Trumbore 1997)."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(direction, second)
    det = np.sum(first * across, axis=1)
    safe = np.where(abs(det) > 1e-12 * abs(det).max(initial=0), det, np.inf)
    from_corner = origin - triangles[:, 0]
    u = np.sum(from_corner * across, axis=1) / safe
    turned = np.cross(from_corner, first)
    v = turned @ direction / safe
    away = np.sum(turned * second, axis=1) / safe
    edge = 1e-9  # a ray through an edge meets one of its faces
    hit = (u >= -edge) & (v >= -edge) & (u + v <= 1 + edge) & (away > 0) & np.isfinite(safe)
    if not hit.any():
        return None
    face = np.flatnonzero(hit)[away[hit].argmax()]
    return face, np.array([1 - u[face] - v[face], u[face], v[face]])
