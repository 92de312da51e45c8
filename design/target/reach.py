"""What segments of one kind can do: the strains of their cells over angle and pressure, and whether a piece
of a target lies within them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pneunet.base.errors import InputError
from pneunet.base.strains import RodStrains
from pneunet.geometry.parameters import TWISTING, Segment
from pneunet.reduced.rod.laws import SegmentLaw

#: degrees: the paper's range for one-sided segments (Fig. 9g), which the trained law knows whole
ANGLES = np.linspace(45.0, 135.0, 19)


@dataclass(frozen=True, eq=False)
class Reach:
    """strains: RodStrains (a, p, 3) of the cells of a `kind` of segment at angles (a,) in degrees and
    pressures (p,) in MPa, both rising; nan where there is no equilibrium."""

    kind: str
    angles: np.ndarray
    pressures: np.ndarray
    strains: RodStrains

    @property
    def curvature(self) -> np.ndarray:
        """(a, p) Frenet curvature of the centreline, 1/mm."""
        return self.strains.frenet_curvature

    @property
    def twist(self) -> np.ndarray:
        """(a, p) rad per mm of deformed length: tau of a twisting segment, the centreline's torsion of a
        one-sided one."""
        return (
            self.strains.twist_per_deformed_length if self.kind == TWISTING else self.strains.frenet_torsion
        )

    def ranges(self) -> dict[str, tuple[float, float]]:
        """{"stretch", "curvature", "twist": (lowest, highest)} over all angles and pressures."""
        values = {"stretch": self.strains.stretch, "curvature": self.curvature, "twist": self.twist}
        return {name: (float(np.nanmin(v)), float(np.nanmax(v))) for name, v in values.items()}

    def share(self, curvature: ArrayLike, twist: ArrayLike) -> np.ndarray:
        """(...,) what is asked of a piece over the most that can be done in that direction: up to 1 it is
        reachable. curvature (1/mm), twist (rad/mm) (...,): as of `Extracted`.

        The direction of a one-sided segment is that of (curvature, torsion): between two of the angles its
        reach is interpolated, beyond the last one there is none (inf). A twisting one does not bend."""
        curvature, twist = np.broadcast_arrays(*(np.asarray(v, float) for v in (curvature, twist)))
        if self.kind == TWISTING:
            low, high = self.ranges()["twist"]
            return np.maximum(twist / high if high > 0 else np.inf, twist / low if low < 0 else 0 * twist)
        size, direction = np.hypot(curvature, twist), np.arctan2(twist, curvature)
        most = np.zeros(size.shape)
        for j in range(len(self.pressures)):
            sizes = np.hypot(self.curvature[:, j], self.twist[:, j])
            known = sizes > 0  # nan is not
            if known.any():
                directions = np.arctan2(self.twist[known, j], self.curvature[known, j])
                order = np.argsort(directions)
                there = np.interp(direction, directions[order], sizes[known][order], left=0.0, right=0.0)
                most = np.maximum(most, there)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(size > 0, size / most, 0.0)


def reach(
    segment: Segment,
    pressures: ArrayLike,
    law: SegmentLaw,
    angles: ArrayLike = ANGLES,
    vary: Mapping[str, Sequence[Any]] | None = None,
) -> Reach:
    """The Reach of segments like `segment` at other angles (a,), at pressures (p,) in MPa.

    vary: {field of Segment: values, as the two ends of a range}: at every angle and pressure the combination
    that bends and twists most. InputError where no combination can be built."""
    angles, pressures = np.sort(np.atleast_1d(angles).astype(float)), np.sort(np.atleast_1d(pressures))
    found = None
    for values in product(*(vary or {}).values()):
        changes: dict[str, Any] = dict(zip(vary or {}, values))
        try:
            changed = replace(segment, **changes)
            alike = [replace(changed, angle=float(angle)) for angle in angles]
        except InputError as error:
            reason = error
            continue
        one = Reach(segment.kind, angles, pressures, law.table(alike, pressures))
        found = one if found is None else _larger(found, one)
    if found is None:
        raise reason
    return found


def _larger(one, other):
    """Of two Reaches the strains that turn the section more, everywhere."""
    sizes = [
        np.nan_to_num(np.linalg.norm(r.strains.k, axis=-1) / r.strains.stretch, nan=-1.0)
        for r in (one, other)
    ]
    more = (sizes[1] > sizes[0])[..., None]
    e, k = (np.where(more, getattr(other.strains, name), getattr(one.strains, name)) for name in "ek")
    return replace(one, strains=RodStrains(e, k))
