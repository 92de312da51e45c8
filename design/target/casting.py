"""`Casting`: how a design is to be cast, and what it may do: the table [casting] of a target."""

from dataclasses import dataclass

from pneunet.base.errors import InputError
from pneunet.base.materials.silicones import measured_silicone
from pneunet.base.quantities import Checked, quantity

#: keys that are [smallest, largest] -> (field of Casting, lowest and highest that are allowed)
RANGES = {"walls_mm": ("walls", 0.3, 10.0), "mu_range_MPa": ("moduli", 1e-3, 5.0)}


@dataclass(frozen=True)
class Casting(Checked):
    """What can be cast, by hand unless the user says more.

    walls: (thinnest, thickest) silicone wall in mm that the search may use. silicones: names from the table
    of silicones to choose among; moduli: (lowest, highest) shear modulus in MPa to choose from continuously;
    with neither the target's own material stands. tolerances: of one casting, from which the expected error
    of the real body follows; modulus_tolerance as a fraction, pressure_tolerance in MPa."""

    grid: float = quantity("mm", 0.05, "dimensions land on multiples of it; 0: none", low=0, high=2)
    angle_grid: float = quantity("deg", 0.5, "angles likewise", key="grid_deg", low=0, high=15)
    allow_steps: bool = quantity(None, False, "the underside may step between segments")
    allow_touch: bool = quantity(None, False, "walls of neighbouring chambers may touch")
    tolerance: float = quantity("mm", 0.1, "of each dimension, one standard deviation", low=0, high=2)
    angle_tolerance: float = quantity("deg", 0.5, key="tolerance_deg", low=0, high=15)
    modulus_tolerance: float = quantity("percent", 0.05, key="tolerance_modulus_percent", low=0, high=100)
    pressure_tolerance: float = quantity("kPa", 0.0005, key="tolerance_pressure_kPa", low=0, high=50)
    walls: tuple[float, float] = (1.0, 2.0)
    silicones: tuple[str, ...] = ()
    moduli: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, (name, low, high) in RANGES.items():
            bounds = getattr(self, name)
            if bounds is not None and not low <= bounds[0] <= bounds[1] <= high:
                told = f"{key} = [{bounds[0]:g}, {bounds[1]:g}]"
                raise InputError(f"{told} must be [smallest, largest] within {low:g}..{high:g}")
        for name in self.silicones:
            measured_silicone(name)
        if self.silicones and self.moduli is not None:
            raise InputError("silicones and mu_range_MPa exclude each other: give one")
