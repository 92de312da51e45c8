"""CAMPAIGN.toml: which designs are computed on which meshes, spread out into the cases of hifi.runs.cases."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pneunet.base.errors import InputError, located
from pneunet.base.files.kinds import CAMPAIGN, read_tables
from pneunet.base.files.toml import as_table, from_table, number, refuse_unknown, to_table
from pneunet.base.materials.laws import material_to_table
from pneunet.base.quantities import Checked, quantities, quantity
from pneunet.base.system.processes import Limits
from pneunet.geometry.designfile import segment_table
from pneunet.geometry.meshfile import ELEMENTS, USUAL_ELEMENT
from pneunet.geometry.parameters import KINDS, Segment
from pneunet.hifi.runs.campaign.sample import PLACES, RANGES, prescribed_states, segments
from pneunet.hifi.runs.cases import Case, case_limits

FUNCTION = "hifi.campaign_case:solve_campaign_case"
#: index of the first edge design, and what their seed is more: both sequences can be extended
EDGES, EDGE_SEED = 100_000, 200


@dataclass(frozen=True)
class Numbers(Checked):
    """The numbers at the top of the file: how many designs, and up to which pressure (over mu) each is
    followed; limit_share: of a limit load's pressure, where that comes first."""

    designs: int = quantity(None, 250, low=0, high=EDGES)
    edge_designs: int = quantity(None, 0, low=0, high=EDGES)
    seed: int = quantity(None, 1, low=0, high=2**31)
    held_out_every: int = quantity(None, 5, low=2, high=1000)
    levels: int = quantity(None, 8, low=2, high=100)
    top_pressure: float = quantity(None, 0.3, key="top_pressure_over_mu", low=1e-3, high=10)
    limit_share: float = quantity(None, 0.9, low=0.1, high=0.99)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.designs and not self.edge_designs:
            raise InputError(f"designs = 0 must lie in 1..{EDGES} where edge_designs = 0")


KEYS = (*quantities(Numbers), "kinds", "further", "mesh", "ranges", "edge_ranges", "limits")


