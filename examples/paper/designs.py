"""Designs for the targets of Figs 7 and 9, split as the paper splits them, and their errors as the paper
counts."""

from collections.abc import Sequence

import numpy as np

from examples.paper.common import Statement
from examples.paper.eq27 import readings
from pneunet.design.design import Design
from pneunet.design.inverse_design import inverse_design
from pneunet.design.target.target import Target
from pneunet.geometry.parameters import TWISTING


def designed(names: Sequence[str]) -> dict[str, Design]:
    """{name of a shipped target: the Design for it}; some seconds each."""
    return {name: inverse_design(Target.read(name)) for name in names}


def angles_of(design: Design) -> str:
    """ "twisting 60.0, 90.0, 52.5" """
    said = (f"{'twisting ' * (s.kind == TWISTING)}{s.angle:.1f}" for s in design.manipulator.segments)
    return ", ".join(said)


def followed(name: str, design: Design) -> Statement:
    """The error of a design beside the printed one, which is another body's, solved or measured another
    way."""
    errors = design.errors
    return Statement(
        f"{name}: {readings(name, errors.reference_length)}",
        f"Eq. 27 as a sum over {errors.eq27_points} points {1e-6 * errors.eq27:.3g} m^2, as a mean"
        f" {1e-6 * errors.eq27 / errors.eq27_points:.3g} m^2; RMS paired by arc length {errors.rms:.2f} mm"
        f" ({errors.percent(errors.rms):.2f} %): the rod against the target, not a casting",
        None,
    )


def draw_designs(designs: dict[str, Design], pressures_kPa: Sequence[float] | None = None):
    """A figure of a panel a design: its shapes from rest to its pressure, and the target."""
    from matplotlib import colormaps

    from pneunet.base.pictures.rendering import figure
    from pneunet.design.report.pictures import equal_axes_3d

    fig = figure(5.2 * len(designs), 4.6)
    for place, (name, design) in enumerate(designs.items(), start=1):
        axes = fig.add_subplot(1, len(designs), place, projection="3d")
        steps = pressures_kPa or [design.pressure_kPa * i / 5 for i in range(1, 6)]
        lines = design.predict(steps)
        for number, (P, line) in enumerate(zip(steps, lines)):
            axes.plot(*line.points.T, color=colormaps["viridis"](number / 5), label=f"{P:.0f} kPa")
        axes.plot(*design.target.points.T, "k--", linewidth=1.2, label="target")
        equal_axes_3d(axes, np.vstack([line.points for line in lines]))
        axes.set_title(f"{name}: {angles_of(design)} deg", fontsize=9)
        axes.legend(fontsize=7)
    fig.tight_layout()
    return fig
