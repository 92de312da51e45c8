"""Polylines: arc length, sampling at fractions of it, nearest points, curvature and torsion of sampled
curves."""

import numpy as np
from scipy.signal import savgol_filter


def arc_lengths(points):
    """Arc length (n,) in mm from the first point to every point of a polyline (n, 3)."""
    steps = np.linalg.norm(np.diff(np.asarray(points, float), axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def sample(points, s):
    """Points (m, 3) of a polyline (n, 3) at arc lengths s (m,) in mm; those beyond an end are the end."""
    points, s = np.asarray(points, float), np.asarray(s, float)
    own = arc_lengths(points)
    return np.column_stack([np.interp(s, own, column) for column in points.T])


def evenly(points, count):
    """`count` points (count, 3) evenly spaced in arc length."""
    return sample(points, np.linspace(0, arc_lengths(points)[-1], count))


def nearest_points(points, polyline):
    """For every point (n, 3) the nearest point (n, 3) on the segments (not only the vertices) of a polyline
    (m, 3)."""
    points, polyline = np.asarray(points, float), np.asarray(polyline, float)
    start, step = polyline[:-1], np.diff(polyline, axis=0)
    squared = np.maximum(np.sum(step**2, axis=1), np.finfo(float).tiny)
    along = np.clip(np.einsum("nmk,mk->nm", points[:, None] - start, step) / squared, 0, 1)
    feet = start + along[..., None] * step
    best = np.argmin(np.sum((points[:, None] - feet) ** 2, axis=2), axis=1)
    return feet[np.arange(len(points)), best]


def frenet(points, window):
    """Curvature (m,) in 1/mm and torsion (m,) in rad/mm of a polyline, with the arc lengths (m,) where they
    hold.

    A quartic is fitted to every `window` mm of the evenly sampled curve (Savitzky & Golay 1964), which
    smooths noise and blurs jumps over the same length. Torsion is 0 where the curve is too straight to have
    one.
    """
    length = arc_lengths(points)[-1]
    count = 401
    step = length / (count - 1)
    width = min(count - 2, max(7, 2 * round(window / step / 2) + 1))
    even = evenly(points, count)
    first, second, third = (savgol_filter(even, width, 4, deriv=d, delta=step, axis=0) for d in (1, 2, 3))
    cross = np.cross(first, second)
    size = np.linalg.norm(cross, axis=1)
    curvature = size / np.linalg.norm(first, axis=1) ** 3
    bent = curvature * length > 0.1
    torsion = np.divide(np.sum(cross * third, axis=1), size**2, out=np.zeros(count), where=bent)
    return np.linspace(0, length, count), curvature, torsion
