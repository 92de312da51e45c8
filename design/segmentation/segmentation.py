"""`Segmentation`: the rod of few pieces of constant strain that a target was found to lie on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.units import PER_MM_PER_M
from pneunet.design.target.file import PIECE_KEYS
from pneunet.design.target.target import Piece

#: of a [[piece]] table, in the order in which they are written
KEYS = (
    *("kind", "length_mm", "pressure_group", "roll_deg"),
    *("curvature_per_m", "tau_rad_per_mm", "torsion_rad_per_m"),
)


@dataclass(frozen=True, eq=False, repr=False)
class Segmentation:
    """pieces: n of them, base to tip, in a section frame that is continuous along the rod.

    base_pose (4, 4): that frame at the curve's start, in target coordinates. strains (n, 3): its rates (k1,
    k2, k3) per deformed length, 1/mm; k2 < 0 is a piece rolled by 180 degrees. standard_errors (n, 3):
    theirs, 0 where a rate is fixed. noise: estimated standard deviation of a coordinate of a point, mm. rms:
    between the points and the rod, across it, mm. criterion: what the split was chosen by, smaller is better.
    curve: the fitted rod's centreline; its length is the target's, which noise does not lengthen. notes: what
    was not identifiable, which convention was taken, what was given up.
    """

    pieces: tuple[Piece, ...]
    base_pose: np.ndarray
    strains: np.ndarray
    standard_errors: np.ndarray
    noise: float
    rms: float
    criterion: float
    curve: Curve
    notes: tuple[str, ...] = ()

    @property
    def length(self) -> float:
        """Of the fitted curve, mm."""
        return self.curve.length

    @property
    def joints(self) -> np.ndarray:
        """(n - 1,) arc lengths at which one piece ends and the next begins, mm."""
        return np.cumsum([piece.length for piece in self.pieces])[:-1]

    def toml(self) -> str:
        """The pieces as [[piece]] tables of a target's file, to be edited and given back."""
        return piece_tables([_row(piece) for piece in self.pieces])

    def __repr__(self) -> str:
        told = ", ".join(f"{p.kind}{' (rolled)' * bool(p.roll)} {p.length:.1f} mm" for p in self.pieces)
        return f"<Segmentation: {told}; rms {self.rms:.3f} mm, noise {self.noise:.3f} mm>"


def piece_tables(rows: Sequence[Mapping]) -> str:
    """[[piece]] tables of a target's file from rows by file key, of which what such a file knows is kept."""
    texts = []
    for row in rows:
        keys = [key for key in KEYS if key in row and key in PIECE_KEYS[row["kind"]]]
        values = (f'"{row[key]}"' if key == "kind" else f"{row[key]:.7g}" for key in keys)
        texts.append("[[piece]]\n" + "".join(f"{key} = {value}\n" for key, value in zip(keys, values)))
    return "\n".join(texts)


def is_piece_row(row: object) -> bool:
    """Whether it is a row of `piece_tables`."""
    if not isinstance(row, dict) or row.get("kind") not in tuple(PIECE_KEYS):
        return False
    return all(isinstance(row[key], Real) for key in KEYS if key in row and key != "kind")


def _row(piece):
    row = {"kind": piece.kind, "length_mm": piece.length, "curvature_per_m": piece.curvature / PER_MM_PER_M}
    row |= {"tau_rad_per_mm": piece.twist, "torsion_rad_per_m": piece.twist / PER_MM_PER_M}
    return row | ({"roll_deg": piece.roll} if piece.roll else {})
