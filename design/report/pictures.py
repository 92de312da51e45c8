"""Pictures of centrelines in matplotlib: 3D with equal scale, two projections, and the picture of a
design."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.pictures.rendering import camera_angles, figure
from pneunet.design.report.labels import STYLES, kPa, plain, segment_colour, segment_name, signed, significant
from pneunet.design.target.metrics import Errors
from pneunet.design.target.target import Target
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced.rod.centreline import Centreline

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.axes3d import Axes3D

#: of the place of 3D axes: the rest is for their labels
FILLED = 0.84
#: label, points (n, 3) in mm, style of STYLES
Line = tuple[str, np.ndarray, str]
#: colour, points (n, 3) in mm: a stretch of a centreline that belongs to a segment
Band = tuple[str, np.ndarray]


def equal_axes_3d(ax: "Axes3D", points: np.ndarray, pad: float = 0.06) -> None:
    """Limits of 3D axes that hold points (n, 3) at one scale in x, y and z, as large as their place allows;
    labels in mm."""
    from matplotlib.ticker import MaxNLocator

    low, high = np.min(points, axis=0), np.max(points, axis=0)
    size = (high - low).max()
    # a flat curve still gets a box with some depth
    half = np.maximum((high - low) / 2, 0.12 * size) + pad * size
    middle = (low + high) / 2
    ax.set_proj_type("ortho")
    ax.set_box_aspect(tuple(half))
    for i, name in enumerate("xyz"):
        getattr(ax, f"set_{name}lim")(middle[i] - half[i], middle[i] + half[i])
        getattr(ax, f"{name}axis").set_major_locator(MaxNLocator(max(2, round(6 * half[i] / half.max()))))
        getattr(ax, f"set_{name}label")(f"{name} (mm)", labelpad=2 + 6 * half[i] / half.max())
    ax.tick_params(labelsize=8, pad=1)
    ax.set_box_aspect(tuple(half), zoom=FILLED / _share_filled(ax, middle, half))


def _share_filled(ax, middle, half):
    """Of the place of 3D axes, in the direction in which more of it is taken."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    ax.apply_aspect()
    corners = middle + half * np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
    x, y, _ = proj_transform(*corners.T, ax.get_proj())
    taken = np.ptp(ax.transData.transform(np.column_stack([x, y])), axis=0)
    place = ax.get_position(original=True).transformed(ax.figure.transFigure)
    return max(taken / [place.width, place.height])


def curve_panels(
    figure: "Figure", curves: Sequence[Line], segments: Sequence[Band] = (), bottom: float = 0.06
) -> None:
    """3D view and the x-y and x-z projections of curves, with the bands of segments under them and the
    dashes of a target in front."""
    everything = np.vstack([points for _, points, _ in curves])
    grid = figure.add_gridspec(
        2, 2, width_ratios=[1.5, 1], left=0.03, right=0.97, bottom=bottom, top=0.87, wspace=0.16, hspace=0.32
    )
    ax = figure.add_subplot(grid[:, 0], projection="3d")
    ax.view_init(*camera_angles(everything))
    band: dict = {"linewidth": 9, "alpha": 0.75, "solid_capstyle": "butt", "zorder": 1}
    for colour, points in segments:
        ax.plot(*points.T, color=colour, clip_on=False, **band)  # its axes are a square in its place
    for label, points, style in curves:
        ax.plot(*points.T, label=label, clip_on=False, **STYLES[style])
    ax.scatter(*curves[0][1][0], color="black", s=22, zorder=5)
    ax.text(*curves[0][1][0], "  base", fontsize=8)
    equal_axes_3d(ax, everything)
    for row, (i, j) in enumerate([(0, 1), (0, 2)]):
        ax = figure.add_subplot(grid[row, 1])
        for colour, points in segments:
            ax.plot(points[:, i], points[:, j], color=colour, **band)
        for _, points, style in curves:
            ax.plot(points[:, i], points[:, j], **STYLES[style])
        ax.plot(*everything[0, [i, j]], "ko", markersize=4)
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.08)
        ax.set_xlabel(f"{'xyz'[i]} (mm)", labelpad=1)
        ax.set_ylabel(f"{'xyz'[j]} (mm)", labelpad=1)
        ax.grid(True, linewidth=0.4, alpha=0.6)
        ax.tick_params(labelsize=8)


def segment_bands(manipulator: Manipulator, s: np.ndarray, points: np.ndarray) -> list[Band]:
    """The Band of each segment on a centreline: s (n,) undeformed, points (n, 3), mm."""
    ends = manipulator.starts + [seg.length for seg in manipulator.segments]
    bands = []
    for i, (start, end) in enumerate(zip(manipulator.starts, ends)):
        inside = np.concatenate([[start], s[(s > start) & (s < end)], [end]])
        bands.append(
            (segment_colour(i), np.column_stack([np.interp(inside, s, column) for column in points.T]))
        )
    return bands


def legend(figure: "Figure", curves: Sequence[Line], segments: Sequence[Segment]) -> None:
    """At the top right: what the lines are, and below it the colours of the segments that are drawn."""
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], label=label, **STYLES[style]) for label, _, style in curves]
    bands = [
        Line2D([], [], color=segment_colour(i), linewidth=9, alpha=0.75, label=f"{i + 1}  {segment_name(s)}")
        for i, s in enumerate(segments)
    ]
    for handles, height in ((lines, 0.995), (bands, 0.955))[: 1 + bool(bands)]:
        figure.legend(
            handles=handles,
            loc="upper right",
            ncols=min(len(handles), 5),
            fontsize=8.5,
            frameon=False,
            bbox_to_anchor=(0.985, height),
            handlelength=2.4,
            columnspacing=1.6,
        )


def error_caption(errors: Errors) -> str:
    """The four errors and the length mismatch (`design.target.metrics.Errors`) in two lines."""

    def both(mm):
        return f"{significant(mm, 2)} mm ({significant(errors.percent(mm), 2)} %)"

    return (
        f"RMS paired by arc length {both(errors.rms)},  two-sided Hausdorff {both(errors.hausdorff)},  "
        f"tip {both(errors.tip)}\n"
        f"Eq. 27 sum over {errors.eq27_points} points {significant(errors.eq27)} mm²,  "
        f"length {errors.length:.1f} mm, wanted {errors.reference_length:.1f} mm "
        f"({signed(errors.percent(errors.length_mismatch), 2)} %)    [% of the wanted length]"
    )


def design_figure(
    content: DesignFile, line: Centreline, target: Target | None = None, errors: Errors | None = None
) -> "Figure":
    """A design's predicted line against its target, with errors, segments and pressure."""
    curves = [("reduced prediction", line.points, "reduced")]
    caption = "no target beside the design: only the prediction is shown"
    if target is not None and errors is not None:
        curves.insert(0, ("target", target.points, "target"))
        caption = error_caption(errors)
    fig, body = figure(12.0, 7.0), content.manipulator
    curve_panels(fig, curves, segment_bands(body, line.s, line.points), bottom=0.15)
    legend(fig, curves, body.segments)
    fig.text(0.025, 0.975, content.name, fontsize=15, weight="bold", va="top")
    told = f"{kPa(content.pressure)}, {body.chambers} chambers"
    fig.text(
        0.025,
        0.02,
        f"{told}, {plain(body.length, 1)} mm long at rest\n{caption}",
        fontsize=9,
        linespacing=1.5,
    )
    return fig
