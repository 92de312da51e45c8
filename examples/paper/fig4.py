"""Fig. 4: one to four segments over 240 mm."""

import numpy as np

from examples.paper.common import (
    ONE_SIDED_BODY,
    PRESSURES,
    Statement,
    curvatures,
    draw_shapes,
    kPa,
    manipulator,
    shapes,
)
from pneunet.reduced.choice import shipped_law
from pneunet.reduced.rod.overlap import overlap_doubts
from pneunet.reduced.rod.prediction import predict

TOTAL = 240.0
ANGLES = {"i": (75.0,), "ii": (90.0, 75.0), "iii": (75.0, 60.0, 90.0), "iv": (75.0, 60.0, 45.0, 90.0)}


def compute() -> dict:
    """{name: {"angles", "length" mm, "curvature" (5, segments) 1/m, "shapes", "through_itself"}}"""
    found = {}
    for name, angles in ANGLES.items():
        body = manipulator(angles, [TOTAL / len(angles)] * len(angles))
        found[name] = {
            "angles": angles,
            "length": body.length,
            "curvature": np.array([curvatures(body, P) for P in PRESSURES]),
            "shapes": shapes(body),
            "through_itself": overlap_doubts(body, predict(body, PRESSURES[-1], shipped_law())),
        }
    return found


def statements(found: dict) -> list[Statement]:
    at_50 = {name: row["curvature"][-1] for name, row in found.items()}
    spread = {name: np.ptp(values) / values.mean() for name, values in at_50.items()}
    shown = "; ".join(f"({name}) {', '.join(f'{c:.1f}' for c in row)}" for name, row in at_50.items())
    lengths = ", ".join(f"{row['length']:.0f}" for row in found.values())
    grown = all((np.diff(row["curvature"], axis=0) > 0).all() for row in found.values())
    through = [name for name, row in found.items() if row["through_itself"]]
    clear = ["all stay clear of themselves", f"({'), ('.join(through)}) would run through itself"][
        bool(through)
    ]
    return [
        Statement(
            f"four manipulators of one total length, {TOTAL:g} mm",
            f"{lengths} mm: whole chambers",
            all(abs(row["length"] - TOTAL) < 0.03 * TOTAL for row in found.values()),
        ),
        Statement(
            '"Unlike the helical deformation with constant curvature formed by soft manipulator (i), shapes'
            " with"
            ' variable curvatures can be constructed using multiple segments"',
            f"kappa_h of the segments at 50 kPa, 1/m: {shown}",
            bool(spread["i"] == 0 and all(spread[name] > 0.01 for name in ("ii", "iii", "iv"))),
        ),
        Statement(
            "shapes at 10 to 50 kPa bend ever more", "every segment's curvature rises at every step", grown
        ),
        Statement(
            "the four shapes at 50 kPa are shown as reached",
            f"{clear} at 50 kPa (chambers of {ONE_SIDED_BODY['chamber_height']:g} mm; the paper's dimensions"
            " are"
            " lost)",
            None,
        ),
    ]


def draw(found: dict):
    return draw_shapes(
        [
            (f"({name}) {' + '.join(f'{a:g}' for a in row['angles'])} deg", row["shapes"], kPa())
            for name, row in found.items()
        ]
    )
