"""Regenerate design/data/*.csv from their numbers: `python -m examples.make_targets [FOLDER]`.

octopus and tentacle2 are rods of piecewise uniform twist and curvature (per *deformed* length); octopus is
the paper's (Jiang et al. 2021, Sec. IV D). vase and pear are wraps of a surface of revolution, for which the
paper prints no numbers: they are fixed here. Every curve has 201 points, evenly spaced in arc length, in mm
to 4 decimals.
"""

import sys
from pathlib import Path

import numpy as np

from pneunet.base import se3
from pneunet.base.files.atomic import write_text
from pneunet.base.strains import helix_frenet

POINTS = 201
#: points on a wrap before it is sampled evenly; its chords then miss arc length by less than 1e-6 mm
DENSE = 20001


def rod(pieces):
    """Points (201, 3) of a rod that starts at the origin along +x with its width along +y.

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
    motions = np.array(poses)[index] @ se3.exp_pose((s - ends[index])[:, None] * screws[index])
    return motions[:, :3, 3]


def wrap(radius, slope, z_from, z_to, turns, offset=6.0):
    """Points (201, 3) of a curve around the surface r(z), `offset` mm outside it along the normal, z linear
    in angle.

    The offset is half the manipulator's width: the body then lies on the surface.
    """
    t = np.linspace(0, 1, DENSE)
    z, angle = z_from + (z_to - z_from) * t, 2 * np.pi * turns * t
    normal = np.hypot(1, slope(z))
    r = radius(z) + offset / normal
    curve = np.column_stack([r * np.cos(angle), r * np.sin(angle), z - offset * slope(z) / normal])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    even = np.linspace(0, s[-1], POINTS)
    return np.column_stack([np.interp(even, s, column) for column in curve.T])


def octopus():
    """0.01 pi rad/mm over 50 mm; 18 1/m over 30 mm; helix of cylinder curvature 70 1/m, pitch 90 mm over 100
    mm."""
    curvature, torsion = helix_frenet(0.070, 90.0)
    return rod([(50, 0.01 * np.pi, 0), (30, 0, 0.018), (100, torsion, curvature)])


def tentacle2():
    """The paper's second tentacle (60, -45, 60 degrees), with numbers fixed here."""
    return rod([(60, 0.020, 0), (70, -0.025, 0.025), (70, 0.020, 0.030)])


def vase():
    return wrap(lambda z: 28 + 7 * ((z - 50) / 50) ** 2, lambda z: 14 * (z - 50) / 2500, 15, 85, 0.9)


def pear():
    def radius(z):
        return 34 * np.sqrt(1 - ((z - 36) / 60) ** 2)

    return wrap(radius, lambda z: -(34**2) * (z - 36) / 3600 / radius(z), 15, 70, 0.8)


TARGETS = {"octopus": octopus, "tentacle2": tentacle2, "vase": vase, "pear": pear}


def csv_text(points):
    rows = np.round(points, 4) + 0.0  # + 0.0 turns -0 into 0
    return "x_mm,y_mm,z_mm\n" + "".join(f"{x:.4f},{y:.4f},{z:.4f}\n" for x, y, z in rows)


def main(folder=Path(__file__).parent / "targets"):
    for name, points in TARGETS.items():
        write_text(Path(folder) / f"{name}.csv", csv_text(points()))


if __name__ == "__main__":
    main(*sys.argv[1:])
