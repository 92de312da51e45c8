"""A rod that carries load: equilibria of segments in a row under gravity, tip and distributed loads.

Each piece has its own law, pressure and mass; section frames are continuous at joints. Newton's method on the
energy of elements with constant strains (reduced.rod.elements) finds the equilibrium, in load steps where a
whole step fails; elements are halved until the answer stands still (reduced.rod.equilibrium). Loads are dead:
fixed in space.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import PASSIVE, Manipulator, Segment
from pneunet.geometry.sections import core_section, rotation
from pneunet.reduced.rod.areas import active_mass, passive_mass
from pneunet.reduced.rod.centreline import Centreline, centreline
from pneunet.reduced.rod.ends import cell_strains, free_pieces
from pneunet.reduced.rod.equilibrium import refine
from pneunet.reduced.rod.laws import SectionLaw, SegmentLaw, TurnedSection
from pneunet.reduced.rod.quadratic import passive_law


@dataclass(frozen=True)
class RodPiece:
    """A run of equal sections. length in mm; pressure in MPa; mass per undeformed length in tonne/mm with its
    centre (y, z) in mm; free (6,): the law's free strains there, where they are known already."""

    length: float
    law: SectionLaw
    pressure: float = 0.0
    mass: float = 0.0
    mass_centre: tuple[float, float] = (0.0, 0.0)
    free: np.ndarray | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.length) and self.length > 0):
            raise InputError(f"length_mm = {self.length:g}: a piece of a rod must be longer than 0")
        if not isinstance(self.law, SectionLaw):
            raise InputError(
                f"law: {type(self.law).__name__} is no SectionLaw, which has free_strains, psi, force and"
                " stiffness"
            )
        if not (np.isfinite(self.pressure) and self.pressure >= 0):
            raise InputError(f"pressure_kPa = {self.pressure * KPA_PER_MPA:g}: give a finite value >= 0")
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise InputError(f"mass = {self.mass:g} tonne/mm: give a finite value >= 0")


@dataclass(frozen=True, eq=False)
class Rod:
    """Pieces from base to tip; base_pose (4, 4): the clamp's frame in space, mm; tip_centre: (y, z) in mm of
    the tip's frame where tip forces act."""

    pieces: Sequence[RodPiece]
    base_pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    tip_centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pieces", tuple(self.pieces))
        object.__setattr__(self, "base_pose", se3.checked_pose(self.base_pose, "base_pose"))
        if not self.pieces:
            raise InputError("pieces: a rod needs at least one")

    def __repr__(self) -> str:
        highest = max(p.pressure for p in self.pieces) * KPA_PER_MPA
        return f"<Rod: {len(self.pieces)} pieces, {self.lengths.sum():.1f} mm, up to {highest:.4g} kPa>"

    @classmethod
    def of(
        cls,
        manipulator: Manipulator,
        laws: SegmentLaw | Sequence[SegmentLaw],
        pressure: float | ArrayLike,
        base_pose: np.ndarray | None = None,
        end_effects: bool = True,
    ) -> "Rod":
        """The rod of a Manipulator. laws: one for all segments or one for each; pressure (MPa): one for all
        or one for each group of them.

        end_effects (docs/theory-reduced.md): every chamber counts with its whole pitch, half a gap at the
        ends included, and the ends of slanted one-sided segments turn about z; False: active from outermost
        wall to outermost wall, ends straight.
        """
        segments, n = manipulator.segments, len(manipulator.segments)
        laws = list(laws) if isinstance(laws, Sequence) else [laws] * n
        for law in laws:
            if not isinstance(law, SegmentLaw):
                raise InputError(f"laws: {type(law).__name__} is no SegmentLaw, such as choose_law() gives")
        if len(laws) != n:
            raise InputError(f"laws: give one for all or one for each of the {n} segments")
        pieces = rod_pieces(segments, laws, manipulator.pressures(pressure), end_effects=end_effects)
        y, z = core_section(segments[-1]).mean(axis=1).tolist()
        return cls(pieces, np.eye(4) if base_pose is None else base_pose, (y, z))

    @property
    def lengths(self) -> np.ndarray:
        """(pieces,) undeformed, mm."""
        return np.array([p.length for p in self.pieces])

    @property
    def free_strains(self) -> RodStrains:
        """RodStrains (pieces, 3) without loads."""
        known = (p.law.free_strains(p.pressure) if p.free is None else p.free for p in self.pieces)
        return RodStrains.of_vector(list(known))

    def free(self, spacing: float = 1.0) -> Centreline:
        """The Centreline without loads, sampled every `spacing` mm."""
        return centreline(self.lengths, self.free_strains, spacing, self.base_pose)

    def equilibrium(
        self,
        loads: DeadLoads | None = None,
        distributed: ArrayLike = (0.0, 0.0, 0.0),
        tolerance: float = 5e-4,
        first_load: float = 1.0,
    ) -> "RodState":
        """The RodState under `loads` (geometry.loading.DeadLoads, in the coordinates of base_pose) and
        `distributed` (3,), a force on the line in N per mm of undeformed length.

        tolerance: of the rod's length; elements are halved until the nodes' estimated error is below.
        ConvergenceError, with the share of the loads that was reached, where no stable equilibrium follows
        (with a tip moment: no equilibrium). first_load: the share of the loads put on first; where several
        stable equilibria exist, a small one leads to that of slow loading. InputError for laws that know free
        shapes alone.
        """
        loads = DeadLoads() if loads is None else loads
        if not isinstance(loads, DeadLoads):
            raise InputError(f"loads: give what pn.loads(...) makes, not {type(loads).__name__}")
        bounds = ("tolerance", tolerance, 1e-9, 0.1), ("first_load", first_load, 1e-3, 1.0)
        for name, value, low, high in bounds:
            if not low <= value <= high:
                raise InputError(f"{name} = {value:g} must lie in {low:g}..{high:g}")
        given = loads.gravity, loads.tip_force, loads.tip_moment, distributed
        vectors = [np.asarray(v, float) for v in given]
        if any(v.shape != (3,) or not np.isfinite(v).all() for v in vectors):
            raise InputError(
                "loads: give three finite numbers each for gravity, tip_force, tip_moment and distributed"
            )
        s, poses, wrench, error, iterations, load_steps = refine(self, vectors, tolerance, first_load)
        moment, force = wrench[:, :3], wrench[:, 3:]
        return RodState(Centreline(s, poses), force, moment, error, iterations, load_steps)


