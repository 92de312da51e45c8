"""A curve in space: points joined by straight lines, measured by arc length."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

#: points that curvature and torsion are found on
FINE = 401


@dataclass(frozen=True, eq=False)
class Curve:
    """The polyline of points (n, 3), mm; arc lengths are counted from its first point."""

    points: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", np.asarray(self.points, float))

    @classmethod
    def of(cls, points: "Curve | np.ndarray") -> "Curve":
        """The Curve through points (n, 3) in mm; a Curve is one already."""
        return points if isinstance(points, Curve) else cls(points)

    def __repr__(self) -> str:
        return f"Curve({len(self.points)} points, {self.length:.2f} mm)"

    @cached_property
    def arc_lengths(self) -> np.ndarray:
        """(n,) of the points, mm."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length(self) -> float:
        """mm"""
        return float(self.arc_lengths[-1])

    def at(self, s: np.ndarray) -> np.ndarray:
        """Points (m, 3) at arc lengths s (m,) in mm; beyond an end lies the end."""
        s = np.asarray(s, float)
        return np.column_stack([np.interp(s, self.arc_lengths, column) for column in self.points.T])

    def evenly(self, count: int) -> np.ndarray:
        """`count` points (count, 3) evenly spaced in arc length, both ends among them."""
        return self.at(np.linspace(0, self.length, count))

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """For every one of points (n, 3) the nearest point (n, 3) of the curve, vertices or between them."""
        edge, share = nearest_on(self.points, points)
        return self.points[edge] + share[:, None] * np.diff(self.points, axis=0)[edge]

    def frenet(self, window: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(arc lengths (m,) in mm, curvature (m,) in 1/mm, torsion (m,) in rad/mm).

        A quartic is fitted to every `window` mm of evenly spaced points (Savitzky & Golay 1964), which
        smooths noise and blurs jumps over the same length. Torsion is 0 where the curve is too straight to
        have one.
        """
        from scipy.signal import savgol_filter  # takes longer to load than everything else here

        step = self.length / (FINE - 1)
        width = min(FINE - 2, max(7, 2 * round(window / step / 2) + 1))
        even = self.evenly(FINE)
        first, second, third = (savgol_filter(even, width, 4, deriv=d, delta=step, axis=0) for d in (1, 2, 3))
        cross = np.cross(first, second)
        size = np.linalg.norm(cross, axis=1)
        curvature = size / np.linalg.norm(first, axis=1) ** 3
        bent = curvature * self.length > 0.1
        torsion = np.divide(np.sum(cross * third, axis=1), size**2, out=np.zeros(FINE), where=bent)
        return np.linspace(0, self.length, FINE), curvature, torsion


def nearest_on(vertices: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For every one of points (n, 3), where the nearest point of a polyline (m, 3) lies: its edge's number
    (n,) from 0, and the share (n,) of the edge before it."""
    start, step = vertices[:-1], np.diff(vertices, axis=0)
    squared = np.maximum(np.sum(step**2, axis=1), np.finfo(float).tiny)
    along = np.clip(np.einsum("nmk,mk->nm", points[:, None] - start, step) / squared, 0, 1)
    apart = np.sum((points[:, None] - start - along[..., None] * step) ** 2, axis=2)
    edge = np.argmin(apart, axis=1)
    return edge, along[np.arange(len(points)), edge]
