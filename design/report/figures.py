"""The report's pictures; each function writes one PNG or several and returns [(file name, caption)]."""

from pathlib import Path

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError
from pneunet.base.files.schemas import MEAN_STRETCH
from pneunet.base.pictures import rendering
from pneunet.base.pictures.rendering import figure, save
from pneunet.base.pictures.walls import EVENLY_LIT, TOUCHING, draw_walls
from pneunet.base.units import KPA_PER_MPA, MPA_PER_KPA
from pneunet.design.report import bodies
from pneunet.design.report.bodies import Scene
from pneunet.design.report.comparison import Comparison
from pneunet.design.report.labels import FINITE_ELEMENTS, STYLES, kPa, segment_colour, significant
from pneunet.design.report.pictures import curve_panels, legend, segment_bands
from pneunet.design.report.rundata import DesignFolder, Solution
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import Manipulator
from pneunet.geometry.sections import chamber_plan
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.prediction import predict_design

#: file, point data, in words, unit, percentile at which the scale ends: corners are singular for the stretch
FIELDS = (
    ("fe_displacement.png", "displacement length", "displacement", " mm", 100),
    ("fe_stretch.png", MEAN_STRETCH, "mean principal stretch", "", 98),
)
#: tells most values apart, where most of a body is stretched little
MAP = "turbo"


def _at(design, solve):
    """End of the titles of finite element pictures: the pressure, and whether parts overlap in them."""
    return kPa(design.scaled(solve.pressure)) + " (overlaps)" * (solve.walls_overlap or solve.body_overlap)


def curve_picture(run: DesignFolder, comparison: "Comparison", folder: Path) -> list[tuple[str, str]]:
    """Target, reduced and finite element centrelines over each other."""
    design, solve, solved = run.design, run.solve, comparison.solved
    curves, bands = [], []
    if run.target is not None:
        curves.append(("target", run.target, "target"))
    reduced = comparison.reduced if solve is None else comparison.reduced_at_solve
    if reduced is not None:
        pressure = design.pressure if solve is None else design.scaled(solve.pressure)
        curves.append((f"reduced, {kPa(pressure)}", reduced, "reduced"))
    if solve is not None and solved is not None:
        curves.append((f"finite elements, {_at(design, solve)}", solved, "finite elements"))
        s = np.linspace(solve.s[0], solve.s[-1], len(solved))
        bands = segment_bands(design.manipulator, s, solved)
    if not curves:
        return []
    fig = figure(11.0, 6.2)
    curve_panels(fig, curves, bands)
    legend(fig, curves, design.manipulator.segments if bands else ())
    save(fig, folder / "curves.png", dpi=110)
    coloured = "; segments coloured along the finite element curve" if bands else ""
    return [("curves.png", f"Centrelines in 3D and in two projections, equal scale{coloured}.")]


def body_pictures(run: DesignFolder, scene: Scene, folder: Path) -> list[tuple[str, str]]:
    """Target, reduced body and finite element body from one camera at one scale; fields on the finite element
    body; the reference body."""
    solve = run.solve
    pressure = run.design.pressure if solve is None else run.design.scaled(solve.pressure)
    dashed = [] if run.target is None else [(run.target, STYLES["target"] | {"linewidth": 3.0})]
    with_target = "; dashed in front: the target" * bool(dashed)
    out = []

    def picture(name, things, title, caption, **more):
        rendering.write_picture(
            folder / name, scene.view, rendering.render(scene.view, things), title, **more
        )
        out.append((name, caption))

    if run.target is not None:
        picture("target.png", [bodies.tube(run.target)], "target", "The target curve.")
    if scene.reduced is not None:
        picture(
            "reduced.png",
            bodies.painted(scene.reduced),
            f"reduced model, {kPa(pressure)}",
            f"The reduced model's body, coloured by segment{with_target}.",
            overlays=dashed,
        )
    if solve is not None and scene.solved is not None:
        surface, lines = scene.solved
        picture(
            "fe.png",
            [(surface, {"color": FINITE_ELEMENTS}), lines],
            f"finite elements, {_at(run.design, solve)}",
            f"The finite element body{with_target}.",
            overlays=dashed,
        )
        for name, field, what, unit, percentile in FIELDS:
            if field not in surface.point_data:
                continue
            values = surface.point_data[field]
            low, top = float(values.min()), float(np.percentile(values, percentile))
            limits = (low, max(top, low + 1e-9))
            beyond = values.max() > limits[1]
            caption = f"Finite element body coloured by {what}, at most {significant(values.max(), 3)}{unit}"
            caption += f"; the scale ends at the {percentile}th percentile" * bool(beyond)
            if field == MEAN_STRETCH:
                inside = significant(solve.steps["largest_stretch"][-1], 3)
                caption += f". Over the most stretched hundredth of a segment it is {inside} on average"
                caption += " (largest_stretch in steps.csv)"
            coloured, look = rendering.coloured(surface, field, limits, MAP)
            picture(
                name,
                [(coloured, look | EVENLY_LIT), lines],
                f"{what}, {_at(run.design, solve)}",
                f"{caption}.",
                bar=(f"{what} ({unit.strip() or '-'})", limits, MAP),
                extend="max" if beyond else "neither",
            )
    rest_view = rendering.view_of(scene.rest.points)
    rendering.write_picture(
        folder / "reference.png",
        rest_view,
        rendering.render(rest_view, bodies.painted(scene.rest)),
        "reference body, 0 kPa",
    )
    out.append(("reference.png", "The body at rest (its own scale)."))
    return out