def rod_pieces(
    segments: Sequence[Segment],
    laws: Sequence[SegmentLaw],
    pressures: ArrayLike,
    counts: Sequence[float] | np.ndarray | None = None,
    end_effects: bool = True,
    clamped: bool = True,
) -> list[RodPiece]:
    """The pieces, three of each, of n segments in a row with laws and pressures (MPa) of their own; counts
    (n,): of chambers, real numbers, by default the segments' own; end_effects: as for Rod.of; clamped:
    whether the first one's base is."""
    pressures = np.broadcast_to(np.asarray(pressures, float), len(segments))
    cells = cell_strains(laws, segments, pressures)
    lengths, strains = free_pieces(segments, cells, counts, end_effects)
    pieces: list[RodPiece] = []
    known: dict[tuple, SectionLaw] = {}
    for i, (length, q) in enumerate(zip(lengths.tolist(), strains.vector)):  # three of each segment
        segment, P = segments[i // 3], float(pressures[i // 3])
        turn = rotation(segment)
        if i % 3 == 1 and segment.kind != PASSIVE:
            mass, z = active_mass(segment)
            section: SectionLaw = _turned(laws[i // 3].of(segment), segment)
        else:
            (mass, z), P, bend = passive_mass(segment), 0.0, float(turn[:, 2] @ q[3:])
            behind_clamp = length if i == 0 and clamped else np.inf
            alike = segment.key, segment.roll, bend, behind_clamp
            section = known.setdefault(alike, _turned(passive_law(segment, bend, behind_clamp), segment))
        y, z = (turn[1:, 2] * z).tolist()
        pieces.append(RodPiece(length, section, P, mass, (y, z), q))
    return pieces


@dataclass(frozen=True, eq=False)
class RodState:
    """An equilibrium. line: Centreline of the elements' ends, exact in between; force (n, 3) in N and moment
    (n, 3) in N mm of the n elements, in their section frames; error: estimate of how far the nodes are from
    where infinitely many elements put them, mm; iterations, load_steps: what it took, all refinements
    together."""

    line: Centreline
    force: np.ndarray
    moment: np.ndarray
    error: float
    iterations: int
    load_steps: int

    def __repr__(self) -> str:
        return f"<RodState: tip at {self.tip[:3, 3].round(2)} mm, error {self.error:.2g} mm>"

    @property
    def tip(self) -> np.ndarray:
        """(4, 4) frame of the tip."""
        return self.line.poses[-1]


def _turned(law: SectionLaw, segment: Segment) -> SectionLaw:
    """The law of a segment's section in the body's axes."""
    return TurnedSection(law, rotation(segment)) if segment.roll else law
