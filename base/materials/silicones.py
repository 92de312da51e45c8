"""Commercial silicones, after their makers' technical bulletins (entered from memory, not compared with them
since)."""

from pneunet.base.errors import InputError

MPA_PER_PSI = 0.006894757

#: name -> (stress at 100 % elongation, psi; elongation at break, %; density, g/cm^3); Smooth-On's technical
#: bulletins
BULLETINS = {
    "Ecoflex 00-10": (8, 800, 1.04),
    "Ecoflex 00-20": (8, 845, 1.07),
    "Ecoflex 00-30": (10, 900, 1.07),
    "Ecoflex 00-35 FAST": (10, 900, 1.07),
    "Ecoflex 00-50": (12, 980, 1.07),
    "Dragon Skin 10": (22, 1000, 1.07),
    "Dragon Skin 20": (49, 620, 1.08),
    "Dragon Skin 30": (86, 364, 1.08),
    "Dragon Skin FX-Pro": (38, 763, 1.06),
    "Mold Star 15 SLOW": (55, 440, 1.18),
    "Mold Star 16 FAST": (55, 440, 1.18),
    "Mold Star 20T": (47, 470, 1.08),
    "Mold Star 30": (96, 339, 1.12),
    "Smooth-Sil 940": (200, 300, 1.18),
    "Smooth-Sil 950": (272, 320, 1.24),
}


def bulletin(name: str) -> dict:
    """File keys of a neo-Hookean material for a silicone of the table; InputError for another name.

    A bulletin's "100 % modulus" is the nominal stress at twice the length, for a neo-Hookean solid mu (2 -
    1/2^2): the shear modulus is that stress over 1.75.
    """
    if name not in tuple(BULLETINS):
        raise InputError(f"silicone = '{name}' is not in the table: known are {', '.join(BULLETINS)}")
    stress, elongation, density = BULLETINS[name]
    return {
        "mu_MPa": float(f"{stress * MPA_PER_PSI / 1.75:.4g}"),
        "density_kg_per_m3": round(1000 * density),
        "elongation_at_break_percent": elongation,
        "name": name,
        "source": (
            f"technical bulletin, from memory, not compared since; mu from its 100 % modulus, {stress} psi /"
            " 1.75"
        ),
    }
