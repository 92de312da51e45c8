"""The public function: a target in, its `Segmentation` out."""

import logging
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pneunet.base.curve import Curve
from pneunet.base.frames import best_rigid_fit
from pneunet.design.segmentation import words
from pneunet.design.segmentation.ends import ends
from pneunet.design.segmentation.fit import Observations, RodFit, refined
from pneunet.design.segmentation.moves import allowed
from pneunet.design.segmentation.rod import PiecewiseRod
from pneunet.design.segmentation.search import POLISH, searched
from pneunet.design.segmentation.segmentation import Segmentation
from pneunet.design.segmentation.start import first_rods
from pneunet.design.segmentation.windows import Stretches, arc_lengths
from pneunet.design.target.extraction import extract
from pneunet.design.target.target import BENDING, HELICAL, Piece, SplitOptions, Target
from pneunet.geometry.parameters import TWISTING

FLOOR = 2e-4  # of the length: noise below it is not told from curvature that varies
MOST_POINTS = 600  # more are thinned to means of neighbours
THINNED = 400
#: rad: bounds of the turns between neighbouring pieces beyond which a twist is put between them at first
LOOSE = (0.4, np.inf)
#: prices of a stretch's strains and joints that first rods are chained with, in turn while the fit is poor
PRICES = (6.0, 14.0)
SPACING = 1.0  # mm between the points of the fitted curve
#: squares may exceed what noise explains by this many standard deviations before another start is tried
POOR = 3.0
log = logging.getLogger(__name__)


def segment(
    target: Target,
    *,
    options: SplitOptions | None = None,
    reach: Mapping[str, tuple[float, float]] | None = None,
) -> Segmentation:
    """The `Segmentation` of a target's points, and of its section frames and fixed base where it has them.

    options: by default the target's own. Pieces that the target has keep their kinds and order and are
    refined from where they are. reach: {kind of piece: (largest |twist|, largest curvature)} in 1/mm
    of what can be built; a kind that is not named has no limits. Deterministic; some 0.05 s for 150 points.
    """
    options = options or target.split
    return _told(*fitted(target, options, reach), target, options)


