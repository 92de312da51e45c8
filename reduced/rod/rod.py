"""A rod that carries load: equilibria of segments in a row under gravity, tip and distributed loads.

Each piece has its own law, pressure and mass; section frames are continuous at joints. Newton's method on the
energy of elements with constant strains (reduced.rod.elements) finds the equilibrium, in load steps where a
whole step fails; elements are halved until the answer stands still (reduced.rod.equilibrium). Loads are dead:
fixed in space.
"""

from dataclasses import dataclass, field

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.geometry.loading import DeadLoads
from pneunet.reduced.rod.areas import active_mass, passive_mass
from pneunet.reduced.rod.centreline import Centreline, centreline
from pneunet.reduced.rod.ends import end_turn
from pneunet.reduced.rod.equilibrium import refine
from pneunet.reduced.rod.laws import passive_law

#: what a law must have; see reduced.rod.laws.RodLaw
LAW = ("free_strains", "psi", "force", "stiffness")


@dataclass(frozen=True)
class Piece:
    """A run of equal sections. length in mm; law: reduced.rod.laws.RodLaw; pressure in MPa; mass per
    undeformed length in tonne/mm with its centre (y, z) in mm."""

    length: float
    law: object
    pressure: float = 0.0
    mass: float = 0.0
    mass_centre: tuple = (0.0, 0.0)

    def __post_init__(self):
        if not (np.isfinite(self.length) and self.length > 0):
            raise InputError(f"length_mm = {self.length:g}: a piece of a rod must be longer than 0")
        if not all(callable(getattr(self.law, name, None)) for name in LAW):
            raise InputError(f"law: {type(self.law).__name__} is no rod law, which has {', '.join(LAW)}")
        if not (np.isfinite(self.pressure) and self.pressure >= 0):
            raise InputError(f"pressure_kPa = {self.pressure * 1e3:g}: give a finite value >= 0")
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise InputError(f"mass = {self.mass:g} tonne/mm: give a finite value >= 0")


@dataclass(frozen=True)
class Rod:
    """Pieces from base to tip; base_pose (4, 4): the clamp's frame in space, mm; tip_centre: (y, z) in mm of
    the tip's frame where tip forces act."""

    pieces: tuple
    base_pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    tip_centre: tuple = (0.0, 0.0)

    def __post_init__(self):
        object.__setattr__(self, "pieces", tuple(self.pieces))
        object.__setattr__(self, "base_pose", np.asarray(self.base_pose, float))
        if not self.pieces:
            raise InputError("pieces: a rod needs at least one")
        if (
            self.base_pose.shape != (4, 4)
            or abs(self.base_pose[:3, :3].T @ self.base_pose[:3, :3] - np.eye(3)).max() > 1e-6
        ):
            raise InputError("base_pose: give a (4, 4) pose with a rotation matrix")

    @classmethod
    def of(cls, manipulator, laws, pressure, base_pose=None, end_effects=True):
        """The rod of a Manipulator. laws, pressure (MPa): one for all segments or one for each.

        end_effects (docs/theory-reduced.md): every chamber counts with its whole pitch, half a gap at the
        ends included, and the ends of slanted one-sided segments turn about z; False: active from outermost
        wall to outermost wall, ends straight.
        """
        n = len(manipulator.segments)
        laws = list(laws) if isinstance(laws, (list, tuple)) else [laws] * n
        pressures = (
            np.broadcast_to(np.asarray(pressure, float), n) if np.shape(pressure) in ((), (n,)) else ()
        )
        if len(laws) != n or len(pressures) != n:
            raise InputError(f"laws, pressure_kPa: give one for all or one for each of the {n} segments")
        pieces, known = [], {}
        for segment, law, P in zip(manipulator.segments, laws, map(float, pressures)):
            reach = segment.gap / segment.sin / 2 if end_effects else 0.0
            turn = end_turn(segment, law.free_strains(P)) if end_effects else 0.0
            length, (mass, z) = segment.end_length - reach, passive_mass(segment)
            bare = [
                known.setdefault((segment.key, t), passive_law(segment, t))
                for t in (turn / length, -turn / length)
            ]
            before, behind = (Piece(length, own, 0.0, mass, (0.0, z)) for own in bare)
            mass, z = active_mass(segment)
            pieces += [before, Piece(segment.active_length + 2 * reach, law, P, mass, (0.0, z)), behind]
        last = manipulator.segments[-1]
        return cls(
            pieces,
            np.eye(4) if base_pose is None else base_pose,
            (0.0, (last.core_bottom + last.core_top) / 2),
        )

    @property
    def lengths(self):
        """(pieces,) undeformed, mm."""
        return np.array([p.length for p in self.pieces])

    @property
    def free_strains(self):
        """RodStrains (pieces, 3) without loads."""
        q = np.array([p.law.free_strains(p.pressure) for p in self.pieces])
        return RodStrains(q[:, :3], q[:, 3:])

    def free(self, spacing=1.0):
        """The Centreline without loads, sampled every `spacing` mm."""
        return centreline(self.lengths, self.free_strains, spacing, self.base_pose)

    def equilibrium(self, loads=None, distributed=(0.0, 0.0, 0.0), tolerance=5e-4, first_load=1.0):
        """The RodState under `loads` (geometry.loading.DeadLoads, in the coordinates of base_pose) and
        `distributed` (3,), a force on the line in N per mm of undeformed length.

        tolerance: of the rod's length; elements are halved until the nodes' estimated error is below.
        ConvergenceError, with the share of the loads that was reached, where no stable equilibrium follows
        (with a tip moment: no equilibrium). first_load: the share of the loads put on first; where several
        stable equilibria exist, a small one leads to that of slow loading.
        """
        loads = loads or DeadLoads()
        for name, value, low, high in (
            ("tolerance", tolerance, 1e-9, 0.1),
            ("first_load", first_load, 1e-3, 1.0),
        ):
            if not low <= value <= high:
                raise InputError(f"{name} = {value:g} must lie in {low:g}..{high:g}")
        vectors = [
            np.asarray(v, float) for v in (loads.gravity, loads.tip_force, loads.tip_moment, distributed)
        ]
        if any(v.shape != (3,) or not np.isfinite(v).all() for v in vectors):
            raise InputError(
                "loads: give three finite numbers each for gravity, tip_force, tip_moment and distributed"
            )
        s, poses, wrench, *effort = refine(self, vectors, tolerance, first_load)
        return RodState(Centreline(s, poses), wrench[:, 3:], wrench[:, :3], *effort)


@dataclass(frozen=True)
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

    @property
    def tip(self):
        """(4, 4) frame of the tip."""
        return self.line.poses[-1]
