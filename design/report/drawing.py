"""The dimensioned drawing of a manipulator: plan, side view, sections with every dimension in mm, table of
segments."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.pictures import rendering
from pneunet.design.report.dimensions import INK, SheetView
from pneunet.design.report.labels import REDUCED, kPa, material_names, plain, segment_colour, segment_mode
from pneunet.design.report.section_views import cross_section, normal_section, section_groups, section_scale
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import TWISTING, Manipulator
from pneunet.geometry.sections import chamber_plan, whole_section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHEET_WIDTH = 16.5  # inches, the width of A3
MARGIN = 0.45
COLUMNS = 4  # section panels in a row
PANEL_WIDTH = (SHEET_WIDTH - 2 * MARGIN) / COLUMNS
PANEL_HEIGHT = 3.6


def segment_table(manipulator: Manipulator) -> list[tuple[str, list[str]]]:
    """Rows (label, [text for every segment]) of all dimensions, lengths in mm, for the drawing and the
    report."""

    def row(label, value, passive=False):
        return label, [value(s) if s.chambers or passive else "-" for s in manipulator.segments]

    called = material_names(manipulator)
    layers = [
        row(
            "stiff layer, bottom of the base",
            lambda s: plain(s.layer_thickness) if s.layer_thickness else "-",
            True,
        ),
        row("its material", lambda s: called[s.layer_material] if s.layer_thickness else "-", True),
    ]
    fillets = [row("fillet of chambers' edges", lambda s: plain(s.fillet) if s.fillet else "-")]
    rolls = [row("roll about the axis, deg", lambda s: f"{s.roll}", True)]
    groups = [row("pressure group", lambda s: f"{s.group}", True)]
    return [
        row("mode", segment_mode, True),
        row("angle to the axis, deg", lambda s: plain(s.angle)),
        row(
            "chambers",
            lambda s: f"{s.chambers} pair{'s' * (s.chambers > 1)}" if s.kind == TWISTING else f"{s.chambers}",
        ),
        row("axial pitch", lambda s: plain(s.pitch)),
        row("width", lambda s: plain(s.width), True),
        row("chamber height (cavity)", lambda s: plain(s.chamber_height)),
        row("cavity thickness, normal", lambda s: plain(s.cavity_thickness)),
        row("wall, normal", lambda s: plain(s.wall)),
        row("gap, normal", lambda s: plain(s.gap)),
        row("top wall", lambda s: plain(s.top_wall)),
        row("side wall", lambda s: plain(s.side_wall)),
        row("base thickness", lambda s: "-" if s.kind == TWISTING else plain(s.base_thickness), True),
        row("roof over the channel", lambda s: plain(s.roof), True),
        row("core thickness", lambda s: plain(s.core_top - s.core_bottom), True),
        row(
            "channel, width x height", lambda s: f"{plain(s.channel_width)} x {plain(s.channel_height)}", True
        ),
        row("cavity floor above the axis", lambda s: plain(s.cavity_floor)),
        row("bare core beyond the chambers", lambda s: plain(s.end_margin)),
        row("passive length, each end", lambda s: plain(s.end_length)),
        row("active length", lambda s: plain(s.active_length)),
        row("length", lambda s: plain(s.length), True),
        row("material", lambda s: called[s.material], True),
        row("shear modulus, MPa", lambda s: plain(s.material.mu, 4), True),
        *(layers if any(s.layer_thickness for s in manipulator.segments) else []),
        *(fillets if any(s.fillet for s in manipulator.segments) else []),
        *(rolls if any(s.roll for s in manipulator.segments) else []),
        *(groups if len(manipulator.groups) > 1 else []),
    ]


def draw_drawing(design: DesignFile, path: str | Path) -> None:
    """Write the drawing of a DesignFile as a PNG (or SVG, PDF: by the suffix of `path`)."""
    rendering.save(drawing_figure(design), path, 130)


def drawing_figure(design: DesignFile) -> "Figure":
    """The drawing as a matplotlib Figure, `SHEET_WIDTH` inches wide and as high as its content."""
    manipulator = design.manipulator
    groups = section_groups(manipulator)
    rows = segment_table(manipulator)
    scale = min((SHEET_WIDTH - 2 * MARGIN - 1.7) / manipulator.length, 0.16)
    (near, far), (lowest, highest) = _extent(manipulator)
    plan_height = scale * (far - near) + 1.9
    side_height = scale * (highest - lowest) + 1.7
    panels = [
        (draw, group)
        for group in groups
        for draw in (cross_section, normal_section)[: 1 + bool(manipulator.segments[group[0]].chambers)]
    ]
    place = len(panels) + (len(panels) % COLUMNS == COLUMNS - 1)  # of the table, as wide as two
    panel_rows = -(-(place + 2) // COLUMNS)
    height = 2 * MARGIN + 0.75 + plan_height + side_height + panel_rows * PANEL_HEIGHT + 0.65
    figure = rendering.figure(SHEET_WIDTH, height)
    _frame(figure, design, height)

    top = height - MARGIN - 0.75
    width = SHEET_WIDTH - 2 * MARGIN
    middle = manipulator.length / 2
    top -= plan_height
    rectangle = (MARGIN, top, width, plan_height)
    _plan(SheetView(figure, rectangle, scale, middle, (near + far) / 2, up=-0.4), manipulator)
    top -= side_height
    rectangle = (MARGIN, top, width, side_height)
    _side(SheetView(figure, rectangle, scale, middle, (highest + lowest) / 2, up=0.48), manipulator)

    panel_scale = min(section_scale(manipulator.segments[g[0]], PANEL_WIDTH, PANEL_HEIGHT) for g in groups)
    for number, (draw, group) in enumerate(panels):
        left = MARGIN + PANEL_WIDTH * (number % COLUMNS)
        bottom = top - PANEL_HEIGHT * (number // COLUMNS + 1)
        draw(figure, (left, bottom, PANEL_WIDTH, PANEL_HEIGHT), panel_scale, manipulator, group)
    left = MARGIN + PANEL_WIDTH * (place % COLUMNS)
    bottom = top - PANEL_HEIGHT * (place // COLUMNS + 1)
    _table(figure, (left + 0.1, bottom + 0.1, 2 * PANEL_WIDTH - 0.2, PANEL_HEIGHT - 0.2), rows)
    return figure


def _frame(figure, design, height):
    from matplotlib.patches import Rectangle

    figure.add_artist(
        Rectangle((0.012, 0.2 / height), 0.976, 1 - 0.4 / height, fill=False, edgecolor=INK, linewidth=1.2)
    )
    manipulator = design.manipulator
    x, y = MARGIN / SHEET_WIDTH, 1 - (MARGIN + 0.1) / height
    figure.text(x, y, design.name, fontsize=17, weight="bold", color=INK, va="top")
    facts = (
        f"pneu-net soft manipulator, {len(manipulator.segments)}"
        f" segment{'s' * (len(manipulator.segments) > 1)}, {manipulator.chambers} chambers/pairs, total"
        f" length {plain(manipulator.length)} mm, design pressure {kPa(design.pressure)}"
    )
    figure.text(x, y - 0.33 / height, facts, fontsize=10, color=INK, va="top")
    figure.text(1 - x, y, "all dimensions in mm", fontsize=10, color=INK, va="top", ha="right")
    told = "; ".join(
        f"{m.name}: {m.law}, mu = {plain(m.mu, 4)} MPa, {plain(m.density * 1e12)} kg/m$^3$"
        for m in manipulator.materials
    )
    notes = (
        f'Material {told}.\n"Normal" = measured across the chamber. z = 0 is the channel axis (blue). The'
        f" lower chambers of a twisting segment are the upper ones turned by half a turn about x.\n"
        f"{_cavities(manipulator)} Sections are in a segment's own axes, before its roll."
    )
    figure.text(x, (MARGIN + 0.42) / height, notes, fontsize=8.5, color=INK, va="top", linespacing=1.4)


def _cavities(manipulator):
    """What the channel joins, and where the air comes in."""
    ports = ", ".join(plain(x) for x in manipulator.ports)
    if len(manipulator.groups) == 1:
        return f"One cavity: the channel joins all chambers. Port at x = {ports}, from the -y side, z = 0."
    walls = manipulator.channels[1:, 0] - manipulator.channels[:-1, 1]
    return (
        f"{len(manipulator.groups)} cavities, one a pressure group, with bulkheads of"
        f" {', '.join(plain(w) for w in walls)} between them. Ports at x = {ports}, from their segments' -y"
        " side, z = 0."
    )


def _extent(manipulator):
    """(2, 2) lowest and highest y and z of the body, mm."""
    sections = np.array([whole_section(s) for s in manipulator.segments])
    return np.column_stack([sections[..., 0].min(axis=0), sections[..., 1].max(axis=0)])


#: roll -> which of a segment's own axes is up on the sheet, with which sign, and from which side of the other
#: it is seen
FROM_ABOVE = {0: ("y", 1, 1), 90: ("z", -1, 1), 180: ("y", -1, -1), 270: ("z", 1, -1)}
FROM_THE_SIDE = {0: ("z", 1, -1), 90: ("y", 1, 1), 180: ("z", -1, 1), 270: ("y", -1, -1)}


def _bodies(view, manipulator, seen):
    """Core, chambers and channel of every segment, as `seen` says: FROM_ABOVE or FROM_THE_SIDE."""
    for i, (s, start) in enumerate(zip(manipulator.segments, manipulator.starts)):
        axis, sign, near = seen[s.roll]
        draw = _along_height if axis == "y" else _along_width
        draw(view, s, start, segment_colour(i), sign, near)
        first, last = manipulator.channels[s.group - 1]
        x0, x1 = max(start, first), min(start + s.length, last)
        half = (s.channel_width if axis == "y" else s.channel_height) / 2
        if axis == "y":
            for y in (-half, half):
                view.line([(x0, y), (x1, y)], width=0.6, style=(0, (5, 2)))
            for x in {x0, x1} & {first, last}:
                view.line([(x, -half), (x, half)], width=0.6, style=(0, (5, 2)))


def _along_height(view, s, start, colour, sign, near):
    """Seen along the segment's z: the chambers of side `near` solid, others dashed."""
    half = s.width / 2
    view.polygon(_box(start, s.length, -half, half), face="#f1f3f5")
    for side in sorted(s.sides, key=lambda side: side == near):
        for x in start + s.chamber_positions:
            outline, cavity = (
                [(x, sign * y) for x, y in chamber_plan(s, x, thickness, width, side)]
                for thickness, width in (
                    (s.chamber_thickness, half),
                    (s.cavity_thickness, s.cavity_width / 2),
                )
            )
            if side == near:
                view.polygon(outline, face=colour, width=0.8)
                view.polygon(cavity, face="white", width=0.5, alpha=0.55)
            else:
                view.polygon(outline, face="none", width=0.6, style=(0, (3, 2)))


