"""How a design is cast: the grid that its dimensions land on, what may be built, and how exact it becomes."""

from dataclasses import dataclass

from pneunet.base.quantities import Checked, quantity


@dataclass(frozen=True)
class Casting(Checked):
    """What a mould maker can do; tolerances are standard deviations."""

    grid: float = quantity("mm", 0.05, "dimensions are multiples of it; 0 = any", low=0, high=5)
    angle_grid: float = quantity("deg", 0.5, "angles are multiples of it; 0 = any", low=0, high=15)
    steps: bool = quantity(None, False, "undersides of one-sided segments may lie at different heights")
    touch: bool = quantity(None, False, "facing walls may touch at the design pressure")
    tolerance: float = quantity("mm", 0.1, "of every dimension", low=0, high=5)
    angle_tolerance: float = quantity("deg", 0.5, "of the chambers' angle", low=0, high=15)
    pressure_tolerance: float = quantity("kPa", 0.0005, "of the pressure", low=0, high=50)
    modulus_tolerance: float = quantity("percent", 0.05, "of the material's modulus", low=0, high=100)
