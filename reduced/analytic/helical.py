"""The one-sided (bending and helical) segment: minimum potential energy of one cell.

The paper's own model stood in its lost supplement; this one is ours, derived in docs/theory-reduced.md:
  Pi = U_core + U_walls - P V  per pitch, in the unknowns of reduced/analytic/kinematics.py.
- The core is a stack of finite-strain membranes, stretched more under the cavity than beside it.
- The chamber is a box on it: two long walls that bend and bulge, tied by a top wall and two side walls.
- The gas fills what these walls enclose.
Rod strains of the channel axis: e = (M11, M12, 0), k = (-K12, K11, 0).
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import ONE_SIDED, Segment
from pneunet.reduced.analytic.energies import Derivatives, bulged_wall, membrane, panel, product
from pneunet.reduced.analytic.equilibrium import follow
from pneunet.reduced.analytic.kinematics import INDEX, SIZE, CellKinematics, along_shapes, wall_shapes

GAUSS_POINTS, ALONG_POINTS = 4, 5
#: (energy density, rows of its arguments by the unknowns, weights in mm^3)
Term = tuple[Callable[[np.ndarray], Derivatives], np.ndarray, np.ndarray]


_rule = lru_cache(np.polynomial.legendre.leggauss)


def _gauss(low, high, n=GAUSS_POINTS):
    """Points and weights on low..high; weights vanish where the interval is empty."""
    points, weights = _rule(n)
    length = max(high - low, 0.0)
    return low + length * (1 + points) / 2, length * weights / 2


class HelicalCell:
    """Potential energy of one cell of a one-sided Segment; `strains` follows its minimum from P = 0.

    Every argument of a density (reduced/analytic/energies.py) is linear in the unknowns, `rows @ x`: gradient
    and Hessian are exact.
    """

    name = "one-sided cell"

    def __init__(self, segment: Segment) -> None:
        if segment.kind != ONE_SIDED:
            raise InputError(f"kind = '{segment.kind}': the helical model is for 'one-sided' segments")
        if segment.cavity_top <= segment.core_top:
            raise InputError(
                f"chamber_height_mm = {segment.chamber_height:g}: the cavity's top must lie above the core "
                f"(z = {segment.core_top:g} mm) for the analytic model"
            )
        s = self.segment = segment
        self.cell = CellKinematics(s)
        self.start = self.cell.start()
        self.mu = s.material.mu
        self.length = s.width / s.sin  # of the chamber, along eta
        self.scale = self.mu * s.width * s.pitch * self.cell.core_height
        # half of the chamber; the other half is its image
        y, self.along_weights = _gauss(0.0, 1.0, ALONG_POINTS)
        self.along = along_shapes(y)  # (derivative, shape, points)
        self.walls: list[Term] = [(membrane, *self._core()), (panel, *self._walls())]
        self.walls.append((bulged_wall, *self._long_walls()))
        self.gas: Term = (product, *self._gas())
        self.small = self._small_strains()

    # terms of the energy: rows of arguments and weights (mm^3)

    def _core(self):
        s, share = self.segment, self.cell.share
        half = s.channel_height / 2
        rows, weights = [], []
        for fraction, part, top in ((share, 1 - share, s.cavity_floor), (1 - share, -share, s.core_top)):
            mu = s.layer_material.mu if s.layer_material else None
            layers = [
                *([(s.core_bottom, s.layer_top, s.width * mu / self.mu)] if mu else []),
                (s.layer_top, -half, s.width),
                (-half, min(half, top), s.width - s.channel_width),
                (half, top, s.width),
            ]
            z, w = np.concatenate(
                [np.multiply([[1.0], [b]], _gauss(low, high)) for low, high, b in layers], axis=1
            )
            rows.append(self.cell.gradient(z, self.along[0], part).reshape(-1, 4, SIZE))
            weights.append(np.outer(w * fraction * s.pitch, self.along_weights).ravel())
        return np.concatenate(rows), np.concatenate(weights)

    def _walls(self):
        """Stretching of the top wall, of the long walls above its middle, and of the side walls (2)."""
        s, height = self.segment, self.cell.section("height")
        rows, weights = [], []

        def add(first, second, other, weight):
            rows.append(np.stack(np.broadcast_arrays(first, second, other), axis=1))
            weights.append(weight)

        none = np.zeros(SIZE)
        z, w = _gauss(self.cell.foot + self.cell.wall_height, s.chamber_top)
        add(self.cell.along_eta(z), none, height, w * 2 * s.wall * self.length)
        top = self.cell.chamber("top", self.along[0])
        volume = s.cavity_thickness * s.top_wall * self.length
        add(top, none, self.cell.along_eta([s.cavity_top + s.top_wall / 2]), volume * self.along_weights)
        for low, high in ((s.cavity_floor, self.cell.foot), (self.cell.foot, s.cavity_top)):
            z, w = _gauss(low, high)
            # their edge along x = xi sin + eta cos spans the cavity
            sin, cos = self.cell.xi[0], self.cell.eta[0]
            across = sin * self.cell.opening(z, self.cell.end[0])[:, 0] + cos * self.cell.shear(z)
            along = sin * self.cell.sliding(z) + cos * self.cell.along_eta(z)
            add(across, along, height, w * 2 * s.side_wall * s.cavity_thickness / s.sin)
        return np.concatenate(rows), np.concatenate(weights)

    def _long_walls(self):
        """Stretching of the two long walls, bulging included: (stretch along, height, slope along, slope
        upwards)."""
        s, H = self.segment, self.cell.wall_height
        x, wx = _gauss(0.0, 1.0)
        shape, slope, _ = wall_shapes(x)
        z = self.cell.foot + H * x
        half = self.length / 2
        ends, slopes = (s.cavity_thickness / 2 * self.cell.wall_amplitudes(self.along[d]) for d in (0, 1))
        slope_up = np.tensordot(slope / H, ends, axes=(0, 0))
        slope_along = np.tensordot(shape / half, slopes, axes=(0, 0))
        arguments = np.broadcast_arrays(
            self.cell.along_eta(z)[:, None], self.cell.section("height"), slope_along, slope_up
        )
        weights = np.outer(wx * H * 2 * s.wall * self.length, self.along_weights)
        return np.stack(arguments, axis=2).reshape(-1, 4, SIZE), weights.ravel()

    def _gas(self):
        """The cavity's volume = sum of weights times (opening, stretch along, height) less (sliding, shear,
        height)."""
        s, rows, weights = self.segment, [], []
        for low, high in ((s.cavity_floor, self.cell.foot), (self.cell.foot, s.cavity_top)):
            z, w = _gauss(low, high)
            volume = w * s.cavity_thickness * s.cavity_width / s.sin
            opening = np.tensordot(self.cell.opening(z, self.along[0]), self.along_weights, axes=(1, 0))
            for first, second, sign in (
                (opening, self.cell.along_eta(z), 1),
                (self.cell.sliding(z), self.cell.shear(z), -1),
            ):
                rows.append(np.stack(np.broadcast_arrays(first, second, self.cell.section("height")), axis=1))
                weights.append(sign * volume)
        return np.concatenate(rows), np.concatenate(weights)

    def _small_strains(self):
        """Hessian (SIZE, SIZE), in units of mu/2, of what stays small: bending of the walls and shear."""
        s, H, t = self.segment, self.cell.wall_height, self.segment.cavity_thickness
        half = s.cavity_width / s.sin / 2
        x, wx = _gauss(0.0, 1.0)
        profile, wy = wall_shapes(x), self.along_weights
        # a wall moves by half of the opening: t/2 times the stretch

        def field(dx, dy):
            amplitude = t / 2 * self.cell.wall_amplitudes(self.along[dy]) / half**dy
            return np.tensordot(profile[dx] / H**dx, amplitude, axes=(0, 0))

        kx, ky, kxy = field(2, 0), field(0, 2), field(1, 1)
        weight = np.outer(wx * H, wy * 2 * half)

        def integral(a, b):
            return np.einsum("ij,ijs,ijt->st", weight, a, b)

        # two walls; plate energy/(mu/2) = wall^3/3 (kx^2 + ky^2 + kx ky + kxy^2): E = 3 mu, nu = 1/2
        wall = s.wall**3 / 3
        cross = integral(kx, ky)
        own = integral(kx, kx) + integral(ky, ky) + integral(kxy, kxy)
        hessian = 2 * wall * (2 * own + cross + cross.T)
        # top wall of span t + wall, bent by the rotation of its two corners
        span = t + s.wall
        turn = t / 2 / H * self.cell.chamber("corner", self.along[0])
        hessian += 8 * s.top_wall**3 / 3 / span * 2 * half * (turn.T * self.along_weights) @ turn
        # side walls, bent by the rotation of the long walls' ends
        ends = t / 2 / half * self.cell.wall_amplitudes(self.cell.end[1])
        turn = np.tensordot(profile[0], ends, axes=(0, 0))[:, 0]
        hessian += 8 * s.side_wall**3 / 3 / span * 2 * H * (turn.T * wx) @ turn
        # sliding shears the top wall, and the long walls where they do not follow the core
        tops = np.array([self.cell.foot + H])
        shear = (self.cell.section("slide") + self.cell.shear(tops))[0]
        hessian += 2 * t * s.top_wall * self.length * np.outer(shear, shear)
        shear = t / 2 / H * (self.cell.section("slide") - self.cell.plane_sliding(tops)[0])
        hessian += 2 * 2 * s.wall * H * self.length * np.outer(shear, shear)
        # where the opening varies along the chamber the core is sheared: its displacement is a sawtooth
        # across xi
        mean_square = (t * (1 - self.cell.share)) ** 2 / 12
        z, w = _gauss(s.core_bottom, s.core_top)
        slope = self.cell.chamber("alpha", self.along[1]) + z[
            :, None, None
        ] / self.cell.core_height * self.cell.chamber("beta", self.along[1])
        slope /= self.length / 2
        weight = np.outer(w * s.width * s.pitch * mean_square, self.along_weights)
        return hessian + 2 * np.einsum("ij,ijs,ijt->st", weight, slope, slope)

    # potential

    def admissible(self, x: np.ndarray) -> bool:
        """Whether nothing is squeezed to a fifth."""
        return bool((x[[INDEX["M11"], INDEX["M22"], INDEX["height"]]] > 0.2).all())

    def energy(self, x: np.ndarray) -> Derivatives:
        """Elastic energy of one pitch in N mm, its gradient and Hessian in the unknowns."""
        value, gradient, hessian = 0.5 * x @ self.small @ x, self.small @ x, self.small
        for term in self.walls:
            v, g, h = _assemble(term, x)
            value, gradient, hessian = value + v, gradient + g, hessian + h
        return self.mu / 2 * value, self.mu / 2 * gradient, self.mu / 2 * hessian

    def volume(self, x: np.ndarray) -> Derivatives:
        """Cavity volume of one pitch in mm^3, its gradient and Hessian."""
        return _assemble(self.gas, x)

    def strains(self, pressures: ArrayLike) -> RodStrains:
        """RodStrains (n, 3) at increasing pressures (n,) in MPa; ConvergenceError at a limit load."""
        return self.rod_strains(follow(self, pressures))

    def rod_strains(self, x: np.ndarray) -> RodStrains:
        """RodStrains (n, 3) of unknowns (n, SIZE)."""
        q = np.zeros((len(x), 6))
        q[:, [0, 1]] = x[:, [INDEX["M11"], INDEX["M12"]]]
        q[:, [3, 4]] = x[:, [INDEX["K12"], INDEX["K11"]]] / self.cell.core_height * [-1, 1]
        return RodStrains.of_vector(q)


def _assemble(term: Term, x: np.ndarray) -> Derivatives:
    density, rows, weights = term
    value, gradient, hessian = density(rows @ x)
    flat = rows.reshape(-1, SIZE)
    weighted = (weights[:, None, None] * hessian) @ rows
    return weights @ value, (weights[:, None] * gradient).ravel() @ flat, flat.T @ weighted.reshape(-1, SIZE)
