"""design.toml: a manipulator, its pressure and where its base stands, complete and re-runnable."""

from dataclasses import asdict, dataclass, field

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_text
from pneunet.base.files.toml import (
    as_table,
    from_table,
    number,
    read_toml,
    refuse_unknown,
    to_table,
    toml_text,
)
from pneunet.base.materials.laws import material_from_table, material_to_table
from pneunet.geometry.loading import (
    CONTACTS,
    CONTROL_KEYS,
    Control,
    DeadLoads,
    Extras,
    read_contact,
    read_control,
    read_extras,
)
from pneunet.geometry.parameters import Manipulator, Segment

SCHEMA = "pneunet-design-1"
KEYS = [
    *(
        "schema",
        "name",
        "pressure_kPa",
        "mesh_size_mm",
        "target",
        "material",
        "layer_material",
        "segment",
        "base",
        "result",
    ),
    *("loads", "measure", "contact", *CONTROL_KEYS),
]


@dataclass(frozen=True)
class Design:
    """What the commands mesh, shape and solve read.

    pressure in MPa; base_pose (4, 4): the base frame in the target's coordinates (mm); mesh_size in mm;
    target: text that names the target file; result: free table of numbers that `pneunet design` adds and
    nobody reads back. loads, control, measure and contact ('auto': walls of neighbouring chambers that touch
    are held apart; 'none': they are not) are for the finite elements alone; a pressure of 0 goes with loads
    only.
    """

    manipulator: Manipulator
    pressure: float
    name: str = "design"
    base_pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    mesh_size: float = 2.0
    target: str = ""
    result: dict = field(default_factory=dict)
    loads: DeadLoads = DeadLoads()
    control: Control = Control()
    measure: Extras = Extras()
    contact: str = CONTACTS[0]


def read_design(path):
    """The Design in a TOML file; InputError with file, table and key otherwise."""
    return design_from_tables(read_toml(path), str(path))


def design_from_tables(data, path):
    """The Design in the tables of a design.toml; `path` is what errors call them."""
    refuse_unknown(data, KEYS, str(path))
    if data.get("schema", SCHEMA) != SCHEMA:
        raise InputError(f"{path}: schema = '{data['schema']}' is not '{SCHEMA}'")
    for key in ("pressure_kPa", "material", "segment"):
        if key not in data:
            raise InputError(f"{path}: key '{key}' is missing")
    pressure = number(data["pressure_kPa"], "pressure_kPa", str(path))
    loads = from_table(DeadLoads, as_table(data.get("loads", {}), f"{path} [loads]"), f"{path} [loads]")
    if not 0 <= pressure <= 2000:
        raise InputError(f"{path}: pressure_kPa = {pressure:g} must lie in 0..2000 kPa")
    if pressure == 0 and not loads:
        raise InputError(f"{path}: pressure_kPa = 0 leaves nothing to solve: give a pressure, or [loads]")
    mesh_size = number(data.get("mesh_size_mm", 2.0), "mesh_size_mm", str(path))
    if not 0.1 <= mesh_size <= 20:
        raise InputError(f"{path}: mesh_size_mm = {mesh_size:g} must lie in 0.1..20 mm")
    material = material_from_table(data["material"], f"{path} [material]")
    layer_material = (
        material_from_table(data["layer_material"], f"{path} [layer_material]")
        if "layer_material" in data
        else None
    )
    if not isinstance(data["segment"], list):
        raise InputError(f"{path}: segments are written [[segment]], with double brackets")
    segments = []
    for i, row in enumerate(data["segment"], start=1):
        segments.append(segment_from_table(row, f"{path} [[segment]] {i}", material, layer_material))
    try:
        manipulator = Manipulator(tuple(segments))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return Design(
        manipulator,
        pressure * 1e-3,
        name=str(data.get("name", "design")),
        base_pose=_base_pose(data.get("base", {}), f"{path} [base]"),
        mesh_size=float(mesh_size),
        target=str(data.get("target", "")),
        result=as_table(data.get("result", {}), f"{path} [result]"),
        loads=loads,
        control=read_control(data, str(path)),
        measure=read_extras(data.get("measure", {}), f"{path} [measure]"),
        contact=read_contact(data, str(path)),
    )


def segment_from_table(row, where, material, layer_material=None):
    """The Segment in a TOML table, its materials the ones given unless it has its own."""
    row = as_table(row, where)
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
            try:
                value = np.array(table[key], float)
            except (TypeError, ValueError):
                value = np.empty(0)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(f"{where}: '{key}' must be numbers of shape {shape}")
            part[...] = value
    if abs(pose[:3, :3].T @ pose[:3, :3] - np.eye(3)).max() > 1e-6 or np.linalg.det(pose[:3, :3]) < 0:
        raise InputError(f"{where}: 'rotation' is not a rotation matrix")
    return pose


def design_tables(design):
    """The nested tables of design.toml; a segment's material is written only where it differs from the first
    one's, a layer's with every layer."""
    first = design.manipulator.segments[0].material
    rows = []
    for s in design.manipulator.segments:
        row = to_table(s)
        if s.material != first:
            row["material"] = material_to_table(s.material)
        if s.layer_material is not None:
            row["layer_material"] = material_to_table(s.layer_material)
        rows.append(row)
    tables = {
        "schema": SCHEMA,
        "name": design.name,
        "pressure_kPa": float(f"{design.pressure * 1e3:.12g}"),
        "mesh_size_mm": design.mesh_size,
    }
    tables |= design.control.table()
    if design.contact != CONTACTS[0]:
        tables["contact"] = design.contact
    if design.target:
        tables["target"] = design.target
    tables["material"] = material_to_table(first)
    tables["segment"] = rows
    tables["base"] = {"origin_mm": design.base_pose[:3, 3], "rotation": design.base_pose[:3, :3]}
    if design.loads:
        tables["loads"] = design.loads.table()
    if any(asdict(design.measure).values()):
        tables["measure"] = asdict(design.measure)
    if design.result:
        tables["result"] = design.result
    return tables


def body_tables(manipulator):
    """What a solution belongs to: every dimension and material of every segment, in file units."""
    layers = [
        {} if s.layer_material is None else {"layer_material": material_to_table(s.layer_material)}
        for s in manipulator.segments
    ]
    return [
        {**to_table(s), "material": material_to_table(s.material), **layer}
        for s, layer in zip(manipulator.segments, layers)
    ]


def write_design(path, design):
    write_text(path, toml_text(design_tables(design)))
