"""How far apart two centrelines are, four ways, with the mismatch of their lengths beside them."""

from dataclasses import dataclass

import numpy as np

from pneunet.base.curve import Curve

PAIRS = 201
#: a point of the reference that is farther from its partner than this share of the length is not followed
FOLLOWED = 0.02


@dataclass(frozen=True)
class Errors:
    """Distances of a curve from a reference curve: mm, and mm^2 for `eq27`.

    rms: root mean square distance of points paired at equal fractions of each curve's own arc length. eq27:
    the paper's Eq. 27, the *sum* over the reference's points of the squared distance to the curve (the paper
        calls it a mean squared error; a curve that is too long does not raise it).
    hausdorff: largest distance from either curve to the other.  tip: distance of the last points.
    not_followed: share of the reference's length whose points are farther than FOLLOWED of it from their
        partners, as where it folds back or has corners.
    """

    rms: float
    eq27: float
    eq27_points: int
    hausdorff: float
    tip: float
    length: float
    reference_length: float
    not_followed: float

    @property
    def length_mismatch(self) -> float:
        """Length of the curve minus that of the reference, mm."""
        return self.length - self.reference_length

    def percent(self, distance: float) -> float:
        """A distance in mm as % of the reference's length."""
        return 100 * distance / self.reference_length

    def table(self) -> dict[str, float]:
        """Everything by file key."""
        return {
            "rms_mm": self.rms,
            "rms_percent_of_length": self.percent(self.rms),
            "eq27_sum_mm2": self.eq27,
            "eq27_points": self.eq27_points,
            "hausdorff_mm": self.hausdorff,
            "hausdorff_percent_of_length": self.percent(self.hausdorff),
            "tip_mm": self.tip,
            "tip_percent_of_length": self.percent(self.tip),
            "not_followed_percent": 100 * self.not_followed,
            "followed_within_mm": FOLLOWED * self.reference_length,
            "length_mm": self.length,
            "reference_length_mm": self.reference_length,
            "length_mismatch_mm": self.length_mismatch,
            "length_mismatch_percent": self.percent(self.length_mismatch),
        }

    @property
    def doubt(self) -> str:
        """What of the reference is not followed, in words; '' where all of it is."""
        within = f"{FOLLOWED * self.reference_length:.1f} mm"
        share = f"not followed: {100 * self.not_followed:.0f} % of length (farther than {within} away)"
        return share if self.not_followed > 0 else ""

    def lines(self) -> list[str]:
        """The same for people, a line each."""
        return [
            f"RMS, paired by arc length  {self.rms:8.3f} mm   ({self.percent(self.rms):.2f} % of length)",
            *filter(None, [self.doubt]),
            f"Eq. 27, sum over {self.eq27_points:4d} points {self.eq27:8.3f} mm^2",
            f"Hausdorff, two-sided       {self.hausdorff:8.3f} mm   ({self.percent(self.hausdorff):.2f} %)",
            f"tip                        {self.tip:8.3f} mm   ({self.percent(self.tip):.2f} %)",
            (
                f"length {self.length:.2f} mm, wanted {self.reference_length:.2f} mm:"
                f" {self.length_mismatch:+.2f} mm ({self.percent(self.length_mismatch):+.2f} %)"
            ),
        ]


def paired(a: Curve, b: Curve, pairs: int = PAIRS) -> np.ndarray:
    """Distances (pairs,) in mm of points paired at equal fractions of the curves' own arc lengths."""
    return np.linalg.norm(a.evenly(pairs) - b.evenly(pairs), axis=1)


def paired_rms(a: Curve, b: Curve, pairs: int = PAIRS) -> float:
    """Their root mean square, mm."""
    return float(np.sqrt(np.mean(paired(a, b, pairs) ** 2)))


def eq27(points: np.ndarray, curve: Curve) -> float:
    """The paper's Eq. 27 in mm^2: sum of squared distances from points (n, 3) to a curve."""
    return float(np.sum((points - curve.nearest(points)) ** 2))


def hausdorff(a: Curve, b: Curve) -> float:
    """Two-sided Hausdorff distance in mm, from the vertices of each curve to the lines of the other."""
    one_way = [np.linalg.norm(p.points - q.nearest(p.points), axis=1).max() for p, q in ((a, b), (b, a))]
    return float(max(one_way))


def compare(curve: Curve | np.ndarray, reference: Curve | np.ndarray) -> Errors:
    """`Errors` of a curve against a reference curve, both in mm and in the same coordinates.

    The reference is the target, or the finite element solution when a reduced prediction is judged.
    """
    curve, reference = Curve.of(curve), Curve.of(reference)
    return Errors(
        rms=paired_rms(curve, reference),
        eq27=eq27(reference.points, curve),
        eq27_points=len(reference.points),
        hausdorff=hausdorff(curve, reference),
        tip=float(np.linalg.norm(curve.points[-1] - reference.points[-1])),
        length=curve.length,
        reference_length=reference.length,
        not_followed=float(np.mean(paired(curve, reference) > FOLLOWED * reference.length)),
    )
