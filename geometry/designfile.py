"""design.toml: a manipulator, its pressure and where its base stands, complete and re-runnable."""

from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import InputError, located
from pneunet.base.files.atomic import write_text
from pneunet.base.files.kinds import DESIGN, read_tables
from pneunet.base.files.toml import (
    array,
    as_table,
    from_table,
    refuse_unknown,
    to_table,
    toml_text,
)
from pneunet.base.materials.laws import Hyperelastic, material_from_table, material_to_table
from pneunet.base.quantities import Checked, quantities, quantity, rounded, shown
from pneunet.base.units import KPA_PER_MPA, LARGEST_PRESSURE_KPA
from pneunet.geometry.fillets import NO_GRID, refuse_fillets
from pneunet.geometry.loading import CONTACTS, CONTROL_KEYS, Control, DeadLoads, Extras, read_control
from pneunet.geometry.meshfile import ELEMENTS, USUAL_ELEMENT
from pneunet.geometry.parameters import NO_CHAMBERS, OF_CHAMBERS, PASSIVE, PLAIN, Manipulator, Segment

SCHEMA = "pneunet-design-1"
#: coordinates of a base, mm: at a kilometre a rounding is still far below a tolerance
FARTHEST = 1e6


@dataclass(frozen=True)
class DesignFile(Checked):
    """What the commands mesh, shape and solve read.

    pressure in MPa: one for all, or a tuple of one for each group of segments; base_pose (4, 4): the base
    frame in the target's coordinates (mm); mesh_size in mm; element: hexahedra of a grid or tetrahedra of
    gmsh's; target: text that names the target file; result: free table of what `pneunet design` adds, for
    people: its split and active bounds alone are read back. control, measure and contact ('auto': walls of
    neighbouring chambers that touch are held apart; 'none': they are not) are for the finite elements alone;
    a pressure of 0 everywhere goes with loads only.
    """

    manipulator: Manipulator
    pressure: float | tuple[float, ...] = quantity("kPa")
    name: str = quantity(None, "design")
    base_pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    mesh_size: float = quantity("mm", 1.5, low=0.1, high=20)
    element: str = quantity(None, USUAL_ELEMENT, choices=tuple(ELEMENTS))
    target: str = quantity(None, "")
    result: dict = field(default_factory=dict)
    loads: DeadLoads = DeadLoads()
    control: Control = Control()
    measure: Extras = Extras()
    contact: str = quantity(None, CONTACTS[0], choices=CONTACTS)

    def __post_init__(self) -> None:
        super().__post_init__()
        each = self.pressure if isinstance(self.pressure, tuple) else (self.pressure,)
        object.__setattr__(self, "pressure", each[0] if len(each) == 1 else each)
        for pressure in each:
            known = isinstance(pressure, Real)
            if not known or not 0 <= rounded(pressure * KPA_PER_MPA) <= LARGEST_PRESSURE_KPA:
                told = f"{pressure * KPA_PER_MPA:g}" if known else shown(pressure)
                raise InputError(f"pressure_kPa = {told} must lie in 0..{LARGEST_PRESSURE_KPA:g} kPa")
        self.manipulator.pressures(self.pressure)
        if self.element == "hexahedra":
            refuse_fillets(self.manipulator.segments, NO_GRID)
        if self.largest_pressure == 0 and not self.loads:
            raise InputError("pressure_kPa = 0 leaves nothing to solve: give a pressure, or [loads]")

    @property
    def largest_pressure(self) -> float:
        """That of the group with the largest, MPa: what "the pressure" of a body with several means."""
        return float(np.max(self.pressure))

    @property
    def shares(self) -> tuple[float, ...]:
        """(groups,) each pressure over the largest; all 1 where all are 0."""
        each, largest = np.broadcast_to(self.pressure, len(self.manipulator.groups)), self.largest_pressure
        return tuple((each / largest).tolist()) if largest else (1.0,) * len(each)

    def scaled(self, largest: float) -> float | tuple[float, ...]:
        """The pressures in the same proportions, the largest of them `largest` (MPa)."""
        if not isinstance(self.pressure, tuple):
            return largest
        return tuple(largest * share for share in self.shares)


TABLES = ("material", "layer_material", "segment", "base", "result", "loads", "measure")
KEYS = ("schema", *quantities(DesignFile), *CONTROL_KEYS, *TABLES)


def read_design_file(path: str | Path) -> DesignFile:
    """The DesignFile in a TOML file; InputError with file, table and key otherwise."""
    return design_from_tables(read_tables(path, DESIGN), str(path))


