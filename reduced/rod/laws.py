"""Elastic laws of a rod's sections: the interface, the quadratic law about free states, and that of bare
core.

A law is an enthalpy psi (N: energy per undeformed length, the gas's work included) of the section frame's
strains q = (e1, e2, e3, k1, k2, k3), 1/mm for k, at a pressure P in MPa. Its minimiser is the free state, its
gradient is (force, moment) in the section frame.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains


class RodLaw(Protocol):
    """What a rod asks of a section; q (..., 6), P a number or (...,)."""

    def free_strains(self, P):
        """(..., 6) minimiser of psi."""

    def psi(self, q, P):
        """(...,) enthalpy per undeformed length, N."""

    def force(self, q, P):
        """(..., 6) gradient of psi: force (N) and moment (N mm) in the section frame."""

    def stiffness(self, q, P):
        """(..., 6, 6) Hessian of psi, N, N mm and N mm2; symmetric."""


@dataclass(frozen=True, eq=False)
class QuadraticLaw:
    """psi = (q - q0)^T K (q - q0)/2 with q0 and K linear in the pressure between given states.

    pressures (n,) in MPa, increasing; strains (n, 6); stiffnesses (n, 6, 6), symmetric and positive definite.
    One state serves at any pressure, several within their range. A tangent at the free state: good for small
    departures from it.
    """

    pressures: np.ndarray
    strains: np.ndarray
    stiffnesses: np.ndarray

    def __post_init__(self):
        p, q, K = (np.asarray(a, float) for a in (self.pressures, self.strains, self.stiffnesses))
        n = p.size
        if p.ndim != 1 or not n or not (np.diff(p) > 0).all() or q.shape != (n, 6) or K.shape != (n, 6, 6):
            raise InputError(
                "pressures, strains, stiffnesses: give n increasing pressures, strains (n, 6) and stiffnesses"
                " (n, 6, 6)"
            )
        if (
            not (np.isfinite(q).all() and np.isfinite(K).all())
            or abs(K - np.swapaxes(K, 1, 2)).max() > 1e-6 * abs(K).max()
        ):
            raise InputError("stiffnesses: must be finite and symmetric")
        if np.linalg.eigvalsh(K).min() <= 0:
            raise InputError(
                "stiffnesses: must be positive definite: a state at or beyond a limit point carries no rod"
            )
        for name, value in (("pressures", p), ("strains", q), ("stiffnesses", K)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_known", lru_cache(maxsize=64)(self._interpolated))

    @classmethod
    def of_states(cls, states):
        """From equilibria of a free unit cell (hifi.cell.system.CellState: pressure, strains, stiffness), in
        order of pressure."""
        return cls(
            [s.pressure for s in states],
            [np.concatenate([s.strains.e, s.strains.k]) for s in states],
            [(s.stiffness + s.stiffness.T) / 2 for s in states],
        )

    @property
    def mirrored(self):
        """The law of the mirror image at the plane y = 0 (Segment.mirrored)."""
        sign = np.array([1, -1, 1, -1, 1, -1])
        return QuadraticLaw(self.pressures, self.strains * sign, self.stiffnesses * np.outer(sign, sign))

    def _at(self, P):
        """(q0 (..., 6), K (..., 6, 6)) at P."""
        return self._known(P) if isinstance(P, (int, float)) else self._interpolated(P)

    def _interpolated(self, P):
        p, q, K = self.pressures, self.strains, self.stiffnesses
        if len(p) == 1:
            return q[0] + np.zeros((*np.shape(P), 1)), K[0] + np.zeros((*np.shape(P), 1, 1))
        if not (np.min(P) >= p[0] and np.max(P) <= p[-1]):
            raise InputError(f"pressure_kPa: this law knows {p[0] * 1e3:g}..{p[-1] * 1e3:g} kPa")
        i = np.minimum(np.searchsorted(p, P, side="right"), len(p) - 1) - 1
        w = np.asarray((P - p[i]) / (p[i + 1] - p[i]))[..., None]
        return q[i] + w * (q[i + 1] - q[i]), K[i] + w[..., None] * (K[i + 1] - K[i])

    def free_strains(self, P):
        return self._at(P)[0]

    def psi(self, q, P):
        return np.sum((q - self.free_strains(P)) * self.force(q, P), axis=-1) / 2

    def force(self, q, P):
        free, K = self._at(P)
        return (K @ (q - free)[..., None])[..., 0]

    def stiffness(self, q, P):
        return self._at(P)[1] + np.zeros((*np.shape(q)[:-1], 1, 1))


def beam_stiffness(rectangles, torsion):
    """(6, 6) stiffness in (e, k) about the x axis of a section of rectangles (half width, z0, z1, signed
    shear modulus), mm and MPa.

    Incompressible (E = 3 mu); plane sections; shear area 5/6 and the shear centre at the centre of stiffness.
    torsion: N mm2 about that centre.
    """
    w, z0, z1, mu = (np.asarray(a, float) for a in zip(*rectangles))
    area = 2 * w * (z1 - z0)
    shear = np.sum(mu * area)
    centre = np.sum(mu * area * (z0 + z1) / 2) / shear
    about_y = 3 * np.sum(mu * 2 * w * ((z1 - centre) ** 3 - (z0 - centre) ** 3) / 3)
    about_z = 3 * np.sum(mu * area * w**2 / 3)
    own = np.diag([3 * shear, 5 / 6 * shear, 5 / 6 * shear, torsion, about_y, about_z])
    move = np.eye(6)  # strains of the line through the centre: e + k x (0, 0, centre)
    move[0, 4], move[1, 3] = centre, -centre
    return move.T @ own @ move


def passive_law(segment, curvature=0.0):
    """The QuadraticLaw of a segment's bare core with its channel: ends, plugs and joints, which the pressure
    leaves unstrained; curvature: free curvature about z, 1/mm, all the same (reduced.rod.ends.end_turn).

    (Around a thin bore in an incompressible core, thrust on the cap and pressure on the wall cancel in the
    elongation.) Torsion is that of the full rectangle (Timoshenko & Goodier, Theory of Elasticity, Sec. 109)
    less the channel's polar moment.
    """
    s, mu = segment, segment.material.mu
    rectangles = [
        (s.width / 2, s.core_bottom, s.core_top, mu),
        (s.channel_width / 2, -s.channel_height / 2, s.channel_height / 2, -mu),
    ]
    if s.layer_thickness:
        rectangles.append((s.width / 2, s.core_bottom, s.layer_top, s.layer_material.mu - mu))
    height = s.core_top - s.core_bottom
    long, short = max(s.width, height), min(s.width, height)
    ratio = short / long
    torsion = long * short**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))
    torsion -= s.channel_width * s.channel_height * (s.channel_width**2 + s.channel_height**2) / 12
    mean = sum(2 * w * (b - a) * m for w, a, b, m in rectangles) / sum(
        2 * w * (b - a) * np.sign(m) for w, a, b, m in rectangles[:2]
    )
    rest = RodStrains.unstrained()
    return QuadraticLaw(
        [0.0], [[*rest.e, *rest.k[:2], curvature]], [beam_stiffness(rectangles, mean * torsion)]
    )
