"""Fig. 3(d), (e), (f): twist and elongation of twisting segments over pressure and angle.

Here by the trained law for the reference case twist-w15 (mu = 0.317 MPa and, by its core, c1 = 0.27, as the
paper's; its walls touch, which the law knows), and by the paper's tube in its consistent form, with E_t = 3
mu and with the printed E_t = 0.008 MPa."""

from dataclasses import replace

import numpy as np

from examples.paper.common import PRESSURES, Statement
from pneunet.base.materials.laws import PAPER_TWISTING
from pneunet.design.target.reach import reach
from pneunet.geometry.reference_cases import CASES
from pneunet.reduced.analytic.calibration import tube_curves
from pneunet.reduced.analytic.law import segment_tube
from pneunet.reduced.analytic.twisting import PAPER_FIBRE_MODULUS
from pneunet.reduced.choice import shipped_law

SHOWN = (75.0, 60.0, 45.0)
ANGLES = np.arange(30.0, 90.1, 1.0)
#: rad/mm: printed in Sec. III and IV
PAPER_MOST, PAPER_ANGLE, PAPER_10, PAPER_50 = 0.033, 53.0, 0.0063, 0.0325


def compute() -> dict:
    """{name: array}: tau in rad/mm and stretch over angles and pressures; doubts: of the law, in words."""
    body = CASES["twist_w15"](60.0, 1)
    assert body.material.mu == PAPER_TWISTING.mu
    law = shipped_law()
    found = reach(body, PRESSURES, law, ANGLES)
    tube = segment_tube(body)
    printed = replace(tube, fibre_modulus=PAPER_FIBRE_MODULUS)
    return {
        "tau": found.twist,
        "stretch": found.strains.stretch,
        "tube": tube_curves(tube, ANGLES, PRESSURES).tau,
        "printed": tube_curves(printed, ANGLES, PRESSURES).tau,
        "doubts": law.doubts(body, float(PRESSURES[-1])),
    }


def statements(found: dict) -> list[Statement]:
    at = [int(np.flatnonzero(ANGLES == angle)[0]) for angle in SHOWN]
    tau, stretch = found["tau"][at], found["stretch"][at]
    start = np.zeros((len(at), 1))
    slopes = np.diff(np.hstack([start, tau]), axis=1)
    growth = np.diff(np.hstack([start + 1, stretch]), axis=1)
    falls, rises = (np.diff(slopes) < 0).all(axis=1), (np.diff(growth) > 0).all(axis=1)
    most = found["tau"][:, -1].argmax()
    inside = 0 < most < len(ANGLES) - 1
    tube = np.nan_to_num(found["tube"])
    best = tube[:, -3].argmax()
    printed = np.nanmax(found["printed"])
    doubted = "; ".join(found["doubts"])
    values = ", ".join(f"{1e3 * t:.1f} at {a:g}" for t, a in zip(tau[:, -1], SHOWN))
    return [
        Statement(
            '"Both the tau and lambda_z increase with P" (75, 60, 45 degrees)',
            f"tau rises at every step, to {values} deg (rad/m, 50 kPa); the stretch too, to"
            f" {stretch[:, -1].min():.3f}..{stretch[:, -1].max():.3f}",
            bool((slopes > 0).all() and (growth > 0).all()),
        ),
        Statement(
            '"The slope of tau decreases with P, while the slope of lambda_z increases with P"',
            f"the slope of tau falls throughout at {falls.sum()} of 3 angles, that of the stretch rises at"
            f" {rises.sum()} of 3; unit cells themselves are in [paper-models.md](paper-models.md)"
            + (f". The law doubts: {doubted}" if doubted else ""),
            bool(falls.all() and rises.all()),
        ),
        Statement(
            f"tau is largest at {PAPER_ANGLE:g} degrees at 50 kPa",
            f"of the angles that the law knows, {ANGLES[0]:g} to 90, it is largest at {ANGLES[most]:g}"
            " degrees",
            bool(inside and abs(ANGLES[most] - PAPER_ANGLE) <= 3),
        ),
        Statement(
            f"the paper's tube has that maximum near {PAPER_ANGLE:g} degrees",
            f"the consistent tube with fibres of 3 mu has it at {ANGLES[best]:g} degrees at 30 kPa, which it"
            " reaches"
            " at all angles",
            bool(abs(ANGLES[best] - PAPER_ANGLE) <= 3),
        ),
        Statement(
            f"tau is at most {PAPER_MOST} rad/mm at 50 kPa (also printed: {PAPER_50}), and {PAPER_10} at 10"
            " kPa",
            f"{found['tau'][:, -1].max():.4f} and {found['tau'][:, 0].max():.4f} rad/mm for a body of other"
            " dimensions"
            " (the paper's are lost)",
            None,
        ),
        Statement(
            "E_t = 0.008 MPa gives these curves",
            f"the consistent tube with it twists by at most {printed:.4f} rad/mm, where the paper plots"
            f" {PAPER_MOST}",
            bool(printed > 0.8 * PAPER_MOST),
        ),
        Statement(
            "Fig. 3(a) is at P = 50 kPa (caption), and at P = 30 kPa (text)",
            "the two contradict each other; nothing here depends on it",
            None,
        ),
    ]


def draw(found: dict):
    from pneunet.base.pictures.rendering import figure

    fig = figure(12, 3.6)
    over_pressure, over_both, over_angle = fig.subplots(1, 3)
    kPa = 1e3 * np.array(PRESSURES)
    stretches = over_pressure.twinx()
    for number, angle in enumerate(SHOWN):
        row = int(np.flatnonzero(ANGLES == angle)[0])
        line = {"color": f"C{number}"}
        over_pressure.plot([0, *kPa], [0, *(1e3 * found["tau"][row])], **line, label=f"{angle:g} deg")
        over_pressure.plot(kPa, 1e3 * found["tube"][row], **line, linestyle=":")
        stretches.plot([0, *kPa], [1, *found["stretch"][row]], **line, linestyle="--")
    over_pressure.set(title="(d) dashed: stretch; dotted: tube", xlabel="P (kPa)", ylabel="tau (rad/m)")
    over_pressure.legend(fontsize=8)
    filled = over_both.contourf(kPa, ANGLES, 1e3 * found["tau"], 12)
    fig.colorbar(filled, ax=over_both, label="tau (rad/m)")
    over_both.set(title="(e)", xlabel="P (kPa)", ylabel="theta (deg)")
    over_angle.plot(ANGLES, 1e3 * found["tau"][:, -1], label="trained law, 50 kPa")
    over_angle.plot(ANGLES, 1e3 * found["tube"][:, -3], ":", label="tube, 30 kPa")
    over_angle.plot([PAPER_ANGLE], [1e3 * PAPER_MOST], "k*", markersize=10, label="paper's maximum, 50 kPa")
    over_angle.set(title="(f)", xlabel="theta (deg)", ylabel="tau (rad/m)")
    over_angle.legend(fontsize=8)
    fig.tight_layout()
    return fig
