"""Uniaxial tensile tests from CSV files: nominal stress against stretch, loading up to break.

The header row is the first one that names a strain (or stretch) and a stress column; what stands above it is
skipped. Units come from the header ("strain_percent", "Engineering Stress (MPa)"). Several specimens may
stand beside each other, each stress column taking the nearest strain column on its left, or below each other,
each starting again from small strain.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.units import MPA_PER_KPA

STRESS_UNITS = {"mpa": 1.0, "n/mm2": 1.0, "n/mm^2": 1.0, "kpa": MPA_PER_KPA, "pa": 1e-6, "psi": 0.006894757}
#: more strain than this, without a unit, is taken for percent by no one but the user
LARGEST_STRAIN = 25.0


@dataclass(frozen=True)
class Specimen:
    """stretch (n,) rising from 1, nominal stress (n,) in MPa; broke: whether the file shows the stress fall
    after it."""

    stretch: np.ndarray
    stress: np.ndarray
    broke: bool


def read_tensile(path: str | Path, stress_unit: str | None = None) -> list[Specimen]:
    """List of Specimen; stress_unit ("kPa", ...) serves where the header names none. InputError for anything
    unclear."""
    rows = _rows(path)
    top = next((i for i, row in enumerate(rows) if _columns(row)), None)
    if top is None:
        raise InputError(
            f"{path}: no header with a strain (or stretch) and a stress column, as in"
            " 'strain_percent,stress_MPa'"
        )
    header, below, specimens = rows[top], rows[top + 1 :], []
    for strain_column, stress_column in _columns(header):
        name = header[strain_column]
        x = _numbers(below, strain_column, path) * (0.01 if _is_percent(name) else 1.0)
        y = _numbers(below, stress_column, path) * _stress_factor(header[stress_column], stress_unit, path)
        known = np.isfinite(x) & np.isfinite(y)
        strain = x[known] - (1.0 if "stretch" in name.lower() else 0.0)
        if len(strain) and strain.max() > LARGEST_STRAIN:
            raise InputError(
                f"{path}: '{name}' reaches {strain.max():g}: if these are percent, name the column"
                " strain_percent"
            )
        specimens += _specimens(strain, y[known])
    if not specimens:
        raise InputError(f"{path}: fewer than 5 points of loading with strain and stress above 0")
    return specimens


def _rows(path):
    try:
        with open(path, newline="", encoding="utf-8-sig") as stream:
            text = stream.read()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text ({error})") from None
    delimiter = max(";\t,", key=text.count)
    if delimiter != ",":  # then a comma is a decimal point
        text = re.sub(r"(?<=\d),(?=\d)", ".", text)
    return list(csv.reader(text.splitlines(), delimiter=delimiter))


def _columns(row):
    """[(strain column, stress column)] of a header row; true strains and stresses are passed over."""
    pairs, strain = [], None
    for i, cell in enumerate(row):
        name = cell.lower()
        if re.search(r"\btrue\b|cauchy", name.replace("_", " ")):
            continue
        if re.search("strain|stretch|elongation", name):
            strain = i
        elif "stress" in name and strain is not None:
            pairs.append((strain, i))
    return pairs


def _is_percent(name):
    return "%" in name or "percent" in name.lower()


def _stress_factor(name, unit, path):
    words = re.split(r"[\s_()\[\],]+", name.lower())
    found = [w for w in words if w in STRESS_UNITS] or ([unit.lower()] if unit else [])
    if not found or found[0] not in STRESS_UNITS:
        raise InputError(
            f"{path}: '{name}' names no unit of stress: write for instance stress_MPa, or give"
            " --stress-unit MPa"
        )
    return STRESS_UNITS[found[0]]


def _numbers(rows, column, path):
    """Column as floats, nan for empty cells."""
    out = np.full(len(rows), np.nan)
    for k, row in enumerate(rows):
        if column < len(row) and row[column].strip():
            try:
                out[k] = float(row[column])
            except ValueError:
                raise InputError(f"{path}: '{row[column]}' is not a number") from None
    return out


def _specimens(strain, stress):
    """Cut at every return to less than a tenth of the strain reached, keep the loading part of each."""
    reached = 0.0
    starts = [0]
    for k, value in enumerate(strain):
        if reached > 0.05 and value < 0.1 * reached and stress[k] <= 0.5 * stress[starts[-1] : k].max():
            starts.append(k)
            reached = 0.0
        reached = max(reached, value)
    return [
        s
        for s in (_loading(strain[a:b], stress[a:b]) for a, b in zip(starts, [*starts[1:], len(strain)]))
        if s
    ]


def _loading(strain, stress):
    """The Specimen up to its largest stress if the stress falls to less than 0.8 of it afterwards, else to
    its largest strain."""
    if len(strain) == 0:
        return None
    top = int(np.argmax(stress))
    broke = bool(len(stress) > top + 1 and stress[top + 1 :].min() < 0.8 * stress[top])
    end = (top if broke else int(np.argmax(strain))) + 1
    strain, stress = strain[:end], stress[:end]
    keep = (strain > 0) & (stress > 0)
    return Specimen(1 + strain[keep], stress[keep], broke) if keep.sum() >= 5 else None
