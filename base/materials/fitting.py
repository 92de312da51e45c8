"""Fit a law to uniaxial tests, and say how far the fit is to be trusted.

Nominal stress is linear in a law's moduli (parameters in MPa) once jm (Gent) or the exponents (Ogden) are
fixed, so the moduli are found by linear least squares with lower bounds of zero (which keep every law but
Yeoh's stable), and the rest by a search around them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import combinations, product
from typing import Any

import numpy as np
from scipy.optimize import minimize, nnls

from pneunet.base.errors import InputError
from pneunet.base.materials.hyperelastic import MODES, Energy, nominal_stress, stable_stretch
from pneunet.base.materials.laws import LAWS, Hyperelastic, Ogden, unchecked
from pneunet.base.materials.tensile import Specimen

#: Ogden's exponents: bounds, and where to start. Below -2 (Mooney-Rivlin's second term) the uniaxial curve
#: hardly sees the exponent, while the equibiaxial stress grows as l^(-2 alpha): fits there predicted it wrong
#: by a factor of a hundred.
LOWEST_EXPONENT, HIGHEST_EXPONENT = -2.0, Ogden.largest_exponent
EXPONENTS = (-2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
#: equibiaxial over uniaxial nominal stress at the same stretch, up to 2: neo-Hookean 1.1, measured on rubbers
#: up to about 2
LARGEST_RATIO = 2.5


@dataclass(frozen=True)
class Fit:
    """material: the law with its parameters; error: root mean square of the stress error over that of the
    stress; warnings: why not to trust it, each one line."""

    material: Hyperelastic
    error: float
    warnings: tuple[str, ...]


class TensileData:
    """What is fitted: all points of all specimens, thinned to at most 200 a specimen and weighted equally."""

    def __init__(self, specimens: Iterable[Specimen], largest_strain: float = np.inf):
        stretch, stress, weight = [], [], []
        for s in specimens:
            use = np.flatnonzero(s.stretch - 1 <= largest_strain)
            use = (
                use[np.unique(np.linspace(0, len(use) - 1, min(200, len(use))).astype(int))]
                if len(use)
                else use
            )
            stretch.append(s.stretch[use])
            stress.append(s.stress[use])
            weight.append(np.full(len(use), 1 / np.sqrt(max(len(use), 1))))
        self.stretch, self.stress, self.weight = (np.concatenate(part) for part in (stretch, stress, weight))
        if len(self.stretch) < 5:
            raise InputError("fewer than 5 points are left to fit: fit to a larger strain")
        self.largest = float(self.stretch.max())
        self.size = float(np.linalg.norm(self.weight * self.stress))

    def error(self, material: Energy) -> float:
        """Relative root mean square error of the nominal stress."""
        return float(
            np.linalg.norm(self.weight * (nominal_stress(material, "uniaxial", self.stretch) - self.stress))
            / self.size
        )

    def moduli(
        self, law: type[Hyperelastic], names: Sequence[str], **fixed: float
    ) -> tuple[dict[str, float], float]:
        """({name: MPa}, relative error) of the best moduli >= 0 (any sign for those that the law says are
        `signed`), the rest `fixed`."""
        signs = [(name, 1.0) for name in names] + [(name, -1.0) for name in law.signed]
        columns = []
        for name, sign in signs:
            unit = unchecked(law, **{n: sign * (n == name) for n in names}, **fixed)
            columns.append(self.weight * nominal_stress(unit, "uniaxial", self.stretch))
        scale = np.linalg.norm(columns, axis=1)
        values, residual = nnls((np.array(columns) / scale[:, None]).T, self.weight * self.stress)
        values[values < 1e-6 * values.max()] = 0.0  # rounding, not a term
        found = dict.fromkeys(names, 0.0)
        for (name, sign), value in zip(signs, values / scale):
            found[name] += sign * float(value)
        return found, residual / self.size


def _moduli(law):
    """Names of the parameters in which its stress is linear."""
    return [f.name for f in fields(law) if f.name in law.parameters and f.metadata["unit"] == "MPa"]


def _ranges(law, tests):
    """{name: (low, high)} of its other parameters."""
    others = [name for name in law.parameters if name not in _moduli(law)]
    return {name: law.fit_range(name, tests.largest) for name in others}


def _searched(law, tests):
    """Moduli at the best of the other parameters, on a logarithmic scale."""
    ranges, names = _ranges(law, tests), _moduli(law)
    low, high = np.log(np.reshape([*ranges.values()], (-1, 2))).T

    def solve(x):
        others = dict(zip(ranges, np.exp(np.clip(x, low, high)).tolist()))
        moduli, error = tests.moduli(law, names, **others)
        return moduli | others, error

    x = min(product(*np.linspace(low, high, 60).T), key=lambda x: solve(x)[1])
    if ranges:
        x = minimize(lambda x: solve(x)[1], x, method="Nelder-Mead").x
    return solve(x)[0]


def _ogden(tests):
    """The fewest terms that fit within a tenth as well as three do."""

    def solve(exponents):
        a = np.clip(exponents, LOWEST_EXPONENT, HIGHEST_EXPONENT)
        a = np.where(np.abs(a) < 0.01, 0.01, a)
        names = [f"mu{p}" for p in range(1, len(a) + 1)]
        alphas = {f"alpha{p}": float(x) for p, x in enumerate(a, start=1)}
        moduli, error = tests.moduli(Ogden, names, **alphas)
        return moduli | alphas, error

    best = []
    for terms in (1, 2, 3):
        starts = sorted(combinations(EXPONENTS, terms), key=lambda a: solve(a)[1])[:3]
        found = [
            minimize(lambda a: solve(a)[1], a, method="Nelder-Mead", options={"maxiter": 400}).x
            for a in starts
        ]
        best.append(min((solve(a) for a in found), key=lambda one: one[1]))
    enough = 1.1 * min(error for _, error in best) + 1e-9
    return next(parameters for parameters, error in best if error <= enough)


def fit(law: str, tests: TensileData, **common: Any) -> Fit:
    """The Fit of one law to `TensileData`; `common`: density, name and the like. InputError when no usable
    law comes out."""
    cls = LAWS[law]
    found = _ogden(tests) if cls is Ogden else _searched(cls, tests)
    rounded: dict[str, Any] = {name: float(f"{value:.6g}") for name, value in found.items()}
    material = cls(**rounded, **common)
    return Fit(material, tests.error(material), tuple(_warnings(material, tests)))


def _warnings(material, tests):
    error, reach = tests.error(material), tests.largest
    if reach < 1.3:
        yield f"the test reaches only {100 * (reach - 1):.0f} % strain: everything beyond is a guess"
    if error > 0.05:
        yield (
            f"the stress is off by {100 * error:.0f} % (root mean square): this law does not have the curve's"
            " shape"
        )
    early = tests.stretch <= min(1.5, 1 + 0.5 * (reach - 1))
    if early.sum() >= 3:
        measured, told = (
            tests.stress[early].sum(),
            nominal_stress(material, "uniaxial", tests.stretch[early]).sum(),
        )
        if abs(told / measured - 1) > 0.15:
            yield (
                f"up to {100 * (tests.stretch[early].max() - 1):.0f} % strain the law is"
                f" {abs(100 * (told / measured - 1)):.0f} % too {'stiff' if told > measured else 'soft'},"
                " where a robot mostly works: fit to less strain"
            )
    law = type(material)
    for name in material.parameters:
        value = getattr(material, name)
        if law is Ogden:
            if name.startswith("alpha") and value and not LOWEST_EXPONENT < value < HIGHEST_EXPONENT:
                yield f"{name} = {value:g} came out at its bound"
        elif name in _moduli(law):
            if value == 0 and name not in law.signed:
                yield f"{name} came out at its bound 0: the test does not ask for it"
        elif value > 0.9 * law.fit_range(name, reach)[1]:
            yield f"{name} came out at its bound: the test shows no stiffening, take the neo-Hookean law"
    stretch = min(2.0, reach)
    ratio = nominal_stress(material, "equibiaxial", stretch) / nominal_stress(material, "uniaxial", stretch)
    if not ratio < LARGEST_RATIO:
        yield (
            f"unlikely in equibiaxial: {ratio:.2g} times the uniaxial stress at stretch {stretch:.2g}, where"
            " rubbers have 1.1 to 2"
        )
    for mode in MODES:
        limit = stable_stretch(material, mode, 1.5 * reach)
        if limit < np.inf:
            where = (
                "inside the test's range"
                if limit <= reach
                else f"just outside the test's range (stretch {reach:.3g})"
            )
            yield f"unstable in {mode} from stretch {limit:.3g} on, {where}"


def biaxial_spread(fits: Iterable[Fit], stretch: float) -> tuple[float, float]:
    """(lowest, highest) equibiaxial nominal stress (MPa) that the fitted laws predict at this stretch; inf
    where all have locked."""
    values = [float(nominal_stress(f.material, "equibiaxial", stretch)) for f in fits]
    known = [v for v in values if np.isfinite(v)] or [np.inf]
    return min(known), max(known)