def history_picture(
    design: DesignFile, solve: Solution, law: SegmentLaw, folder: Path
) -> list[tuple[str, str]]:
    """Tip, volume, wall distance and stretch against pressure; the reduced tip dashed."""
    steps = solve.steps
    p = steps["pressure_kPa"]
    fig = figure(10.0, 6.6)
    axes = fig.subplots(2, 2)
    levels, tips = np.linspace(0, p.max(), 15), []
    for level in levels:
        try:
            line = predict_design(design, design.scaled(level * MPA_PER_KPA), law)
        except ConvergenceError:
            break
        tips.append(se3.transform(se3.inverse_pose(design.base_pose), line.points[-1]))
    for i, (name, colour) in enumerate(zip("xyz", ("#1f6fb2", "#2f9e44", "#d9480f"))):
        axes[0, 0].plot(
            p,
            steps[f"tip_{name}_mm"],
            "o-",
            color=colour,
            markersize=3,
            linewidth=1.4,
            label=f"{name}, finite elements",
        )
        if tips:
            reduced, label = [tip[i] for tip in tips], f"{name}, reduced"
            axes[0, 0].plot(levels[: len(tips)], reduced, "--", color=colour, linewidth=1.2, label=label)
    axes[0, 0].set_ylabel("tip, body axes (mm)")
    axes[0, 0].legend(fontsize=7, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    for ax, column, label in (
        (axes[0, 1], "volume_mm3", "cavity volume (mm³)"),
        (axes[1, 0], "smallest_wall_distance_mm", "smallest wall distance (mm)"),
        (axes[1, 1], "largest_stretch", "largest stretch (-)"),
    ):
        values = np.where(np.isfinite(steps[column]), steps[column], np.nan)  # no gaps, no distance: infinity
        ax.plot(p, values, "o-", color=FINITE_ELEMENTS, markersize=3, linewidth=1.4)
        ax.set_ylabel(label)
    between = steps["body_distance_mm"]
    if between.min() < 2 * max(s.gap for s in design.manipulator.segments):
        axes[1, 0].plot(
            p,
            between,
            "s--",
            color="#862e9c",
            markersize=3,
            linewidth=1.2,
            label="parts far apart along the body",
        )
        axes[1, 0].legend(fontsize=7, frameon=False)
    low = axes[1, 0].get_ylim()[0]
    axes[1, 0].axhline(0.0, color="#c92a2a", linewidth=1.0)
    axes[1, 0].set_ylim(bottom=min(low, -0.05))
    axes[1, 0].axhspan(axes[1, 0].get_ylim()[0], 0.0, color="#c92a2a", alpha=0.12)
    for ax in axes.flat:
        ax.set_xlabel("pressure (kPa)")
        ax.axvline(design.largest_pressure * KPA_PER_MPA, color="#868e96", linewidth=0.9, linestyle=":")
        ax.set_xlim(left=0.0)
        ax.grid(True, linewidth=0.4, alpha=0.6)
    fig.subplots_adjust(left=0.08, right=0.98, top=0.92, bottom=0.08, wspace=0.24, hspace=0.28)
    save(fig, folder / "history.png", dpi=110)
    return [
        (
            "history.png",
            (
                "Load history of the finite element solution, one mark an accepted step; the reduced model's"
                " tip dashed; dotted: design pressure; red: below zero walls overlap."
            ),
        )
    ]


def touching_picture(
    design: DesignFile, solve: Solution, scene: Scene, folder: Path
) -> list[tuple[str, str]]:
    """The deformed body, its facing walls coloured by their distance; [] without fields or gaps."""
    if scene.solved is None:
        return []
    surface, (lines, _) = scene.solved
    walls = bodies.facing_walls(surface)
    if walls is None:
        return []
    gap = max(s.gap for s in design.manipulator.segments)
    touching = TOUCHING * gap * solve.contact
    around = f"is nearer than {touching:.2g} mm: contact" if touching else "lies behind the other: overlap"
    title = f"distance of walls, {_at(design, solve)}"
    draw_walls(folder / "fe_walls.png", surface, lines, walls, gap, title, touching, scene.view)
    return [
        (
            "fe_walls.png",
            (
                "Finite element body, last step; walls that face each other across a gap coloured by their"
                f" distance. A black line surrounds where one {around}."
            ),
        )
    ]


def wall_picture(manipulator: Manipulator, solve: Solution, folder: Path) -> list[tuple[str, str]]:
    """Plan strips of the upper and the lower side, every gap coloured by the smallest distance of its
    walls."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import TwoSlopeNorm
    from matplotlib.patches import Polygon

    walls = {(a, b, c): d for a, b, c, d in solve.walls}
    if not walls:
        return []
    sides = sorted({side for _, side, _ in walls}, reverse=True)
    top = max(s.gap for s in manipulator.segments)
    # red = overlap, white = touching, blue = open; the scale reaches as far down as the deepest overlap
    norm = TwoSlopeNorm(0.0, min(-0.25 * top, *walls.values()), max(top, *walls.values()))
    colours = ScalarMappable(norm, "RdBu")
    half = max(s.width for s in manipulator.segments) / 2
    strip = 9.6 * (2 * half + 3) / manipulator.length
    height = len(sides) * (strip + 0.45) + 1.15
    fig = figure(10.6, height)
    for row, side in enumerate(sides):
        ax = fig.add_axes([0.07, 1 - (row + 1) * (strip + 0.45) / height, 0.9, strip / height])
        for i, (s, start) in enumerate(zip(manipulator.segments, manipulator.starts)):
            w = s.width / 2
            ax.add_patch(
                Polygon(
                    [(start, -w), (start + s.length, -w), (start + s.length, w), (start, w)],
                    facecolor="#e9ecef",
                    edgecolor="#495057",
                    linewidth=0.8,
                )
            )
            if side not in s.sides:
                continue
            for x in start + s.chamber_positions:
                ax.add_patch(
                    Polygon(
                        chamber_plan(s, x, s.chamber_thickness, w, side),
                        facecolor=segment_colour(i),
                        alpha=0.45,
                        edgecolor="none",
                    )
                )
            for gap, x in enumerate((start + s.chamber_positions)[:-1] + s.pitch / 2, start=1):
                distance = walls.get((i + 1, side, gap))
                if distance is not None:
                    ax.add_patch(
                        Polygon(
                            chamber_plan(s, x, s.gap, w, side),
                            facecolor=colours.to_rgba(np.asarray(distance)),
                            edgecolor="#212529",
                            linewidth=0.7,
                        )
                    )
                    if distance < 0 and not solve.contact:
                        ax.plot(
                            x + w * s.cot * side, w + 1.2, "v", color="#c92a2a", markersize=6, clip_on=False
                        )
        ax.set_xlim(-1, manipulator.length + 1)
        ax.set_ylim(-half - 1.5, half + 1.5)
        ax.set_title(
            ("upper chambers" if side > 0 else "lower chambers (seen through the body)")
            + ", each segment as before its roll" * any(s.roll for s in manipulator.segments),
            fontsize=9,
            loc="left",
            pad=7,
        )
        ax.set_yticks([])
        ax.tick_params(labelsize=8)
        for edge in ("left", "right", "top"):
            ax.spines[edge].set_visible(False)
    ax.set_xlabel("along the body at rest (mm)", fontsize=9, labelpad=2)
    cax = fig.add_axes([0.25, 0.45 / height, 0.5, 0.13 / height])
    fig.colorbar(colours, cax=cax, orientation="horizontal")
    cax.set_xlabel("smallest distance of the walls facing each other (mm); negative = overlap", fontsize=9)
    cax.tick_params(labelsize=8)
    save(fig, folder / "walls.png", dpi=110)
    return [
        (
            "walls.png",
            (
                "Plan of the body at rest, gaps coloured by the smallest distance of their walls,"
                " last step. Red triangles mark overlap."
            ),
        )
    ]
