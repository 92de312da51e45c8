"""A law that the project does not have, as one would add it: a class with its energy, and a name in LAWS."""

from dataclasses import dataclass

import numpy as np

from pneunet.base.materials.laws import Hyperelastic
from pneunet.base.quantities import quantity


@dataclass(frozen=True)
class Demiray(Hyperelastic):
    """W = mu/(2 b) (exp(b (I1 - 3)) - 1): a rubber that stiffens without a limit."""

    mu: float = quantity("MPa")
    b: float = quantity(None)
    law = "Demiray"
    stiffness = "mu_MPa"

    def energy(self, I1, I2, operators):
        return self.mu / (2 * self.b) * (operators.exp(self.b * (I1 - 3)) - 1)

    @classmethod
    def fit_range(cls, name, largest):
        return 1e-3, 10.0


def demiray_stress(material, stretch):
    """Uniaxial nominal stress in closed form."""
    I1 = stretch**2 + 2 / stretch
    return material.mu * np.exp(material.b * (I1 - 3)) * (stretch - 1 / stretch**2)
