"""Laws of the free strains compared on the held-out designs, and what more designs would bring.

The analytic models with one fitted factor for each strain, the regressor over the pressure, alone and for
what the analytic models leave, the regressor along the path of free states, and the one that learns from
derivatives by the shape too, which is the law's: the analytic cell costs milliseconds a state.
"""

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry.shape_numbers import SHAPE, segment_of
from pneunet.reduced.analytic.law import AnalyticLaw
from pneunet.reduced.trained.coordinates import REST, Coordinates
from pneunet.reduced.training.fit import fit_path, fit_strains
from pneunet.reduced.training.judging import PITCH, UNITS, strain_error
from pneunet.reduced.training.states import Sample, States

#: parts of the training designs in the learning curve
CURVE = (0.25, 0.5, 1.0)


def analytic_strains(states: States) -> np.ndarray:
    """(n, 6) strains of the analytic law at P > 0, nan beyond its limit loads."""
    out, law, material = np.full(states.strains.shape, np.nan), AnalyticLaw(), NeoHookean(mu=1.0)
    for number in np.unique(states.design):
        rows = np.flatnonzero(states.design == number)
        segment = segment_of(states.kind, states.numbers[rows[0], : len(SHAPE)], PITCH, material)
        for last in range(len(rows), 0, -1):
            try:
                found = law.strains(segment, states.pressure[rows[:last]])
            except (ConvergenceError, InputError):
                continue
            out[rows[:last]] = found.vector * UNITS
            break
    return out


def compare_laws(training: Sample, held_out: Sample) -> list[tuple[str, float, float, float]]:
    """[(law of the free strains, median error, 95th percentile, share without an answer)] on the coarsest
    grid."""
    train, test = (sample.free.loaded for sample in (training, held_out))
    a_train, a_test = (analytic_strains(states) for states in (train, test))
    co = Coordinates(train.kind)
    good = np.isfinite(a_train).all(axis=1)
    w = 1 / train.size[good, None]
    a, q = (a_train[good] - REST) * w, (train.strains[good] - REST) * w
    factor = (a * q).sum(axis=0) / np.maximum((a * a).sum(axis=0), 1e-30)
    with np.errstate(invalid="ignore", divide="ignore"):
        learned = [
            co.learned_strains(s.numbers, s.pressure, a) for s, a in ((train, a_train), (test, a_test))
        ]
    values = co.learned_strains(train.numbers, train.pressure, train.strains)
    by_pressure = []
    for y, known in ((values, np.zeros(1)), (values - learned[0], learned[1])):
        process = fit_strains(train, np.isfinite(y).all(axis=1), train.inputs, y)
        found = process(test.inputs) + known
        by_pressure.append(co.strains(test.numbers, test.pressure * np.exp(-found[:, 0]), found[:, 1:]))
    along = [fit_path(train, slopes=slopes).strains(test.numbers, test.pressure) for slopes in (False, True)]
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


def learning_curve(training: Sample, held_out: Sample) -> list[tuple[int, float, float]]:
    """[(designs trained on, median error, 95th percentile)] of the free strains for the first parts of the
    training designs."""
    states, test = (sample.free.loaded for sample in (training, held_out))
    numbers, rows = np.unique(states.design), []
    for part in CURVE:
        some = numbers[: max(8, round(part * len(numbers)))]
        path = fit_path(states.of(np.isin(states.design, some)))
        rows.append((len(some), *_spread(strain_error(test, path.strains(test.numbers, test.pressure)))))
    return rows


def law_table(rows: list[tuple[str, float, float, float]]) -> list[str]:
    """Lines of a table of `compare_laws`."""
    lines = [
        "",
        "| law of the free strains | median error | 95th percentile | without an answer |",
        "|---|---|---|---|",
    ]
    return lines + [
        f"| {name} | {median:.4f} | {high:.4f} | {without:.1%} |" for name, median, high, without in rows
    ]


def curve_table(rows: list[tuple[int, float, float]]) -> list[str]:
    """Lines of a table of `learning_curve`."""
    lines = ["", "| designs trained on | median error | 95th percentile |", "|---|---|---|"]
    return lines + [f"| {n} | {median:.4f} | {high:.4f} |" for n, median, high in rows]
