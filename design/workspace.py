"""Workspace: what segments do over angle and pressure, and where the tips of one to three of them go.

Strains come from the law once a kind, angle and pressure. A shape is a product of closed-form pieces, so that
a hundred thousand of them are a matter of seconds; which angles a shape has follows from its number alone, so
that any number of ranks computes the same.
"""

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.archive import write_archive
from pneunet.base.files.atomic import write_csv
from pneunet.base.files.folder import output_folder
from pneunet.base.files.record import write_record
from pneunet.base.files.toml import array, from_table, number, read_toml, refuse_unknown
from pneunet.base.materials.laws import PAPER_TWISTING, Hyperelastic, material_from_table
from pneunet.base.pictures import rendering
from pneunet.base.progress import progress
from pneunet.base.quantities import Checked, quantities, quantity, shown
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA, MPA_PER_KPA, PER_MM_PER_M
from pneunet.design.design import chosen_law
from pneunet.design.search.space import START
from pneunet.design.target.file import START_KEYS
from pneunet.design.target.reach import Reach, reach
from pneunet.design.target.shapes import PRESSURE_LIMIT
from pneunet.geometry.parameters import KINDS, ONE_SIDED, TWISTING, Segment
from pneunet.reduced.rod.centreline import free_shapes
from pneunet.reduced.rod.ends import free_pieces
from pneunet.reduced.rod.laws import SegmentLaw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Map = Callable[..., Iterable]
SCHEMA = "pneunet-workspace-1"
#: columns of reach.csv
REACH = (
    *(
        "kind",
        "angle_deg",
        "pressure_kPa",
        "stretch",
        "tau_rad_per_mm",
        "curvature_per_m",
        "torsion_rad_per_m",
    ),
    *("cylinder_curvature_per_m", "pitch_mm", "doubted"),
)
#: a law's excess that is a doubt: more than what rounding does at the edge of what it knows
DOUBT = 1e-3
#: shapes that are computed at once
BLOCK = 5000
MOST_SEGMENTS = 8
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class WorkspaceCase(Checked):
    """What is varied. Segments of a kind are alike but for their angle, and as many whole chambers long as
    fit `length` best.

    shapes: how many, of all chains together; chains: kinds of the segments in a row; angles: (first, last),
    degrees; pressures: MPa, rising; start: {field of Segment: mm}."""

    length: float = quantity("mm", 60.0, "of every segment at rest", low=10, high=500)
    angle_step: float = quantity("deg", 1.0, low=0.01, high=45)
    shapes: int = quantity(None, 100_000, low=1, high=10_000_000)
    name: str = "workspace"
    angles: tuple[float, float] = (45.0, 135.0)
    pressures: tuple[float, ...] = tuple(MPA_PER_KPA * kPa for kPa in range(0, 61, 5))
    chains: tuple[tuple[str, ...], ...] = (
        (ONE_SIDED,),
        (TWISTING, ONE_SIDED),
        (TWISTING, ONE_SIDED, ONE_SIDED),
    )
    material: Hyperelastic = PAPER_TWISTING
    start: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 30 <= self.angles[0] <= self.angles[1] <= 150:
            raise InputError("angles_deg must be [smallest, largest] within 30..150")
        rising = all(a < b for a, b in zip(self.pressures, self.pressures[1:]))
        if not self.pressures or not rising or self.pressures[0] < 0 or self.pressures[-1] <= 0:
            raise InputError("pressures_kPa must rise from 0 or more, the last one larger than 0")
        if self.pressures[-1] > PRESSURE_LIMIT * (1 + 1e-9):
            raise InputError(
                f"pressures_kPa must lie in 0..{KPA_PER_MPA * PRESSURE_LIMIT:g} (above it chambers leak)"
            )
        for chain in self.chains:
            if not 1 <= len(chain) <= MOST_SEGMENTS or not set(chain) <= set(KINDS):
                raise InputError(f"chains: {list(chain)} must be 1 to {MOST_SEGMENTS} of {', '.join(KINDS)}")
        if not self.chains:
            raise InputError("chains: give at least one list of kinds")

    @classmethod
    def read(cls, path: str | Path) -> "WorkspaceCase":
        """The case in a TOML file (docs/use-workspace.md); InputError that names key and fix."""
        table, where = read_toml(path), str(path)
        special = ("name", "angles_deg", "pressures_kPa", "chains", "material", "segment")
        refuse_unknown(table, (*quantities(cls), *special), where)
        given: dict = {"name": str(table.get("name", Path(path).stem))}
        if "angles_deg" in table:
            ends = array(table["angles_deg"], "angles_deg", where, "[smallest, largest]", (2,))
            given["angles"] = tuple(ends.tolist())
        if "pressures_kPa" in table:
            kPa = array(table["pressures_kPa"], "pressures_kPa", where, "a list of numbers", (None,))
            given["pressures"] = tuple((MPA_PER_KPA * kPa).tolist())
        if "chains" in table:
            given["chains"] = _chains(table["chains"], where)
        if "material" in table:
            given["material"] = material_from_table(table["material"], f"{where} [material]")
        own = table.get("segment", {})
        refuse_unknown(own, START_KEYS, f"{where} [segment]")
        given["start"] = {
            START_KEYS[key]: float(number(value, key, f"{where} [segment]")) for key, value in own.items()
        }
        case = from_table(cls, {key: table[key] for key in quantities(cls) if key in table}, where, **given)
        with located(f"{where} [segment]"):
            for kind in case.kinds:
                case.segment(kind, case.angles[0])
        return case

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds that are in a chain."""
        return tuple(kind for kind in KINDS if any(kind in chain for chain in self.chains))

    @property
    def angle_grid(self) -> np.ndarray:
        """(a,) degrees."""
        low, high = self.angles
        return np.linspace(low, high, round((high - low) / self.angle_step) + 1)

    def segment(self, kind: str, angle: float) -> Segment:
        """A segment of a kind at an angle in degrees. InputError where it cannot be built."""
        one = Segment(kind, angle, 1, **(START[kind] | self.start), material=self.material)
        return replace(one, chambers=max(1, 1 + round((self.length - one.length) / one.pitch)))


def _chains(value, where):
    rows = value if isinstance(value, list) else [value]
    if not all(isinstance(row, list) and all(isinstance(kind, str) for kind in row) for row in rows):
        raise InputError(f"{where}: 'chains' must be lists of kinds, [[\"{ONE_SIDED}\"]], not {shown(value)}")
    return tuple(map(tuple, rows))


@dataclass(frozen=True, eq=False)
class Cloud:
    """Shapes of one chain of kinds: angles (n, m) in degrees, pressures (n,) in MPa, tips (n, 3) in mm and
    directions (n, 3) there, from a base at the origin along x whose width lies along y; doubted (n,): whether
    the law doubts one of the segments."""

    chain: tuple[str, ...]
    angles: np.ndarray
    pressures: np.ndarray
    tips: np.ndarray
    directions: np.ndarray
    doubted: np.ndarray

    @property
    def name(self) -> str:
        return " + ".join(self.chain)


@dataclass(frozen=True, eq=False)
class Workspace:
    """reach: {kind: Reach}; doubted: {kind: (angles, pressures) whether the law doubts it}; clouds: of each
    chain; lost: shapes without an equilibrium."""

    case: WorkspaceCase
    law: SegmentLaw
    reach: dict[str, Reach]
    doubted: dict[str, np.ndarray]
    clouds: tuple[Cloud, ...]
    lost: int
    seconds: float

    def __repr__(self) -> str:
        return f"<Workspace {self.case.name}: {sum(len(c.tips) for c in self.clouds)} shapes>"

    def rows(self) -> Iterator[list]:
        """Of reach.csv; a cell is empty where a kind has no such number."""
        for kind, found in self.reach.items():
            doubted = self.doubted[kind]
            q = found.strains
            curved = (q.frenet_curvature, q.frenet_torsion, q.helix_cylinder_curvature)
            helix = [*(c / PER_MM_PER_M for c in curved), q.helix_pitch]
            for i, angle in enumerate(found.angles):
                for j, pressure in enumerate(found.pressures):
                    own = (
                        [found.twist[i, j]] + [""] * 4
                        if kind == TWISTING
                        else ["", *(c[i, j] for c in helix)]
                    )
                    yield [kind, angle, KPA_PER_MPA * pressure, q.stretch[i, j], *own, int(doubted[i, j])]

    def save(self, directory: str | Path) -> Path:
        """`write` to a folder, which is made if need be; the folder."""
        with output_folder(directory) as folder:
            self.write(folder)
        return folder

    def write(self, directory: Path) -> None:
        """Write reach.csv, tips.npz, run.json and, with matplotlib, workspace.png."""
        write_csv(directory / "reach.csv", REACH, self.rows())
        arrays: dict[str, np.ndarray] = {}
        for number_, cloud in enumerate(self.clouds, start=1):
            arrays |= {
                f"tip_mm_{number_}": cloud.tips.astype(np.float32),
                f"direction_{number_}": cloud.directions.astype(np.float32),
                f"angle_deg_{number_}": cloud.angles.astype(np.float32),
                f"pressure_kPa_{number_}": (KPA_PER_MPA * cloud.pressures).astype(np.float32),
                f"doubted_{number_}": cloud.doubted,
            }
        about: dict[str, Any] = {"chains": [list(cloud.chain) for cloud in self.clouds], "law": self.law.name}
        write_archive(directory / "tips.npz", SCHEMA, about, arrays, compress=True)
        entries: dict[str, Any] = {"shapes": sum(len(c.tips) for c in self.clouds)}
        entries |= {"without_equilibrium": self.lost}
        write_record(directory, case=self.case.name, **about, **entries, wall_seconds=round(self.seconds, 2))
        try:
            rendering.save(self.plot(), directory / "workspace.png")
        except ImportError:
            log.info("no picture: matplotlib is missing, install it with: pip install 'pneunet[pictures]'")

    def plot(self) -> "Figure":
        """A matplotlib figure: reach of the kinds, and the clouds of tips."""
        from pneunet.design.report.workspace import workspace_figure

        return workspace_figure(
            self.reach, [(cloud.name, cloud.tips, cloud.pressures) for cloud in self.clouds]
        )


@dataclass(frozen=True, eq=False)
class _Table:
    """Pieces of a kind's segments: lengths (a, 3) in mm, strains (a, p, 3, 6)."""

    lengths: np.ndarray
    strains: np.ndarray


