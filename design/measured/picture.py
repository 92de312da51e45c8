"""The picture of a comparison: over pressure, errors with their bars, and shapes."""

from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.pictures.rendering import figure
from pneunet.design.report.labels import FINITE_ELEMENTS, REDUCED, TARGET

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneunet.design.measured.comparison import MeasuredComparison

FITTED = "#2b8a3e"
#: of shapes that are drawn
MOST_SHAPES = 6


def comparison_figure(found: "MeasuredComparison") -> "Figure":
    """A matplotlib Figure of a MeasuredComparison."""
    points = found.aligned.values.shape[2] == 3
    fig = figure(14.5 if points else 9.8, 4.6)
    axes = fig.subplots(1, 3 if points else 2)
    _over_pressure(axes[0], found)
    _errors(axes[1], found)
    if points:
        _shapes(axes[2], found)
    fig.suptitle(f"{found.design.content.name}: measured against predicted", fontsize=11)
    fig.tight_layout()
    return fig


def _over_pressure(ax, found):
    kPa, told, predicted = found.pressures_kPa, found.told, found.way(found.predicted.plain)
    half = found.predicted.half_width
    if half is not None:
        low, high = predicted - half[:, told], predicted + half[:, told]
        ax.fill_between(
            kPa, low, high, color=REDUCED, alpha=0.2, linewidth=0, label="90 % interval of the prediction"
        )
    ax.plot(kPa, predicted, color=REDUCED, label="predicted")
    if found.fitted is not None:
        label = f"modulus x {found.fit.change.modulus:.3f}"
        ax.plot(kPa, found.way(found.fitted), "--", color=FITTED, label=label)
    if found.solved is not None:
        ax.plot(*found.solved, ":", color=FINITE_ELEMENTS, label="finite elements")
    spread = found.measured.spread[:, told]
    ax.errorbar(
        kPa,
        found.way(found.aligned.values),
        np.nan_to_num(spread),
        fmt="o",
        color=TARGET,
        markersize=4,
        label="measured",
    )
    name = found.measured.names[told] if found.measured.names else "tip"
    what = "angle" if found.measured.unit == "deg" else f"how far {name} has moved"
    ax.set(xlabel="pressure, kPa", ylabel=f"{what}, {found.measured.unit}")
    ax.legend(fontsize=8)


def _errors(ax, found):
    kPa, unit = found.pressures_kPa, found.measured.unit
    rms = np.sqrt(np.nanmean(found.errors**2, axis=1))
    if found.bars is not None:
        bars = np.sqrt(np.mean(found.bars**2, axis=1))
        ax.fill_between(kPa, 0, bars, color=REDUCED, alpha=0.2, linewidth=0, label="90 % bars, RMS")
    ax.plot(kPa, rms, "o-", color=TARGET, markersize=4, label="measured - predicted, RMS")
    if found.fitted is not None:
        from pneunet.design.measured.prediction import align

        moved = align(found.measured, found.fitted, found.as_is).values
        off = np.sqrt(np.nanmean(np.sum((moved - found.fitted) ** 2, axis=2), axis=1))
        ax.plot(kPa, off, "--", color=FITTED, label="after the fit")
    ax.set(xlabel="pressure, kPa", ylabel=f"{unit}", ylim=(0, None))
    ax.legend(fontsize=8)


def _shapes(ax, found):
    """In the plane that holds most of the prediction."""
    predicted, measured = found.predicted.plain, found.aligned.values
    middle = predicted.reshape(-1, 3).mean(axis=0)
    _, _, axes = np.linalg.svd(predicted.reshape(-1, 3) - middle, full_matrices=False)
    levels = np.unique(np.linspace(0, len(predicted) - 1, MOST_SHAPES).round().astype(int))
    for i in levels:
        first = i == levels[0]
        p, m = ((v[i] - middle) @ axes[:2].T for v in (predicted, measured))
        ax.plot(
            *p.T,
            "s-",
            color=REDUCED,
            linewidth=0.8,
            markersize=4,
            fillstyle="none",
            label="predicted" if first else None,
        )
        ax.plot(*m.T, "o", color=TARGET, markersize=3, label="measured" if first else None)
    ax.set(xlabel="mm", ylabel="mm", title="in the plane that holds most of it")
    ax.set_aspect("equal")
    ax.legend(fontsize=8)
