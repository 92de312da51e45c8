"""`pneunet train`: the rod law from the data set of cells, and how well it does on designs that it has not seen.

Compared for the free strains, on the held-out designs: the analytic models with one fitted factor for each strain, the regressor
over the pressure, alone and for what the analytic models leave, the regressor along the path of free states, and the one that learns
from derivatives by the shape too. The law that is written is the last one: the analytic cell costs milliseconds a state. Intervals
come from the residuals of a cross-validation by design (conformal, with the Gaussian process's deviation as their shape); nothing of
the held-out designs is used before the last table. Where they are few, laws trained on parts of the training designs are judged on
the other ones too (reduced.states.splits); they find metric and noise anew.
"""

import hashlib
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from base.dataset import read_dataset
from base.errors import ConvergenceError, InputError
from base.files import write_text
from base.materials import NeoHookean
from geometry.shape_numbers import segment_of
from reduced import gaussian
from reduced.free_path import FreePath
from reduced.free_stiffness import FreeStiffness, order
from reduced.judging import PITCH, figures, finest_mesh, misses, strain_error, symmetric
from reduced.law import LOWEST, KindLaw, RodLaw, write_law
from reduced.law_coordinates import REST, Coordinates, cosine, odd
from reduced.model import AnalyticModel
from reduced.potential import fit_anharmonic
from reduced.states import folds, sample_of, splits

#: of the cross-validation that intervals come from
FOLDS = 10
INTERVAL = 0.9
#: parts of the training designs in the learning curve
CURVE = (0.25, 0.5, 1.0)
#: the training designs' ranges are widened by this part before a design is outside
MARGIN = 0.02

#: points that the free states are summed up on, as many as 10,000 of them may cost in a quarter of a second; and those of the rough
#: process that the search for the leading strain starts from: within some 3 % of it (measured: median), from where one step is
#: mostly enough
INDUCING, ROUGH = 1300, 300
#: times the largest leading strain of the training designs: up to there paths of free states are followed
FURTHEST = 1.2
#: a deviation above this many times the largest one at the training points, rest included, is outside
DOUBT = 2.0
#: step of central differences along directions of shape (degrees, normal pitches): the transformations are smooth there
STEP = 1e-4

#: of what is learned (of the strains: the leading one's logarithm) over a standard deviation of the inputs: above that a state is next
#: to its limit load or walls are just touching, where derivatives grow without bound. (Those of the stiffness where walls touch are left
#: out altogether; measured: with them its error is a fifth larger.)
STEEPEST = 1.0
#: designs seen to touch that suffice to learn what contact adds to the stiffness; and bounds of its noises: mesh points come into contact
#: one by one
TELLING, CONTACT_NOISES = 10, tuple((low, np.log(most)) for (low, _), most in zip(gaussian.LOG_NOISES, (1e-2, 1e-2, 1.0)))
#: states that the metric of how far walls close is found on: without slopes, and with one output, more cost little
MANY = 1200
#: of the angle, below which derivatives along it are not used
SMALLEST_COSINE = 0.2

# ---- fitting


def slopes_of(states, known, inputs, outputs, some):
    """gaussian.Slopes of the states where they are `known` (n, s), among those that are `some` (n,).

    inputs, outputs: functions of (shape, strains, matrices, states) that give what the process sees.
    """
    at, way = np.nonzero(known & some[:, None])
    s, change = states.of(at), (states.directions[way], states.strain_slopes[at, way], states.matrix_slopes[at, way])
    ends = [[a + sign * STEP * b for a, b in zip((s.shape, s.strains, s.matrices), change)] for sign in (1, -1)]
    ways, values = ((f(*ends[0], s) - f(*ends[1], s)) / (2 * STEP) for f in (inputs, outputs))
    return gaussian.Slopes((np.cumsum(some) - 1)[at], ways, values)


def in_deviations(slopes, inputs):
    """(r, p) Slopes over a standard deviation of the inputs (n, d)."""
    return slopes.in_units(np.maximum(inputs.std(axis=0), 1e-12)).values


def told_by_angle(states):
    """(n, s) bool: not along the angle near 90 degrees, where what is odd in its cosine is divided by it."""
    return (np.abs(cosine(states.shape)) > SMALLEST_COSINE)[:, None] | (states.directions[:, 0] == 0)


