"""The data sheet of a data set of cells: what is in it, in which ranges, what failed and where. Markdown."""

import numpy as np

from pneunet.base.files.dataset import SCHEMA, CellData


def datasheet(data: CellData) -> str:
    """Markdown text on CellData."""
    about = data.about
    lines = [
        "# Data set of unit cells",
        "",
        f"Schema {SCHEMA}, made by `pneunet campaign` at revision {', '.join(about['revisions'])}.",
    ]
    lines += [
        "",
        "| campaign | |",
        "|---|---|",
        *(f"| {key} | {value} |" for key, value in about["campaign"].items()),
    ]
    for k, kind in enumerate(about["kinds"]):
        lines += [
            "",
            f"## {kind}",
            "",
            *_counts(data, k),
            "",
            *_ranges(data, k),
            "",
            *_quality(data, k),
            *_failures(data, k),
        ]
    return "\n".join(lines) + "\n"


def _counts(data, k):
    yield (
        "| mesh | cases | accepted | held out | free states | prescribed states | limit load met | walls"
        " touch | CPU hours |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for m, mesh in enumerate(data.about["meshes"]):
        rows = (data.kind == k) & (data.mesh == m)
        states = rows[data.case]
        if not rows.any():
            continue
        share = data.accepted[rows].mean()
        numbers = [
            f"{mesh['name']} ({', '.join(_settings(mesh))})",
            rows.sum(),
            f"{data.accepted[rows].sum()} ({share:.1%})",
            (rows & data.held_out).sum(),
            (states & ~data.prescribed).sum(),
            f"{(states & data.prescribed).sum()} ({data.missing[rows].sum()} not reached)",
            np.isfinite(data.limit_pressure[rows]).sum(),
            np.isfinite(data.first_touch[rows]).sum(),
            f"{data.seconds[rows].sum() / 3600:.2f}",
        ]
        yield "| " + " | ".join(map(str, numbers)) + " |"


def _settings(mesh):
    """A text each: sizes, and the kind of its elements where that is told."""
    for key, value in mesh.items():
        if key != "name":
            yield f"{key} {value if isinstance(value, str) else f'{value:g}'}"


def _ranges(data, k):
    kind = data.about["kinds"][k]
    yield "| sampled | from | to |"
    yield "|---|---|---|"
    for name, (low, high) in data.about["ranges"][kind].items():
        yield f"| {name} | {low:g} | {high:g} |"
    rows = data.kind == k
    if not rows.any():
        return
    yield ""
    yield "| in the data (lengths in normal pitches) | smallest | median | largest |"
    yield "|---|---|---|---|"
    for name, values in zip(data.about["shape"], data.shape[rows].T):
        yield f"| {name} | {values.min():.4g} | {np.median(values):.4g} | {values.max():.4g} |"
    pressure = data.pressure[rows[data.case]]
    if len(pressure):
        yield f"| P/mu | {pressure.min():.4g} | {np.median(pressure):.4g} | {pressure.max():.4g} |"


def _quality(data, k):
    rows = (data.kind == k) & (data.status == data.about["statuses"].index("done"))
    if not rows.any():
        return
    yield "| quality of finished cases | median | 95th percentile | largest |"
    yield "|---|---|---|---|"
    for name, values in (
        ("symmetry defect (forbidden over all strains)", data.symmetry_defect[rows]),
        ("energy balance", data.energy_defect()[rows]),
        ("residual over mu pitch^2", data.residual[rows[data.case]]),
        ("largest principal stretch", data.largest_stretch[rows[data.case]]),
    ):
        values = values[np.isfinite(values)]
        if len(values):
            yield (
                f"| {name} | {np.median(values):.2g} | {np.percentile(values, 95):.2g} | {values.max():.2g} |"
            )


def _failures(data, k):
    rejected = np.flatnonzero((data.kind == k) & ~data.accepted)
    if not len(rejected):
        return
    yield ""
    yield "Not accepted (status, reason; where it lies):"
    yield ""
    for row in rejected:
        status = data.about["statuses"][data.status[row]]
        reason = data.about["reasons"].get(
            str(row), f"symmetry defect {data.symmetry_defect[row]:.1%}, or an unstable free state"
        )
        place = ", ".join(f"{name} {value:.3g}" for name, value in zip(data.about["shape"], data.shape[row]))
        yield (
            f"- design {data.design[row]} ({data.about['meshes'][data.mesh[row]]['name']}): {status}:"
            f" {reason} ({place})"
        )
    yield ""
    yield "| mean over | all | not accepted |"
    yield "|---|---|---|"
    for name, values in zip(data.about["shape"], data.shape.T):
        yield f"| {name} | {values[data.kind == k].mean():.3g} | {values[rejected].mean():.3g} |"