def workspace(
    case: WorkspaceCase | str | Path | None = None, *, law: str | SegmentLaw = "trained", mapping: Map = map
) -> Workspace:
    """The Workspace of a case, its file, or by default of the paper's silicone and the start dimensions of a
    design.

    law: 'trained', 'analytic', a law's file (.npz) or a SegmentLaw. mapping: a `map`, over processes for
    instance; the answer does not depend on it. InputError on bad input."""
    started = time.perf_counter()
    law = chosen_law(law)
    case = case if isinstance(case, WorkspaceCase) else WorkspaceCase.read(case) if case else WorkspaceCase()
    angles, pressures = case.angle_grid, np.array(case.pressures)
    log.info(f"workspace {case.name}: {len(angles)} angles, {len(pressures)} pressures, law '{law.name}'")
    reaches, tables, doubted = {}, {}, {}
    for kind in case.kinds:
        segments = [case.segment(kind, float(a)) for a in angles]
        reaches[kind] = reach(case.segment(kind, 90.0), pressures, law, angles)
        tables[kind] = _table(segments, reaches[kind].strains)
        told = reaches[kind].ranges()
        log.info(
            f"  {kind}: curvature up to {told['curvature'][1] / PER_MM_PER_M:.1f} 1/m,"
            f" twist {told['twist'][0]:.4f}..{told['twist'][1]:.4f} rad/mm"
        )
        doubted[kind] = _doubted(segments, pressures, law)
    loaded = np.flatnonzero(pressures > 0)
    clouds, lost = [], 0
    for chain, count in zip(case.chains, _shares(case, len(angles), len(loaded))):
        picks = _picks(len(chain), len(angles), len(loaded), count)
        blocks = [picks[i : i + BLOCK] for i in range(0, len(picks), BLOCK)]
        work = partial(_tips, tables=[tables[kind] for kind in chain], loaded=loaded)
        found = np.concatenate(list(progress(mapping(work, blocks), "blocks of shapes", len(blocks))))
        known = np.isfinite(found).all(axis=1)
        lost += int((~known).sum())
        picks, found = picks[known], found[known]
        at = loaded[picks[:, 0]]
        doubts = np.any([doubted[kind][picks[:, 1 + i], at] for i, kind in enumerate(chain)], axis=0)
        clouds.append(Cloud(chain, angles[picks[:, 1:]], pressures[at], found[:, :3], found[:, 3:], doubts))
        log.info(f"  {clouds[-1].name}: {len(found)} shapes, {time.perf_counter() - started:.1f} s")
    return Workspace(case, law, reaches, doubted, tuple(clouds), lost, time.perf_counter() - started)


