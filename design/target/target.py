"""`Target`: what the user wants. Points in space, and what the user says about them beyond that."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.errors import InputError
from pneunet.base.materials.laws import PAPER_TWISTING, Hyperelastic, of_modulus, silicone
from pneunet.base.quantities import Checked, quantity, shown
from pneunet.design.target.casting import Casting
from pneunet.design.target.points import check_curve, checked_vector, held_base
from pneunet.design.target.shapes import PRESSURE_LIMIT as PRESSURE_LIMIT
from pneunet.design.target.shapes import TargetShape, TipPoints, checked_pressures
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import MOST_GROUPS

#: kinds of pieces beside TWISTING, which is straight and turns about itself, and PASSIVE: straight, with no
#: twist wanted
BENDING, HELICAL = "bending", "helical"
LENGTH_TOLERANCE = 0.02  # the pieces' lengths may miss the curve's by this fraction


@dataclass(frozen=True)
class Piece:
    """A part of the target that one segment is to follow; lengths and rates per *deformed* length.

    length in mm; twist in rad/mm: the twist tau of a twisting piece, the torsion of a helical one; curvature
    in 1/mm (Frenet's). None = to be extracted from the points. roll in degrees: by how much the piece is
    turned about the axis against the section frame that runs through all pieces; 180 bends to the other side.
    group: number of the group of segments that share its pressure.
    """

    kind: str
    length: float
    twist: float | None = None
    curvature: float | None = None
    roll: float = 0.0
    group: int = 1


@dataclass(frozen=True)
class SplitOptions(Checked):
    """How a curve is split where no pieces are given, and whether given ones are refined."""

    tolerance: float | None = quantity(
        "mm", None, "noise to be assumed at least; by default a part of the length", above=0, high=100
    )
    most_pieces: int = quantity(None, 8, "pieces at most", low=1, high=20)
    shortest: float = quantity("mm", 20.0, "length of the shortest piece", low=1, high=1000)
    refine: bool = quantity(None, False, "whether the places and rates of given pieces are refined")


@dataclass(frozen=True, eq=False)
class Target:
    """points (n, 3) in mm from base to tip, and optionally

    frames (n, 3, 3): section frames at the points, columns t1 (along), t2 (width), t3 (height);
    weights (n,) >= 0: how much each point counts (None: alike; all 0: the curve is a guide, and only `tip`
    and `shapes` count); pieces: the split; base_direction, base_width (3,): vectors that hold the base
    (width None = its roll stays free, both None = it is free to turn); gravity (3,): acceleration in mm/s2,
    in the target's coordinates; pressure_range (low, high) in MPa, equal = fixed; pressures: fixed ones of
    several groups of segments instead; shapes: further `TargetShape`s, each at pressures of its own; tip:
    `TipPoints` as the pressure rises; material; casting: what can be cast; groups: how many pressures there
    are, where pieces do not say; start: {field of Segment: mm}; vary: {field of Segment: (low, high)} or None
    for the default choice; split: how it is split; source: name of the file that it was read from.
    """

    points: np.ndarray
    name: str = "target"
    frames: np.ndarray | None = None
    pieces: tuple[Piece, ...] = ()
    base_direction: np.ndarray | None = None
    base_width: np.ndarray | None = None
    pressure_range: tuple[float, float] | None = None
    material: Hyperelastic = PAPER_TWISTING
    start: dict = field(default_factory=dict)
    vary: dict[str, tuple[float, float]] | None = None
    split: SplitOptions = field(default_factory=SplitOptions)
    source: str = ""
    weights: np.ndarray | None = None
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pressures: tuple[float, ...] = ()
    shapes: tuple[TargetShape, ...] = ()
    tip: TipPoints | None = None
    casting: Casting = Casting()
    groups: int = 1

    @classmethod
    def read(cls, path: str | Path) -> "Target":
        """The Target in a CSV of points or a TOML (docs/use-targets.md), or a shipped one by its name:
        'octopus'. InputError that names key and fix otherwise."""
        from pneunet.design.target.file import read_target

        return read_target(path)

    def __post_init__(self) -> None:
        tip = () if self.tip is None else (self.tip,)
        for name, wanted, each in (
            ("material", Hyperelastic, (self.material,)),
            ("casting", Casting, (self.casting,)),
            ("split", SplitOptions, (self.split,)),
            ("tip", TipPoints, tip),
            ("pieces", Piece, self.pieces),
            ("shapes", TargetShape, self.shapes),
        ):
            if not isinstance(each, (list, tuple)) or not all(isinstance(one, wanted) for one in each):
                raise InputError(f"{name} must be of {wanted.__name__}, not {shown(getattr(self, name))}")
        check_curve(self)
        nothing_else = self.tip is None and not self.shapes
        if self.weights is not None and not self.weights.any() and nothing_else:
            raise InputError("weights: all are 0, so that nothing is asked for: give one that is larger")
        object.__setattr__(
            self, "gravity", DeadLoads(gravity=checked_vector(self.gravity, "gravity")).gravity
        )
        along, across = held_base(self.base_direction, self.base_width)
        object.__setattr__(self, "base_direction", along)
        object.__setattr__(self, "base_width", across)
        if self.pressure_range is not None:
            ends = checked_pressures(self.pressure_range)
            if len(ends) != 2 or not ends[0] <= ends[1] or not ends[1]:
                raise InputError(f"pressure_range = {self.pressure_range} must be (lowest, highest) in MPa")
            object.__setattr__(self, "pressure_range", ends)
        if type(self.groups) is not int or not 1 <= self.groups <= MOST_GROUPS:
            told = f"pressure_groups = {shown(self.groups)}"
            raise InputError(f"{told} must be a whole number, 1..{MOST_GROUPS}")
        if len(np.atleast_1d(self.pressures)):
            object.__setattr__(self, "pressures", checked_pressures(self.pressures))
        if self.pieces:
            object.__setattr__(self, "pieces", _fitted_to(self.pieces, self.length))

    def __repr__(self) -> str:
        told = f"{len(self.points)} points{' with frames' * (self.frames is not None)}, {self.length:.1f} mm"
        return f"<Target {self.name}: {told}{f', {len(self.pieces)} pieces' if self.pieces else ''}>"

    @property
    def materials(self) -> tuple[Hyperelastic, ...]:
        """Those to choose among: the silicones that may be cast, else the target's own."""
        return tuple(map(silicone, self.casting.silicones)) or (self.material,)

    @property
    def softest(self) -> Hyperelastic:
        """What reaches farthest of all that may be chosen."""
        material = min(self.materials, key=lambda m: m.mu)
        return of_modulus(material, self.casting.moduli[0]) if self.casting.moduli else material

    @property
    def length(self) -> float:
        """Arc length of the points' polyline, mm."""
        return self.curve.length

    @cached_property
    def curve(self) -> Curve:
        """The points' polyline."""
        return Curve(self.points)

    @property
    def guided(self) -> bool:
        """Whether the curve is but a guide, which no error counts against: every weight is 0."""
        return self.weights is not None and not self.weights.any()

    @property
    def base_rotation(self) -> np.ndarray | None:
        """Rotation (3, 3) of a base that is fixed altogether, else None."""
        along, across = self.base_direction, self.base_width
        if along is None or across is None:
            return None
        return np.column_stack([along, across, np.cross(along, across)])

    @property
    def base_told(self) -> str:
        """How the base is held, in words."""
        if self.base_direction is None:
            return "the base is free to turn: its direction and its roll are results"
        if self.base_width is None:
            return "the base is fixed in direction: its roll about it is a result"
        return "the base is fixed, in direction and roll"

    @property
    def loads(self) -> DeadLoads:
        """Gravity as dead load, in the target's coordinates."""
        return DeadLoads(gravity=self.gravity)


def _fitted_to(pieces, length):
    """The pieces with lengths scaled to add up to the curve's; more than a rounding apart is the user's
    mistake."""
    total = sum(p.length for p in pieces)
    if abs(total - length) > LENGTH_TOLERANCE * length:
        raise InputError(
            f"[[piece]] length_mm: the pieces add up to {total:.4g} mm but the curve is {length:.4g} mm long"
            " (lengths are deformed ones)"
        )
    return tuple(replace(p, length=p.length * length / total) for p in pieces)
