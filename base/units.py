"""Consistent units: mm, N, MPa, tonne, s. Files and the command line carry the unit in the key; inside there
is one system, and these are the factors between the two."""

from collections.abc import Iterable
from numbers import Real

from pneunet.base.errors import InputError

MPA_PER_KPA, KPA_PER_MPA = 1e-3, 1e3
TONNE_PER_MM3_PER_KG_PER_M3 = 1e-12
PER_MM_PER_M = 1e-3  # 1/m -> 1/mm
GRAVITY = 9810.0  # mm/s^2
#: more than silicone bears: a larger number is in another unit
LARGEST_PRESSURE_KPA = 2000.0

#: mm; as people name units of length
LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1e3, "um": 1e-3, "in": 25.4, "inch": 25.4}
#: kPa; as people name units of pressure, in small letters
PRESSURES_KPA = {"kpa": 1.0, "pa": 1e-3, "mpa": 1e3, "bar": 100.0, "mbar": 0.1, "psi": 6.894757}

#: unit suffix of a file key -> factor to the consistent system
TO_INTERNAL = {
    "mm": 1.0,
    "MPa": 1.0,
    "kPa": MPA_PER_KPA,
    "deg": 1.0,
    "kg_per_m3": TONNE_PER_MM3_PER_KG_PER_M3,
    "percent": 0.01,
    "rad_per_mm": 1.0,
    "per_m": PER_MM_PER_M,
    "m_per_s2": 1e3,
    "N": 1.0,
    "N_mm": 1.0,
    "rad_per_m": PER_MM_PER_M,
}


def in_MPa(pressure_kPa: float) -> float:
    """A pressure in MPa; InputError where it is no number of kPa that silicone bears."""
    if not (isinstance(pressure_kPa, Real) and 0 <= pressure_kPa <= LARGEST_PRESSURE_KPA):
        shown = f"{pressure_kPa:g}" if isinstance(pressure_kPa, Real) else repr(pressure_kPa)
        raise InputError(f"pressure_kPa = {shown} must lie in 0..{LARGEST_PRESSURE_KPA:g} kPa")
    return pressure_kPa * MPA_PER_KPA


def each_in_MPa(pressure_kPa: float | Iterable[float]) -> float | tuple[float, ...]:
    """One pressure in MPa, or one for each group of segments; InputError as for `in_MPa`."""
    if isinstance(pressure_kPa, Iterable) and not isinstance(pressure_kPa, str):
        return tuple(in_MPa(p) for p in pressure_kPa)
    return in_MPa(pressure_kPa)
