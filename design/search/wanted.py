"""What is wanted of the segments: the pieces of a target, given or found, and the curve that they follow."""

from dataclasses import dataclass, replace

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.errors import InputError
from pneunet.design.search.possible import out_of_reach
from pneunet.design.search.space import RANGES, limits, prototype
from pneunet.design.segmentation.segment import segment
from pneunet.design.segmentation.segmentation import Segmentation
from pneunet.design.segmentation.windows import arc_lengths
from pneunet.design.target.extraction import Extracted, extract
from pneunet.design.target.points import STRIDE, strides
from pneunet.design.target.reach import ANGLES, reach
from pneunet.design.target.target import BENDING, HELICAL, PRESSURE_LIMIT, Target
from pneunet.geometry.parameters import PASSIVE, TWISTING
from pneunet.reduced.rod.laws import SegmentLaw

GIVEN_NOTE, FOUND_NOTE = "split given by the user", "automatic split"
REFINED_NOTE = "split given by the user, refined"
GUIDE_NOTE = "one piece for the points of the tip, at first along an arc to the farthest"
#: of the length, by which a curve may leave its pieces unless the user says: bare ends of segments do so
TOLERANCE = 1e-3
#: the same under gravity, which bends a segment unevenly: what it does is for the search to find
LOADED_TOLERANCE = 1e-2
#: of the length: a polyline that differs by more from the fitted curve is noisy or too coarse to be followed
FAITHFUL = 2e-3

#: of noise or tolerance: points that lie farther off the fitted curve are not on it
EXPLAINED = 3.0


@dataclass(frozen=True, eq=False)
class Wanted:
    """target: with the points that are followed, the fitted curve's where the given ones are noisy or few;
    pieces of it; note: where they come from; notes: what was assumed or given up."""

    target: Target
    pieces: tuple[Extracted, ...]
    note: str
    notes: tuple[str, ...] = ()


def wanted(target: Target, law: SegmentLaw) -> Wanted:
    """The Wanted of a Target: its own pieces, or those that it is split into. InputError where none of them
    is to bend or to twist."""
    found = _given_or_found(target, law)
    if all(piece.kind == PASSIVE for piece in found.pieces):
        raise InputError(
            "the curve is straight and no twist is asked for: a plain piece of silicone follows it, and"
            " there is nothing to inflate; give points that bend, frames that turn, or a [[piece]] with"
            " tau_rad_per_mm"
        )
    return replace(found, notes=(*found.notes, *out_of_reach(target, found.pieces, law)))


def _given_or_found(target, law):
    if target.pieces and not target.split.refine:
        pieces = tuple(extract(target, target.pieces))
        # what a file of points of the tip alone is read as
        made = target.guided and [(p.kind, p.curvature) for p in target.pieces] == [(HELICAL, None)]
        return Wanted(target, pieces, GUIDE_NOTE if made else GIVEN_NOTE)
    if any(piece.group > 1 for piece in target.pieces):
        raise InputError("[split] refine: pieces of several pressure groups are not refined: leave it out")
    tolerance, options = target.split.tolerance, target.split
    if tolerance is None:
        tolerance = (LOADED_TOLERANCE if any(target.gravity) else TOLERANCE) * _chords(target)
        options = replace(options, tolerance=tolerance)
    split = segment(target, options=options, reach=reachable(target, law))
    explained = split.rms <= EXPLAINED * max(split.noise, tolerance)
    curve = split.curve if explained else Curve(arc_lengths(target.points)[0])
    followed, notes = target, split.notes
    if abs(target.length - curve.length) > FAITHFUL * curve.length:
        followed = _on_curve(target, curve)
        told = f"{target.length:.1f} mm as a polyline, {curve.length:.1f} mm smoothed"
        notes += (f"followed is the smooth curve: noise {split.noise:.2g} mm a coordinate; {told}",)
    scale = followed.length / split.length
    pieces = tuple(replace(p, length=p.length * scale) for p in _extracted(split, followed))
    return Wanted(followed, pieces, REFINED_NOTE if target.pieces else FOUND_NOTE, notes)


def reachable(target: Target, law: SegmentLaw) -> dict[str, tuple[float, float]]:
    """{kind of piece: (largest |twist|, largest curvature)} in 1/mm that segments of usual dimensions reach
    at the highest allowed pressure; up to half a large change of the chambers' height more than at first."""
    pressure = target.pressure_range[1] if target.pressure_range else PRESSURE_LIMIT
    out = {}
    for kind in (BENDING, TWISTING):
        piece = Extracted(kind, 50.0, 0.0, 0.0, 0.0)
        like = prototype(target, piece)
        own = limits(target, piece, like).get("chamber_height")
        heights = {"chamber_height": [like.chamber_height, like.chamber_height + _half(like.kind)]}
        vary = heights if target.vary is None else {"chamber_height": own[0]} if own else {}
        found = reach(like, [pressure], law, ANGLES, vary)
        across = int(np.argmin(abs(found.angles - 90.0)))
        twist = float(np.nanmax(abs(found.twist), initial=0.0))
        if kind == TWISTING:
            out[TWISTING] = twist, 0.0
        else:
            out[BENDING] = 0.0, float(np.nan_to_num(found.curvature[across, 0]))
            out[HELICAL] = twist, float(np.nanmax(found.curvature, initial=0.0))
    return out


def _chords(target):
    """Length (mm) that noise does not lengthen."""
    return Curve(target.points[strides(target.points, STRIDE)]).length


def _half(kind):
    return RANGES[kind]["chamber_height"][1] / 2


def _on_curve(target, curve):
    """The Target with a Curve's points instead of its own, and the frames and weights that were nearest by
    arc length."""
    s, own = curve.arc_lengths / curve.length, target.curve.arc_lengths / target.length
    nearest = np.rint(np.interp(s, own, np.arange(len(own)))).astype(int)
    kept = {name: getattr(target, name) for name in ("frames", "weights")}
    kept = {name: values if values is None else values[nearest] for name, values in kept.items()}
    return replace(target, points=curve.points, **kept)


def _extracted(split: Segmentation, target: Target):
    """`Extracted` of the pieces that were found; twists at an end are seen by frames or a fixed base
    alone."""
    last = len(split.pieces) - 1
    for i, p in enumerate(split.pieces):
        seen = target.frames is not None or (i < last and (i > 0 or target.base_rotation is not None))
        twist, curvature = p.twist or 0.0, p.curvature or 0.0
        # gravity twists what would only bend
        kind = HELICAL if p.kind == BENDING and any(target.gravity) else p.kind
        yield Extracted(kind, p.length, twist, curvature, split.rms, seen, "", p.roll)