def fitted(
    target: Target,
    options: SplitOptions | None = None,
    reach: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[RodFit, float]:
    """The `RodFit` behind it, before conventions and words, and the noise of what it was fitted to, mm."""
    options = options or target.split
    points, frames, weights = _thinned(target)
    if len(points) < len(target.points):
        log.info(words.thinned(len(target.points)))
    _, s = arc_lengths(points)
    length = float(s[-1])
    floor = FLOOR * length if options.tolerance is None else options.tolerance
    shortest = min(options.shortest, length)
    data = Observations(
        points,
        floor,
        s,
        frames=frames,
        base=target.base_rotation,
        weights=weights,
        shortest=shortest,
    )
    stretches = Stretches(points, s, floor, shortest, frames)
    data = replace(data, noise=stretches.noise, noise_seen=stretches.noise_seen)
    if target.pieces:
        fit = refined(_given(target, data, s), POLISH, 1e-4)
    else:
        fit = found(data, stretches, options.most_pieces)
        said = _noise(fit, floor, options.most_pieces)
        if said != (data.noise, data.lever):
            # what the whole rod leaves says more than what the shortest stretches do
            data = replace(data, noise=said[0], lever=said[1])
            again = found(data, stretches, options.most_pieces)
            kept = searched(replace(fit, data=data), options.most_pieces)
            fit = min(again, kept, key=lambda f: f.criterion)
    noise = fit.noise if fit.poor < POOR else data.noise
    if reach and (abs(fit.rod.strains) > replace(fit, data=replace(data, reach=reach)).most).any():
        # the curve says what it is made of, what can be reached how nearly it is met
        for _ in range(2):
            fit = refined(replace(fit, data=replace(data, reach=reach)), POLISH, 1e-4)
            data = replace(data, noise=max(noise, fit.noise))
    return fit, noise


def _given(target, data, s):
    """The `RodFit` of the target's own pieces where the best rigid motion puts them."""
    pieces = extract(target, target.pieces)
    strains = np.array([[p.twist, -p.curvature if p.roll == 180 else p.curvature] for p in pieces])
    free = np.array([[p.kind in (TWISTING, HELICAL), p.kind in (BENDING, HELICAL)] for p in pieces])
    ends = np.cumsum([p.length for p in pieces])
    rod = PiecewiseRod(np.eye(4), ends[:-1] * s[-1] / ends[-1], strains * free)
    start = best_rigid_fit(rod.at(s).points, data.points, np.ones(len(s)))
    return RodFit(data, replace(rod, start=start), free, s)


def _noise(fit, floor, most):
    """(noise, lever) that a fit speaks for; those that were assumed where they will do, or where the points
    are too far from any rod to say anything."""
    noise, lever = fit.data.noise, fit.data.lever
    if (fit.lengths < fit.data.shortest + 1.0).any() or len(fit.free) == most:
        return noise, lever  # it may be the limits that keep it away
    left = max(fit.noise, floor)
    if 0.5 < left / noise < 2.0 and not 0.8 < left / noise < 1.25:
        noise = left
    if fit.frame_noise > 1.5 * left:
        # frames that are less certain than points are measured at a shorter lever
        lever *= left / fit.frame_noise
    return noise, lever


def found(data: Observations, stretches: Stretches, most: int) -> RodFit:
    """The best rod of at most `most` pieces from all starts."""
    best = None
    for price in PRICES:
        starts = [
            f
            for f in first_rods(data, stretches, LOOSE, price)
            if allowed(f.free, data.frames is not None, data.base is not None)
        ]
        fits = [refined(f) for f in starts]
        fit = searched(min(fits, key=lambda f: f.criterion), most)
        if best is None or fit.criterion < best.criterion:
            best = fit
        if best.poor < POOR:
            break
    assert best is not None
    return best


def _thinned(target):
    """(points, frames, weights that are 1 on average or None): means of neighbours where there are many."""
    points, frames, weights = target.points, target.frames, target.weights
    if len(points) > MOST_POINTS:
        edges = np.linspace(0, len(points), THINNED + 1).astype(int)
        counts = np.diff(edges)
        points = np.add.reduceat(points, edges[:-1], axis=0) / counts[:, None]
        if weights is not None:
            weights = np.add.reduceat(weights, edges[:-1]) / counts
        if frames is not None:
            sums = np.add.reduceat(frames.reshape(-1, 9), edges[:-1], axis=0).reshape(-1, 3, 3)
            U, _, Vt = np.linalg.svd(sums)
            frames = U @ Vt
    if weights is not None:
        weights = None if np.ptp(weights) == 0 else weights / weights.mean()
    return points, frames, weights


def _told(fit, noise, target, options):
    """The `Segmentation` of the final fit, in the conventions that `words` tells."""
    data = fit.data
    free_base = data.frames is None and data.base is None
    strains = fit.rod.strains.copy()
    first, last = ends(fit.feet, noise)
    station = fit.rod.at(np.array([first]))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = station.frames[0], station.points[0]
    bent = np.flatnonzero(strains[:, 1])
    if free_base and len(bent) and strains[bent[0], 1] < 0:
        # half a turn of the base changes no point: the first bend is one that is not rolled
        strains[:, 1] *= -1
        pose[:3, 1:3] *= -1
    lengths = np.diff(np.concatenate([[first], fit.rod.joints, [last]]))
    pieces = tuple(
        Piece(
            kind,
            float(length),
            twist=float(k1),
            curvature=float(abs(k2)),
            roll=180.0 if k2 < 0 else 0.0,
        )
        for kind, length, (k1, k2) in zip(fit.kinds, lengths, strains)
    )
    errors = np.zeros((len(pieces), 3))
    variances = np.zeros(fit.free.size)
    variances[np.flatnonzero(fit.free)] = np.diag(fit.covariance)[5 + len(pieces) :]
    errors[:, :2] = np.sqrt(variances).reshape(-1, 2)
    count = max(2, int(np.ceil((last - first) / SPACING)) + 1)
    curve = Curve(fit.rod.at(np.linspace(first, last, count)).points)
    noise *= np.sqrt(len(target.points) / len(data.points))
    return Segmentation(
        pieces,
        pose,
        np.column_stack([strains, np.zeros(len(pieces))]),
        errors,
        float(noise),
        fit.rms,
        fit.criterion,
        curve,
        tuple(words.told(fit, pieces, target, options)),
    )