@dataclass(frozen=True)
class Mesh(Checked):
    """What meshes of cells are like: grids of hexahedra, with a layer of edge_size at planes where stresses
    are singular, or gmsh's tetrahedra, of edge_size at the body's edges. every: n-th designs, from the
    first, are computed on it, and further ones where it is 1.

    alike: on grids, all designs have the elements of hifi.runs.campaign.sample.typical, for which the sizes
    are then meant. levels: where they are not the campaign's. prescribed: states at prescribed strains of
    every prescribed_every-th of those. slopes, stiffness_slopes: whether the free states of designs that are
    not held out are differentiated by shape and stiffening, and their stiffness too. contact: whether walls
    that touch are held apart; else the path ends there.
    """

    name: str = quantity(None)
    mesh_size: float = quantity("mm", low=0.02, high=20)
    edge_size: float | None = quantity("mm", None, low=0.02, high=20)
    element: str = quantity(None, USUAL_ELEMENT, choices=tuple(ELEMENTS))
    alike: bool = quantity(None, False)
    levels: int | None = quantity(None, None, low=2, high=100)
    every: int = quantity(None, 1, low=1, high=10_000)
    prescribed: int = quantity(None, 0, low=0, high=PLACES)
    prescribed_every: int = quantity(None, 1, low=1, high=10_000)
    slopes: bool = quantity(None, False)
    stiffness_slopes: bool = quantity(None, False)
    contact: bool = quantity(None, True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.alike and self.element != "hexahedra":
            raise InputError(f"alike = true: {self.element} differ from design to design: take hexahedra")

    @property
    def settings(self) -> dict[str, Any]:
        """What makes the mesh, in file units."""
        sizes = {key: value for key, value in to_table(self).items() if key.endswith("_mm")}
        return sizes | {"element": self.element} | ({"alike": True} if self.alike else {})

    def prescribed_of(self, index: int) -> int:
        """How many prescribed states the design has."""
        return self.prescribed if index // self.every % self.prescribed_every == 0 else 0


@dataclass(frozen=True)
class SampledDesign:
    """One case: what is computed, and what the data set says about where it stands in the sample."""

    kind: str
    index: int
    mesh: Mesh
    held_out: bool
    segment: Segment
    case: Case


@dataclass(frozen=True)
class Campaign:
    """designs in the order of computing: by index, so that a campaign that is ended half way is a smaller
    one."""

    designs: tuple[SampledDesign, ...]
    kinds: tuple[str, ...]
    meshes: tuple[Mesh, ...]
    ranges: dict[str, dict[str, tuple[float, float]]]
    limits: Limits
    table: dict[str, Any]


def read_campaign(path: str | Path) -> Campaign:
    """The Campaign in a TOML file; InputError that names key and fix otherwise."""
    data, where = read_tables(path, CAMPAIGN), str(path)
    if not data:
        raise InputError(f"{where}: is empty: write at least designs = {Numbers.designs}")
    refuse_unknown(data, KEYS, where)

    kinds = data.get("kinds", list(KINDS))
    if not isinstance(kinds, list) or not kinds or any(kinds.count(k) > 1 or k not in KINDS for k in kinds):
        raise InputError(f"{where}: kinds = {kinds!r} must be a list of 'one-sided', 'twisting', each once")
    numbers = from_table(Numbers, {key: data[key] for key in quantities(Numbers) if key in data}, where)
    count, seed, table = numbers.designs, numbers.seed, asdict(numbers)
    common = {key: table[key] for key in ("levels", "top_pressure", "limit_share")}
    meshes = _meshes(data.get("mesh", [{"name": "coarse", "mesh_size_mm": 1.5}]), where)
    ranges = _ranges(data, "ranges", kinds, where, RANGES)
    edge_ranges = _ranges(data, "edge_ranges", kinds, where, ranges)
    further = _further(data, kinds, count, where)
    designs, places = [], max(m.prescribed for m in meshes)
    for kind in kinds:
        # (name of the ranges, those, places in the sequence, index of the first, seed, whether they are edge
        # designs)
        own = [*range(count), *further[kind]]
        sequences = (
            ("ranges", ranges, own, 0, seed, False),
            ("edge_ranges", edge_ranges, range(numbers.edge_designs), EDGES, seed + EDGE_SEED, True),
        )
        for name, box, positions, first, start, at_edges in sequences:
            size = max(positions, default=-1) + 1
            with located(f"{where} [{name}.{kind}]: they hold impossible bodies"):
                bodies = segments(kind, box[kind], size, start, at_edges)
            states = prescribed_states(kind, size, places, start)
            for position in positions:
                index = first + position
                judge = not at_edges and is_held_out(index, numbers.held_out_every)
                for mesh in meshes:
                    if mesh.every == 1 or index % mesh.every == 0 and index < count:
                        settings = common | {
                            "levels": mesh.levels or numbers.levels,
                            "slopes": mesh.slopes and not judge,
                            "stiffness_slopes": mesh.stiffness_slopes and not judge,
                            "apart": not mesh.contact,
                        }
                        case = _case(
                            kind,
                            index,
                            mesh,
                            bodies[position],
                            states[position][: mesh.prescribed_of(index)],
                            settings,
                        )
                        designs.append(SampledDesign(kind, index, mesh, judge, bodies[position], case))
    designs.sort(key=lambda d: d.index)
    table["further"] = {kind: len(indices) for kind, indices in further.items()}
    table["edge_ranges"] = {
        k: {name: r for name, r in edge_ranges[k].items() if r != ranges[k][name]} for k in kinds
    }
    return Campaign(tuple(designs), tuple(kinds), meshes, ranges, case_limits(data, where), table)


def on_offer(campaign: Campaign, kind: str, count: int) -> list[tuple[int, Segment]]:
    """[(index, Segment)] of the next `count` designs of the sample after a Campaign's that could be further
    ones: neither held out nor among its own."""
    start, known = campaign.table["designs"], {d.index for d in campaign.designs if d.kind == kind}
    bodies = segments(kind, campaign.ranges[kind], start + count, campaign.table["seed"])
    free = (
        i
        for i in range(start, start + count)
        if i not in known and not is_held_out(i, campaign.table["held_out_every"])
    )
    return [(i, bodies[i]) for i in free]


def is_held_out(index: int, every: int) -> bool:
    """Every n-th design, never the first: chosen by index alone, before anything is computed."""
    return index % every == every - 1


def _case(kind, index, mesh, segment, prescribed, common):
    inputs = {
        "segment": segment_table(segment),
        "material": material_to_table(segment.material),
        "mesh": mesh.settings,
        **common,
        "prescribed": [asdict(p) for p in prescribed],
    }
    # through JSON, so that inputs are what the record on disk will hold
    return Case(FUNCTION, json.loads(json.dumps(inputs)), f"{kind} {index} {mesh.name}")


def _meshes(rows, where):
    if not isinstance(rows, list) or not rows:
        raise InputError(f"{where}: meshes are written [[mesh]], with double brackets")
    meshes = [from_table(Mesh, row, f"{where} [[mesh]] {i}") for i, row in enumerate(rows, start=1)]
    if len({m.name for m in meshes}) < len(meshes):
        raise InputError(f"{where}: two [[mesh]] have the same name")
    return tuple(meshes)


def _further(data, kinds, count, where):
    """{kind: indices} of [further], designs of the sample beyond the first `count`."""
    where = f"{where} [further]"
    table = as_table(data.get("further", {}), where)
    refuse_unknown(table, kinds, where)
    for kind, indices in table.items():
        whole = isinstance(indices, list) and all(
            isinstance(i, int) and not isinstance(i, bool) for i in indices
        )
        if not whole or len(set(indices)) < len(indices) or any(not count <= i < EDGES for i in indices):
            raise InputError(
                f"{where}: {kind} must be a list of different whole numbers in {count}..{EDGES - 1}"
            )
    return {kind: table.get(kind, []) for kind in kinds}


def _ranges(data, name, kinds, where, default):
    """{kind: {variable: (low, high)}}: the default ones, replaced by [NAME.KIND]."""
    where = f"{where} [{name}]"
    table = as_table(data.get(name, {}), where)
    refuse_unknown(table, KINDS, where)
    out = {}
    for kind in kinds:
        own = as_table(table.get(kind, {}), f"{where}.{kind}")
        refuse_unknown(own, RANGES[kind], f"{where}.{kind}")
        out[kind] = dict(default[kind])
        for key, both in own.items():
            if not isinstance(both, list) or len(both) != 2:
                raise InputError(f"{where}.{kind}: {key} must be [low, high]")
            low, high = (float(number(v, key, f"{where}.{kind}")) for v in both)
            if not low < high:
                raise InputError(f"{where}.{kind}: {key} = [{low:g}, {high:g}]: write the lower value first")
            out[kind][key] = (low, high)
    return out