def fit_path(states, like=None, again=False, slopes=True):
    """The FreePath of the free states; the leading strain has a metric of its own (measured: a quarter off its error)."""
    states = states.loaded
    co = Coordinates(states.kind)

    def inputs(shape, strains, matrices, s):
        with np.errstate(invalid="ignore"):
            return co.path_inputs(shape, co.leading(strains), s.level)

    def outputs(shape, strains, matrices, s):
        with np.errstate(invalid="ignore"):
            return co.learned_strains(shape, s.pressure, strains)

    x, y = inputs(states.shape, states.strains, None, states), outputs(states.shape, states.strains, None, states)
    good = np.isfinite(y).all(axis=1)  # the leading strain is larger than 0
    steep = None
    if slopes:
        known = np.isfinite(states.strain_slopes).all(axis=2) & told_by_angle(states)
        steep = slopes_of(states, known, inputs, outputs, good)
        steep = steep.of((np.abs(in_deviations(steep, x[good])) < STEEPEST).all(axis=1))
    learned = _fit_strains(states, good, x, y, steep, like and like.learned, again)
    start = gaussian.fit_side_by_side(states.inputs[good], -y[good, :1], states.case[good], np.ones((good.sum(), 1)), (1,), inducing=ROUGH)
    return FreePath(states.kind, learned, start, FURTHEST * float(co.leading(states.strains).max()))


def _fit_strains(states, good, x, y, slopes=None, like=None, again=False):
    trust = odd(Coordinates(states.kind).strain_parity, np.abs(cosine(states.shape)))
    settings = {"slopes": slopes, "like": like, "again": again, "inducing": INDUCING}
    return gaussian.fit_side_by_side(x[good], y[good], states.case[good], trust[good], (1, y.shape[1] - 1), **settings)


def fit_closing(states, like=None, again=False):
    """Gaussian process of `States.closing`."""
    states = states.of(np.isfinite(states.closing))
    co = Coordinates(states.kind)
    x, y = co.closing_inputs(states.shape, co.closing_load(states.pressure, states.strains)), states.closing[:, None]
    return gaussian.fit_side_by_side(x, y, states.case, np.ones(y.shape), (1,), like=like, again=again, most=MANY)


def fit_stiffness(states, like=None, again=False):
    """The FreeStiffness of free states."""
    co = Coordinates(states.kind)
    closing = fit_closing(states, like and like.closing, again)
    y = co.learned_stiffness(states.shape, states.matrices)
    good, touching = np.isfinite(y).all(axis=1), states.touching
    if len(np.unique(states.design[touching & good])) < TELLING:
        return FreeStiffness(states.kind, closing, _fit_smooth(states.of(good), like and like.smooth, again), None)
    smooth = _fit_smooth(states.of(good & ~touching), like and like.smooth, again)
    states, y = states.of(good & touching), y[good & touching]
    closed = FreeStiffness(states.kind, closing, smooth, None).closed(states.shape, states.pressure, states.strains)
    added = (y - smooth(co.stiffness_inputs(states.shape, states.strains, states.level)))[:, order(co)]
    trust, x = _trust_in_stiffness(states)[:, order(co)], co.contact_inputs(states.shape, states.strains, closed)
    settings = {"like": like and like.contact, "again": again, "noises": CONTACT_NOISES}
    contact = gaussian.fit_side_by_side(x, added, states.case, trust, (1, added.shape[1] - 1), **settings)
    return FreeStiffness(states.kind, closing, smooth, contact)


def _trust_in_stiffness(states):
    """(n, p) trust of gaussian.fit in what is learned of the stiffness: what is odd in the angle's cosine was divided by it."""
    return odd(Coordinates(states.kind).stiffness_parity, np.abs(cosine(states.shape)))


def _fit_smooth(states, like, again):
    """Gaussian process of Coordinates.learned_stiffness, by slopes too where walls do not touch."""
    co = Coordinates(states.kind)

    def inputs(shape, strains, matrices, s):
        return co.stiffness_inputs(shape, strains, s.level)

    def outputs(shape, strains, matrices, s):
        return co.learned_stiffness(shape, matrices)

    x, y = inputs(states.shape, states.strains, None, states), outputs(states.shape, None, states.matrices, states)
    known = np.isfinite(states.matrix_slopes).all(axis=(2, 3)) & told_by_angle(states) & ~states.touching[:, None]
    steep = slopes_of(states, known, inputs, outputs, np.ones(len(y), bool))
    steep = steep.of((np.abs(in_deviations(steep, x)) < STEEPEST).all(axis=1))
    return gaussian.fit_side_by_side(x, y, states.case, _trust_in_stiffness(states), (y.shape[1],), steep, like, again=again)


def fit_kind(sample, like=None):
    """The KindLaw of a Sample; `like`: another one from whose metrics and noise the search for them starts."""
    states, around = sample.free, sample.around
    path = fit_path(states, like and like.path, again=True)
    stiffness = fit_stiffness(states, like and like.stiffness, again=True)
    co = Coordinates(states.kind)
    closed = stiffness.closed(around.shape, around.pressure, around.strains)
    x = co.around_inputs(around.shape, around.strains, closed)
    anharmonic = fit_anharmonic(states.kind, x, cosine(around.shape), symmetric(around.matrices), sample.change, sample.forces)
    x = states.inputs
    level = int(states.level.max())
    doubt = DOUBT * float(path.deviation(path.at(states.shape, np.maximum(states.pressure, LOWEST), level)[-1]).max())
    margin = MARGIN * (x.max(axis=0) - x.min(axis=0))
    low, high = x.min(axis=0) - margin, x.max(axis=0) + margin
    low[0] = 0.0  # 90 degrees, where the angle and its mirror image meet, has data on both sides
    law = KindLaw(states.kind, path, stiffness, anharmonic, np.ones(6), low, high, doubt, level)
    return replace(law, quantile=_quantiles(law, states.loaded))


