"""Drawing at a fixed scale with dimension lines: distances of lines and text are inches on paper, the part is
in mm."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: left, bottom, width, height in inches
Rectangle = tuple[float, float, float, float]
#: x0, x1, y0, y1 in mm
Box = tuple[float, float, float, float]
#: from, to, text of a dimension
Interval = tuple[float, float, str]
#: matplotlib's, or (offset, (on, off, ...)) in points
LineStyle = str | tuple[float, tuple[float, ...]]
INK, LINE = "#1b1f24", "#55606b"
TEXT_SIZE = 7.5


def text_width(text: str, size: float = TEXT_SIZE) -> float:
    """Estimated width of a line of text in inches."""
    return 0.56 * size * len(text) / 72


def spread(positions: Sequence[float], distance: float) -> np.ndarray:
    """Positions (n,) moved as little as needed to be `distance` apart, order kept (pooled least squares)."""
    order = np.argsort(positions, kind="stable")
    wanted = np.asarray(positions, float)[order] - distance * np.arange(len(order))
    #: (mean, count): neighbours that collide share the mean of what they want
    pools: list[tuple[float, int]] = []
    for value in wanted:
        pools.append((value, 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (a, n), (b, m) = pools[-2:]
            pools[-2:] = [((a * n + b * m) / (n + m), n + m)]
    out = np.empty(len(order))
    out[order] = np.repeat([p[0] for p in pools], [p[1] for p in pools]) + distance * np.arange(len(order))
    return out


class SheetView:
    """A rectangle of a figure that shows (x, y) in mm at `scale` inches per mm.

    (x, y) lies at the rectangle's middle, moved by `right` and `up` inches.
    """

    def __init__(
        self,
        figure: "Figure",
        rectangle: Rectangle,
        scale: float,
        x: float,
        y: float,
        right: float = 0.0,
        up: float = 0.0,
    ) -> None:
        left, bottom, width, height = rectangle
        sheet_width, sheet_height = figure.get_size_inches()
        self.scale = scale
        self.ax = figure.add_axes(
            (left / sheet_width, bottom / sheet_height, width / sheet_width, height / sheet_height)
        )
        x, y = x - right / scale, y - up / scale
        self.x0, self.x1 = x - width / 2 / scale, x + width / 2 / scale
        self.y0, self.y1 = y - height / 2 / scale, y + height / 2 / scale
        self.ax.set_xlim(self.x0, self.x1)
        self.ax.set_ylim(self.y0, self.y1)
        self.ax.set_axis_off()

    def mm(self, inches: float) -> float:
        """A distance on paper in mm of the part."""
        return inches / self.scale

    def text(
        self,
        x: float,
        y: float,
        text: str,
        ha: str = "center",
        va: str = "center",
        size: float = TEXT_SIZE,
        weight: str = "normal",
        rotation: float = 0,
    ) -> None:
        self.ax.text(x, y, text, ha=ha, va=va, fontsize=size, weight=weight, color=INK, rotation=rotation)

    def title(self, x: float, y: float, text: str) -> None:
        """The name of a view, ending at (x, y)."""
        self.text(x, y, text, ha="right", size=9, weight="bold")

    def heading(self, text: str) -> None:
        """A title centred at the top of the rectangle."""
        self.text((self.x0 + self.x1) / 2, self.y1 - self.mm(0.14), text, size=8.5, weight="bold")

    def line(self, points: ArrayLike, width: float = 0.6, style: LineStyle = "-", colour: str = LINE) -> None:
        """Straight lines between points (n, 2)."""
        x, y = np.asarray(points, float).T
        self.ax.plot(x, y, linewidth=width, linestyle=style, color=colour, solid_capstyle="butt")

    def polygon(
        self, corners: ArrayLike, face: str, width: float = 0.8, style: LineStyle = "-", alpha: float = 1.0
    ) -> None:
        """A closed line through corners (n, 2) with a face."""
        from matplotlib.patches import Polygon

        self.ax.add_patch(
            Polygon(
                np.asarray(corners, float),
                closed=True,
                facecolor=face,
                edgecolor=INK if width else "none",
                linewidth=width,
                linestyle=style,
                alpha=alpha,
            )
        )

    def cut(
        self,
        solids: Sequence[Box],
        voids: Sequence[Box],
        colour: str,
        clip: tuple[float, float] | None = None,
    ) -> None:
        """A section: union of `solids` minus union of `voids`; broken off at the x of `clip`."""
        from matplotlib import patches

        def add(box, **style):
            x0, x1, y0, y1 = box
            if clip:
                x0, x1 = max(x0, clip[0]), min(x1, clip[1])
            self.ax.add_patch(patches.Rectangle((x0, y0), x1 - x0, y1 - y0, **style))

        # the edges first, then the faces above them: inner halves of edges inside the union disappear
        for boxes, face in ((solids, colour), (voids, "white")):
            for box in boxes:
                add(box, fill=False, edgecolor=INK, linewidth=2.0)
            for box in boxes:
                add(box, facecolor=face, edgecolor="none")
        if clip:
            low, high = solids[0][2:]
            for x in clip:
                self.ax.plot([x, x], [low, high], color="white", linewidth=2.4)
                self.ax.plot(
                    [x, x],
                    [low - self.mm(0.05), high + self.mm(0.05)],
                    color=LINE,
                    linewidth=0.7,
                    linestyle=(0, (6, 2, 1, 2)),
                )

    def axes_cross(self) -> None:
        """The channel axis as a small centre mark."""
        r = self.mm(0.1)
        self.line([(-r, 0), (r, 0)], width=0.6)
        self.line([(0, -r), (0, r)], width=0.6)

    def _arrows(self, a, b, inside):
        style = {
            "arrowstyle": "-|>,head_length=0.35,head_width=0.12",
            "color": LINE,
            "linewidth": 0.6,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        a, b = np.asarray(a, float), np.asarray(b, float)
        if inside:
            pairs = [((a + b) / 2, a), ((a + b) / 2, b)]
        else:
            out = (b - a) / np.linalg.norm(b - a) * self.mm(0.16)
            pairs = [(a - out, a), (b + out, b)]
            self.line([a, b], width=0.6)
        for tail, head in pairs:
            self.ax.annotate("", xy=head, xytext=tail, arrowprops=style)

    def horizontal(self, x0: float, x1: float, y_part: float, y: float, text: str) -> None:
        """A dimension between x0 and x1, its line at y, extension lines from y_part."""
        over = self.mm(0.05) * np.sign(y - y_part)
        for x in (x0, x1):
            self.line([(x, y_part), (x, y + over)], width=0.35)
        inside = (x1 - x0) * self.scale > 0.3
        self._arrows((x0, y), (x1, y), inside)
        if (x1 - x0) * self.scale > text_width(text) + 0.12:
            self._on_line((x0 + x1) / 2, y, text)
        else:
            self.text(x1 + self.mm(0.08 if inside else 0.2), y, text, ha="left")

    def between(self, x0: float, x1: float, y: float, text: str) -> None:
        """The link of a chain (`chain_below`) that has room for its text on the line."""
        self.line([(x0, y), (x1, y)], width=0.6)
        self._on_line((x0 + x1) / 2, y, text)

    def _on_line(self, x, y, text):
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
        self.ax.text(x, y, text, ha="center", va="center", fontsize=TEXT_SIZE, color=INK, bbox=box)

    def vertical(self, y0: float, y1: float, x_part: float, x: float, text: str) -> None:
        """A dimension between y0 and y1, its line at x left of the part."""
        for y in (y0, y1):
            self.line([(x_part, y), (x - self.mm(0.05), y)], width=0.35)
        self._arrows((x, y0), (x, y1), (y1 - y0) * self.scale > 0.3)
        self.text(x - self.mm(0.06), (y0 + y1) / 2, text, ha="right")

    def ladder(self, intervals: Sequence[Interval], x_part: float, x: float) -> None:
        """Neighbouring vertical dimensions in one column at x, their labels spread apart."""
        middles = [(a + b) / 2 for a, b, _ in intervals]
        levels = spread(middles, self.mm(0.16))
        for y in {y for a, b, _ in intervals for y in (a, b)}:
            self.line([(x_part, y), (x + self.mm(0.05), y)], width=0.35)
        for (a, b, text), middle, level in zip(intervals, middles, levels):
            self.line([(x, a), (x, b)], width=0.6)
            self._tick(x, a)
            self._tick(x, b)
            self.line([(x, middle), (x + self.mm(0.18), level), (x + self.mm(0.24), level)], width=0.35)
            self.text(x + self.mm(0.27), level, text, ha="left")

    def chain_below(self, intervals: Sequence[Interval], y_part: float, y: float) -> None:
        """Short neighbouring horizontal dimensions with upright labels below the line."""
        levels = spread([(a + b) / 2 for a, b, _ in intervals], self.mm(0.13))
        for (a, b, text), level in zip(intervals, levels):
            for x in (a, b):
                self.line([(x, y_part), (x, y - self.mm(0.05))], width=0.35)
                self._tick(x, y)
            self.line([(a, y), (b, y)], width=0.6)
            self.line([((a + b) / 2, y), (level, y - self.mm(0.08))], width=0.35)
            self.text(level, y - self.mm(0.1), text, va="top", rotation=90, size=7)

    def _tick(self, x, y):
        half = self.mm(0.025)
        self.line([(x - half, y - half), (x + half, y + half)], width=0.9, colour=INK)

    def angle(self, x: float, y: float, degrees: float, radius: float) -> None:
        """The angle of a line through (x, y) with the x axis: the line, an arc of `radius` inches and the
        value."""
        from matplotlib.patches import Arc

        r, full, half = self.mm(radius), np.radians(degrees), np.radians(degrees / 2)
        self.line([(x, y), (x + 1.15 * r * np.cos(full), y + 1.15 * r * np.sin(full))], width=0.5)
        self.line([(x, y), (x + 1.15 * r, y)], width=0.5)
        self.ax.add_patch(Arc((x, y), 2 * r, 2 * r, theta1=0, theta2=degrees, color=LINE, linewidth=0.6))
        self.text(x + 0.62 * r * np.cos(half), y + 0.62 * r * np.sin(half), f"{degrees:.4g}°", size=7)

    def balloon(self, x: float, y: float, number: int, text: str, colour: str) -> None:
        """A numbered circle with a line of text at its right, centred on x."""
        shift = self.mm(0.13 + text_width(text, 8.5)) / 2
        self.ax.text(
            x - shift,
            y,
            str(number),
            ha="center",
            va="center",
            fontsize=9,
            weight="bold",
            color=INK,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": colour, "edgecolor": INK, "linewidth": 0.7},
        )
        self.text(x - shift + self.mm(0.17), y, text, ha="left", size=8.5)
