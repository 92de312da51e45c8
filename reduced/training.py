"""`pneunet train`: the rod law from the data set of cells, and how well it does on designs that it has not seen.

Three laws are compared for the free strains: the analytic models with one fitted factor for each strain, the regressor alone, and
the regressor for what the analytic models leave. The law that is written is the regressor alone: the analytic cell costs
milliseconds a state. Intervals come from the residuals of a cross-validation by design (conformal, with the Gaussian process's
deviation as their shape); nothing of the held-out designs is used before the last table.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from base.dataset import read_dataset
from base.errors import ConvergenceError, InputError
from base.files import write_text
from base.materials import NeoHookean
from base.se3 import exp_pose
from geometry.shape_numbers import segment_of
from reduced import gaussian
from reduced.law import KindLaw, RodLaw, write_law
from reduced.law_coordinates import REST, Coordinates, cosine, odd
from reduced.model import AnalyticModel
from reduced.potential import fit_anharmonic, whitening

FOLDS = 5
INTERVAL = 0.9
#: mm; of the free segment whose tip is compared
TIP_LENGTH = 100.0
#: mm; normal pitch of the segments that stand for shape numbers
PITCH = 5.0
#: parts of the training designs in the learning curve
CURVE = (0.25, 0.5, 1.0)
#: the training designs' ranges are widened by this part before a design is outside
MARGIN = 0.02
#: a deviation above this many times the largest one at the training points is outside
DOUBT = 2.0


@dataclass(frozen=True)
class States:
    """Rows of one kind: shape (n, 13), pressure (n,), strains (n, 6), matrices (n, 6, 6), design (n,) numbers, level (n,) of the
    mesh, and size (n,): norm of the free strains, rest taken off, at the case's top pressure."""

    kind: str
    shape: np.ndarray
    pressure: np.ndarray
    strains: np.ndarray
    matrices: np.ndarray
    design: np.ndarray
    level: np.ndarray
    size: np.ndarray

    def of(self, chosen):
        names = ("shape", "pressure", "strains", "matrices", "design", "level", "size")
        return States(self.kind, *(getattr(self, name)[chosen] for name in names))

    @property
    def case(self):
        """(n,) equal for the states of one design on one mesh."""
        return self.design * (1 + self.level.max(initial=0)) + self.level

    @property
    def inputs(self):
        return Coordinates(self.kind).inputs(self.shape, self.pressure, self.level)


@dataclass(frozen=True)
class Prescribed:
    """States at prescribed strains with their free state's: change (n, 6) of the strains, forces (n, 6)."""

    free: States
    change: np.ndarray
    forces: np.ndarray

    def of(self, chosen):
        return Prescribed(self.free.of(chosen), self.change[chosen], self.forces[chosen])


def states_of(data, kind, held_out):
    """(States of the accepted free states, rest included, Prescribed) of a kind, of the held-out designs or of all others."""
    k = data.about["kinds"].index(kind)
    cases = data.accepted & (data.kind == k) & (data.held_out == held_out)
    sizes = [min(size for key, size in mesh.items() if key != "name") for mesh in data.about["meshes"]]
    level = np.argsort(np.argsort(-np.array(sizes)))  # the finest last
    rows = np.flatnonzero(cases[data.case] & ~data.overlapping)
    free, held = rows[~data.prescribed[rows]], rows[data.prescribed[rows]]
    top = {}
    for i in free:  # pressures increase
        top[data.case[i]] = np.linalg.norm(data.strains[i] - REST)
    at = {(data.case[i], round(float(data.pressure[i]), 6)): n for n, i in enumerate(free)}
    states = States(
        kind,
        *(a.astype(float) for a in (data.shape[data.case[free]], data.pressure[free], data.strains[free], data.matrices[free])),
        data.design[data.case[free]],
        level[data.mesh[data.case[free]]],
        np.array([top[data.case[i]] for i in free]),
    )
    held = np.array([i for i in held if (data.case[i], round(float(data.pressure[i]), 6)) in at], int)
    where = np.array([at[data.case[i], round(float(data.pressure[i]), 6)] for i in held], int)
    change = data.strains[held].astype(float) - states.strains[where]
    return states, Prescribed(states.of(where), change, data.forces[held].astype(float))


