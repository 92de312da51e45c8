"""`Segmentation`: the rod of few pieces of constant strain that a target was found to lie on."""

from dataclasses import dataclass

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.units import PER_MM_PER_M
from pneunet.design.target.target import BENDING, HELICAL, Piece
from pneunet.geometry.parameters import TWISTING


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
        return "\n".join(_table(piece) for piece in self.pieces)

    def __repr__(self) -> str:
        told = ", ".join(f"{p.kind}{' (rolled)' * bool(p.roll)} {p.length:.1f} mm" for p in self.pieces)
        return f"<Segmentation: {told}; rms {self.rms:.3f} mm, noise {self.noise:.3f} mm>"


def _table(piece):
    rows = {"kind": f'"{piece.kind}"', "length_mm": f"{piece.length:.3f}"}
    curved, turned = piece.kind in (BENDING, HELICAL), piece.kind in (TWISTING, HELICAL)
    if curved and piece.roll:
        rows["roll_deg"] = f"{piece.roll:g}"
    if curved and piece.curvature:
        rows["curvature_per_m"] = f"{piece.curvature / PER_MM_PER_M:.4f}"
    if turned and piece.twist is not None:
        key, unit = ("tau_rad_per_mm", 1.0) if piece.kind == TWISTING else ("torsion_rad_per_m", PER_MM_PER_M)
        rows[key] = f"{piece.twist / unit:.7g}"
    return "[[piece]]\n" + "".join(f"{key} = {value}\n" for key, value in rows.items())
