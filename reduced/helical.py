"""The one-sided (bending and helical) segment: minimum potential energy of one cell.

The paper's own model stood in its lost supplement; this one is ours, derived in docs/theory-reduced.md. With xi across
and eta along the chambers, z = 0 on the channel axis, and one chamber per pitch:
- the core is a stack of membranes stretched in plan by A(z) = M + z K, M and K symmetric, and under the cavity
  more than beside it: by the opening (alpha + beta z) xi and the sliding (gamma + delta z) eta, the mean staying A(z);
- the chamber is a box on the core: two long walls that bend as plates, clamped to the turning core and tied by a top
  wall and two side walls; all are stretched along eta with the core and by `height` along z;
- the gas fills what these walls enclose.
Rod strains of the channel axis: e = (M11, M12, 0), k = (-K12, K11, 0).
"""

import numpy as np

from base.errors import InputError
from geometry.parameters import ONE_SIDED
from reduced.equilibrium import follow
from reduced.laws import membrane, panel, product

#: Unknowns of the section and of the chamber; the latter vary along the chamber with `along_shapes`. All are of order
#: 1: K, beta and delta are multiplied by the core's height.
SECTION = ("M11", "M12", "M22", "K11", "K12", "K22", "gamma", "delta", "slide", "height")
CHAMBER = ("alpha", "beta", "top", "corner", "bulge")
UNKNOWNS = SECTION + tuple(f"{name}_{part}" for name in CHAMBER for part in ("end", "mid", "slope"))
INDEX = {name: i for i, name in enumerate(UNKNOWNS)}
SIZE = len(UNKNOWNS)
GAUSS_POINTS, ALONG_POINTS = 4, 5


