"""Consistent units: mm, N, MPa, tonne, s. Files and the command line carry the unit in the key; inside there
is one system, and these are the factors between the two."""

MPA_PER_KPA, KPA_PER_MPA = 1e-3, 1e3
TONNE_PER_MM3_PER_KG_PER_M3 = 1e-12
PER_MM_PER_M = 1e-3  # 1/m -> 1/mm
GRAVITY = 9810.0  # mm/s^2

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