def _along_width(view, s, start, colour, sign, near):
    """Seen along the segment's y: the end faces of the chambers at the side `near` dark, their slanted sides
    behind them light."""
    for side in s.sides:
        z0, z1 = side * sign * s.core_top, side * sign * s.chamber_top
        for shade, width in ((0.35, None), (1.0, 0.7)):
            for x in start + s.chamber_positions:
                corners = [c[0] for c in chamber_plan(s, x, s.chamber_thickness, s.width / 2, side)]
                faces = corners[:2] if near < 0 else corners[:1:-1]
                x0, x1 = (min(corners), max(corners)) if width is None else faces
                view.polygon(
                    [(x0, z0), (x1, z0), (x1, z1), (x0, z1)], face=colour, width=width or 0.4, alpha=shade
                )
    view.polygon(_box(start, s.length, sign * s.core_bottom, sign * s.core_top), face="#e4e8ec", width=0.9)


def _box(start, length, low, high):
    return [(start, low), (start + length, low), (start + length, high), (start, high)]


def _plan(view, manipulator):
    """Seen from above: upper chambers solid, lower ones and the channel dashed."""
    short = min(s.length for s in manipulator.segments) * view.scale < 1.5
    highest = _extent(manipulator)[0, 1]
    view.title(-view.mm(0.28), view.mm(0.3), "plan")
    _bodies(view, manipulator, FROM_ABOVE)
    for i, (s, start) in enumerate(zip(manipulator.segments, manipulator.starts)):
        half, (axis, sign, _) = s.width / 2, FROM_ABOVE[s.roll]
        level = highest + view.mm(0.92 + (0.3 if short and i % 2 else 0.0))
        told = f"{segment_mode(s)} {plain(s.angle)}°" if s.chambers else segment_mode(s)
        told += f", rolled {s.roll}°" * bool(s.roll)
        view.balloon(start + s.length / 2, level, i + 1, told, segment_colour(i))
        if not s.chambers or axis == "z":
            continue
        first, slant = start + s.chamber_positions[0], half * s.cot
        view.angle(first + sign * slant, half, s.angle if sign > 0 else 180 - s.angle, 0.42)
        if s.chambers > 1:
            x = first - sign * slant
            view.horizontal(x, x + s.pitch, -half, -half - view.mm(0.3), f"pitch {plain(s.pitch)}")
    _axis(view, manipulator)
    view.text(-view.mm(0.28), 0, "base", ha="right")
    view.text(manipulator.length + view.mm(0.28), 0, "tip", ha="left")


