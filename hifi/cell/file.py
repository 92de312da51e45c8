"""CELL.toml: the case of a unit cell that `pneunet cell` and studies solve."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pneunet.base.errors import InputError
from pneunet.base.files.toml import as_table, number, read_toml, refuse_unknown, to_table
from pneunet.base.materials.laws import material_from_table, material_to_table
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.designfile import segment_from_table
from pneunet.geometry.parameters import Segment
from pneunet.hifi.contact.medium import ThirdMedium
from pneunet.hifi.contact.penalty import WallPenalty

STRAINS = ("e1", "e2", "e3", "k1_per_mm", "k2_per_mm", "k3_per_mm")
CONTROLS = ("pressure", "volume")
KEYS = (
    *("pressure_kPa", "mesh_size_mm", "levels", "control", "volume_factor", "contact", "graded"),
    *("material", "layer_material", "segment", "held"),
)
CONTACTS = ("auto", "third-medium", "none")
#: size at the body's edges of a graded mesh, over its mesh_size
EDGE = 0.2


@dataclass(frozen=True)
class CellCase:
    """What CELL.toml says: pressure in MPa, mesh_size in mm, levels equal pressure steps at which the state
    is recorded.

    held: {index of (e, k): prescribed value, 1/mm for k}; reached from the free state at the top pressure.
    control: 'pressure', or 'volume', which walks through a limit point of the pressure up to `volume_factor`
    times the volume at rest. contact: 'auto': walls that touch are held apart by the `penalty`;
    'third-medium': by the `medium` in the gap; 'none': they pass through each other. graded: elements shrink
    to mesh_size * EDGE at the body's edges, where stresses are singular.
    """

    segment: Segment
    pressure: float
    mesh_size: float = 1.5
    levels: int = 10
    held: dict = field(default_factory=dict)
    control: str = "pressure"
    volume_factor: float = 2.0
    contact: str = "auto"
    penalty: WallPenalty = WallPenalty()
    medium: ThirdMedium = ThirdMedium()
    graded: bool = False


def read_cell(path: str | Path) -> CellCase:
    """The CellCase in a TOML file; InputError with file, table and key otherwise."""
    return cell_from_tables(read_toml(path), str(path))


def cell_from_tables(data: dict[str, Any], where: str) -> CellCase:
    """The CellCase in the tables of a CELL.toml; `where` is what errors call them."""
    refuse_unknown(data, KEYS, where)
    for key in ("material", "segment"):
        if key not in data:
            raise InputError(f"{where}: key '{key}' is missing")
    control = data.get("control", "pressure")
    if control not in CONTROLS:
        raise InputError(f"{where}: control = {control!r} is not known: write 'pressure' or 'volume'")
    contact = data.get("contact", CellCase.contact)
    if contact not in CONTACTS:
        raise InputError(
            f"{where}: contact = {contact!r} is not known: write 'auto', 'third-medium' or 'none'"
        )
    if contact == "third-medium" and control == "volume":
        raise InputError(f"{where}: contact = 'third-medium' goes with control = 'pressure'")
    graded = data.get("graded", CellCase.graded)
    if not isinstance(graded, bool):
        raise InputError(f"{where}: graded = {graded!r} must be true or false")
    if control == "pressure" and "pressure_kPa" not in data:
        raise InputError(f"{where}: key 'pressure_kPa' is missing")

    def ranged(key, default, low, high, integer=False):
        value = number(data.get(key, default), key, where, integer=integer)
        if not low <= value <= high:
            raise InputError(f"{where}: {key} = {value:g} must lie in {low:g}..{high:g}")
        return value

    pressure = ranged("pressure_kPa", 1.0, 1e-3, 2000) / KPA_PER_MPA
    mesh_size = ranged("mesh_size_mm", CellCase.mesh_size, 0.1, 20)
    levels = ranged("levels", CellCase.levels, 1, 1000, integer=True)
    volume_factor = ranged("volume_factor", CellCase.volume_factor, 1.001, 100)
    held_table = as_table(data.get("held", {}), f"{where} [held]")
    refuse_unknown(held_table, STRAINS, f"{where} [held]")
    held = {
        STRAINS.index(key): float(number(value, key, f"{where} [held]")) for key, value in held_table.items()
    }
    if held and control == "volume":
        raise InputError(f"{where}: [held] strains go with control = 'pressure'")
    row = as_table(data["segment"], f"{where} [segment]")
    row.setdefault("chambers", 1)
    material, layer_material = (
        material_from_table(data[key], f"{where} [{key}]") if key in data else None
        for key in ("material", "layer_material")
    )
    segment = segment_from_table(row, f"{where} [segment]", material, layer_material)
    return CellCase(
        segment,
        pressure,
        float(mesh_size),
        levels,
        held,
        control,
        float(volume_factor),
        contact,
        graded=graded,
    )


def cell_tables(case: CellCase) -> dict[str, Any]:
    """The complete tables of a CellCase, which cell_from_tables reads back."""
    segment = case.segment
    tables = {
        "pressure_kPa": float(f"{case.pressure * KPA_PER_MPA:.12g}"),
        "mesh_size_mm": case.mesh_size,
        "levels": case.levels,
        "control": case.control,
        "volume_factor": case.volume_factor,
        "contact": case.contact,
        "graded": case.graded,
        "material": material_to_table(segment.material),
        "segment": to_table(segment),
        "held": {STRAINS[i]: value for i, value in case.held.items()},
    }
    if segment.layer_material is not None:
        tables["layer_material"] = material_to_table(segment.layer_material)
    return tables
