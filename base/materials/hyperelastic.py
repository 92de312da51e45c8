"""What a law answers to homogeneous stretch: incompressible, in numpy, for any law of base.materials.laws.

Everything comes from the slopes s_i = l_i dW/dl_i of the energy of principal stretches: the Cauchy stress of
an incompressible solid is s_i - p, and a free direction gives p. They are exact: the imaginary part of W at
stretches l (1 + i h v), over a tiny h, is the derivative along v, with no difference of nearly equal numbers.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

#: the complex step; its square is nothing beside 1
_STEP = 1e-30


class Energy(Protocol):
    """What is needed of a law."""

    def of_stretches(self, stretches: np.ndarray) -> np.ndarray:
        """W (...,) in MPa of principal stretches (..., 3), real or complex; nan beyond a limit."""


def _slope(material: Energy, stretches: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """dW (...,) in MPa by logarithmic strains along `direction` (..., 3)."""
    return material.of_stretches(stretches * (1 + 1j * _STEP * direction)).imag / _STEP


def slopes(material: Energy, stretches: np.ndarray) -> np.ndarray:
    """s_i = l_i dW/dl_i in MPa, shape (..., 3), of principal stretches (..., 3); nan beyond Gent's limit."""
    l = np.asarray(stretches, float)
    return _slope(material, l[..., None, :], np.eye(3))


#: mode -> principal stretches when the pulled direction has stretch l; the last is the free one
MODES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "uniaxial": lambda l: np.stack([l, l**-0.5, l**-0.5], -1),
    "equibiaxial": lambda l: np.stack([l, l, l**-2.0], -1),
    "pure shear": lambda l: np.stack([l, np.ones_like(l), 1 / l], -1),
}


def nominal_stress(material: Energy, mode: str, stretch: float | np.ndarray) -> np.ndarray:
    """Force per undeformed area (MPa) in the pulled direction, shape of `stretch`; mode is a key of MODES."""
    l = np.asarray(stretch, float)
    return _slope(material, MODES[mode](l), np.array([1, 0, -1])) / l


def shear_stress(material: Energy, amount: float | np.ndarray) -> np.ndarray:
    """Shear stress (MPa) at a simple shear by `amount` = l - 1/l: dW/d(amount)."""
    g = np.asarray(amount, float)
    l = g / 2 + np.sqrt(1 + g * g / 4)
    return _slope(material, MODES["pure shear"](l), np.array([1, 0, -1])) / (l + 1 / l)


def stable_stretch(material: Energy, mode: str, largest: float = 10.0) -> float:
    """The stretch at which the law stops being stable in this mode; inf when it is stable up to `largest`.

    Drucker: the Hessian of W in the two free logarithmic strains is positive definite, so that any further
    stretch costs work. Gent's law counts as stable up to its limit.
    """
    l = np.geomspace(1.001, largest, 400)
    e = np.log(MODES[mode](l))
    step, free = 1e-5, np.array([[1, 0, -1], [0, 1, -1]])

    def gradients(shift):
        return _slope(material, np.exp(e + shift)[:, None], free)

    ends = [(gradients(step * way), gradients(-step * way)) for way in free]
    (a, b), (c, d) = (((up - down) / (2 * step)).T for up, down in ends)
    trace, determinant = a + d, a * d - b * c
    unstable = (trace <= 0) | (determinant <= 0)  # false where nan
    return float(l[np.argmax(unstable)]) if unstable.any() else np.inf