def _axis(view, manipulator):
    over = view.mm(0.25)
    view.line([(-over, 0), (manipulator.length + over, 0)], style=(0, (12, 3, 2, 3)), colour=REDUCED)


def _side(view, manipulator):
    """Seen along y, from where y is negative."""
    view.title(-view.mm(0.28), view.mm(0.3), "side view")
    _bodies(view, manipulator, FROM_THE_SIDE)
    ends, lengths = [], []
    for s, start in zip(manipulator.segments, manipulator.starts):
        a, b = start + s.end_length, start + s.end_length + s.active_length
        if s.chambers:
            ends += [(start, a, plain(s.end_length)), (b, start + s.length, plain(s.end_length))]
        else:
            ends.append((start, start + s.length, plain(s.length)))
        lengths.append((start, start + s.length, plain(s.length), (a, b, s)))
    _axis(view, manipulator)
    low = _extent(manipulator)[1, 0]
    view.chain_below(ends, low, low - view.mm(0.25))
    for start, stop, text, (a, b, s) in lengths:
        if s.chambers:
            view.between(a, b, low - view.mm(0.25), plain(s.active_length))
        view.horizontal(start, stop, low, low - view.mm(0.68), text)
    view.horizontal(
        0.0, manipulator.length, low, low - view.mm(0.98), f"total length {plain(manipulator.length)}"
    )
    view.text(-view.mm(0.1), low - view.mm(0.25), "passive | active", ha="right", size=6.5)
    view.text(-view.mm(0.1), low - view.mm(0.68), "segment", ha="right", size=6.5)


