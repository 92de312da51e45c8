"""The law of one kind from the states of cells: Gaussian processes for the path of free states and for their
stiffness, the enthalpy around them, and intervals from the residuals of a cross-validation by design
(conformal, with the process's deviation as their shape).
"""

from dataclasses import replace

import numpy as np

from pneunet.geometry.parameters import ONE_SIDED, TWISTING
from pneunet.reduced.trained.closing import Closing, learned_closing
from pneunet.reduced.trained.coordinates import Coordinates, cosine, odd
from pneunet.reduced.trained.enthalpy import symmetric
from pneunet.reduced.trained.free_path import FreePath
from pneunet.reduced.trained.free_stiffness import FreeStiffness, order
from pneunet.reduced.trained.kind_law import LOWEST, KindLaw
from pneunet.reduced.trained.mesh import MeshDifference
from pneunet.reduced.trained.recorded import Recorded
from pneunet.reduced.trained.side_by_side import SideBySide
from pneunet.reduced.training.anharmonic import fit_anharmonic
from pneunet.reduced.training.landmarks import LANDMARKS, with_cheap_doubt
from pneunet.reduced.training.meshes import INTERVAL, converged_sample, fit_meshes
from pneunet.reduced.training.regression import LOG_NOISES, FitSettings, Slopes, fit_side_by_side
from pneunet.reduced.training.slopes import in_deviations, known_slopes, slopes_of, told_by_angle
from pneunet.reduced.training.states import Sample, States, folds

#: of the cross-validation that intervals come from
FOLDS = 10
#: the training designs' ranges are widened by this part before a design is outside
MARGIN = 0.02

#: points that the free states are summed up on: more where that many states are known (measured, twisting:
#: half of 1,600 points' error)
INDUCING = {ONE_SIDED: 1600, TWISTING: 3200}
#: those of how walls close; of the rough process that the search for the leading strain starts from: within
#: some 3 % of it (measured: median), from where one step is mostly enough; of the stiffness; and of what is
#: recorded besides
CLOSING, ROUGH, OF_STIFFNESS, OF_RECORDED = 1000, 300, 2200, 600
#: times the largest leading strain of the training designs: up to there paths of free states are followed
FURTHEST = 1.2
#: a deviation above this many times the largest one at the training points, rest included, is outside
DOUBT = 2.0
#: of what is learned (of the strains: the leading one's logarithm) over a standard deviation of the inputs:
#: above that a state is next to its limit load or walls are just touching, where derivatives grow without
#: bound. (Those of the stiffness where walls touch are left out altogether; measured: with them its error is
#: a fifth larger.)
STEEPEST = 1.0
#: designs seen to touch that suffice to learn what contact adds to the stiffness; and bounds of its noises:
#: mesh points come into contact one by one
TELLING = 10
CONTACT_NOISES = tuple((low, np.log(most)) for (low, _), most in zip(LOG_NOISES, (1e-2, 1e-2, 1.0)))
#: states that the metric of how far walls close is found on: without slopes, and with one output, more cost
#: little
MANY = 1200
#: those that the metric of what is recorded besides is found on
FEW = 200


def fit_path(
    states: States, like: FreePath | None = None, again: bool = False, slopes: bool = True
) -> FreePath:
    """The FreePath of the free states; the leading strain has a metric of its own (measured: a quarter off
    its error). Without remainder and with the first inducing points as landmarks: `with_cheap_doubt` finds
    better ones."""
    states = states.loaded
    co = Coordinates(states.kind)
    closing = fit_closing(states, like.closing.process if like else None, again)

    def inputs(s: States) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            lead = co.leading(s.strains)
            return co.path_inputs(s.numbers, lead, closing.overlap(s.numbers, s.pressure, lead))

    def outputs(s: States) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return co.learned_strains(s.numbers, s.pressure, s.strains)

    x, y = inputs(states), outputs(states)
    good = np.isfinite(y).all(axis=1)  # the leading strain is larger than 0
    at_pressure = states.inputs

    def ease(s: States) -> np.ndarray:
        return -outputs(s)[:, :1]

    steep, rising = None, None
    if slopes:
        known = known_slopes(states.strain_slopes) & told_by_angle(states)
        steep = slopes_of(states, known, inputs, outputs, good)
        steep = _gentle(steep, x[good])
        rising = slopes_of(states, known, lambda s: s.inputs, ease, good)
        rising = _gentle(rising, at_pressure[good])
    learned = fit_strains(states, good, x, y, steep, like.learned if like else None, again)
    data = at_pressure[good], -y[good, :1], states.design[good], np.ones((good.sum(), 1)), (1,), rising
    start = fit_side_by_side(*data, like.start if like else None, FitSettings(inducing=ROUGH, again=again))
    furthest = FURTHEST * float(co.leading(states.strains).max())
    none, first = np.zeros((2, 2)), np.arange(min(LANDMARKS, len(learned.processes[0].inducing)))
    return FreePath(states.kind, closing, learned, start, furthest, none, first)


