"""What the figures share: statements of the paper beside what comes out here, bodies, and drawn shapes.

The paper's drawing of its dimensions stood in its supplement, which is lost, so the bodies are ours: silicone
of 1.5 mm everywhere, within the paper's 1 to 2 mm (Sec. IV D), and chambers 4 mm high, which bend about as
much as the paper's targets ask. Numbers are the trained law's, unless said otherwise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneunet.base.materials.laws import PAPER_HELICAL, Hyperelastic, NeoHookean
from pneunet.design.workspace import WorkspaceCase
from pneunet.geometry.parameters import ONE_SIDED, Manipulator
from pneunet.reduced.choice import shipped_law
from pneunet.reduced.rod.prediction import predict

POISSON = 0.49
WALLS = ("wall", "top_wall", "side_wall", "roof")
ONE_SIDED_BODY = {"chamber_height": 4.0, "base_thickness": 2.0} | {name: 1.5 for name in WALLS}
PRESSURES = (0.010, 0.020, 0.030, 0.040, 0.050)


@dataclass(frozen=True)
class Statement:
    """says: what the paper says, in its words where they are quoted; here: what comes out; agrees: whether,
    None where nothing can be compared."""

    says: str
    here: str
    agrees: bool | None

    @property
    def verdict(self) -> str:
        return {True: "agrees", False: "does not agree", None: "cannot be compared"}[self.agrees]


def silicone(E: float) -> NeoHookean:
    """Of a Young's modulus in MPa, at the paper's Poisson's ratio."""
    return NeoHookean(mu=E / (2 * (1 + POISSON)), name=f"E = {E:g} MPa")


def manipulator(
    angles: Sequence[float],
    lengths: Sequence[float],
    materials: Sequence[Hyperelastic] | None = None,
    kinds: Sequence[str] | None = None,
) -> Manipulator:
    """Segments as long as asked (mm), but for whole chambers."""
    materials, kinds = materials or [PAPER_HELICAL] * len(angles), kinds or [ONE_SIDED] * len(angles)
    return Manipulator(
        tuple(
            WorkspaceCase(length=length, material=material, start=ONE_SIDED_BODY).segment(kind, angle)
            for kind, angle, length, material in zip(kinds, angles, lengths, materials)
        )
    )


def shapes(body: Manipulator, pressures: Sequence[float] = PRESSURES) -> list[np.ndarray]:
    """Centrelines (n, 3) in mm at pressures in MPa."""
    return [predict(body, P, shipped_law()).points for P in pressures]


def curvatures(body: Manipulator, pressure: float) -> np.ndarray:
    """(segments,) the paper's curvature of the cells, of the helix's cylinder, 1/m."""
    return 1e3 * shipped_law().each(body.segments, pressure).helix_cylinder_curvature


def draw_shapes(panels: Sequence[tuple[str, Sequence[np.ndarray], Sequence[str]]], columns: int = 4):
    """A figure of panels: title, centrelines, their labels."""
    from matplotlib import colormaps

    from pneunet.base.pictures.rendering import figure
    from pneunet.design.report.pictures import equal_axes_3d

    rows = -(-len(panels) // columns)
    fig = figure(3.4 * columns, 3.3 * rows + 0.3)
    for place, (title, lines, labels) in enumerate(panels, start=1):
        axes = fig.add_subplot(rows, columns, place, projection="3d")
        for number, (line, label) in enumerate(zip(lines, labels)):
            colour = colormaps["viridis"](number / max(1, len(lines) - 1))
            axes.plot(*line.T, color=colour, label=label, linewidth=1.6)
        axes.scatter(0, 0, 0, color="black", s=14)
        equal_axes_3d(axes, np.vstack(lines))
        axes.set_title(title, fontsize=9)
        if place == 1:
            axes.legend(fontsize=7, loc="upper left")
    fig.subplots_adjust(left=0.02, right=0.95, bottom=0.1, top=0.92, wspace=0.18, hspace=0.2)
    return fig


def kPa(pressures: Sequence[float] = PRESSURES) -> list[str]:
    return [f"{1e3 * P:.0f} kPa" for P in pressures]