def _quantiles(law, states):
    """(6,) what deviations are multiplied by for INTERVAL of the cross-validated residuals to lie within."""
    scores = []
    for learned, judged in folds(np.unique(states.design), FOLDS):
        path = fit_path(states.of(np.isin(states.design, learned)), like=law.path)
        t = states.of(np.isin(states.design, judged))
        spread = path.spread(t.shape, t.pressure, t.level)
        miss = np.abs(path.strains(t.shape, t.pressure, t.level) - t.strains)
        scores.append(np.divide(miss, spread, out=np.zeros_like(miss), where=spread > 0))
    return np.quantile(np.concatenate(scores), INTERVAL, axis=0)


def judge_again(law, learned, judged):
    """`misses` on a Sample of the law that another Sample gives."""
    return misses(fit_kind(learned, law), judged)


# ---- the laws compared


def analytic_strains(states):
    """(n, 6) strains of the analytic models at P > 0, nan beyond their limit loads."""
    out, model, material = np.full(states.strains.shape, np.nan), AnalyticModel(), NeoHookean(mu=1.0)
    scale = np.array([1, 1, 1, PITCH, PITCH, PITCH])
    for number in np.unique(states.design):
        rows = np.flatnonzero(states.design == number)
        segment = segment_of(states.kind, states.shape[rows[0]], PITCH, material)
        for last in range(len(rows), 0, -1):
            try:
                s = model.strains(segment, states.pressure[rows[:last]])
            except (ConvergenceError, InputError):
                continue
            out[rows[:last]] = np.hstack([s.e, s.k]) * scale
            break
    return out


def compare_laws(training, held_out):
    """[(law of the free strains, median error, 95th percentile, share without an answer)] on the coarsest mesh."""
    train, test = (sample.on(0).free.loaded for sample in (training, held_out))
    a_train, a_test = (analytic_strains(states) for states in (train, test))
    co = Coordinates(train.kind)
    good = np.isfinite(a_train).all(axis=1)
    w = 1 / train.size[good, None]
    a, q = (a_train[good] - REST) * w, (train.strains[good] - REST) * w
    factor = (a * q).sum(axis=0) / np.maximum((a * a).sum(axis=0), 1e-30)
    with np.errstate(invalid="ignore", divide="ignore"):
        learned = [co.learned_strains(s.shape, s.pressure, a) for s, a in ((train, a_train), (test, a_test))]
    values = co.learned_strains(train.shape, train.pressure, train.strains)
    by_pressure = []
    for y, known in ((values, 0.0), (values - learned[0], learned[1])):
        process = _fit_strains(train, np.isfinite(y).all(axis=1), train.inputs, y)
        found = process(test.inputs) + known
        by_pressure.append(co.strains(test.shape, test.pressure * np.exp(-found[:, 0]), found[:, 1:]))
    along = [fit_path(train, slopes=slopes).strains(test.shape, test.pressure, 0) for slopes in (False, True)]
    laws = {
        "calibrated analytic model": REST + factor * (a_test - REST),
        "regressor of the states, by the pressure": by_pressure[0],
        "analytic model and regressor of the states, by the pressure": by_pressure[1],
        "regressor of the states, along their path": along[0],
        "regressor of the states and their derivatives by the shape, along their path": along[1],
    }
    errors = {name: strain_error(test, strains) for name, strains in laws.items()}
    return [(name, *_spread(e), float(np.isnan(e).mean())) for name, e in errors.items()]


def _spread(error):
    good = error[np.isfinite(error)]
    return float(np.median(good)), float(np.percentile(good, 95))


def learning_curve(training, held_out):
    """[(designs trained on, median error, 95th percentile)] of the free strains for the first parts of the training designs."""
    states, test = (sample.on(0).free.loaded for sample in (training, held_out))
    numbers, rows = np.unique(states.design), []
    for part in CURVE:
        some = numbers[: max(8, round(part * len(numbers)))]
        path = fit_path(states.of(np.isin(states.design, some)))
        rows.append((len(some), *_spread(strain_error(test, path.strains(test.shape, test.pressure, 0)))))
    return rows


# ---- the command


