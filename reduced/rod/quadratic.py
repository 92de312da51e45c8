"""Laws that are quadratic about free states: of given states, and that of bare core."""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError
from pneunet.base.strains import MIRROR, RodStrains
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.parameters import Segment
from pneunet.reduced.rod.clamp import stiffening
from pneunet.reduced.rod.laws import SegmentLaw


class FreeState(Protocol):
    """An equilibrium of a free unit cell, as hifi.cell.system.CellState is one: MPa, 1/mm, and (6, 6) in N, N
    mm and N mm2."""

    pressure: float
    strains: RodStrains
    stiffness: np.ndarray


class QuadraticLaw(SegmentLaw):
    """psi = (q - q0)^T K (q - q0)/2 with q0 and K linear in the pressure between given states; the section of
    any segment.

    pressures (n,) in MPa, increasing; free (n, 6), their strains; stiffnesses (n, 6, 6), symmetric and
    positive definite. One state serves at any pressure, several within their range. A tangent at the free
    state: good for small departures from it.
    """

    name = "quadratic"

    def __init__(self, pressures: ArrayLike, free: ArrayLike, stiffnesses: ArrayLike) -> None:
        p, q, K = (np.asarray(a, float) for a in (pressures, free, stiffnesses))
        n = p.size
        if p.ndim != 1 or not n or not (np.diff(p) > 0).all() or q.shape != (n, 6) or K.shape != (n, 6, 6):
            raise InputError(
                "pressures, free, stiffnesses: give n increasing pressures, free strains (n, 6) and"
                " stiffnesses (n, 6, 6)"
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
        self.pressures, self.free, self.stiffnesses = p, q, K
        self._known = lru_cache(maxsize=64)(self._interpolated)

    @classmethod
    def of_states(cls, states: Sequence[FreeState]) -> "QuadraticLaw":
        """From equilibria of a free unit cell, in order of pressure."""
        return cls(
            [s.pressure for s in states],
            [s.strains.vector for s in states],
            [(s.stiffness + s.stiffness.T) / 2 for s in states],
        )

    @property
    def mirrored(self) -> "QuadraticLaw":
        """The law of the mirror image at the plane y = 0 (Segment.mirrored)."""
        return QuadraticLaw(self.pressures, self.free * MIRROR, self.stiffnesses * np.outer(MIRROR, MIRROR))

    def of(self, segment: Segment) -> "QuadraticLaw":
        """Itself, whatever the segment."""
        return self

    def _at(self, P: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(q0 (..., 6), K (..., 6, 6)) at P."""
        return self._known(P) if isinstance(P, (int, float)) else self._interpolated(P)

    def _interpolated(self, P: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        p, q, K = self.pressures, self.free, self.stiffnesses
        if len(p) == 1:
            return q[0] + np.zeros((*np.shape(P), 1)), K[0] + np.zeros((*np.shape(P), 1, 1))
        if not (np.min(P) >= p[0] and np.max(P) <= p[-1]):
            low, high = p[[0, -1]] * KPA_PER_MPA
            raise InputError(f"pressure_kPa: this law knows {low:g}..{high:g} kPa")
        i = np.minimum(np.searchsorted(p, P, side="right"), len(p) - 1) - 1
        w = np.asarray((P - p[i]) / (p[i + 1] - p[i]))[..., None]
        return q[i] + w * (q[i + 1] - q[i]), K[i] + w[..., None] * (K[i + 1] - K[i])

    def free_strains(self, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) at P in MPa, a number or (...,); InputError outside of the pressures."""
        return self._at(P)[0]

    def psi(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(...,) enthalpy per undeformed length, N."""
        return np.sum((q - self.free_strains(P)) * self.force(q, P), axis=-1) / 2

    def force(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(..., 6) force (N) and moment (N mm)."""
        free, K = self._at(P)
        return (K @ (q - free)[..., None])[..., 0]

    def stiffness(self, q: np.ndarray, P: float | np.ndarray) -> np.ndarray:
        """(..., 6, 6) in N, N mm and N mm2."""
        return self._at(P)[1] + np.zeros((*np.shape(q)[:-1], 1, 1))


def beam_stiffness(
    rectangles: Iterable[tuple[float, ...]], torsion: float, stiffer: ArrayLike = 1.0
) -> np.ndarray:
    """(6, 6) stiffness in (e, k) about the x axis of a section of rectangles (half width, z0, z1, signed
    shear modulus), mm and MPa.

    Incompressible (E = 3 mu); plane sections; shear area 5/6 and the shear centre at the centre of stiffness.
    torsion: N mm2 about that centre; stiffer (6,): factors of what the section has about it
    (reduced.rod.clamp).
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
    return move.T @ (own * np.asarray(stiffer)) @ move


def passive_law(segment: Segment, curvature: float = 0.0, clamped: float = np.inf) -> QuadraticLaw:
    """The QuadraticLaw of a segment's bare core with its channel: ends, plugs and joints, which the pressure
    leaves unstrained; curvature: free curvature about z, 1/mm, all the same (reduced.rod.ends); clamped:
    length (mm) of a piece behind a clamp, infinite without one.

    (Around a thin bore in an incompressible core, thrust on the cap and pressure on the wall cancel in the
    elongation.) Torsion is that of the full rectangle (Timoshenko & Goodier, Theory of Elasticity, Sec. 109)
    less the channel's polar moment.
    """
    s, mu = segment, segment.material.mu
    rectangles = [
        (s.width / 2, s.core_bottom, s.core_top, mu),
        (s.channel_width / 2, -s.channel_height / 2, s.channel_height / 2, -mu),
    ]
    if s.layer_material:
        rectangles.append((s.width / 2, s.core_bottom, s.layer_top, s.layer_material.mu - mu))
    height = s.core_top - s.core_bottom
    long, short = max(s.width, height), min(s.width, height)
    ratio = short / long
    torsion = long * short**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))
    torsion -= s.channel_width * s.channel_height * (s.channel_width**2 + s.channel_height**2) / 12
    mean = sum(2 * w * (b - a) * m for w, a, b, m in rectangles) / sum(
        2 * w * (b - a) * np.sign(m) for w, a, b, m in rectangles[:2]
    )
    free = RodStrains([1.0, 0.0, 0.0], [0.0, 0.0, curvature])
    stiffness = beam_stiffness(rectangles, mean * torsion, stiffening(s.width, height, clamped))
    return QuadraticLaw([0.0], [free.vector], [stiffness])
