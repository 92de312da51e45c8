"""Fig. 5: two segments of 90 mm in three combinations of angles."""

import numpy as np

from examples.paper.common import Statement, draw_shapes, kPa, manipulator, shapes

LENGTH = 90.0
ANGLES = {"a": (90.0, 75.0), "b": (90.0, 60.0), "c": (45.0, 75.0)}


def compute() -> dict:
    """{name: {"angles", "shapes", "tip" (3,) mm at 50 kPa}}"""
    found = {}
    for name, angles in ANGLES.items():
        lines = shapes(manipulator(angles, [LENGTH, LENGTH]))
        found[name] = {"angles": angles, "shapes": lines, "tip": lines[-1][-1]}
    return found


def statements(found: dict) -> list[Statement]:
    tips = {name: row["tip"] for name, row in found.items()}
    names = list(tips)
    apart = [np.linalg.norm(tips[a] - tips[b]) for i, a in enumerate(names) for b in names[i + 1 :]]
    aside = [abs(row["shapes"][-1][:, 1]).max() for row in found.values()]
    shown = "; ".join(f"({name}) ({', '.join(f'{x:.0f}' for x in tip)})" for name, tip in tips.items())
    return [
        Statement(
            "\"By adjusting the orientation angles in each segment, the two-segment soft manipulators'"
            " trajectory can"
            ' be programmed"',
            f"tips at 50 kPa, mm: {shown}: at least {min(apart):.0f} mm apart",
            bool(min(apart) > 10),
        ),
        Statement(
            "a first segment of 90 degrees bends in a plane; the shapes leave it where the angle is another",
            f"largest distance from the plane of bending, mm: {', '.join(f'{v:.0f}' for v in aside)}",
            bool(aside[0] < aside[1] < aside[2]),
        ),
    ]


def draw(found: dict):
    return draw_shapes(
        [
            (f"({name}) {' + '.join(f'{a:g}' for a in row['angles'])} deg", row["shapes"], kPa())
            for name, row in found.items()
        ],
        columns=3,
    )
