"""Public measurements beside what is computed (examples/measured), and the page to turn the demo: the parts
`compare` and `view`."""

import tempfile
from pathlib import Path

DEMO = Path(__file__).resolve().parents[1] / "out" / "demo"


def compare():
    """The clamped beam: largest difference from the middle of the measured drops, of body and rod."""
    from examples.measured import arm, beam

    body = {force: beam.body_drop(force) for force in beam.MEASURED}
    coarser = beam.body_drop(0.0, (12, 4, 4))
    rod = {force: beam.rod_drop(force) for force in beam.MEASURED}
    figures = {
        "compare_beam_tip_rel": max(abs(beam.off(drop, force)) for force, drop in body.items()),
        "compare_beam_tip_rod_rel": max(abs(beam.off(drop, force)) for force, drop in rod.items()),
    }
    details = {
        "body_mm": list(body.values()),
        "rod_mm": list(rod.values()),
        "body_coarser_own_weight_mm": coarser,
    }
    details |= {"measured_mm": list(beam.MEASURED.values()), "arm_arc_lengths_mm": arm.arc_lengths().tolist()}
    return figures, details


def view():
    """The page of the demo's folder, which `make demo` makes."""
    from pneunet.design.report.viewing import run_view

    with tempfile.TemporaryDirectory() as folder:
        page = run_view(DEMO, folder)
        sizes = {"view_html_MB": page, "report_html_MB": DEMO / "report.html"}
        return {key: path.stat().st_size / 1e6 for key, path in sizes.items()}
