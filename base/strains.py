"""Rod strains and the numbers that users and the paper derive from them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base import se3

#: signs of a strain's six numbers (e, k) in the mirror image at the plane y = 0
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True)
class RodStrains:
    """Strains of a section frame per *undeformed* length: frame origin c and rotation Q obey c' = Q e, Q' = Q
    hat(k).

    e : (..., 3) stretch and shears; e[0] is the axial stretch along the section's normal (1 at rest).
    k : (..., 3) in 1/mm; k[0] twist, k[1] and k[2] curvatures about the width (y) and height (z) directions.
    Both depend on the line and frame they refer to; only |k| and k.e of a uniform screw do not.
    """

    e: np.ndarray
    k: np.ndarray

    def __init__(self, e: ArrayLike, k: ArrayLike) -> None:
        object.__setattr__(self, "e", np.asarray(e, float))
        object.__setattr__(self, "k", np.asarray(k, float))

    @classmethod
    def unstrained(cls) -> "RodStrains":
        """(3,) at rest."""
        return cls([1.0, 0.0, 0.0], [0.0, 0.0, 0.0])

    @classmethod
    def of_vector(cls, q: ArrayLike) -> "RodStrains":
        """From (..., 6) = (e, k)."""
        q = np.asarray(q, float)
        return cls(q[..., :3], q[..., 3:])

    @classmethod
    def from_relative_pose(cls, pose: np.ndarray, length: float | np.ndarray) -> "RodStrains":
        """Uniform strains that carry a frame over an undeformed `length` (mm) by the relative `pose` (..., 4,
        4)."""
        twist = se3.log_pose(pose) / np.asarray(length, float)[..., None]
        return cls(twist[..., 3:], twist[..., :3])

    @property
    def vector(self) -> np.ndarray:
        """(..., 6) = (e, k)."""
        return np.concatenate([self.e, self.k], axis=-1)

    @property
    def mirrored(self) -> "RodStrains":
        """Of the mirror image at the plane y = 0."""
        return RodStrains.of_vector(self.vector * MIRROR)

    @property
    def twist_vector(self) -> np.ndarray:
        """(..., 6) argument of `se3.exp_pose` per undeformed length: (k, e)."""
        return np.concatenate([self.k, self.e], axis=-1)

    @property
    def stretch(self) -> np.ndarray:
        """Stretch of the line of origins, |e| = deformed/undeformed length."""
        return np.linalg.norm(self.e, axis=-1)

    @property
    def twist_per_deformed_length(self) -> np.ndarray:
        """The paper's tau of a twisting segment, rad/mm: k1 / lambda."""
        return self.k[..., 0] / self.stretch

    @property
    def frenet_curvature(self) -> np.ndarray:
        """Frenet curvature of the centreline, 1/mm: |k x e| / |e|^2."""
        return np.linalg.norm(np.cross(self.k, self.e), axis=-1) / self.stretch**2

    @property
    def frenet_torsion(self) -> np.ndarray:
        """Frenet torsion of the centreline, rad/mm: k.e / |e|^2."""
        return np.sum(self.k * self.e, axis=-1) / self.stretch**2

    @property
    def helix_cylinder_curvature(self) -> np.ndarray:
        """The paper's kappa_h, 1/mm: 1/(radius of the helix's cylinder) = (kF^2 + tF^2)/kF."""
        kF, tF = self.frenet_curvature, self.frenet_torsion
        return np.divide(kF**2 + tF**2, kF, out=np.zeros_like(kF * 1.0), where=kF > 0)

    @property
    def helix_pitch(self) -> np.ndarray:
        """The paper's P_t, mm: 2 pi tF/(kF^2 + tF^2), signed by handedness."""
        kF, tF = self.frenet_curvature, self.frenet_torsion
        total = kF**2 + tF**2
        return np.divide(2 * np.pi * tF, total, out=np.full_like(total * 1.0, np.inf), where=total > 0)


def helix_frenet(
    cylinder_curvature: float | np.ndarray, pitch: float | np.ndarray
) -> tuple[float | np.ndarray, float | np.ndarray]:
    """Frenet curvature and torsion (1/mm) of a helix given the paper's kappa_h (1/mm) and P_t (mm)."""
    a, b = 1.0 / cylinder_curvature, pitch / (2 * np.pi)
    return a / (a * a + b * b), b / (a * a + b * b)
