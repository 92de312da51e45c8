"""Laws of materials: what a silicone is, apart from how a solver uses it.

Each law is an energy density W (MPa) of the isochoric deformation, with I1 and I2 the invariants of C /
det(C)^(1/3) and l1, l2, l3 its principal stretches. Incompressible unless a bulk modulus is given. The energy
is written once, in operators that take arrays as well as the symbols of finite elements: a new law is a class
here and a name in LAWS.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.toml import as_table, from_table, to_table
from pneunet.base.materials import halfpowers
from pneunet.base.materials.hyperelastic import MODES, stable_stretch
from pneunet.base.materials.silicones import measured_silicone
from pneunet.base.quantities import Checked, quantities, quantity

#: a law that is not stable up to this stretch has a slip in its numbers
STABLE_AT_LEAST = 1.2
#: largest shear modulus in MPa and smallest bulk modulus over it: of a body, and of a layer in it. Paper has
#: some GPa and a Poisson's ratio of 0.2
BODY_LIMITS, LAYER_LIMITS = (100, 5), (1e4, 1.33)

Law = TypeVar("Law")
One = TypeVar("One", bound="Hyperelastic")


def unchecked(law: type[Law], **parameters: Any) -> Law:
    """A law with these parameters, arrays or symbols among them: nothing is checked."""
    made = object.__new__(law)
    vars(made).update(parameters)
    return made


class Arrays:
    """Operators on complex arrays that continue the real functions: nan where these have no value."""

    @staticmethod
    def ln(x: np.ndarray) -> np.ndarray:
        return np.log(np.where(x.real > 0, x, np.nan))

    @staticmethod
    def sqrt(x: np.ndarray) -> np.ndarray:
        return np.sqrt(np.where(x.real >= 0, x, np.nan))

    exp = staticmethod(np.exp)


@dataclass(frozen=True, kw_only=True)
class Hyperelastic(Checked, ABC):
    """What every law has beside its own parameters; those come first, in order of the law's formula.

    A law says its `energy`, `law`, its name in files, `stiffness`, its shear modulus in words, and `mu`, that
    modulus in MPa. What else it may say: `signed`, moduli that may be negative; `constants`, what its energy
    takes in finite elements where these are not its own parameters; `long`, an energy whose derivatives take
    the form compiler minutes.

    density in tonne/mm^3 (file key: kg/m^3); bulk_modulus in MPa, inf = incompressible; elongation_at_break:
    engineering strain, inf = not known. Infinite values are not written to files.
    """

    density: float = quantity("kg_per_m3", 1.07e-9, "mass density", low=50, high=25e3, hint="is it in g/cm3?")
    bulk_modulus: float = quantity("MPa", math.inf, note="incompressible unless given")
    elongation_at_break: float = quantity("percent", math.inf, "engineering strain at break", above=0)
    name: str = quantity(None, "silicone", "free text")
    source: str = quantity(None, "", "where the numbers come from")

    law: ClassVar[str]
    stiffness: ClassVar[str]
    parameters: ClassVar[tuple[str, ...]]
    constants: ClassVar[tuple[str, ...]]
    signed: ClassVar[tuple[str, ...]] = ()
    long: ClassVar[bool] = False

    if TYPE_CHECKING:

        @property
        def mu(self) -> float:
            """Shear modulus at rest, MPa."""

    @abstractmethod
    def energy(self, I1: Any, I2: Any, operators: Any) -> Any:
        """W (MPa) of the invariants: arrays with the operators ln, sqrt and exp of `Arrays`, or UFL's symbols
        with those of ufl, the parameters being symbols too."""

    def of_stretches(self, stretches: np.ndarray) -> np.ndarray:
        """W (...,) in MPa of principal stretches (..., 3) whose product is 1, real or complex."""
        squares = stretches * stretches
        return self.energy(squares.sum(-1), (1 / squares).sum(-1), Arrays)

    @classmethod
    def fit_range(cls, name: str, largest: float) -> tuple[float, float]:
        """(low, high), positive, between which a parameter that is no modulus is fitted to tests that reach
        the stretch `largest`; a law with such parameters must say it."""
        raise TypeError(f"{cls.__name__} has no fit_range, which says where to look for {name}")

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_law()
        if not self.mu > 0:
            raise InputError(
                f"{self.stiffness} = {self.mu:g} must be larger than 0: it is the initial shear modulus"
            )
        self.check_limits(*LAYER_LIMITS)
        for mode in MODES:
            limit = stable_stretch(self, mode, STABLE_AT_LEAST)
            if limit < math.inf:
                raise InputError(
                    f"law = '{self.law}': these parameters are unstable from stretch {limit:.3g} on in"
                    f" {mode}: check signs"
                )

    def check_limits(self, stiffest: float, least_bulk: float) -> None:
        """InputError for a shear modulus over `stiffest` MPa, or a bulk modulus below `least_bulk` times the
        shear modulus."""
        if not 1e-4 <= self.mu <= stiffest:
            raise InputError(
                f"{self.stiffness} = {self.mu:g} is outside 1e-4..{stiffest:g} MPa: silicones lie in 0.01..2"
                " MPa; is it in kPa?"
            )
        if not self.bulk_modulus >= least_bulk * self.mu:
            raise InputError(
                f"bulk_modulus_MPa = {self.bulk_modulus:g} is less than {least_bulk:g} shear moduli"
                f" ({self.mu:g} MPa): too compressible here; leave it out for an incompressible material"
            )

    def __init_subclass__(cls) -> None:
        #: names of the law's own parameters, in order
        cls.parameters = tuple(cls.__annotations__)
        cls.constants = vars(cls).get("constants", cls.parameters)

    def _check_law(self) -> None:
        """InputError for parameters that this law cannot have."""

    @property
    def bulk_compliance(self) -> float:
        """1 / bulk modulus, 1/MPa; 0 when incompressible."""
        return 1 / self.bulk_modulus

    @property
    def break_stretch(self) -> float:
        """Stretch at which a strip breaks; inf when not known."""
        return 1 + self.elongation_at_break


@dataclass(frozen=True)
class NeoHookean(Hyperelastic):
    """W = mu/2 (I1 - 3)."""

    mu: float = quantity("MPa", note="shear modulus")
    law = "neo-Hookean"
    stiffness = "mu_MPa"

    def energy(self, I1: Any, I2: Any, operators: Any) -> Any:
        return self.mu / 2 * (I1 - 3)


@dataclass(frozen=True)
class MooneyRivlin(Hyperelastic):
    """W = c10 (I1 - 3) + c01 (I2 - 3)."""

    c10: float = quantity("MPa")
    c01: float = quantity("MPa")
    law = "Mooney-Rivlin"
    stiffness = "2 (c10_MPa + c01_MPa)"

    @property
    def mu(self) -> float:
        return 2 * (self.c10 + self.c01)

    def energy(self, I1: Any, I2: Any, operators: Any) -> Any:
        return self.c10 * (I1 - 3) + self.c01 * (I2 - 3)


@dataclass(frozen=True)
class Yeoh(Hyperelastic):
    """W = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3."""

    c10: float = quantity("MPa")
    c20: float = quantity("MPa", 0.0)
    c30: float = quantity("MPa", 0.0)
    law = "Yeoh"
    stiffness = "2 c10_MPa"
    signed = ("c20",)

    @property
    def mu(self) -> float:
        return 2 * self.c10

    def energy(self, I1: Any, I2: Any, operators: Any) -> Any:
        x = I1 - 3
        return self.c10 * x + self.c20 * x**2 + self.c30 * x**3


@dataclass(frozen=True)
class Gent(Hyperelastic):
    """W = -mu jm/2 ln(1 - (I1 - 3)/jm): no state with I1 >= 3 + jm exists."""

    mu: float = quantity("MPa", note="shear modulus")
    jm: float = quantity(
        None,
        note="largest I1 - 3",
        low=0.1,
        high=1e6,
        hint="it is the largest I1 - 3 (some 10 to 100 for silicones)",
    )
    law = "Gent"
    stiffness = "mu_MPa"

    def energy(self, I1: Any, I2: Any, operators: Any) -> Any:
        """With the root of 1 - x, x = (I1 - 3)/jm.

        The logarithm is gone from its derivative, and 1/(1 - x) beyond the limit x = 1 is a finite stress of
        wrong sign on which Newton's method could settle. The root makes stress and tangent nan there, so that
        a step which leaves the admissible range is recognised and cut back, and every accepted state is
        Gent's.
        """
        x = (I1 - 3) / self.jm
        return -self.mu * self.jm * operators.ln(operators.sqrt(1 - x))

    @classmethod
    def fit_range(cls, name: str, largest: float) -> tuple[float, float]:
        """Beyond the upper end it is the neo-Hookean law."""
        return 1.001 * (largest**2 + 2 / largest - 3), 1e5


@dataclass(frozen=True)
class Ogden(Hyperelastic):
    """W = sum over p of 2 mu_p / alpha_p^2 (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3), up to three terms.

    The shear modulus is mu1 + mu2 + mu3. (With the other convention, W = sum M_p / alpha_p (...), mu_p = M_p
    alpha_p / 2.)
    """

    mu1: float = quantity("MPa")
    alpha1: float = quantity(None)
    mu2: float = quantity("MPa", 0.0)
    alpha2: float = quantity(None, 0.0)
    mu3: float = quantity("MPa", 0.0)
    alpha3: float = quantity(None, 0.0)
    law = "Ogden"
    stiffness = "mu1_MPa + mu2_MPa + mu3_MPa"
    constants = ("half_power_weights",)
    long = True
    largest_exponent = 10.0

    def energy(self, I1: Any, I2: Any, operators: Any) -> Any:
        """By a series (base.materials.halfpowers), since principal stretches cannot be differentiated where
        they coincide."""
        return halfpowers.energy(self.half_power_weights, I1, I2, operators)

    def of_stretches(self, stretches: np.ndarray) -> np.ndarray:
        return sum(2 * m / a**2 * (stretches**a - 1).sum(-1) for m, a in self.terms)

    @property
    def mu(self) -> float:
        return self.mu1 + self.mu2 + self.mu3

    @cached_property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """((mu_p, alpha_p), ...) of the terms in use."""
        return tuple(
            (m, a)
            for m, a in ((self.mu1, self.alpha1), (self.mu2, self.alpha2), (self.mu3, self.alpha3))
            if m
        )

    @cached_property
    def half_power_weights(self) -> np.ndarray:
        """(2 ORDER,) MPa: what finite elements take instead of the terms."""
        return halfpowers.weights(self.terms)

    def _check_law(self):
        for p, (m, a) in enumerate(
            ((self.mu1, self.alpha1), (self.mu2, self.alpha2), (self.mu3, self.alpha3)), start=1
        ):
            if m and not 1e-3 <= abs(a) <= self.largest_exponent:
                raise InputError(
                    f"alpha{p} = {a:g} must lie in -{self.largest_exponent:g}..{self.largest_exponent:g} and"
                    " not be 0"
                )


#: The paper's two calibrations (physics: mu = 0.317 for its twisting theory; E = 0.619, nu = 0.49 for its
#: helical one).
PAPER_TWISTING = NeoHookean(mu=0.317, name="paper, twisting theory", source="Jiang et al. 2021, Eq. 2")
PAPER_HELICAL = NeoHookean(
    mu=0.619 / (2 * 1.49), name="paper, helical theory", source="Jiang et al. 2021, Sec. IV, E=0.619, nu=0.49"
)

LAWS: dict[str, type[Hyperelastic]] = {cls.law: cls for cls in (NeoHookean, MooneyRivlin, Yeoh, Gent, Ogden)}


def of_modulus(material: One, mu: float) -> One:
    """The material with all of its moduli in proportion, so that its shear modulus at rest is mu (MPa)."""
    share = mu / material.mu
    moduli = [f.name for f in quantities(type(material)).values() if f.metadata["unit"] == "MPa"]
    return replace(material, **{name: share * getattr(material, name) for name in moduli})


def silicone(name: str) -> Hyperelastic:
    """The law of the table in base.materials.silicones; InputError for another name."""
    return material_from_table(measured_silicone(name), "silicone")


@dataclass(frozen=True)
class _Engineering(Checked):
    """What data sheets of stiff materials say."""

    youngs_modulus: float = quantity("MPa", above=0)
    poisson_ratio: float = quantity(None, low=0.2, high=0.5)

    @property
    def moduli(self) -> dict[str, float]:
        nu, own = self.poisson_ratio, {"mu_MPa": self.youngs_modulus / 2 / (1 + self.poisson_ratio)}
        return own if nu == 0.5 else own | {"bulk_modulus_MPa": self.youngs_modulus / 3 / (1 - 2 * nu)}


def material_from_table(table: dict, where: str) -> Hyperelastic:
    """A law from its TOML table: `law = "..."` (default neo-Hookean) with its parameters, or `silicone =
    "..."`, the law of a row in base.materials.silicones, of which further keys replace values, or the
    engineering constants `youngs_modulus_MPa` and `poisson_ratio` of a neo-Hookean one."""
    table = as_table(table, where)
    if "silicone" in table:
        if "law" in table:
            raise InputError(f"{where}: 'silicone' and 'law' exclude each other: a silicone has its law")
        with located(where):
            table = {**measured_silicone(table.pop("silicone")), **table}
    constants = {key: table.pop(key) for key in quantities(_Engineering) if key in table}
    if constants:
        for key in ("law", "silicone", "mu_MPa", "bulk_modulus_MPa"):
            if key in table:
                raise InputError(
                    f"{where}: '{key}' and '{next(iter(constants))}' exclude each other: give one"
                )
        table |= from_table(_Engineering, constants, where).moduli
    law = table.pop("law", NeoHookean.law)
    if law not in tuple(LAWS):
        raise InputError(f"{where}: unknown law '{law}': known laws are {', '.join(LAWS)}")
    if law == Yeoh.law and "mu_MPa" in table:
        raise InputError(f"{where}: law 'Yeoh' has no 'mu_MPa': write 'c10_MPa', half of it")
    return from_table(LAWS[law], table, where)


def material_to_table(material: Hyperelastic) -> dict:
    """The TOML table that material_from_table reads, the law's own parameters first."""
    table = to_table(material)
    own = {k: table.pop(k) for k, f in quantities(type(material)).items() if f.name in material.parameters}
    return {"law": material.law, **own, **table}
