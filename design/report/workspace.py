"""The picture of a workspace: what the kinds of segments reach (the paper's Fig. 9g), and where tips go
(9h)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.pictures.rendering import figure
from pneunet.base.units import KPA_PER_MPA, PER_MM_PER_M
from pneunet.design.report.labels import plain
from pneunet.design.report.pictures import equal_axes_3d
from pneunet.design.target.reach import Reach
from pneunet.geometry.parameters import TWISTING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: points of a cloud that are drawn
DRAWN = 6000
COLOURS = "viridis"


def workspace_figure(
    reaches: Mapping[str, Reach], clouds: Sequence[tuple[str, np.ndarray, np.ndarray]]
) -> "Figure":
    """A figure of reaches by kind, and of clouds: name, tips (n, 3) in mm, pressures (n,) in MPa."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    columns, rows = max(len(reaches), len(clouds)), 1 + bool(clouds)
    fig = figure(4.6 * columns + 0.8, 4.2 * rows)
    highest = max(float(r.pressures[-1]) for r in reaches.values())
    norm, colours = Normalize(0, KPA_PER_MPA * highest), colormaps[COLOURS]
    grid = fig.add_gridspec(
        rows, columns, left=0.07, right=0.9, bottom=0.09, top=0.93, wspace=0.3, hspace=0.3
    )
    for place, (kind, found) in enumerate(reaches.items()):
        axes = fig.add_subplot(grid[0, place])
        for j, pressure in enumerate(found.pressures):
            line = {"color": colours(norm(KPA_PER_MPA * pressure)), "marker": ".", "markersize": 3}
            if kind == TWISTING:
                axes.plot(found.angles, found.twist[:, j] / PER_MM_PER_M, **line)
            else:
                axes.plot(found.curvature[:, j] / PER_MM_PER_M, found.twist[:, j] / PER_MM_PER_M, **line)
        if kind == TWISTING:
            axes.set(title=kind, xlabel="angle (deg)", ylabel="tau (rad/m)")
        else:
            low, high = (plain(float(a)) for a in found.angles[[0, -1]])
            title = f"{kind}, {low} to {high} deg"
            axes.set(title=title, xlabel="curvature (1/m)", ylabel="torsion (rad/m)")
        axes.grid(alpha=0.3)
    for place, (name, tips, pressures) in enumerate(clouds):
        axes = fig.add_subplot(grid[1, place], projection="3d")
        every = max(1, len(tips) // DRAWN)
        shown = tips[::every]
        axes.scatter(*shown.T, c=KPA_PER_MPA * pressures[::every], cmap=COLOURS, norm=norm, s=2, linewidths=0)
        axes.scatter(0, 0, 0, color="black", s=20)
        equal_axes_3d(axes, np.vstack([tips, np.zeros((1, 3))]))
        axes.set_title(f"tips of {name}", fontsize=10)
    bar = fig.add_axes((0.93, 0.2, 0.015, 0.6))
    fig.colorbar(ScalarMappable(norm, COLOURS), cax=bar, label="pressure (kPa)")
    return fig
