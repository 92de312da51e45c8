"""CELL.toml: the case of a unit cell that `pneunet cell` and studies solve."""

from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any

from pneunet.base.errors import InputError
from pneunet.base.files.kinds import CELL, read_tables
from pneunet.base.files.toml import as_table, from_table, refuse_unknown, to_table
from pneunet.base.materials.laws import material_from_table, material_to_table
from pneunet.base.quantities import Checked, quantities, quantity
from pneunet.base.units import LARGEST_PRESSURE_KPA, MPA_PER_KPA
from pneunet.geometry.designfile import segment_from_table, segment_table
from pneunet.geometry.meshfile import ELEMENTS, USUAL_ELEMENT
from pneunet.geometry.parameters import KINDS, Segment
from pneunet.hifi.contact.medium import ThirdMedium
from pneunet.hifi.contact.penalty import WallPenalty

#: size at the body's edges of a graded mesh, over its mesh_size
EDGE = 0.2


@dataclass(frozen=True)
class Held(Checked):
    """Strains of the section frame that are prescribed; None: free."""

    e1: float | None = quantity(None, None, low=0.2, high=5, hint="it is a stretch, 1 at rest")
    e2: float | None = quantity(None, None, low=-2, high=2)
    e3: float | None = quantity(None, None, low=-2, high=2)
    k1: float | None = quantity("per_mm", None, low=-2, high=2)
    k2: float | None = quantity("per_mm", None, low=-2, high=2)
    k3: float | None = quantity("per_mm", None, low=-2, high=2)


STRAINS = tuple(quantities(Held))


@dataclass(frozen=True)
class CellCase(Checked):
    """What CELL.toml says: pressure in MPa, mesh_size in mm, levels equal pressure steps at which the state
    is recorded.

    held: {index of (e, k): prescribed value, 1/mm for k}; reached from the free state at the top pressure.
    control: 'pressure', or 'volume', which walks through a limit point of the pressure up to `volume_factor`
    times the volume at rest. contact: 'auto': walls that touch are held apart by the `penalty`;
    'third-medium': by the `medium` in the gap; 'none': they pass through each other. graded: elements shrink
    to mesh_size * EDGE at the body's edges, where stresses are singular; of hexahedra there is one layer of
    this thickness on each side of the planes in which those edges lie. element: hexahedra of a sheared
    grid, or gmsh's tetrahedra.
    """

    segment: Segment
    pressure: float = quantity("kPa", MPA_PER_KPA, low=1e-3, high=LARGEST_PRESSURE_KPA)
    mesh_size: float = quantity("mm", 1.5, low=0.1, high=20)
    levels: int = quantity(None, 10, low=1, high=1000)
    held: dict = field(default_factory=dict)
    control: str = quantity(None, "pressure", choices=("pressure", "volume"))
    volume_factor: float = quantity(None, 2.0, low=1.001, high=100)
    contact: str = quantity(None, "auto", choices=("auto", "third-medium", "none"))
    penalty: WallPenalty = WallPenalty()
    medium: ThirdMedium = ThirdMedium()
    graded: bool = quantity(None, False)
    element: str = quantity(None, USUAL_ELEMENT, choices=tuple(ELEMENTS))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.segment.kind not in KINDS:
            raise InputError(f"kind = '{self.segment.kind}': a cell is a pitch of chambers, which it has not")
        for key, usual, value in (
            ("roll_deg", 0, self.segment.roll),
            ("pressure_group", 1, self.segment.group),
        ):
            if value != usual:
                raise InputError(f"{key} = {value}: a cell is one by itself, in its own axes: leave it out")
        if self.control == "volume" and (self.held or self.contact == "third-medium"):
            what = "[held] strains go" if self.held else "contact = 'third-medium' goes"
            raise InputError(f"{what} with control = 'pressure'")


KEYS = (*quantities(CellCase), "material", "layer_material", "segment", "held")


def read_cell(path: str | Path) -> CellCase:
    """The CellCase in a TOML file; InputError with file, table and key otherwise."""
    return cell_from_tables(read_tables(path, CELL), str(path))


def cell_from_tables(data: dict[str, Any], where: str) -> CellCase:
    """The CellCase in the tables of a CELL.toml; `where` is what errors call them."""
    refuse_unknown(data, KEYS, where)
    for key in ("material", "segment", "pressure_kPa"):
        if key not in data and not (key == "pressure_kPa" and data.get("control") == "volume"):
            raise InputError(f"{where}: key '{key}' is missing")
    held = astuple(from_table(Held, data.get("held", {}), f"{where} [held]"))
    row = as_table(data["segment"], f"{where} [segment]")
    if row.get("kind") in KINDS:
        row.setdefault("chambers", 1)
    materials = [
        material_from_table(data[key], f"{where} [{key}]") if key in data else None
        for key in ("material", "layer_material")
    ]
    return from_table(
        CellCase,
        {key: data[key] for key in quantities(CellCase) if key in data},
        where,
        segment=segment_from_table(row, f"{where} [segment]", *materials),
        held={i: float(value) for i, value in enumerate(held) if value is not None},
    )


def cell_tables(case: CellCase) -> dict[str, Any]:
    """The complete tables of a CellCase, which cell_from_tables reads back."""
    segment = case.segment
    tables = to_table(case) | {
        "material": material_to_table(segment.material),
        "segment": segment_table(segment),
        "held": {STRAINS[i]: value for i, value in case.held.items()},
    }
    if segment.layer_material is not None:
        tables["layer_material"] = material_to_table(segment.layer_material)
    return tables
