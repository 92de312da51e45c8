"""Uniaxial tensile tests from text files: nominal stress against stretch, first loading up to break.

A column is used only if its name says what it is. Units stand in the name ("strain_percent", "Engineering
Stress (MPa)") or in a row below it. Several specimens may stand beside each other, each stress column taking
the nearest strain column on its left, or below each other, each starting again from small strain.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.text import read_numbers_table
from pneunet.base.units import LENGTHS, MPA_PER_KPA

#: MPa
STRESS_UNITS = {
    "MPa": 1.0,
    "kPa": MPA_PER_KPA,
    "Pa": 1e-6,
    "GPa": 1e3,
    "N/mm2": 1.0,
    "N/cm2": 1e-2,
    "N/m2": 1e-6,
    "bar": 0.1,
    "kgf/cm2": 0.0980665,
    "kg/cm2": 0.0980665,
    "kgf/mm2": 9.80665,
    "psi": 0.006894757,
    "ksi": 6.894757,
}
RATIOS = {"%": 0.01, "percent": 0.01, "pct": 0.01, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0}
#: more strain than this, without a unit, is taken for percent by no one but the user
LARGEST_STRAIN = 25.0
#: columns of other things: true measures, spread about a mean, rates, single results
_PASSED_OVER = re.compile(
    r"\b(true|cauchy|log|logarithmic|hencky|sd|std|stdev|dev|deviation|error|err|sem|se|variance|var|cv|cov|ci"
    r"|lower|upper|min|minimum|max|maximum|rate|energy|modulus|at|ultimate)\b|±"
)
_OTHER_TESTS = {
    "compress": "compression",
    "shear": "shear",
    "biax": "biaxial tension",
    "planar": "planar tension",
}
_OTHER_TESTS |= {"flex": "bending", "bending": "bending", "torsion": "torsion"}


@dataclass(frozen=True)
class Specimen:
    """stretch (n,) rising from 1, nominal stress (n,) in MPa; broke: whether the file shows the stress fall
    after it."""

    stretch: np.ndarray
    stress: np.ndarray
    broke: bool


def read_tensile(
    path: str | Path, stress_unit: str | None = None, gauge_length: float | None = None
) -> list[Specimen]:
    """The specimens of a file. stress_unit ("kPa", ...) serves where the header names none. With gauge_length
    (mm) strains are elongations over it. InputError for anything unclear."""
    table = read_numbers_table(path)
    names = [f"{name[:80]} {unit[:20]}".strip() for name, unit in zip(table.header, table.units)]
    specimens = []
    for strain_column, stress_column in _pairs(path, names, gauge_length):
        name = names[strain_column]
        x = table.numbers(strain_column, gaps=True) * _strain_factor(name, gauge_length)
        y = table.numbers(stress_column, gaps=True) * _stress_factor(path, names[stress_column], stress_unit)
        known = np.isfinite(x) & np.isfinite(y)
        strain = x[known] - (1.0 if _kind(name) == "stretch" else 0.0)
        if len(strain) == 0:
            continue
        if strain.max() > LARGEST_STRAIN:
            raise InputError(
                f"{path}: '{name}' reaches {strain.max():g}: if these are percent, name the column"
                " strain_percent"
            )
        if strain.max() <= 0:
            raise InputError(f"{path}: '{name}' is nowhere above 0: only tension is fitted, no compression")
        specimens += _specimens(strain, y[known])
    if not specimens:
        raise InputError(f"{path}: fewer than 5 points of loading with strain and stress above 0")
    return specimens


def _pairs(path, names, gauge_length):
    """[(strain column, stress column)]: each stress with the nearest strain on its left, or the first."""
    kinds = [_kind(name) for name in names]
    wanted = ("length",) if gauge_length else ("strain", "stretch")
    strains = [i for i, kind in enumerate(kinds) if kind in wanted]
    stresses = [i for i, kind in enumerate(kinds) if kind == "stress"]
    if strains and stresses:
        pairs = [(max((s for s in strains if s < i), default=strains[0]), i) for i in stresses]
        named = [(strain, names[i]) for strain, i in pairs]
        twice = next((name for strain, name in named if named.count((strain, name)) > 1), None)
        if twice:
            raise InputError(f"{path}: two columns '{twice}' for one strain: rename or delete one")
        return pairs
    if gauge_length and stresses:
        raise InputError(f"{path}: a gauge length is given, but no column of lengths, as 'elongation_mm'")
    for name, kind in zip(names, kinds):
        if kind in _OTHER_TESTS.values():
            raise InputError(f"{path}: '{name}' is of a test in {kind}: only uniaxial tension is fitted")
        if kind == "length" and stresses:
            raise InputError(f"{path}: '{name}' is a length, not a strain: give --gauge-length-mm")
        if kind == "unclear" and stresses:
            raise InputError(f"{path}: '{name}' names no unit: write strain_percent, or elongation_mm")
    raise InputError(
        f"{path}: no header with a strain (or stretch) and a stress column, as in 'strain_percent,stress_MPa'"
    )


def _kind(name):
    """What a column holds: "strain", "stretch", "stress", "length", "unclear", a key's value of _OTHER_TESTS,
    or None."""
    words = _words(name)
    stress, strain, stretch = (
        "stress" in words,
        "strain" in words,
        re.search("stretch|extension ratio", words),
    )
    if _PASSED_OVER.search(words) or (stress and strain):
        return None
    other = next((test for word, test in _OTHER_TESTS.items() if re.search(rf"\b{word}", words)), None)
    if other or stress:
        return other or "stress"
    if not (strain or stretch or re.search("elongation|extension|displacement", words)):
        return None
    if _unit(name, RATIOS | LENGTHS) in LENGTHS:
        return "length"
    if stretch or strain:
        return "stretch" if stretch else "strain"
    return "strain" if _unit(name, RATIOS) else "unclear"


def _words(name):
    """A column's name in small letters, one space between words and none around the slash of a unit."""
    plain = name.lower().replace("_", " ").replace("%", " % ").replace("²", "2").replace("^", "")
    return " ".join(re.sub(r"\s+per\s+|\s*/\s*", "/", plain.replace("per cent", "percent")).split())


