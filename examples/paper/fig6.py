"""Fig. 6: Young's modulus, of all segments and a modulus a segment, at 50 kPa."""

import numpy as np

from examples.paper.common import Statement, curvatures, draw_shapes, manipulator, shapes, silicone
from pneunet.reduced.choice import shipped_law
from pneunet.reduced.rod.prediction import doubts

PRESSURE = 0.050
MODULI = (0.8, 0.7, 0.6, 0.5, 0.4)
BODIES = {"a": ((60.0, 90.0, 60.0), (40.0, 70.0, 40.0)), "b": ((45.0, 90.0, 75.0), (60.0, 60.0, 40.0))}
MIXED_BODY = ((45.0, 90.0, 45.0), (40.0, 60.0, 40.0))
MIXED = {"i": (0.4, 0.4, 0.4), "ii": (0.4, 0.6, 0.4), "iii": (0.9, 0.3, 0.9)}


def compute() -> dict:
    """{name: {"curvature" (moduli, segments) 1/m, "shapes", "doubts" of the softest}} of (a), (b), (c)'s i"
    " ..."""
    found: dict = {}
    for name, (angles, lengths) in BODIES.items():
        bodies = [manipulator(angles, lengths, [silicone(E)] * 3) for E in MODULI]
        found[name] = {
            "curvature": np.array([curvatures(body, PRESSURE) for body in bodies]),
            "shapes": [shapes(body, [PRESSURE])[0] for body in bodies],
            "doubts": doubts(bodies[-1], PRESSURE, shipped_law()),
        }
    for name, moduli in MIXED.items():
        body = manipulator(*MIXED_BODY, [silicone(E) for E in moduli])
        found[name] = {
            "curvature": curvatures(body, PRESSURE),
            "shapes": shapes(body, [PRESSURE]),
            "doubts": doubts(body, PRESSURE, shipped_law()) if name == "iii" else (),
        }
    return found


def statements(found: dict) -> list[Statement]:
    grows = all((np.diff(found[name]["curvature"], axis=0) > 0).all() for name in BODIES)
    ends = "; ".join(
        f"({name}) {', '.join(f'{a:.1f} to {b:.1f}' for a, b in zip(*found[name]['curvature'][[0, -1]]))}"
        for name in BODIES
    )
    doubted = "; ".join(dict.fromkeys(text for name in BODIES for text in found[name]["doubts"])) or "nothing"
    second = {name: found[name]["curvature"][1] for name in MIXED}
    third = found["iii"]["curvature"]
    beyond = next((text for text in found["iii"]["doubts"] if "limit load" in text or "/ mu" in text), "")
    return [
        Statement(
            '"the deformation increases with the decrease in E at a fixed pressure" (50 kPa, 0.8 to 0.4 MPa)',
            f"every segment's curvature rises at every step, 1/m: {ends}. At 0.4 MPa the law doubts:"
            f" {doubted}",
            grows,
        ),
        Statement(
            'a modulus a segment: "its bending curvature is smaller than that in the segment 2 of soft'
            " manipulator"
            ' (i)" for the stiffer segment 2 of (ii)',
            f"{second['ii']:.1f} against {second['i']:.1f} 1/m",
            bool(second["ii"] < second["i"]),
        ),
        Statement(
            "(iii) with 0.9 + 0.3 + 0.9 MPa bends mostly in its middle at 50 kPa",
            f"curvatures {', '.join(f'{c:.1f}' for c in third)} 1/m{f'; but {beyond}' if beyond else ''}",
            bool(third[1] > 2 * max(third[0], third[2])) if not beyond else None,
        ),
    ]


def draw(found: dict):
    panels = [(f"({name}), E in MPa", found[name]["shapes"], [f"{E:g}" for E in MODULI]) for name in BODIES]
    labels = ["(" + name + ") " + " + ".join(f"{E:g}" for E in moduli) for name, moduli in MIXED.items()]
    panels.append(("(c)", [found[name]["shapes"][0] for name in MIXED], labels))
    fig = draw_shapes(panels, columns=3)
    fig.axes[-1].legend(fontsize=7)
    return fig
