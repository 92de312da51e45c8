"""Figures of the trained law that comes along: its errors on designs that it has not seen, as `pneunet train`
found them, those on the held-out designs computed again from data set and law; and what it costs.
"""

import numpy as np

from benchmarks import silicones
from benchmarks.rod import best_seconds
from benchmarks.tables import below_mark, table

PRESSURE = 0.02  # MPa
BATCH = 10_000
JUDGED = (
    *("law_strain_median_rel", "law_strain_p95_rel", "law_angles_30_40_p95_rel", "law_tip100_p95_rel"),
    *("law_stiffness_p95_rel", "law_force_p95_rel", "law_mesh_uncertainty_rel"),
)


def law():
    """The part `law`."""
    from pneunet.base.errors import InputError
    from pneunet.base.files.dataset import read_dataset
    from pneunet.reduced import read_law
    from pneunet.reduced.choice import DATA_SET, SHIPPED
    from pneunet.reduced.training.train import digest, held_out_figures, judged_on, samples_of

    data, shipped = read_dataset(DATA_SET), read_law(SHIPPED)
    if shipped.about["data_sha256"] != digest(DATA_SET):
        raise InputError(
            f"{SHIPPED.name} was trained on another data set than {DATA_SET.name}: make it again with pneunet"
            " train"
        )
    samples, judged = samples_of(data), shipped.about["figures"]
    for kind, found in held_out_figures(shipped.kinds, samples).items():
        told = shipped.about["held_out"][kind]
        if not all(np.isclose(found[key], told[key], rtol=1e-3, equal_nan=True) for key in told):
            raise InputError(
                f"{SHIPPED.name}: on held-out {kind} designs it does not do what it says: make it again with"
                " pneunet train"
            )
    details = {
        kind: (
            {
                "judged on": judged_on(*pair),
                "figures": judged[kind],
                "held out": shipped.about["held_out"][kind],
            }
            | shipped.about["compared"][kind]
        )
        for kind, pair in samples.items()
    }
    # the worse kind's; an interval is as bad as it is off
    figures = {key: max(one[key] for one in judged.values()) for key in JUDGED}
    inside = [one["law_interval_coverage_90"] for one in judged.values()]
    figures["law_interval_coverage_90"] = max(inside, key=lambda share: abs(share - 0.9))
    for kind, number in zip(
        data.about["kinds"], np.bincount(data.kind[_coarse(data)], minlength=len(data.about["kinds"]))
    ):
        figures[f"dataset_{kind.replace('-', '_')}"] = int(number)
    figures["dataset_accepted_fraction"] = float(data.accepted.mean())
    return {key: value for key, value in figures.items() if np.isfinite(value)} | costs(shipped), details


def _coarse(data):
    """(n,) bool: accepted cases, each design once."""
    first = {}
    for row in np.flatnonzero(data.accepted):
        first.setdefault((data.kind[row], data.design[row]), row)
    chosen = np.zeros(len(data.kind), bool)
    chosen[list(first.values())] = True
    return chosen


def costs(shipped):
    """What calls of a TrainedLaw cost, the dearer kind's, CPU s on one core."""
    from pneunet.geometry import Manipulator
    from pneunet.geometry.reference_cases import CASES
    from pneunet.geometry.shape_numbers import numbers_of
    from pneunet.reduced import predict, read_law
    from pneunet.reduced.choice import SHIPPED

    kinds = {"twisting": CASES["twist_w12"](60.0, 5), "one-sided": CASES["one_sided_w10"](60.0, 6)}
    known = [segment for kind, segment in kinds.items() if kind in shipped.kinds]
    batches = []
    for segment in known:
        numbers = np.repeat(numbers_of([segment])[0], BATCH, axis=0)
        numbers[:, 1:] *= np.random.default_rng(0).uniform(0.9, 1.1, (BATCH, numbers.shape[1] - 1))
        batches.append((shipped.kinds[segment.kind], numbers, np.linspace(0.01, 0.3, BATCH)))
    body = Manipulator((known * 4)[:4])
    spacing = body.length / 195
    return {
        "law_batch_10k_seconds": max(
            best_seconds(lambda b=b: b[0].free_strains_and_slopes(*b[1:]), 1) for b in batches
        ),
        "law_single_us": (
            1e6 * max(best_seconds(lambda s=s: shipped.strains(s, PRESSURE), 100) for s in known)
        ),
        "law_load_ms": 1e3 * best_seconds(lambda: read_law(SHIPPED), 1),
        "rod_free_shape_with_law_us": (
            1e6 * best_seconds(lambda: predict(body, PRESSURE, shipped, spacing), 50)
        ),
        "law_stiffness_10k_seconds": max(
            best_seconds(lambda b=b: b[0].free_stiffness(*b[1:]), 1) for b in batches
        ),
        "law_error_bars_10k_seconds": max(
            best_seconds(lambda b=b: b[0].half_width(*b[1:]), 1) for b in batches
        ),
    }


def page(text, details, meta):
    """docs/rod-law.md, of which `text` is the present one, with the part below its mark made anew; meta: of
    the other parts, of which `silicones` has something to say here."""
    lines = silicones.lines(meta["silicones"]["details"]) if "silicones" in meta else []
    lines.append("## How well it does")
    for kind, found in details.items():
        lines += ["", f"### {kind}", "", found["judged on"], ""]
        alone = {name: f"{value:.4g}" for name, value in found["held out"].items()}
        rows = [
            (f"`{name}`", f"{value:.4g}", alone.get(name, "")) for name, value in found["figures"].items()
        ]
        lines += table(["figure", "value", "held-out designs alone"], rows)
        rows = [
            (name, f"{median:.2%}", f"{high:.2%}", f"{without:.1%}")
            for name, median, high, without in found["laws"]
        ]
        lines += [
            "",
            *table(["law of the free strains", "median error", "95th percentile", "without an answer"], rows),
        ]
        rows = [(n, f"{median:.2%}", f"{high:.2%}") for n, median, high in found["learning curve"]]
        lines += ["", *table(["designs trained on", "median error", "95th percentile"], rows)]
    return below_mark(text, "law", lines)