def _table(figure, rectangle, rows):
    """The segment table, one column a segment."""
    view = SheetView(figure, rectangle, 1.0, rectangle[2] / 2, rectangle[3] / 2)
    width, height = rectangle[2], rectangle[3]
    step = height / (len(rows) + 1)
    count = len(rows[0][1])
    label_width = 2.3
    cell = min((width - label_width) / count, 1.5)
    right = label_width + cell * count
    y = height - step
    view.text(0.06, y + step / 2, "segment", weight="bold", size=8, ha="left")
    for i in range(count):
        x = label_width + cell * i
        view.polygon(
            [(x, y), (x + cell, y), (x + cell, height), (x, height)], face=segment_colour(i), width=0
        )
        view.text(x + cell / 2, y + step / 2, str(i + 1), weight="bold", size=8)
    size = min(8.0, 72 * step * 0.66)
    for number, (label, values) in enumerate(rows):
        y -= step
        if number % 2:
            view.polygon([(0, y), (right, y), (right, y + step), (0, y + step)], face="#f1f3f5", width=0)
        view.text(0.06, y + step / 2, label, size=size, ha="left")
        for i, value in enumerate(values):
            # long words (material names) are cut to what the column holds
            room = int(cell * 72 / (0.56 * size))
            view.text(
                label_width + cell * (i + 0.5),
                y + step / 2,
                value if len(value) <= room else value[: room - 1] + "…",
                size=size,
            )
    view.polygon([(0, 0), (right, 0), (right, height), (0, height)], face="none", width=0.8)
    view.line([(0, height - step), (right, height - step)], width=0.8)