def _doubted(segments, pressures, law):
    """(segments, pressures) whether the law doubts a state; the worst of its reasons is told."""
    excess = np.array([[law.excess(s, float(P)).max() for P in pressures] for s in segments])
    found = excess > DOUBT
    if found.any():
        i, j = np.unravel_index(excess.argmax(), excess.shape)
        lowest = KPA_PER_MPA * pressures[found.any(axis=0)].min()
        reasons = "; ".join(law.doubts(segments[i], float(pressures[j])))
        share = f"{100 * found.mean():.0f} % of these are doubted, from {lowest:g} kPa on"
        log.warning(f"  warning: {share}, most at {segments[i].angle:g} deg: {reasons}")
    return found


def run_workspace(
    path: str | Path | None, directory: str | Path, law: SegmentLaw, mapping: Map = map
) -> Workspace:
    """`pneunet workspace`: a case's file, or the default one, saved in a folder. InputError on bad input."""
    case = WorkspaceCase.read(path) if path else WorkspaceCase()
    with output_folder(directory) as folder:
        found = workspace(case, law=law, mapping=mapping)
        found.write(folder)
    lost = f", {found.lost} without an equilibrium" if found.lost else ""
    log.info(f"{sum(len(c.tips) for c in found.clouds)} shapes in {found.seconds:.1f} s{lost}: {folder}")
    return found