def along_shapes(y):
    """Shapes of y = -1..1 along the chamber, with two derivatives: (derivative, shape, points).

    The value at the ends, the excess in the middle (1 - y^2)^2, and y^2 (1 - y^2), which has a slope at the ends.
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


def wall_shapes(x):
    """Long wall's profiles of x = 0..1 from foot to top, with two derivatives: (derivative, profile, points).

    Hermite cubics (displacement and slope at the foot, displacement and slope at the top) and the bulge 16 x^2 (1-x)^2.
    """
    polynomials = np.array([[1, 0, -3, 2, 0], [0, 1, -2, 1, 0], [0, 0, 3, -2, 0], [0, 0, -1, 1, 0], [0, 0, 16, -32, 16]])
    powers = np.arange(5)
    value = x[None] ** powers[:, None]
    first = powers[:, None] * x[None] ** np.maximum(powers - 1, 0)[:, None]
    second = (powers * (powers - 1))[:, None] * x[None] ** np.maximum(powers - 2, 0)[:, None]
    return np.stack([polynomials @ value, polynomials @ first, polynomials @ second])


def _gauss(low, high, n=GAUSS_POINTS):
    """Points and weights on low..high; weights vanish where the interval is empty."""
    points, weights = np.polynomial.legendre.leggauss(n)
    length = max(high - low, 0.0)
    return low + length * (1 + points) / 2, length * weights / 2


class HelicalCell:
    """Potential energy of one cell of a one-sided Segment; follow its minimum from P = 0 with `strains`.

    Every argument of a law (reduced/laws.py) is linear in the unknowns: `rows @ x`. Gradient and Hessian are exact.
    """

    name = "one-sided cell"

    def __init__(self, segment):
        if segment.kind != ONE_SIDED:
            raise InputError(f"kind = '{segment.kind}': the helical model is for 'one-sided' segments")
        if segment.cavity_top <= segment.core_top:
            raise InputError(
                f"chamber_height_mm = {segment.chamber_height:g}: the cavity's top must lie above the core (z = {segment.core_top:g} "
                "mm) for the analytic model"
            )
        s = self.segment = segment
        self.mu = s.material.mu
        self.core_height = s.core_top - s.core_bottom
        self.xi = s.sin * np.array([1.0, -s.cot])  # unit normal of the chambers in plan
        self.eta = s.sin * np.array([s.cot, 1.0])
        self.share = s.cavity_thickness / (s.chamber_thickness + s.gap)  # of the pitch, under the cavity
        self.foot = s.core_top
        self.wall_height = s.cavity_top + s.top_wall / 2 - self.foot
        self.length = s.width / s.sin  # of the chamber, along eta
        self.scale = self.mu * s.width * s.pitch * self.core_height
        self.start = np.zeros(SIZE)
        for name in ("M11", "M22", "height", "top_end"):
            self.start[INDEX[name]] = 1.0
        y, self.along_weights = _gauss(0.0, 1.0, ALONG_POINTS)  # half of the chamber; the other half is its image
        self.along = along_shapes(y)  # (derivative, shape, points)
        self.end = along_shapes(np.ones(1))
        self.membranes = (membrane, *self._core())
        self.panels = (panel, *self._walls())
        self.gas = (product, *self._gas())
        self.bending = self._plates()

    # Linear forms of the unknowns, as rows (..., SIZE). z in mm is an array (n,); shapes (3, m) are `along_shapes` at m
    # stations or their derivatives, and the result is (n, m, SIZE).

    def _section(self, name):
        row = np.zeros(SIZE)
        row[INDEX[name]] = 1.0
        return row

    def _chamber(self, name, shapes):
        rows = np.zeros((shapes.shape[1], SIZE))
        first = INDEX[name + "_end"]
        rows[:, first : first + 3] = shapes.T
        return rows

    def _gradient(self, z, shapes, part):
        """F in the axes (xi, eta): A(z) and `part` of the opening and sliding; rows (n, m, 4, SIZE) of F11, F21, F12, F22."""
        Z = np.asarray(z, float)[:, None] / self.core_height
        out = np.zeros(Z.shape[:1] + shapes.shape[1:] + (4, SIZE))
        for row, (a, b) in enumerate(((self.xi, self.xi), (self.eta, self.xi), (self.xi, self.eta), (self.eta, self.eta))):
            for i, j, ij in ((0, 0, "11"), (0, 1, "12"), (1, 1, "22")):
                both = a[i] * b[j] + (a[j] * b[i] if i != j else 0.0)
                out[..., row, INDEX["M" + ij]] = both * shapes[0]
                out[..., row, INDEX["K" + ij]] = both * Z * shapes[0]
        out[..., 0, :] += part * (self._chamber("alpha", shapes) + Z[..., None] * self._chamber("beta", shapes))
        out[..., 1, INDEX["gamma"]] += part * shapes[0]
        out[..., 1, INDEX["delta"]] += part * Z * shapes[0]
        return out

    def _along_eta(self, z):
        """Stretch of eta (n, SIZE), the same at every station and on both sides of a cavity's edge."""
        return self._gradient(z, self.end[0], 0.0)[:, 0, 3]

    def _shear(self, z):
        """eta's tilt towards xi (n, SIZE): A(z)'s own shear."""
        return self._gradient(z, self.end[0], 0.0)[:, 0, 2]

    def _plane_sliding(self, z):
        """Sliding of the cavity's far side along eta by the core under it (n, SIZE)."""
        return self._gradient(z, self.end[0], 1 - self.share)[:, 0, 1]

    def _sliding(self, z):
        """Sliding at heights z: above the foot linear up to the top wall's own, as the long walls shear in their planes."""
        x = ((z - self.foot) / self.wall_height)[:, None]
        free = (1 - x) * self._plane_sliding([self.foot]) + x * self._section("slide")
        return np.where(x > 0, free, self._plane_sliding(z))

    def _plane_opening(self, z, shapes):
        """Stretch of the cavity across itself by the core under it."""
        return self._gradient(z, shapes, 1 - self.share)[..., 0, :]

    def _wall_amplitudes(self, shapes):
        """Coefficients of `wall_shapes` in units of the cavity's stretch: (profile, m, SIZE)."""
        foot, above = self._plane_opening([self.foot, self.foot + self.wall_height], shapes)
        return np.stack([foot, above - foot] + [self._chamber(name, shapes) for name in ("top", "corner", "bulge")])

    def _opening(self, z, shapes):
        """Stretch of the cavity across itself at heights z."""
        x = (z - self.foot) / self.wall_height
        free = np.tensordot(wall_shapes(x)[0], self._wall_amplitudes(shapes), axes=(0, 0))
        return np.where((x > 0)[:, None, None], free, self._plane_opening(z, shapes))

    # terms of the energy: rows of arguments and weights (mm^3)

    def _core(self):
        s = self.segment
        half = s.channel_height / 2
        rows, weights = [], []
        for fraction, part, top in ((self.share, 1 - self.share, s.cavity_floor), (1 - self.share, -self.share, s.core_top)):
            channel_top = min(half, top)
            layers = ((s.core_bottom, -half, s.width), (-half, channel_top, s.width - s.channel_width), (channel_top, top, s.width))
            for low, high, breadth in layers:
                z, w = _gauss(low, high)
                rows.append(self._gradient(z, self.along[0], part).reshape(-1, 4, SIZE))
                weights.append(np.outer(w * fraction * s.pitch * breadth, self.along_weights).ravel())
        return np.concatenate(rows), np.concatenate(weights)

    def _walls(self):
        """Stretching of long walls (2), top wall and side walls (2)."""
        s, height = self.segment, self._section("height")
        rows, weights = [], []

        def add(first, second, other, weight):
            rows.append(np.stack(np.broadcast_arrays(first, second, other), axis=1))
            weights.append(weight)

        none = np.zeros(SIZE)
        z, w = _gauss(self.foot, s.chamber_top)
        add(self._along_eta(z), none, height, w * 2 * s.wall * self.length)
        top = self._chamber("top", self.along[0])
        volume = s.cavity_thickness * s.top_wall * self.length
        add(top, none, self._along_eta([s.cavity_top + s.top_wall / 2]), volume * self.along_weights)
        for low, high in ((s.cavity_floor, self.foot), (self.foot, s.cavity_top)):
            z, w = _gauss(low, high)
            # their edge along x = xi sin + eta cos spans the cavity
            sin, cos = self.xi[0], self.eta[0]
            across = sin * self._opening(z, self.end[0])[:, 0] + cos * self._shear(z)
            along = sin * self._sliding(z) + cos * self._along_eta(z)
            add(across, along, height, w * 2 * s.side_wall * s.cavity_thickness / s.sin)
        return np.concatenate(rows), np.concatenate(weights)

    def _gas(self):
        """The cavity's volume = sum of weights times (opening, stretch along, height) less (sliding, shear, height)."""
        s, rows, weights = self.segment, [], []
        for low, high in ((s.cavity_floor, self.foot), (self.foot, s.cavity_top)):
            z, w = _gauss(low, high)
            volume = w * s.cavity_thickness * s.cavity_width / s.sin
            opening = np.tensordot(self._opening(z, self.along[0]), self.along_weights, axes=(1, 0))
            for first, second, sign in ((opening, self._along_eta(z), 1), (self._sliding(z), self._shear(z), -1)):
                rows.append(np.stack(np.broadcast_arrays(first, second, self._section("height")), axis=1))
                weights.append(sign * volume)
        return np.concatenate(rows), np.concatenate(weights)

    def _plates(self):
        """Hessian (SIZE, SIZE), in units of mu/2, of what stays small: bending of the walls and shear."""
        s, H, t = self.segment, self.wall_height, self.segment.cavity_thickness
        half = s.cavity_width / s.sin / 2
        x, wx = _gauss(0.0, 1.0)
        profile, wy = wall_shapes(x), self.along_weights
        # a wall moves by half of the opening: t/2 times the stretch

        def field(dx, dy):
            amplitude = t / 2 * self._wall_amplitudes(self.along[dy]) / half**dy
            return np.tensordot(profile[dx] / H**dx, amplitude, axes=(0, 0))

        kx, ky, kxy = field(2, 0), field(0, 2), field(1, 1)
        weight = np.outer(wx * H, wy * 2 * half)

        def integral(a, b):
            return np.einsum("ij,ijs,ijt->st", weight, a, b)

        # two walls; plate energy/(mu/2) = wall^3/3 (kx^2 + ky^2 + kx ky + kxy^2): E = 3 mu, nu = 1/2
        wall = s.wall**3 / 3
        cross = integral(kx, ky)
        hessian = 2 * wall * (2 * integral(kx, kx) + 2 * integral(ky, ky) + cross + cross.T + 2 * integral(kxy, kxy))
        # top wall of span t + wall, bent by the rotation of its two corners
        span = t + s.wall
        turn = t / 2 / H * self._chamber("corner", self.along[0])
        hessian += 8 * s.top_wall**3 / 3 / span * 2 * half * np.einsum("i,is,it->st", self.along_weights, turn, turn)
        # side walls, bent by the rotation of the long walls' ends
        turn = t / 2 / half * np.tensordot(profile[0], self._wall_amplitudes(self.end[1]), axes=(0, 0))[:, 0]
        hessian += 8 * s.side_wall**3 / 3 / span * 2 * H * np.einsum("i,is,it->st", wx, turn, turn)
        # sliding shears the top wall, and the long walls where they do not follow the core
        tops = np.array([self.foot + H])
        shear = (self._section("slide") + self._shear(tops))[0]
        hessian += 2 * t * s.top_wall * self.length * np.outer(shear, shear)
        shear = t / 2 / H * (self._section("slide") - self._plane_sliding(tops)[0])
        hessian += 2 * 2 * s.wall * H * self.length * np.outer(shear, shear)
        # where the opening varies along the chamber the core is sheared: its displacement is a sawtooth across xi
        mean_square = (t * (1 - self.share)) ** 2 / 12
        z, w = _gauss(s.core_bottom, s.core_top)
        slope = self._chamber("alpha", self.along[1]) + z[:, None, None] / self.core_height * self._chamber("beta", self.along[1])
        slope /= self.length / 2
        weight = np.outer(w * s.width * s.pitch * mean_square, self.along_weights)
        return hessian + 2 * np.einsum("ij,ijs,ijt->st", weight, slope, slope)

    # potential

    def admissible(self, x):
        return (x[[INDEX["M11"], INDEX["M22"], INDEX["height"]]] > 0.2).all()

    def energy(self, x):
        """Elastic energy of one pitch in N mm, its gradient and Hessian in the unknowns."""
        value, gradient, hessian = 0.5 * x @ self.bending @ x, self.bending @ x, self.bending
        for term in (self.membranes, self.panels):
            v, g, h = _assemble(*term, x)
            value, gradient, hessian = value + v, gradient + g, hessian + h
        return self.mu / 2 * value, self.mu / 2 * gradient, self.mu / 2 * hessian

    def volume(self, x):
        """Cavity volume of one pitch in mm^3, its gradient and Hessian."""
        return _assemble(*self.gas, x)

    def strains(self, pressures):
        """e and k, each (n, 3), at increasing pressures (n,) in MPa; ConvergenceError at a limit load."""
        x = follow(self, pressures)
        e, k = np.zeros((2, len(pressures), 3))
        e[:, 0], e[:, 1] = x[:, INDEX["M11"]], x[:, INDEX["M12"]]
        k[:, 0], k[:, 1] = -x[:, INDEX["K12"]] / self.core_height, x[:, INDEX["K11"]] / self.core_height
        return e, k


def _assemble(law, rows, weights, x):
    value, gradient, hessian = law(rows @ x)
    flat = rows.reshape(-1, SIZE)
    weighted = (weights[:, None, None] * hessian) @ rows
    return weights @ value, (weights[:, None] * gradient).ravel() @ flat, flat.T @ weighted.reshape(-1, SIZE)
