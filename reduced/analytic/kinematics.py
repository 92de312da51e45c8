"""Kinematics of the one-sided cell: its unknowns, and the stretches and openings that are linear in them.

xi across and eta along the chambers, in plan; z = 0 on the channel axis. The core is stretched in plan by
A(z) = M + z K, and under the cavity by the opening (alpha + beta z) xi and the sliding (gamma + delta z) eta
more than beside it, the mean over the pitch staying A(z). The long walls are clamped to the turning core at
their feet and held by the top wall. See docs/theory-reduced.md.
"""

import numpy as np
from numpy.typing import ArrayLike

from pneunet.geometry.parameters import Segment

#: Unknowns of the section and of the chamber; the latter vary along the chamber with `along_shapes`. All are
#: of order 1: K, beta and delta are multiplied by the core's height.
SECTION = ("M11", "M12", "M22", "K11", "K12", "K22", "gamma", "delta", "slide", "height")
CHAMBER = ("alpha", "beta", "top", "corner", "bulge")
UNKNOWNS = SECTION + tuple(f"{name}_{part}" for name in CHAMBER for part in ("end", "mid", "slope"))
INDEX = {name: i for i, name in enumerate(UNKNOWNS)}
SIZE = len(UNKNOWNS)


def along_shapes(y: np.ndarray) -> np.ndarray:
    """Shapes of y = -1..1 along the chamber, with two derivatives: (derivative, shape, points).

    The value at the ends, the excess in the middle (1 - y^2)^2, and y^2 (1 - y^2), which has a slope at the
    ends.
    """
    zero = np.zeros_like(y)
    y2 = y * y
    return np.array(
        [
            [zero + 1, (1 - y2) ** 2, y2 * (1 - y2)],
            [zero, -4 * y * (1 - y2), 2 * y - 4 * y * y2],
            [zero, 12 * y2 - 4, 2 - 12 * y2],
        ]
    )


def wall_shapes(x: np.ndarray) -> np.ndarray:
    """Long wall's profiles of x = 0..1 from foot to top, with two derivatives: (derivative, profile, points).

    Hermite cubics (displacement and slope at the foot, displacement and slope at the top) and the bulge 16
    x^2 (1-x)^2.
    """
    polynomials = np.array(
        [[1, 0, -3, 2, 0], [0, 1, -2, 1, 0], [0, 0, 3, -2, 0], [0, 0, -1, 1, 0], [0, 0, 16, -32, 16]]
    )
    powers = np.arange(5)
    value = x[None] ** powers[:, None]
    first = powers[:, None] * x[None] ** np.maximum(powers - 1, 0)[:, None]
    second = (powers * (powers - 1))[:, None] * x[None] ** np.maximum(powers - 2, 0)[:, None]
    return np.stack([polynomials @ value, polynomials @ first, polynomials @ second])


