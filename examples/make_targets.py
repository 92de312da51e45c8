"""Regenerate design/data/*.csv from their numbers, the profiles of vase and pear in examples/wraps, and the
octopus with section frames in examples/curves: `python -m examples.make_targets [FOLDER [FOLDER [FOLDER]]]`.

octopus and tentacle2 are rods of piecewise uniform twist and curvature (per *deformed* length); octopus is
the paper's (Jiang et al. 2021, Sec. IV D). vase and pear are wraps of a surface of revolution, for which the
paper prints no numbers: they are fixed here. Every curve has 201 points, evenly spaced in arc length, in mm
to 4 decimals.
"""

import sys
from pathlib import Path

import numpy as np

from pneunet.base import se3
from pneunet.base.files.atomic import write_csv, write_text
from pneunet.base.files.schemas import POINT
from pneunet.base.strains import helix_frenet
from pneunet.design.target.table import FRAME_COLUMNS
from pneunet.design.target.wrap import POINTS, Revolution, WrapPath, wrap

#: mm between the rows of a profile: a cubic spline through them then meets the shipped wraps to 1e-6 mm
PROFILE_STEP = 0.5


def rod(pieces):
    """Frames (201, 4, 4) of a rod that starts at the origin along +x with its width along +y.

    pieces: (length mm, twist rad/mm, curvature 1/mm) each. Curvature bends the rod towards its -z, as a
    one-sided segment with its chambers on top does.
    """
    lengths = np.array([piece[0] for piece in pieces], float)
    screws = np.array([[twist, curvature, 0, 1, 0, 0] for _, twist, curvature in pieces])
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    poses = [np.eye(4)]
    for length, screw in zip(lengths, screws):
        poses.append(poses[-1] @ se3.exp_pose(length * screw))
    s = np.linspace(0, ends[-1], POINTS)
    index = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(pieces) - 1)
    return np.array(poses)[index] @ se3.exp_pose((s - ends[index])[:, None] * screws[index])


def octopus_frames():
    """0.01 pi rad/mm over 50 mm; 18 1/m over 30 mm; helix of cylinder curvature 70 1/m, pitch 90 mm over 100
    mm."""
    curvature, torsion = helix_frenet(0.070, 90.0)
    return rod([(50, 0.01 * np.pi, 0), (30, 0, 0.018), (100, torsion, curvature)])


def octopus():
    return octopus_frames()[:, :3, 3]


def tentacle2():
    """The paper's second tentacle (60, -45, 60 degrees), with numbers fixed here."""
    return rod([(60, 0.020, 0), (70, -0.025, 0.025), (70, 0.020, 0.030)])[:, :3, 3]


def vase_radius(z):
    return 28 + 7 * ((z - 50) / 50) ** 2


def pear_radius(z):
    return 34 * np.sqrt(1 - ((z - 36) / 60) ** 2)


#: name -> (radius of the surface, its slope, top, path): the offset is half the manipulator's width, so that
#: the body lies on the surface
WRAPS = {
    "vase": (vase_radius, lambda z: 14 * (z - 50) / 2500, 100, WrapPath(6.0, 0.9, z_range=(15, 85))),
    "pear": (
        pear_radius,
        lambda z: -(34**2) * (z - 36) / 3600 / pear_radius(z),
        80,
        WrapPath(6.0, 0.8, z_range=(15, 70)),
    ),
}


def vase():
    radius, slope, _, path = WRAPS["vase"]
    return wrap(Revolution(radius, slope), path)


def pear():
    radius, slope, _, path = WRAPS["pear"]
    return wrap(Revolution(radius, slope), path)


TARGETS = {"octopus": octopus, "tentacle2": tentacle2, "vase": vase, "pear": pear}


def csv_text(points):
    rows = np.round(points, 4) + 0.0  # + 0.0 turns -0 into 0
    return "x_mm,y_mm,z_mm\n" + "".join(f"{x:.4f},{y:.4f},{z:.4f}\n" for x, y, z in rows)


def frames_text(frames):
    rows = np.hstack(
        [np.round(frames[:, :3, 3], 4), np.round(frames[:, :3, 0], 6), np.round(frames[:, :3, 1], 6)]
    )
    lines = [",".join((*POINT, *FRAME_COLUMNS)), *(",".join(f"{v:.10g}" for v in row) for row in rows + 0.0)]
    return "\n".join(lines) + "\n"


def main(
    folder=Path(__file__).parents[1] / "design" / "data",
    profiles=Path(__file__).parent / "wraps",
    curves=Path(__file__).parent / "curves",
):
    for name, points in TARGETS.items():
        write_text(Path(folder) / f"{name}.csv", csv_text(points()))
    for name, (radius, _, top, _) in WRAPS.items():
        z = np.arange(0, top + PROFILE_STEP / 2, PROFILE_STEP)
        write_csv(Path(profiles) / f"{name}_profile.csv", ("r_mm", "z_mm"), np.column_stack([radius(z), z]))
    write_text(Path(curves) / "octopus.csv", frames_text(octopus_frames()))


if __name__ == "__main__":
    main(*sys.argv[1:])
