"""Fig. 8: twist, curvature and pitch of the pieces of a target, extracted from its points."""

import numpy as np

from examples.paper.common import Statement
from pneunet.design.target.extraction import Extracted, extract
from pneunet.design.target.target import Piece, Target

#: of the octopus (Sec. IV D): rad/mm, 1/m, 1/m, mm
TAU, BENDING, CYLINDER, PITCH = 0.01 * np.pi, 18.0, 70.0, 90.0


def compute() -> list[Extracted]:
    """Of the octopus's points and base, split as the paper splits it, with no rate given."""
    target = Target.read("octopus")
    return extract(target, [Piece(p.kind, p.length) for p in target.pieces])


def statements(found: list[Extracted]) -> list[Statement]:
    twisting, bending, helical = (piece.table() for piece in found)
    angle = twisting["tau_rad_per_mm"] * twisting["length_mm"]
    close = np.isclose(bending["curvature_per_m"], BENDING, rtol=1e-3) and np.isclose(
        [helical["cylinder_curvature_per_m"], helical["pitch_mm"]], [CYLINDER, PITCH], rtol=1e-3
    )
    return [
        Statement(
            f"bending piece: kappa_b = {BENDING:g} 1/m; helical piece: kappa_h = {CYLINDER:g} 1/m, P_t ="
            f" {PITCH:g} mm",
            f"{bending['curvature_per_m']:.2f} 1/m; {helical['cylinder_curvature_per_m']:.2f} 1/m,"
            f" {helical['pitch_mm']:.2f} mm from 201 points",
            bool(np.all(close)),
        ),
        Statement(
            f'twisting piece: the twist "is easily calculated", {TAU:.4f} rad/mm over 50 mm, a quarter turn',
            f"{twisting['tau_rad_per_mm']:.4f} rad/mm: a straight piece shows {np.degrees(angle):.1f} deg of"
            " turn,"
            " modulo 360, and only because the base is held and the next piece bends",
            bool(np.isclose(twisting["tau_rad_per_mm"], TAU, rtol=1e-3)),
        ),
        Statement(
            '"x(t) = a cos(t), y(t) = a sin(t), z(t) = bt, where a = 1/kappa_h, b = P_t/2 pi"',
            "the same helix by Frenet's numbers: curvature"
            f" {helical['curvature_per_m']:.2f} 1/m, torsion {helical['torsion_rad_per_m']:.2f} rad/m",
            bool(
                np.isclose(
                    1 / helical["cylinder_curvature_per_m"],
                    helical["curvature_per_m"]
                    / (helical["curvature_per_m"] ** 2 + helical["torsion_rad_per_m"] ** 2),
                )
            ),
        ),
    ]


def draw(found: list[Extracted]):
    from pneunet.base.pictures.rendering import figure
    from pneunet.design.report.labels import segment_colour
    from pneunet.design.report.pictures import equal_axes_3d

    target = Target.read("octopus")
    fig = figure(5.6, 4.6)
    axes = fig.add_subplot(projection="3d")
    ends = np.concatenate([[0], np.cumsum([piece.length for piece in found])])
    for number, (piece, low, high) in enumerate(zip(found, ends, ends[1:])):
        line = target.curve.at(np.linspace(low, high, 60))
        axes.plot(*line.T, color=segment_colour(number), linewidth=4, label=piece.kind)
    axes.plot(*target.points.T, "k.", markersize=1)
    equal_axes_3d(axes, target.points)
    axes.legend(fontsize=8)
    fig.tight_layout()
    return fig
