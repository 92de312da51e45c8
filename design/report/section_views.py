"""The two sections of a segment with their dimensions: through a chamber, and across the chambers."""

from typing import TYPE_CHECKING

from pneunet.design.report.dimensions import Interval, Rectangle, SheetView
from pneunet.design.report.labels import plain, segment_colour
from pneunet.geometry.parameters import TWISTING, Manipulator, Segment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROW = 0.24  # inches between dimension lines


def section_groups(manipulator: Manipulator) -> list[list[int]]:
    """Lists of segment indices that share the same cross-section (everything but angle, number, ends and
    material)."""
    groups: dict[tuple, list[int]] = {}
    for i, s in enumerate(manipulator.segments):
        key = (
            s.kind,
            s.width,
            s.chamber_height,
            s.cavity_thickness,
            s.wall,
            s.gap,
            s.top_wall,
            s.side_wall,
            s.core_top,
            s.core_bottom,
            s.layer_thickness,
            s.channel_width,
            s.channel_height,
            s.cavity_floor,
        )
        groups.setdefault(key, []).append(i)
    return list(groups.values())


def section_scale(s: Segment, width: float, height: float) -> float:
    """Inches per mm at which both sections of a segment leave room for their dimensions in a panel
    (inches)."""
    normal_width = 2 * s.chamber_thickness + s.gap + 3.0
    return min(
        (width - 2.05) / max(s.width, normal_width), (height - 1.95) / (s.chamber_top - s.chamber_bottom)
    )


def _named(group, what):
    return f"{what}, segment{'s' * (len(group) > 1)} {', '.join(str(i + 1) for i in group)}"


def cross_section(
    figure: "Figure", rectangle: Rectangle, scale: float, manipulator: Manipulator, group: list[int]
) -> None:
    """Section through a chamber, seen along x."""
    s = manipulator.segments[group[0]]
    view = SheetView(figure, rectangle, scale, 0.0, (s.chamber_top + s.chamber_bottom) / 2, right=-0.1)
    half = s.width / 2
    solids = [(-half, half, s.core_bottom, s.core_top)]
    voids = [(-s.channel_width / 2, s.channel_width / 2, -s.channel_height / 2, s.channel_height / 2)]
    for side in s.sides:
        solids.append((-half, half, 0.0, side * s.chamber_top))
        voids.append((-s.cavity_width / 2, s.cavity_width / 2, side * s.cavity_floor, side * s.cavity_top))
    view.cut(solids, voids, segment_colour(group[0]))
    view.axes_cross()
    top, low = s.chamber_top, s.chamber_bottom
    view.heading(_named(group, f"through {'a chamber' if s.chambers else 'the core'}, along x"))
    if s.chambers:
        inner = s.cavity_width / 2
        view.horizontal(-inner, inner, s.cavity_top, top + view.mm(0.2), f"cavity {plain(s.cavity_width)}")
        view.horizontal(
            inner, half, s.cavity_top, top + view.mm(0.2 + ROW), f"side wall {plain(s.side_wall)}"
        )
    view.horizontal(
        -s.channel_width / 2,
        s.channel_width / 2,
        -s.channel_height / 2,
        low - view.mm(0.2),
        f"channel {plain(s.channel_width)}",
    )
    view.horizontal(-half, half, low, low - view.mm(0.2 + ROW), f"width {plain(s.width)}")
    view.vertical(low, top, -half, -half - view.mm(0.25), f"{plain(top - low)}")
    if s.layer_thickness:
        view.horizontal(-half, half, s.layer_top, s.layer_top, f"layer {plain(s.layer_thickness)}")
    below, r = "roof" if s.kind == TWISTING else "base", s.channel_height / 2
    core = [
        (s.core_bottom, -r, f"{below} {plain(-r - s.core_bottom)}"),
        (-r, r, f"channel {plain(s.channel_height)}"),
        (r, s.core_top, f"roof {plain(s.roof)}"),
    ]
    view.ladder(core, half, half + view.mm(0.2))


def normal_section(
    figure: "Figure", rectangle: Rectangle, scale: float, manipulator: Manipulator, group: list[int]
) -> None:
    """Section across the chambers on the channel axis."""
    s = manipulator.segments[group[0]]
    pairs = min(2, max(manipulator.segments[i].chambers for i in group))
    step, margin = s.chamber_thickness + s.gap, 1.5
    stop = (pairs - 1) * step + s.chamber_thickness
    view = SheetView(
        figure, rectangle, scale, stop / 2, (s.chamber_top + s.chamber_bottom) / 2, right=-0.3, up=0.22
    )
    solids = [(-margin, stop + margin, s.core_bottom, s.core_top)]
    voids = [(-margin - 1, stop + margin + 1, -s.channel_height / 2, s.channel_height / 2)]
    for side in s.sides:
        for k in range(pairs):
            x = k * step
            solids.append((x, x + s.chamber_thickness, 0.0, side * s.chamber_top))
            voids.append(
                (x + s.wall, x + s.wall + s.cavity_thickness, side * s.cavity_floor, side * s.cavity_top)
            )
    view.cut(solids, voids, segment_colour(group[0]), clip=(-margin, stop + margin))
    top, low = s.chamber_top, s.chamber_bottom
    view.heading(_named(group, "normal to the chambers"))
    y = low - view.mm(0.2)
    view.horizontal(s.wall, s.wall + s.cavity_thickness, low, y, f"cavity {plain(s.cavity_thickness)}")
    view.horizontal(0.0, s.wall, low, y - view.mm(ROW), f"wall {plain(s.wall)}")
    if pairs > 1:
        view.horizontal(s.chamber_thickness, step, low, y - view.mm(2 * ROW), f"gap {plain(s.gap)}")
        view.horizontal(0.0, step, top, top + view.mm(0.2), f"normal pitch {plain(step)}")
    edge = stop + margin
    heights: list[Interval] = [
        (s.cavity_floor, s.cavity_top, f"chamber {plain(s.chamber_height)}"),
        (s.cavity_top, s.chamber_top, f"top wall {plain(s.top_wall)}"),
    ]
    if s.cavity_floor > 0:
        heights.insert(0, (0.0, s.cavity_floor, f"floor {plain(s.cavity_floor)}"))
    view.ladder(heights, stop, edge + view.mm(0.15))
    view.vertical(
        s.core_bottom,
        s.core_top,
        -margin,
        -margin - view.mm(0.25),
        f"core {plain(s.core_top - s.core_bottom)}",
    )