class CellKinematics:
    """Linear forms of the unknowns, as rows (..., SIZE), for a one-sided Segment.

    z in mm is an array (n,); shapes (3, m) are `along_shapes` at m stations of the chamber or their
    derivatives, and rows depend on (n, m). "Opening" and "sliding" are per cavity thickness: 1 and 0 at rest.
    """

    def __init__(self, segment: Segment) -> None:
        s = self.segment = segment
        self.core_height = s.core_top - s.core_bottom
        self.xi = s.sin * np.array([1.0, -s.cot])
        self.eta = s.sin * np.array([s.cot, 1.0])
        axes = ((self.xi, self.xi), (self.eta, self.xi), (self.xi, self.eta), (self.eta, self.eta))
        # (A11, A12, A22) to the components a.A.b in the axes (xi, eta)
        self.plan = np.array([[a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]] for a, b in axes])
        self.share = s.cavity_thickness / (s.chamber_thickness + s.gap)  # of the pitch, under the cavity
        self.foot = s.core_top
        self.wall_height = s.cavity_top + s.top_wall / 2 - self.foot  # free height, to the top wall's middle
        self.end = along_shapes(np.ones(1))

    def start(self) -> np.ndarray:
        """The unknowns at rest (SIZE,)."""
        x = np.zeros(SIZE)
        for name in ("M11", "M22", "height", "top_end"):
            x[INDEX[name]] = 1.0
        return x

    def section(self, name: str) -> np.ndarray:
        """The unknown itself (SIZE,)."""
        row = np.zeros(SIZE)
        row[INDEX[name]] = 1.0
        return row

    def chamber(self, name: str, shapes: np.ndarray) -> np.ndarray:
        """A chamber's unknown at the stations (m, SIZE)."""
        rows = np.zeros((shapes.shape[1], SIZE))
        first = INDEX[name + "_end"]
        rows[:, first : first + 3] = shapes.T
        return rows

    def gradient(self, z: ArrayLike, shapes: np.ndarray, part: float) -> np.ndarray:
        """F = A(z) + `part` of opening and sliding, in axes (xi, eta): rows (n, m, 4, SIZE) of F11, F21, F12,
        F22."""
        Z = np.asarray(z, float)[:, None] / self.core_height
        out = np.zeros(Z.shape[:1] + shapes.shape[1:] + (4, SIZE))
        out[..., INDEX["M11"] : INDEX["M22"] + 1] = shapes[0][:, None, None] * self.plan
        out[..., INDEX["K11"] : INDEX["K22"] + 1] = (Z * shapes[0])[..., None, None] * self.plan
        out[..., 0, :] += part * (self.chamber("alpha", shapes) + Z[..., None] * self.chamber("beta", shapes))
        out[..., 1, INDEX["gamma"]] += part * shapes[0]
        out[..., 1, INDEX["delta"]] += part * Z * shapes[0]
        return out

    def along_eta(self, z: ArrayLike) -> np.ndarray:
        """Stretch of eta (n, SIZE), the same at every station and on both sides of a cavity's edge."""
        return self.gradient(z, self.end[0], 0.0)[:, 0, 3]

    def shear(self, z: ArrayLike) -> np.ndarray:
        """eta's tilt towards xi (n, SIZE): A(z)'s own shear."""
        return self.gradient(z, self.end[0], 0.0)[:, 0, 2]

    def plane_sliding(self, z: ArrayLike) -> np.ndarray:
        """Sliding of the cavity's far side along eta by the core under it (n, SIZE)."""
        return self.gradient(z, self.end[0], 1 - self.share)[:, 0, 1]

    def sliding(self, z: np.ndarray) -> np.ndarray:
        """Sliding at heights z: above the foot linear up to the top wall's, as the long walls shear in their
        planes."""
        x = ((z - self.foot) / self.wall_height)[:, None]
        free = (1 - x) * self.plane_sliding([self.foot]) + x * self.section("slide")
        return np.where(x > 0, free, self.plane_sliding(z))

    def plane_opening(self, z: ArrayLike, shapes: np.ndarray) -> np.ndarray:
        """Stretch of the cavity across itself by the core under it."""
        return self.gradient(z, shapes, 1 - self.share)[..., 0, :]

    def wall_amplitudes(self, shapes: np.ndarray) -> np.ndarray:
        """Coefficients of `wall_shapes` in units of the cavity's stretch: (profile, m, SIZE)."""
        foot, above = self.plane_opening([self.foot, self.foot + self.wall_height], shapes)
        return np.stack(
            [foot, above - foot] + [self.chamber(name, shapes) for name in ("top", "corner", "bulge")]
        )

    def opening(self, z: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        """Stretch of the cavity across itself at heights z."""
        x = (z - self.foot) / self.wall_height
        free = np.tensordot(wall_shapes(x)[0], self.wall_amplitudes(shapes), axes=(0, 0))
        return np.where((x > 0)[:, None, None], free, self.plane_opening(z, shapes))
