"""Fig. 9: wraps around a vase and a pear, and the workspace of segments, (g), and of two in a row, (h)."""

import numpy as np

from examples.paper.common import ONE_SIDED_BODY, Statement
from examples.paper.eq27 import readings
from pneunet.base.materials.laws import PAPER_HELICAL
from pneunet.design.target.extraction import extract
from pneunet.design.target.reach import Reach, reach
from pneunet.design.target.target import Target
from pneunet.design.workspace import WorkspaceCase, workspace
from pneunet.geometry.parameters import KINDS, ONE_SIDED, TWISTING, Manipulator
from pneunet.reduced.choice import shipped_law
from pneunet.reduced.rod.prediction import predict

#: (g): 5 degrees apart, 0 to 60 kPa
ANGLES, PRESSURES = np.linspace(45, 135, 19), np.linspace(0, 0.06, 7)
#: (h): curves at every pressure; cells of less than 30 degrees, which the paper's twisting segments begin
#: below, are
#: not built here
CURVES = 14
TWISTING_ANGLES, ONE_SIDED_ANGLES = np.linspace(30, 90, CURVES), np.linspace(45, 135, CURVES)
#: name -> (angles of the paper's design, its pressure in MPa)
DESIGNS = {"vase": ((70.0, 55.0, 70.0), 0.0364), "pear": ((70.0, 55.0), 0.0426)}
#: of each number of segments, and their length together, mm
SHAPES, TOTAL = 20_000, 180.0


def compute() -> dict:
    law = shipped_law()
    case = WorkspaceCase(material=PAPER_HELICAL)
    found: dict = {
        "reach": {kind: reach(case.segment(kind, 90.0), PRESSURES, law, ANGLES) for kind in KINDS},
        "curves": _curves(case, law),
        "visited": [_visited(count, law) for count in (1, 2, 3)],
    }
    for name, (angles, pressure) in DESIGNS.items():
        target = Target.read(name)
        body = WorkspaceCase(material=PAPER_HELICAL, start=ONE_SIDED_BODY).segment(ONE_SIDED, 90.0)
        found[name] = {
            "length": target.length,
            "asked": extract(target, target.pieces),
            "reach": reach(body, PRESSURES, law),
            "theirs": reach(body, [pressure], law, np.unique(angles)),
        }
    return found


def _visited(count, law):
    """cm^3 of cubes of 10 mm that tips of `count` one-sided segments, together TOTAL long, come to."""
    case = WorkspaceCase(
        length=TOTAL / count, material=PAPER_HELICAL, chains=((ONE_SIDED,) * count,), shapes=SHAPES
    )
    return len(np.unique(np.floor(workspace(case, law=law).clouds[0].tips / 10), axis=0))


def _curves(case, law):
    """{pressure in MPa: 14 centrelines (n, 3) of a twisting and a one-sided segment}."""
    bodies = [
        Manipulator((case.segment(TWISTING, float(a)), case.segment(ONE_SIDED, float(b))))
        for a, b in zip(TWISTING_ANGLES, ONE_SIDED_ANGLES)
    ]
    return {float(P): [predict(body, float(P), law, 4.0).points for body in bodies] for P in PRESSURES[1:]}


def statements(found: dict) -> list[Statement]:
    one_sided, twisting = (found["reach"][kind] for kind in KINDS)
    helix = one_sided.strains.helix_cylinder_curvature[:, -1] * 1e3
    pitch = abs(one_sided.strains.helix_pitch[:, -1]).max()
    beyond = one_sided.share(0.010, 0.030)
    visited = found["visited"]
    said = [
        Statement(
            '(g) "not all kappa and P_t combinations can be realized"',
            f"at 60 kPa from 45 to 135 degrees kappa_h is {helix.min():.0f}..{helix.max():.0f} 1/m and |P_t|"
            f" at most {pitch:.0f} mm; a helix of curvature 10 and torsion 30 1/m is reached at no angle",
            bool(np.isinf(beyond)),
        ),
        Statement(
            '"the workspace is significantly expanded by varying the number and the orientation angle of each'
            ' segment"',
            f"{SHAPES} tips of one, two and three one-sided segments, together {TOTAL:g} mm long, come to"
            f" {', '.join(map(str, visited))} cubes of 1 cm^3",
            bool(visited[0] < visited[1] < visited[2]),
        ),
        Statement(
            "(h) twisting segments from 0 to 90 degrees",
            "cells of less than 30 degrees are not built here; tau up to"
            f" {twisting.ranges()['twist'][1]:.4f} rad/mm"
            " from 45 degrees on",
            None,
        ),
    ]
    for name, (angles, pressure) in DESIGNS.items():
        said += _of_design(name, angles, pressure, found[name])
    return said


def _of_design(name, angles, pressure, row):
    asked, most, theirs = row["asked"], row["reach"], row["theirs"]
    shares = [float(most.share(p.curvature, p.twist)) for p in asked]
    at = [int(np.flatnonzero(theirs.angles == angle)[0]) for angle in angles]
    built = ", ".join(f"{1e3 * theirs.curvature[i, 0]:.0f}/{1e3 * theirs.twist[i, 0]:.0f}" for i in at)
    wanted = ", ".join(f"{1e3 * p.curvature:.0f}/{1e3 * p.twist:.0f}" for p in asked)
    return [
        Statement(
            f"{name}: segments of {', '.join(f'{a:g}' for a in angles)} degrees at {1e3 * pressure:g} kPa",
            f"curvature/torsion of these angles at this pressure {built} 1/m, of the wrap {wanted} 1/m"
            " (paths and"
            " dimensions are ours)",
            None,
        ),
        Statement(
            f"{name}: a wrap can be designed",
            f"each piece asks for {', '.join(f'{100 * s:.0f}' for s in shares)} % of the most that a body"
            " can do in"
            " its direction up to 60 kPa",
            bool(max(shares) <= 1),
        ),
        Statement(f"{name}: {readings(name, row['length'])}", "a design of ours: `designs.py`", None),
    ]


def draw(found: dict):
    from matplotlib import colormaps

    from pneunet.base.pictures.rendering import figure
    from pneunet.design.report.pictures import equal_axes_3d

    fig = figure(11, 4.4)
    axes = fig.add_subplot(1, 2, 1)
    space: Reach = found["reach"][ONE_SIDED]
    for j in range(1, len(space.pressures)):
        pitch = abs(space.strains.helix_pitch[:, j])
        drawn = pitch < 1e3
        kappa = 1e3 * space.strains.helix_cylinder_curvature[:, j]
        colour = colormaps["viridis"](j / (len(space.pressures) - 1))
        axes.plot(kappa[drawn], pitch[drawn], ".-", color=colour, label=f"{1e3 * space.pressures[j]:.0f} kPa")
    axes.set(title="(g) 45 to 135 deg", xlabel="kappa_h (1/m)", ylabel="|P_t| (mm)", ylim=(0, 350))
    axes.legend(fontsize=7)
    shapes = fig.add_subplot(1, 2, 2, projection="3d")
    colours = {0.01: "r", 0.02: "r", 0.03: "g", 0.04: "g", 0.05: "b", 0.06: "b"}  # the paper's
    everything = []
    for pressure, lines in found["curves"].items():
        for line in lines:
            shapes.plot(*line.T, color=colours[round(pressure, 3)], linewidth=0.7)
            everything.append(line)
    equal_axes_3d(shapes, np.vstack(everything))
    shapes.set_title("(h) 10, 20 kPa red; 30, 40 green; 50, 60 blue", fontsize=9)
    fig.tight_layout()
    return fig
