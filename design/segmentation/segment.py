"""The public function: a target in, its `Segmentation` out."""

import logging
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pneunet.base.curve import Curve
from pneunet.design.segmentation import words
from pneunet.design.segmentation.fit import Fit, Observations, refined
from pneunet.design.segmentation.search import allowed, searched
from pneunet.design.segmentation.segmentation import Segmentation
from pneunet.design.segmentation.start import first_rods
from pneunet.design.segmentation.windows import Stretches, arc_lengths
from pneunet.design.target.target import Piece, SplitOptions, Target

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

    options: by default the target's own. reach: {kind of piece: (largest |twist|, largest curvature)} in 1/mm
    of what can be built; a kind that is not named has no limits. Deterministic; some 0.05 s for 150 points.
    """
    options = options or target.split
    return _told(fitted(target, options, reach), target, options)


def fitted(
    target: Target,
    options: SplitOptions | None = None,
    reach: Mapping[str, tuple[float, float]] | None = None,
) -> Fit:
    """The `Fit` behind it, before conventions and words."""
    options = options or target.split
    points, frames, block = _thinned(target.points, target.frames)
    if block > 1:
        log.info(words.thinned(len(target.points)))
    _, s = arc_lengths(points)
    length = float(s[-1])
    floor = FLOOR * length if options.tolerance is None else options.tolerance
    shortest = min(options.shortest, length)
    stretches = Stretches(points, s, floor, shortest, frames)
    data = Observations(
        points,
        stretches.noise,
        length,
        frames=frames,
        base=target.base_rotation,
        shortest=shortest,
        reach=reach or {},
    )
    fit = found(data, stretches, options.most_pieces)
    if not 0.8 < max(fit.noise, floor) / data.noise < 1.25:
        # what the whole rod leaves is a better estimate than the shortest stretches'
        data = replace(data, noise=max(fit.noise, floor))
        again = found(data, stretches, options.most_pieces)
        kept = searched(Fit(data, fit.rod, fit.free, fit.feet), options.most_pieces)
        fit = min(again, kept, key=lambda f: f.criterion)
    return _within_reach(fit)


def found(data: Observations, stretches: Stretches, most: int) -> Fit:
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
        left = data.values - len(best.columns)
        if best.square / data.noise**2 < left + POOR * np.sqrt(2 * max(left, 1)):
            break
    assert best is not None
    return best


def _thinned(points, frames):
    """(points, frames, how many points each is the mean of); of frames the middle one is kept."""
    if len(points) <= MOST_POINTS:
        return points, frames, 1
    edges = np.linspace(0, len(points), THINNED + 1).astype(int)
    means = np.add.reduceat(points, edges[:-1], axis=0) / np.diff(edges)[:, None]
    middles = (edges[:-1] + edges[1:]) // 2
    return means, None if frames is None else frames[middles], len(points) / THINNED


def _within_reach(fit):
    """With strains exactly within reach: the penalty lets them out by a little."""
    if not fit.data.reach:
        return fit
    most = np.array([fit.data.reach.get(kind, (np.inf, np.inf)) for kind in fit.kinds])
    strains = np.clip(fit.rod.strains, -most, most)
    return Fit(fit.data, replace(fit.rod, strains=strains), fit.free, fit.feet)


def _told(fit, target, options):
    """The `Segmentation` of the final fit, in the conventions that `words` tells."""
    data = fit.data
    free_base = data.frames is None and data.base is None
    strains = fit.rod.strains.copy()
    first, last = float(fit.feet[0]), float(fit.feet[-1])
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
    left = max(1, data.values - len(fit.columns) + 1)
    noise = float(np.sqrt(fit.square / left * len(target.points) / len(data.points)))
    return Segmentation(
        pieces,
        pose,
        np.column_stack([strains, np.zeros(len(pieces))]),
        errors,
        noise,
        fit.rms,
        fit.criterion,
        curve,
        tuple(words.told(fit, pieces, target, options)),
    )