def _unit(name, known):
    """The key of `known` that a name ends in or has in brackets, "quantity/unit" included; None without."""
    keys = {key.lower(): key for key in known}
    tokens = re.split(r"[\s()\[\],;:]+", _words(name))
    last = [t for t in tokens if t][-1:]
    for token in [*reversed(tokens), *last]:
        for one in (token, token.partition("/")[2]):
            if one in keys and (one != "in" or [token] == last):  # "in" is a word, too
                return keys[one]
    return None


def _strain_factor(name, gauge_length):
    if gauge_length:
        return LENGTHS[_unit(name, LENGTHS)] / gauge_length
    return RATIOS.get(_unit(name, RATIOS), 1.0)


def _stress_factor(path, name, given):
    unit = _unit(name, STRESS_UNITS) or _unit(given or "", STRESS_UNITS)
    if unit is None:
        where = f"--stress-unit {given}" if given else f"'{name}'"
        raise InputError(
            f"{path}: {where} names no unit of stress: write for instance stress_MPa, or give --stress-unit"
            f" MPa; known are {', '.join(STRESS_UNITS)}"
        )
    return STRESS_UNITS[unit]


def _specimens(strain, stress):
    """Pulls of one strip follow each other through its unloading; after a break or a jump back comes another
    strip."""
    starts, jumped, reached = [0], [True], 0.0
    for k in range(1, len(strain)):
        reached = max(reached, strain[k - 1])
        jumps = strain[k - 1] >= 0.9 * reached and strain[k] < 0.5 * reached
        if reached > 0.05 and (jumps or strain[k] < 0.1 * reached):
            starts.append(k)
            jumped.append(jumps)
            reached = 0.0
    whole = False
    strips: list[tuple[list[slice], list[bool]]] = []
    for a, b, jumps in zip(starts, [*starts[1:], len(strain)], jumped):
        end, broke = _loading_end(strain[a:b], stress[a:b])
        if jumps or not whole:
            strips.append(([], []))
        whole = not broke
        strips[-1][0].append(slice(a, a + end))
        strips[-1][1].append(broke)
    found = [_first_loading(strain, stress, *strip) for strip in strips]
    return [specimen for specimen in found if specimen]


def _loading_end(strain, stress):
    """(end, broke): a break is a fall to less than half the largest stress without unloading."""
    top = int(np.argmax(stress))
    broke = bool(np.any((stress[top:] < 0.5 * stress[top]) & (strain[top:] >= 0.95 * strain[top])))
    return (top if broke else int(np.argmax(strain))) + 1, broke


def _first_loading(strain, stress, pulls, broke):
    """The Specimen of points beyond all strain before, as every later pull is softer up to there; None for
    fewer than 5."""
    strain, stress = (np.concatenate([x[pull] for pull in pulls]) for x in (strain, stress))
    before = np.maximum.accumulate(np.concatenate([[0.0], strain[:-1]]))
    keep = (strain > before) & (stress > 0)
    return Specimen(1 + strain[keep], stress[keep], any(broke)) if keep.sum() >= 5 else None
