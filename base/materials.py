"""Material parameters: what a silicone is, apart from how a solver uses it."""

from dataclasses import dataclass, field

from base.errors import InputError
from base.tables import as_table, from_table, quantity, to_table


@dataclass(frozen=True)
class NeoHookean:
    """Incompressible neo-Hookean solid, psi = mu/2 (I1 - 3).

    shear_modulus in MPa, density in tonne/mm^3 (file key: kg/m^3).
    """

    mu: float = quantity("MPa", note="shear modulus")
    density: float = quantity("kg_per_m3", 1.07e-9, note="mass density")
    name: str = field(default="silicone", metadata={"unit": None, "note": "free text"})
    source: str = field(default="", metadata={"unit": None, "note": "where the numbers come from"})
    law = "neo-Hookean"

    def __post_init__(self):
        if not 1e-4 <= self.mu <= 1e3:
            raise InputError(f"mu_MPa = {self.mu:g} is outside 1e-4..1e3 MPa: silicones lie in 0.01..2 MPa; is it in kPa?")
        if not 0 <= self.density < 1e-7:
            raise InputError(f"density_kg_per_m3 = {self.density * 1e12:g} is outside 0..1e5")


#: The paper's two calibrations (physics: mu = 0.317 for its twisting theory; E = 0.619, nu = 0.49 for its helical one).
PAPER_TWISTING = NeoHookean(mu=0.317, name="paper, twisting theory", source="Jiang et al. 2021, Eq. 2")
PAPER_HELICAL = NeoHookean(mu=0.619 / (2 * 1.49), name="paper, helical theory", source="Jiang et al. 2021, Sec. IV, E=0.619, nu=0.49")

LAWS = {NeoHookean.law: NeoHookean}


def material_from_table(table, where):
    table = as_table(table, where)
    law = table.pop("law", NeoHookean.law)
    if law not in tuple(LAWS):
        raise InputError(f"{where}: unknown law '{law}': known laws are {', '.join(LAWS)}")
    return from_table(LAWS[law], table, where)


def material_to_table(material):
    return {"law": material.law, **to_table(material)}