def _gentle(slopes, inputs):
    """The Slopes below STEEPEST, at inputs (n, d)."""
    return slopes.of((np.abs(in_deviations(slopes, inputs)) < STEEPEST).all(axis=1))


def fit_strains(
    states: States,
    good: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    slopes: Slopes | None = None,
    like: SideBySide | None = None,
    again: bool = False,
) -> SideBySide:
    """SideBySide processes of Coordinates.learned_strains y (n, p) at inputs x (n, d) of the States that are
    `good` (n,), the leading strain's first; slopes: at those; like, again: as for
    regression.fit."""
    trust = odd(Coordinates(states.kind).strain_parity, np.abs(cosine(states.numbers)))
    data = x[good], y[good], states.design[good], trust[good]
    settings = FitSettings(inducing=INDUCING[states.kind], again=again)
    return fit_side_by_side(*data, (1, y.shape[1] - 1), slopes, like, settings)


def fit_closing(states: States, like: SideBySide | None = None, again: bool = False) -> Closing:
    """The Closing of free states; like: the process of another one."""
    if len(np.unique(states.design[states.touching])) < TELLING:
        return Closing(states.kind, None)
    states = states.of(np.isfinite(states.closing))
    co = Coordinates(states.kind)
    x = co.closing_inputs(states.numbers, co.closing_load(states.pressure, co.leading(states.strains)))
    data = x, learned_closing(states.closing)[:, None], states.design, np.ones((len(x), 1))
    settings = FitSettings(most=MANY, inducing=CLOSING, again=again)
    return Closing(states.kind, fit_side_by_side(*data, (1,), like=like, settings=settings))


def fit_stiffness(
    states: States, closing: Closing, like: FreeStiffness | None = None, again: bool = False
) -> FreeStiffness:
    """The FreeStiffness of free states whose walls close as the Closing says."""
    co = Coordinates(states.kind)
    y = co.learned_stiffness(states.numbers, states.matrices)
    good, touching = np.isfinite(y).all(axis=1), states.touching
    if closing.process is None or len(np.unique(states.design[touching & good])) < TELLING:
        return FreeStiffness(states.kind, _fit_smooth(states.of(good), like, again), None)
    smooth = _fit_smooth(states.of(good & ~touching), like, again)
    states, y = states.of(good & touching), y[good & touching]
    closed = closing.closed(states.numbers, states.pressure, states.strains)
    added = (y - smooth(co.stiffness_inputs(states.numbers, states.strains)))[:, order(co)]
    trust = _trust_in_stiffness(states)[:, order(co)]
    data = co.contact_inputs(states.numbers, states.strains, closed), added, states.design, trust
    known, settings = like.contact if like else None, FitSettings(again=again, noises=CONTACT_NOISES)
    contact = fit_side_by_side(*data, (1, added.shape[1] - 1), like=known, settings=settings)
    return FreeStiffness(states.kind, smooth, contact)


def _trust_in_stiffness(states):
    """(n, p) trust of regression.fit in what is learned of the stiffness: what is odd in the angle's cosine
    was divided by it."""
    return odd(Coordinates(states.kind).stiffness_parity, np.abs(cosine(states.numbers)))


def _fit_smooth(states, like, again):
    """Gaussian process of Coordinates.learned_stiffness, by slopes too where walls do not touch."""
    co = Coordinates(states.kind)

    def inputs(s: States) -> np.ndarray:
        return co.stiffness_inputs(s.numbers, s.strains)

    def outputs(s: States) -> np.ndarray:
        return co.learned_stiffness(s.numbers, s.matrices)

    x, y = inputs(states), outputs(states)
    known = known_slopes(states.matrix_slopes) & told_by_angle(states)
    known &= ~states.touching[:, None]
    steep = slopes_of(states, known, inputs, outputs, np.ones(len(y), bool))
    steep = _gentle(steep, x)
    data = x, y, states.design, _trust_in_stiffness(states)
    settings = FitSettings(inducing=OF_STIFFNESS, again=again)
    return fit_side_by_side(*data, (y.shape[1],), steep, like.smooth if like else None, settings)