def _table(segments, strains):
    """The _Table of segments (a,) whose cells have RodStrains (a, p, 3)."""
    count, levels = strains.e.shape[:2]
    lengths, found = np.empty((count, 3)), np.empty((count, levels, 3, 6))
    for i, segment in enumerate(segments):
        for j in range(levels):
            lengths[i], pieces = free_pieces(
                [segment], RodStrains(strains.e[i, j, None], strains.k[i, j, None])
            )
            found[i, j] = pieces.vector
    return _Table(lengths, found)


def _shares(case, angles, levels):
    """How many shapes each chain gets: all that there are, where that is less than its share."""
    all_of = [levels * angles ** len(chain) for chain in case.chains]
    counts, left = [0] * len(all_of), case.shapes
    order = sorted(range(len(all_of)), key=lambda i: all_of[i])
    for place, i in enumerate(order):
        counts[i] = min(all_of[i], left // (len(order) - place))
        left -= counts[i]
    return counts


def _picks(segments, angles, levels, count):
    """(count, 1 + segments) indices of pressures and angles: all combinations where there are no more,
    otherwise evenly spread ones (the additive recurrence of M. Roberts, 2018)."""
    sizes = np.array([levels, *[angles] * segments])
    if count == sizes.prod():
        return np.stack(np.unravel_index(np.arange(count), sizes), axis=1)
    base = 2.0
    for _ in range(60):  # the root of x^(d + 1) = x + 1
        base = (1 + base) ** (1 / (len(sizes) + 1))
    steps = base ** -np.arange(1.0, len(sizes) + 1)
    return np.floor((0.5 + np.arange(count)[:, None] * steps) % 1 * sizes).astype(int)


def _tips(picks, tables, loaded):
    """(n, 6) tips and directions of shapes."""
    lengths = np.concatenate([t.lengths[picks[:, 1 + i]] for i, t in enumerate(tables)], axis=1)
    at = loaded[picks[:, 0]]
    strains = np.concatenate([t.strains[picks[:, 1 + i], at] for i, t in enumerate(tables)], axis=1)
    _, poses = free_shapes(lengths, RodStrains.of_vector(strains), samples=1)
    return np.concatenate([poses[:, -1, :3, 3], poses[:, -1, :3, 0]], axis=1)