# ---- fitting


def fit_strains(states, like=None):
    """GaussianProcess of the learned free strains."""
    states = states.of(states.pressure > 0)
    co = Coordinates(states.kind)
    y = co.learned_strains(states.shape, states.pressure, states.strains)
    trust = odd(co.strain_parity, np.abs(cosine(states.shape)))
    return gaussian.fit(states.inputs, y, states.case, trust, like=like)


def fit_stiffness(states):
    """GaussianProcess of the learned stiffness."""
    co = Coordinates(states.kind)
    y = co.learned_stiffness(states.shape, states.matrices)
    good = np.isfinite(y).all(axis=1)
    trust = odd(co.stiffness_parity, np.abs(cosine(states.shape)))
    return gaussian.fit(states.inputs[good], y[good], states.case[good], trust[good])


def fit_kind(states, prescribed):
    """The KindLaw of training states."""
    strains, stiffness = fit_strains(states), fit_stiffness(states)
    f = prescribed.free
    anharmonic = fit_anharmonic(states.kind, cosine(f.shape), _symmetric(f.matrices), prescribed.change, prescribed.forces)
    x = states.inputs
    doubt = DOUBT * float(strains.deviation(x)[:, 0].max())
    margin = MARGIN * (x.max(axis=0) - x.min(axis=0))
    low, high = x.min(axis=0) - margin, x.max(axis=0) + margin
    low[0] = 0.0  # 90 degrees, where the angle and its mirror image meet, has data on both sides
    law = KindLaw(states.kind, strains, stiffness, anharmonic, np.ones(6), low, high, doubt, int(states.level.max()))
    quantile = _quantiles(law, states)
    return replace(law, quantile=quantile)


def _symmetric(K):
    return (K + np.swapaxes(K, 1, 2)) / 2


def _folds(states):
    """(rows to train on, rows to test) by design."""
    numbers = np.unique(states.design)
    fold = np.random.default_rng(0).permutation(len(numbers)) % FOLDS
    for f in range(FOLDS):
        test = np.isin(states.design, numbers[fold == f])
        yield ~test, test


def _quantiles(law, states):
    """(6,) what deviations are multiplied by for INTERVAL of the cross-validated residuals to lie within."""
    states = states.of(states.pressure > 0)
    scores = []
    for train, test in _folds(states):
        process = fit_strains(states.of(train), like=law.strains)
        t = states.of(test)
        learned, co = process(t.inputs), law.coordinates
        spread = co.spread(t.shape, t.pressure, learned, process.deviation(t.inputs))
        miss = np.abs(co.strains(t.shape, t.pressure, learned) - t.strains)
        scores.append(np.divide(miss, spread, out=np.zeros_like(miss), where=spread > 0))
    return np.quantile(np.concatenate(scores), INTERVAL, axis=0)


# ---- the analytic models


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


def compare_laws(train, test):
    """{name: (n,) errors on the test states of the coarsest mesh} of the three laws; nan where the analytic model has no answer."""
    train, test = (s.of((s.pressure > 0) & (s.level == 0)) for s in (train, test))
    co = Coordinates(train.kind)
    a_train, a_test = analytic_strains(train), analytic_strains(test)
    known = np.isfinite(a_train).all(axis=1)
    w = 1 / train.size[known, None]
    a, q = (a_train[known] - REST) * w, (train.strains[known] - REST) * w
    factor = (a * q).sum(axis=0) / np.maximum((a * a).sum(axis=0), 1e-30)
    laws = {"calibrated analytic model": REST + factor * (a_test - REST)}
    process = fit_strains(train)
    laws["regressor"] = co.strains(test.shape, test.pressure, process(test.inputs))
    laws["analytic model and regressor"] = _corrected(co, train, a_train, test, a_test)
    return {name: strain_error(test, strains) for name, strains in laws.items()}