def fit_kind(sample: Sample, like: KindLaw | None = None, again: bool = True, part: bool = False) -> KindLaw:
    """The KindLaw of a Sample; `like`: another one from whose metrics and noise the search for them starts,
    or, unless `again`, which are taken as they are. With finer grids the coarse one is learned first, then
    what they change, and what that gives in the same way. part: of what `like` was learned from; its
    quantiles and what is uncertain of its grids are taken too, and doubts are left out."""
    mesh, known = MeshDifference.none(sample.free.kind), (like.path, like.stiffness) if like else (None, None)
    if sample.finer:
        path = fit_path(sample.free, like.path if like else None, again)
        stiffness = fit_stiffness(sample.free, path.closing, like.stiffness if like else None, again)
        mesh, again = fit_meshes(sample, path, stiffness, like.mesh if like and part else None), False
        sample, known = converged_sample(sample, mesh), (path, stiffness)
    states, around = sample.free, sample.around
    path = fit_path(states, known[0], again)
    stiffness = fit_stiffness(states, path.closing, known[1], again)
    co = Coordinates(states.kind)
    closed = path.closing.closed(around.numbers, around.pressure, around.strains)
    x = co.around_inputs(around.numbers, around.strains, closed)
    anharmonic = fit_anharmonic(
        states.kind, x, cosine(around.numbers), symmetric(around.matrices), sample.change, sample.forces
    )
    x = co.ranged(states.numbers, states.pressure)
    _, _, there = path.at(states.numbers, np.maximum(states.pressure, LOWEST))
    doubt = DOUBT * float(path.learned.processes[0].deviation(there).max())
    path = path if part else with_cheap_doubt(path, there)
    margin = MARGIN * (x.max(axis=0) - x.min(axis=0))
    low, high = x.min(axis=0) - margin, x.max(axis=0) + margin
    low[0] = 0.0  # 90 degrees, where the angle and its mirror image meet, has data on both sides
    # where the sample of silicones begins: a neo-Hookean one
    low[co.stiffening] = np.minimum(low[co.stiffening], 0.0)
    besides = None if part else fit_recorded(states, path.closing)
    quantile = like.quantile if like and part else np.ones(6)
    law = KindLaw(states.kind, path, stiffness, anharmonic, besides, mesh, quantile, low, high, doubt)
    return law if part else replace(law, quantile=_quantiles(law, states.loaded, sample.drawn))


def fit_recorded(states: States, closing: Closing) -> Recorded | None:
    """The Recorded of free states; None where their stretch is not known."""
    states = states.of((states.pressure > 0) & np.isfinite(states.stretch))
    if not len(states.stretch):
        return None
    lead = Coordinates(states.kind).leading(states.strains)
    states, lead = states.of(lead > 0), lead[lead > 0]
    over = closing.overlap(states.numbers, states.pressure, lead)
    x = Coordinates(states.kind).path_inputs(states.numbers, lead, over)
    y = np.log(np.column_stack([(states.stretch - 1) / lead, states.volume]))
    trust = np.ones(y.shape)
    return Recorded(
        fit_side_by_side(
            x, y, states.design, trust, (1, 1), settings=FitSettings(most=FEW, inducing=OF_RECORDED)
        )
    )


def _quantiles(law, states, drawn):
    """(6,) what deviations are multiplied by for INTERVAL of the cross-validated residuals to lie within.
    Those of designs that were drawn like the held-out ones, with numbers below `drawn`: the chosen ones are
    harder, and would widen the intervals."""
    scores = []
    for judged in folds(np.unique(states.design[states.design < drawn]), FOLDS):
        out = np.isin(states.design, judged)
        path, t = fit_path(states.of(~out), like=law.path), states.of(out)
        found, spread, _ = path.strains_and_spread(t.numbers, t.pressure, exact=True)
        miss = np.abs(found - t.strains)
        scores.append(np.divide(miss, spread, out=np.zeros_like(miss), where=spread > 0))
    return np.quantile(np.concatenate(scores), INTERVAL, axis=0)
