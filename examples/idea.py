"""`python -m examples.idea`: the README's picture of the idea, docs/idea.png: cell -> law -> rod -> body.

The cell and the law are of the reference case one-sided-w10, rod and body are the demo's (`make demo` first;
without its solution the body is the reduced model's outline).
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from pneunet.base import se3
from pneunet.base.files.schemas import MEAN_STRETCH
from pneunet.base.pictures.rendering import coloured, edges, figure, render, save, view_of
from pneunet.base.units import KPA_PER_MPA, MPA_PER_KPA
from pneunet.design.report.bodies import body_mesh, deformed_surface, painted, read_solution, tube
from pneunet.design.report.labels import FINITE_ELEMENTS, REDUCED
from pneunet.geometry import tags
from pneunet.geometry.designfile import read_design
from pneunet.geometry.reference_cases import CASES
from pneunet.reduced import shipped_law
from pneunet.reduced.rod.prediction import predict_design

ROOT = Path(__file__).resolve().parent.parent
DEMO, PICTURE = ROOT / "out" / "demo", ROOT / "docs" / "idea.png"
#: the cell: degrees, kPa in steps, mesh in mm (the finest that the law knows), pitches shown
ANGLE, TOP_kPa, LEVELS, MESH_SIZE, PITCHES = 60.0, 50.0, 5, 1.0, 4
#: what a quadratic facet (corners, mid-edges) is drawn as
FLAT = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
WIDE, PIXELS = (14.0, 4.1), (840, 720)
MAP = "YlOrRd"
EDGES = {"color": "#3b434b", "line_width": 2.5, "lighting": False}
#: so that colours stay those of the bar
LIT = {"ambient": 0.6, "diffuse": 0.5}


def solved_cell(segment):
    """(surface of a few pitches at the top pressure, its CellStates from rest), finite elements."""
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.run import solve_cell

    states = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.npz"
        case = CellCase(segment, TOP_kPa * MPA_PER_KPA, MESH_SIZE, LEVELS, element="tetrahedra")
        solve_cell(case, path, states.append)
        return cell_surface(CellProblem(segment, path), states[-1]), states


def cell_surface(problem, state):
    """pyvista.PolyData of PITCHES pitches of a cell, deformed by its screw; point data "moved" (mm)."""
    import pyvista

    from pneunet.hifi.fem.surface import facet_nodes

    triangles = facet_nodes(problem, tags.OUTER)[:, FLAT].reshape(-1, 3)
    used, corners = np.unique(triangles, return_inverse=True)
    bulge = problem.displacement(state.array)[used]
    pitches = []
    for number in np.arange(PITCHES):
        rest = problem.nodes[used] + [number * problem.segment.pitch, 0, 0]
        screw = se3.exp_pose(state.strains.twist_vector * rest[:, :1])
        moved = np.einsum("nij,nj->ni", screw[:, :3, :3], rest * [0, 1, 1] + bulge) + screw[:, :3, 3]
        pitch = pyvista.PolyData.from_regular_faces(rest, corners.reshape(-1, 3))
        pitch.point_data["place"], pitch.point_data["moved"] = moved, np.linalg.norm(bulge, axis=1)
        pitches.append(pitch)
    return pyvista.merge(pitches).extract_surface().clean(tolerance=1e-6, absolute=True)


def in_place(surface):
    """(surface, edges) of a `cell_surface` where it has moved to, edges as they are at rest."""
    lines, _ = edges(surface)
    for mesh in (surface, lines):
        mesh.points = np.asarray(mesh.point_data["place"])
    return surface, lines


def lit(surface, name, limits):
    mesh, look = coloured(surface, name, limits, MAP)
    return mesh, look | LIT


def demo_design():
    """The demo's design; it is made where it is not there yet."""
    path = DEMO / "design.toml"
    if not path.exists():
        command = [sys.executable, "-m", "pneunet", "design", "design/data/octopus.toml", "-o", str(DEMO)]
        subprocess.run(command, cwd=ROOT, check=True)
    return read_design(path)


def draw_law(axes, segment, states, law):
    """Strains over pressure: the law with its error bars, the cell's states as dots."""
    from matplotlib.ticker import MultipleLocator

    section, pressures = law.of(segment), np.linspace(0.0, TOP_kPa, 21)
    strains, half = section.free_strains(MPA_PER_KPA * pressures), section.half_width(MPA_PER_KPA * pressures)
    for i, name, unit, colour in ((3, "twist", "$k_1$", REDUCED), (4, "bending", "$k_2$", "#2f9e44")):
        k = 1e3 * strains[:, i]
        axes.plot(pressures, k, color=colour, linewidth=2, label=f"{name} {unit}")
        axes.errorbar(
            pressures[4::4],
            k[4::4],
            1e3 * half[4::4, i],
            fmt="none",
            ecolor=colour,
            elinewidth=1.2,
            capsize=3.5,
        )
        dots = [(KPA_PER_MPA * s.pressure, 1e3 * s.strains.k[i - 3]) for s in states]
        axes.plot(*np.transpose(dots), "o", color=FINITE_ELEMENTS, markersize=5, zorder=3, clip_on=False)
    axes.plot([], [], "o", color=FINITE_ELEMENTS, markersize=5, label="cells, finite elements")
    axes.errorbar([], [], [], fmt="none", ecolor="0.4", capsize=3.5, label="90 % interval of the law")
    axes.set(xlabel="pressure, kPa", ylabel="strains of the section, rad/m", xlim=(0, TOP_kPa), ylim=(0, 50))
    axes.xaxis.set_major_locator(MultipleLocator(10))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9, loc="upper left", borderaxespad=0.1, handlelength=1.4)