def samples_of(data, say=lambda text: None):
    """{kind: (training Sample, held-out Sample)} of the kinds of which there are enough; InputError where there is none."""
    out = {}
    for kind in data.about["kinds"]:
        pair = training, held_out = tuple(sample_of(data, kind, held) for held in (False, True))
        designs, held = (len(sample.designs) for sample in pair)
        text = f"{kind}: {designs} designs to train on, {held} held out"
        if designs < 2 * FOLDS or not held or not len(training.forces):
            say(f"{text}: too few, or no prescribed states: the law will not know this kind")
            continue
        say(text)
        common = training.on_common_meshes()
        if common.free.level.max() < training.free.level.max():
            say(f"{kind}: too few designs on the finest mesh: the law is one of the coarser mesh")
        out[kind] = common, held_out
    if not out:
        raise InputError(f"too few accepted designs of any kind to train on ({text})")
    return out


def digest(path):
    """What a law knows its data set again by."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def run_training(path, out, say=print, compare=True, mapping=map):
    """Train on the data set at `path`; `out` (.npz) gets the law, the same name with .md its tables. Returns the RodLaw.

    mapping: a `map`, over processes for instance; what it computes side by side does not depend on how many there are.
    """
    data, started = read_dataset(path), time.perf_counter()
    try:
        samples = samples_of(data, say)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    jobs = [(fit_kind, (training,)) for training, _ in samples.values()]
    if compare:
        jobs += [(job, pair) for pair in samples.values() for job in (compare_laws, learning_curve)]
    done = list(_shown(mapping(_do, jobs), len(jobs), "trained", say))
    laws, tables = dict(zip(samples, done)), iter(done[len(samples) :])
    judged = judge(laws, samples, mapping, say)
    lines, held_out, compared = [f"# The trained law of {Path(path).name}"], held_out_figures(laws, samples), {}
    for kind, pair in samples.items():
        lines += ["", f"## {kind}", "", judged_on(*pair), "", "| figure | value |", "|---|---|"]
        lines += [f"| {name} | {value:.4f} |" for name, value in judged[kind].items()]
        if compare:
            compared[kind] = {"laws": next(tables), "learning curve": next(tables)}
            lines += [*law_table(compared[kind]["laws"]), *curve_table(compared[kind]["learning curve"])]
    about = {"data": Path(path).name, "data_sha256": digest(path), "revisions": data.about["revisions"]}
    law = RodLaw(laws, about | {"figures": judged, "held_out": held_out, "compared": compared})
    write_law(out, law)
    write_text(Path(out).with_suffix(".md"), "\n".join(lines) + "\n")
    for line in lines:
        say(line)
    say(f"law in {out}, tables in {Path(out).with_suffix('.md')}; {time.perf_counter() - started:.0f} s")
    return law


def _do(job):
    function, arguments = job
    return function(*arguments)


def held_out_figures(laws, samples):
    """{kind: {figure: number}} of KindLaws on the held-out designs alone."""
    return {kind: figures([misses(law, samples[kind][1])]) for kind, law in laws.items()}


def _shown(results, count, what, say):
    """The results as they come, each told."""
    for number, result in enumerate(results, start=1):
        say(f"{number}/{count} {what}")
        yield result


def judge(laws, samples, mapping=map, say=lambda text: None):
    """{kind: {figure: number}} of KindLaws on the designs that neither they nor, where those are few, laws of parts have seen."""
    jobs = []
    for kind, law in laws.items():
        (_, held_out), *parts = splits(*samples[kind])
        jobs += [(misses, (law, held_out)), *[(judge_again, (law, *part)) for part in parts]]
    done = iter(list(_shown(mapping(_do, jobs), len(jobs), "judged", say)))
    out = {}
    for kind, law in laws.items():
        found = [next(done) for _ in splits(*samples[kind])]
        out[kind] = figures(found) | finest_mesh(law, samples[kind][1])
    return out


def judged_on(training, held_out):
    """A sentence on which designs the figures are about."""
    designs, held = len(training.designs), len(held_out.designs)
    text = f"{designs} designs to train on, {held} held out."
    parts = len(splits(training, held_out)) - 1
    if parts:
        text += f" The figures are of all {designs + held}: of the held-out ones by the law,"
        text += f" of the others by cross-validation by design in {parts} parts."
    return text


def law_table(rows):
    """Lines of a table of `compare_laws`."""
    lines = ["", "| law of the free strains | median error | 95th percentile | without an answer |", "|---|---|---|---|"]
    return lines + [f"| {name} | {median:.4f} | {high:.4f} | {without:.1%} |" for name, median, high, without in rows]


def curve_table(rows):
    """Lines of a table of `learning_curve`."""
    lines = ["", "| designs trained on | median error | 95th percentile |", "|---|---|---|"]
    return lines + [f"| {n} | {median:.4f} | {high:.4f} |" for n, median, high in rows]
