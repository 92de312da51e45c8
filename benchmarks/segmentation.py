"""The split of 200 random targets against the pieces that they are made of: the part `segmentation`."""

import time

import numpy as np

from benchmarks.random_curves import NOISE, RandomTarget, random_targets

#: of its standard error: below it a torsion or twist is not told from none by any method
TOLD = 5.0
SAME = 0.02  # of the criterion (-2 log of evidence): by what two refinements of the same split may differ
SAMPLES = 0.02  # mm between the points of a true curve that distances are measured to


def _truth(target: RandomTarget, data):
    """The `RodFit` of the true split to the points, from the true rod on."""
    from pneunet.design.segmentation.fit import RodFit, refined
    from pneunet.design.segmentation.rod import PiecewiseRod
    from pneunet.design.segmentation.search import untwisted

    ends = np.cumsum(target.lengths)
    rod = PiecewiseRod(target.pose, ends[:-1], target.strains)
    free = np.array([[k in ("twisting", "helical"), k in ("bending", "helical")] for k in target.kinds])
    s = np.linspace(0, ends[-1], 4000)
    distances = np.sum((target.points[:, None] - target.exact(s)) ** 2, axis=2)
    # the order of the points is known: far turns that pass close by are not their feet
    guess = np.linspace(0, ends[-1], len(target.points))
    distances[abs(s - guess[:, None]) > 0.3 * ends[-1]] = np.inf
    fit = refined(RodFit(data, rod, free, s[np.argmin(distances, axis=1)]), 60, 1e-4)
    return refined(untwisted(fit), 60, 1e-4)


def _told(truth) -> bool:
    """Whether every torsion of the true split, and every twist modulo half a turn, shows in the points."""
    first = 5 + len(truth.free)
    errors = np.zeros(truth.free.size)
    errors[np.flatnonzero(truth.free)] = np.sqrt(np.diag(truth.covariance)[first:])
    k1, wanted = abs(truth.rod.strains[:, 0]), truth.free[:, 0]
    return bool((k1 > TOLD * errors.reshape(-1, 2)[:, 0])[wanted].all())


def _distances(target, fit):
    """(how far each joint is from the true one along the true curve, RMS distance of the curves), mm."""
    length = target.lengths.sum()
    s = np.arange(0, length, SAMPLES)
    exact = target.exact(s)
    joints = fit.rod.at(fit.rod.joints)
    feet = np.linspace(fit.feet[0], fit.feet[-1], 201)
    points = fit.rod.at(feet).points

    def nearest(point, guess):
        near = np.flatnonzero(abs(s - guess) < 15.0)
        square = np.sum((exact[near] - point) ** 2, axis=1)
        best = int(np.argmin(square))
        return s[near[best]], square[best]

    ends = np.cumsum(target.lengths)[:-1]
    off = []
    if len(joints.points) == len(ends):
        found = [nearest(p, at - fit.feet[0])[0] for p, at in zip(joints.points, fit.rod.joints)]
        off = list(abs(np.array(found) - ends)) if len(ends) else []
    squares = [nearest(p, at - fit.feet[0])[1] for p, at in zip(points, feet)]
    return off, float(np.sqrt(np.mean(squares)))


def segmentation(count: int | None = None, noise: float = NOISE, seed: int | None = None):
    """Figures of the part, with the targets that went wrong as details; other arguments for studies."""
    from pneunet.design.segmentation.segment import fitted
    from pneunet.design.target.target import Target

    given = {key: value for key, value in (("count", count), ("seed", seed)) if value is not None}
    targets = random_targets(noise=noise, **given)
    right, optimal, kinds, off, rms, seconds, wrong = [], [], [], [], [], [], []
    for i, target in enumerate(targets):
        started = time.process_time()
        fit, _ = fitted(Target(target.points))
        seconds.append(time.process_time() - started)
        truth = _truth(target, fit.data)
        right.append(len(fit.kinds) == len(target.kinds))
        optimal.append(fit.criterion <= truth.criterion + SAME)
        if _told(truth):
            kinds.append(tuple(fit.kinds) == target.kinds)
        here, distance = _distances(target, fit)
        off += here
        rms.append(distance / target.lengths.sum())
        if not (right[-1] and optimal[-1]):
            wrong.append(
                f"{i}: {' '.join(fit.kinds)} ({fit.criterion:.2f}) for {' '.join(target.kinds)}"
                f" ({truth.criterion:.2f})"
            )
    for text in wrong:
        print("  ", text, flush=True)
    figures = {
        "segmentation_count_right": np.mean(right),
        "segmentation_break_median_mm": np.median(off),
        "segmentation_break_p90_mm": np.quantile(off, 0.9),
        "segmentation_rms_rel_median": np.median(rms),
        "segmentation_rms_rel_max": np.max(rms),
        "segmentation_optimal": np.mean(optimal),
        "segmentation_kinds_right": np.mean(kinds),
        "segmentation_seconds_median": np.median(seconds),
    }
    details = {"wrong": wrong, "kinds_judged": len(kinds), "seconds_p95": float(np.quantile(seconds, 0.95))}
    return {key: float(value) for key, value in figures.items()}, details


if __name__ == "__main__":
    import sys

    arguments = sys.argv[1:]
    print(segmentation(int(arguments[0]), float(arguments[1]), int(arguments[2])))
