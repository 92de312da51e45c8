"""How a silicone stiffens, in the two numbers that the rod law is learned for: the ratios c20/c10 and c30/c10
of Yeoh's law with the same initial shear modulus.

Yeoh's and the neo-Hookean law have them exactly. Any other law gets those whose stresses come nearest to its
own in uniaxial, planar and equibiaxial tension, up to the stretch that walls of chambers come to.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pneunet.base.materials.hyperelastic import MODES, nominal_stress
from pneunet.base.materials.laws import Hyperelastic, NeoHookean, Yeoh, unchecked

#: up to which stresses are compared, and at how many stretches
LARGEST, MANY = 1.8, 25


class Stiffening(NamedTuple):
    """c20/c10 and c30/c10; misfit: norm of what the stresses are off by over their norm, 0 where nothing
    is."""

    c20: float
    c30: float
    misfit: float


@lru_cache(maxsize=4096)
def stiffening(material: Hyperelastic) -> Stiffening:
    """The Stiffening of a material. c30 is not negative: beyond a moderate stretch the law would be unstable.
    A law that ends below the stretch LARGEST, as Gent's may, is compared up to there."""
    if isinstance(material, NeoHookean):
        return Stiffening(0.0, 0.0, 0.0)
    if isinstance(material, Yeoh):
        return Stiffening(material.c20 / material.c10, material.c30 / material.c10, 0.0)
    stretch = np.linspace(1, LARGEST, MANY + 1)[1:]
    own, plain, *columns = (_stresses(law, stretch) for law in (material, *_parts(material.mu)))
    there = np.isfinite(own)
    wanted, (a, b) = (own - plain)[there], (column[there] for column in columns)
    c20, c30 = np.linalg.lstsq(np.column_stack([a, b]), wanted, rcond=None)[0].tolist()
    if c30 < 0:
        c20, c30 = float(a @ wanted / (a @ a)), 0.0
    missed = np.linalg.norm(wanted - c20 * a - c30 * b) / np.linalg.norm(own[there])
    return Stiffening(c20, c30, float(missed))


def _parts(mu):
    """Yeoh's laws of modulus `mu` without stiffening, and of c20 = c10 and c30 = c10 alone: stresses are
    linear in the constants."""
    constants = np.eye(3) * mu / 2
    return [unchecked(Yeoh, c10=c10, c20=c20, c30=c30) for c10, c20, c30 in constants]


def _stresses(material, stretch):
    return np.concatenate([nominal_stress(material, mode, stretch) for mode in MODES])