def _corrected(co, train, a_train, test, a_test):
    with np.errstate(invalid="ignore", divide="ignore"):
        learned = [co.learned_strains(s.shape, s.pressure, a) for s, a in ((train, a_train), (test, a_test))]
    y = co.learned_strains(train.shape, train.pressure, train.strains) - learned[0]
    good = np.isfinite(y).all(axis=1)
    trust = odd(co.strain_parity, np.abs(cosine(train.shape)))
    process = gaussian.fit(train.inputs[good], y[good], train.case[good], trust[good])
    return co.strains(test.shape, test.pressure, learned[1] + process(test.inputs))


# ---- judging


def strain_error(states, strains):
    """(n,) norm of the error over the norm of the free strains at top pressure."""
    return np.linalg.norm(strains - states.strains, axis=1) / states.size


def tip_error(states, strains):
    """(n,) distance of the tips of free segments of TIP_LENGTH, at normal pitch PITCH, over that length."""
    scale = np.array([PITCH, PITCH, PITCH, 1, 1, 1]) ** -1.0
    tips = [exp_pose(TIP_LENGTH * q[:, [3, 4, 5, 0, 1, 2]] * scale)[:, :3, 3] for q in (states.strains, strains)]
    return np.linalg.norm(tips[1] - tips[0], axis=1) / TIP_LENGTH


def stiffness_error(states, K):
    """(n,) largest |1 - eigenvalue| of K_FE^-1 K."""
    values = np.linalg.eigvals(np.linalg.solve(states.matrices, K)).real
    return np.abs(values - 1).max(axis=1)


def force_error(law, prescribed):
    """(n,) norm of the force error over that of the force, whitened by the stiffness; law alone, its free states included."""
    f = prescribed.free
    free, K = law.free_strains(f.shape, f.pressure), law.free_stiffness(f.shape, f.pressure)
    M, D1 = whitening(law.kind, K)
    v = np.einsum("nij,nj->ni", M, f.strains + prescribed.change - free)
    by_v = D1[:, None] * (v + law.anharmonic.gradient(v, cosine(f.shape)))
    forces = np.einsum("nij,ni->nj", M, by_v)
    own, _ = whitening(law.kind, _symmetric(f.matrices))
    white = [np.linalg.solve(np.swapaxes(own, 1, 2), x[..., None])[..., 0] for x in (forces - prescribed.forces, prescribed.forces)]
    return np.linalg.norm(white[0], axis=1) / np.linalg.norm(white[1], axis=1)


def coverage(law, states):
    """Share of the held-out strains that are not zero by symmetry within their 90 % intervals."""
    states = states.of(states.pressure > 0)
    half = law.half_width(states.shape, states.pressure)
    inside = np.abs(law.free_strains(states.shape, states.pressure) - states.strains) <= half
    return float(inside[:, law.quantile > 0].mean())


def judge(law, states, prescribed):
    """{figure: value} on held-out states: of the coarsest mesh, which most designs have, with the law for that mesh; of the free
    strains on the finest mesh with the law as it is, where there are several."""
    fine = states.of((states.level == law.level) & (states.pressure > 0))
    figures = _on_finest(law, fine) if law.level and len(fine.size) else {}
    law, states, prescribed = replace(law, level=0), states.of(states.level == 0), prescribed.of(prescribed.free.level == 0)
    loaded = states.of(states.pressure > 0)
    q = law.free_strains(loaded.shape, loaded.pressure)
    strain, tip = strain_error(loaded, q), tip_error(loaded, q)
    stiffness = stiffness_error(states, law.free_stiffness(states.shape, states.pressure))
    figures |= {
        "law_strain_median_rel": np.median(strain),
        "law_strain_p95_rel": np.percentile(strain, 95),
        "law_tip100_p95_rel": np.percentile(tip, 95),
        "law_stiffness_p95_rel": np.percentile(stiffness, 95),
        "law_interval_coverage_90": coverage(law, loaded),
    }
    if len(prescribed.forces):
        figures["law_force_p95_rel"] = np.percentile(force_error(law, prescribed), 95)
    return {name: float(value) for name, value in figures.items()}