def section_frames(line, every, length):
    """Things to render: axes of the section frames of a Centreline, `every` mm, `length` mm long."""
    import pyvista

    poses = line.at(np.arange(line.s[0], line.s[-1], every))
    for axis, colour in ((1, "#c92a2a"), (2, "#2b8a3e")):
        bars = [
            pyvista.Cylinder(
                center=p[:3, 3] + length / 2 * p[:3, axis], direction=p[:3, axis], radius=0.5, height=length
            )
            for p in poses
        ]
        yield pyvista.merge(bars).extract_surface(), {"color": colour}


def body(design, law):
    """(things to render, points, words, limits of the colour bar or None) of the demo's body."""
    path = DEMO / "solve" / "solution.pvd"
    if not path.exists():
        mesh = body_mesh(design.manipulator, predict_design(design, design.pressure, law))
        return painted(mesh), mesh.points, "outline carried by the rod", None
    surface, (lines, _) = deformed_surface(read_solution(path), design.base_pose)
    limits = (1.0, float(np.percentile(surface.point_data[MEAN_STRETCH], 99)))
    return [lit(surface, MEAN_STRETCH, limits), (lines, EDGES)], surface.points, "finite elements", limits


def colour_bar(fig, place, limits, label, extend="neither"):
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    axes = fig.add_axes(place)
    fig.colorbar(ScalarMappable(Normalize(*limits), MAP), cax=axes, orientation="horizontal", extend=extend)
    axes.set_xlabel(label, fontsize=9)
    axes.tick_params(labelsize=9)


def main():
    law, segment = shipped_law(), CASES["one_sided_w10"](ANGLE, 1)
    surface, states = solved_cell(segment)
    design = demo_design()
    line = predict_design(design, design.pressure, law)
    things, points, words, limits = body(design, law)

    # base first, tip last: the camera looks across the way from one to the other
    view = view_of(np.vstack([line.points[:1], points, line.points]), 1.15)
    fig = figure(*WIDE)
    cell, lines = in_place(surface)
    moved = (0.0, float(np.asarray(cell.point_data["moved"]).max()))
    panels = [
        (
            "1  Cell",
            f"one pitch, repeated by its screw; {TOP_kPa:.0f} kPa",
            view_of(cell.points, 1.2),
            [lit(cell, "moved", moved), (lines, EDGES)],
        ),
        ("2  Law", f"strains over pressure; one-sided, {ANGLE:.0f}°", None, None),
        (
            "3  Rod",
            f"the demo's centreline by the law; {KPA_PER_MPA * design.pressure:.0f} kPa",
            view,
            [tube(line.points, 1.0, REDUCED), *section_frames(line, 8.0, 9.0)],
        ),
        ("4  Body", f"{words}; {KPA_PER_MPA * design.pressure:.0f} kPa", view, things),
    ]
    for number, (title, text, seen, shown) in enumerate(panels):
        left = 0.012 + 0.25 * number
        fig.text(left, 0.955, title, fontsize=15, weight="bold", va="top")
        fig.text(left, 0.875, text, fontsize=10, color="0.3", va="top")
        if seen is None:
            draw_law(fig.add_axes([left + 0.035, 0.235, 0.175, 0.565]), segment, states, law)
            continue
        axes = fig.add_axes([left - 0.01, 0.2, 0.235, 0.64])
        axes.imshow(render(seen, shown, PIXELS))
        axes.set_axis_off()
        scale_bar(axes, seen)
    for number in range(3):
        fig.text(
            0.25 * (number + 1) - 0.012, 0.52, "\u279c", fontsize=24, color="0.35", ha="center", va="center"
        )
    colour_bar(fig, [0.04, 0.15, 0.16, 0.03], moved, "displacement in the section frame, mm")
    if limits:
        colour_bar(fig, [0.79, 0.15, 0.16, 0.03], limits, "largest principal stretch", "max")
    fig.text(
        0.6, 0.13, "bars: section frames, across (red)\nand up (green)", fontsize=9, ha="center", va="center"
    )
    save(fig, PICTURE, dpi=110)
    print(f"idea: {PICTURE}, {PICTURE.stat().st_size / 1000:.0f} kB")


def scale_bar(axes, view, share=0.2):
    """A length in mm at the lower right of a rendered image."""
    per_pixel = 2 * view.half_height / PIXELS[1]
    length = max(n for n in (1, 2, 5, 10, 20, 50, 100) if n <= 2 * share * PIXELS[0] * per_pixel)
    right, low = PIXELS[0] - 25, PIXELS[1] - 18
    axes.plot([right - length / per_pixel, right], [low, low], color="black", linewidth=2)
    axes.text(right - length / per_pixel / 2, low - 10, f"{length} mm", ha="center", va="bottom", fontsize=9)


if __name__ == "__main__":
    main()