def design_from_tables(data: dict, path: str) -> DesignFile:
    """The DesignFile in the tables of a design.toml; `path` is what errors call them."""
    refuse_unknown(data, KEYS, path)
    if data.get("schema", SCHEMA) != SCHEMA:
        raise InputError(f"{path}: schema = '{data['schema']}' is not '{SCHEMA}'")
    for key in ("pressure_kPa", "material", "segment"):
        if key not in data:
            raise InputError(f"{path}: key '{key}' is missing")
    if not isinstance(data["segment"], list):
        raise InputError(f"{path}: segments are written [[segment]], with double brackets")
    materials = [
        material_from_table(data[key], f"{path} [{key}]") if key in data else None
        for key in ("material", "layer_material")
    ]
    segments = [
        segment_from_table(row, f"{path} [[segment]] {i}", *materials)
        for i, row in enumerate(data["segment"], start=1)
    ]
    with located(path):
        manipulator = Manipulator(tuple(segments))
    return from_table(
        DesignFile,
        {key: data[key] for key in quantities(DesignFile) if key in data},
        path,
        manipulator=manipulator,
        base_pose=_base_pose(data.get("base", {}), f"{path} [base]"),
        result=as_table(data.get("result", {}), f"{path} [result]"),
        loads=from_table(DeadLoads, data.get("loads", {}), f"{path} [loads]"),
        control=read_control(data, path),
        measure=from_table(Extras, data.get("measure", {}), f"{path} [measure]"),
    )


def segment_from_table(
    row: dict, where: str, material: Hyperelastic | None, layer_material: Hyperelastic | None = None
) -> Segment:
    """The Segment in a TOML table, its materials the ones given unless it has its own."""
    row = as_table(row, where)
    refuse_unknown(row, [*quantities(Segment), "material", "layer_material"], where)
    if row.get("kind") == PASSIVE:
        of_chambers = [key for key in OF_CHAMBERS if key in row]
        if of_chambers:
            raise InputError(f"{where}: {', '.join(of_chambers)}: {NO_CHAMBERS}")
        row |= {"angle_deg": PLAIN["angle"], "chambers": PLAIN["chambers"]}
    own = row.pop("material", None)
    if own is not None:
        material = material_from_table(own, f"{where} material")
    own = row.pop("layer_material", None)
    if own is not None:
        layer_material = material_from_table(own, f"{where} layer_material")
    elif not row.get("layer_thickness_mm"):
        layer_material = None
    return from_table(Segment, row, where, material=material, layer_material=layer_material)


def _base_pose(table, where):
    refuse_unknown(table, ["origin_mm", "rotation"], where)
    pose = np.eye(4)
    for key, shape, part in (("origin_mm", (3,), pose[:3, 3]), ("rotation", (3, 3), pose[:3, :3])):
        if key in table:
            part[...] = array(table[key], key, where, f"numbers of shape {shape}", shape)
            if (abs(part) > FARTHEST).any():
                raise InputError(f"{where}: '{key}' must be numbers up to {FARTHEST:g} in size")
    if not se3.is_pose(pose):
        raise InputError(f"{where}: 'rotation' is not a rotation matrix")
    return pose


def design_tables(design: DesignFile) -> dict:
    """The nested tables of design.toml; a segment's material is written only where it differs from the first
    one's, a layer's with every layer."""
    first = design.manipulator.segments[0].material
    rows = body_tables(design.manipulator)
    for row, segment in zip(rows, design.manipulator.segments):
        if segment.material == first:
            del row["material"]
    tables = {"schema": SCHEMA} | to_table(design) | design.control.table()
    for key, usual in (("target", ""), ("contact", CONTACTS[0])):
        if tables[key] == usual:
            del tables[key]
    tables["material"] = material_to_table(first)
    tables["segment"] = rows
    tables["base"] = {"origin_mm": design.base_pose[:3, 3], "rotation": design.base_pose[:3, :3]}
    measure = to_table(design.measure)
    others = {"loads": design.loads.table(), "measure": measure if any(measure.values()) else {}}
    return tables | {key: table for key, table in (others | {"result": design.result}).items() if table}


def body_tables(manipulator: Manipulator) -> list[dict]:
    """What a solution belongs to: every dimension and material of every segment, in file units."""
    rows = []
    for segment in manipulator.segments:
        row = segment_table(segment) | {"material": material_to_table(segment.material)}
        if segment.layer_material is not None:
            row["layer_material"] = material_to_table(segment.layer_material)
        rows.append(row)
    return rows


def segment_table(segment: Segment) -> dict:
    """Every dimension of a segment that counts, in file units; no material. What is as it is for most, no
    roll, no fillet and the first group, is not written."""
    table = to_table(segment)
    drop = OF_CHAMBERS if segment.kind == PASSIVE else ("plain_length_mm",)
    usual = {"roll_deg": 0, "pressure_group": 1, "fillet_mm": 0}
    return {k: v for k, v in table.items() if k not in drop and usual.get(k) != v}


def write_design_file(path: str | Path, design: DesignFile) -> None:
    """Write the DesignFile as TOML, complete: `read_design_file` reads it back."""
    write_text(path, toml_text(design_tables(design)))