def _on_finest(law, fine):
    error = strain_error(fine, law.free_strains(fine.shape, fine.pressure))
    return {
        "finest_mesh_held_out_designs": len(np.unique(fine.design)),
        "finest_mesh_strain_median_rel": np.median(error),
        "finest_mesh_strain_p95_rel": np.percentile(error, 95),
    }


def learning_curve(states, test):
    """[(designs, median, 95th percentile)] of the free strains' error for parts of the training designs, the first ones."""
    states, test = (s.of((s.pressure > 0) & (s.level == 0)) for s in (states, test))
    numbers, rows = np.unique(states.design), []
    co = Coordinates(states.kind)
    for part in CURVE:
        some = states.of(np.isin(states.design, numbers[: max(8, round(part * len(numbers)))]))
        process = fit_strains(some)
        error = strain_error(test, co.strains(test.shape, test.pressure, process(test.inputs)))
        rows.append((len(np.unique(some.design)), float(np.median(error)), float(np.percentile(error, 95))))
    return rows


# ---- the command


def run_training(path, out, say=print, compare=True, mapping=map):
    """Train on the data set at `path`; `out` (.npz) gets the law, the same name with .md its tables. Returns the RodLaw.

    mapping: a `map`, over processes for instance; what it computes side by side does not depend on how many there are.
    """
    data, started = read_dataset(path), time.perf_counter()
    sets = {}
    for kind in data.about["kinds"]:
        (states, prescribed), (test, test_prescribed) = sets[kind] = [states_of(data, kind, held_out) for held_out in (False, True)]
        designs, held = (len(np.unique(s.design)) for s in (states, test))
        if designs < 2 * FOLDS or not held or not len(prescribed.forces) or not len(test_prescribed.forces):
            raise InputError(f"{path}: {designs} accepted {kind} designs, {held} held out: too few, or no prescribed states, to train on")
        say(f"{kind}: {designs} designs to train on, {held} held out")
    jobs = [(_fitted, sets[kind]) for kind in sets]
    if compare:
        jobs += [(job, sets[kind]) for kind in sets for job in (_law_rows, _curve_rows)]
    done = list(mapping(_do, jobs))
    fitted = dict(zip(sets, done))
    rest = iter(done[len(sets) :])
    tables = {kind: next(rest) + next(rest) for kind in sets} if compare else {}
    lines = [f"# The trained law of {Path(path).name}"]
    for kind, (_, figures) in fitted.items():
        designs, held = (len(np.unique(sets[kind][i][0].design)) for i in (0, 1))
        lines += ["", f"## {kind}", "", f"{designs} designs to train on, {held} held out.", "", "| held-out figure | value |", "|---|---|"]
        lines += [f"| {name} | {value:.4f} |" for name, value in figures.items()]
        lines += tables.get(kind, [])
    about = {"data": Path(path).name, "figures": {kind: f for kind, (_, f) in fitted.items()}, "revisions": data.about["revisions"]}
    law = RodLaw({kind: law for kind, (law, _) in fitted.items()}, about)
    write_law(out, law)
    write_text(Path(out).with_suffix(".md"), "\n".join(lines) + "\n")
    for line in lines:
        say(line)
    say(f"law in {out}, tables in {Path(out).with_suffix('.md')}; {time.perf_counter() - started:.0f} s")
    return law


def _do(job):
    function, sets = job
    return function(*sets)


def _fitted(training, held_out):
    law = fit_kind(*training)
    return [law, judge(law, *held_out)]


def _law_rows(training, held_out):
    rows = ["", "| law of the free strains | median error | 95th percentile | without an answer |", "|---|---|---|---|"]
    for name, error in compare_laws(training[0], held_out[0]).items():
        good = error[np.isfinite(error)]
        rows.append(f"| {name} | {np.median(good):.4f} | {np.percentile(good, 95):.4f} | {1 - len(good) / len(error):.1%} |")
    return rows


def _curve_rows(training, held_out):
    rows = ["", "| designs trained on | median error | 95th percentile |", "|---|---|---|"]
    rows += [f"| {n} | {median:.4f} | {high:.4f} |" for n, median, high in learning_curve(training[0], held_out[0])]
    return rows
