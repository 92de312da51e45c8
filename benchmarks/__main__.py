"""`python -m benchmarks [--only PART] [--snapshot]`: measure figures into out/bench/results.json.

Parts merge into the file; results.meta.json beside it says for each part when, at which revision, on which
machine and how fast a fixed calibration loop ran. --snapshot copies both to docs/ and rewrites the table
docs/figures.md.
"""

import argparse
import json
import sys
import time
from pathlib import Path

from benchmarks import (
    cell,
    chain,
    contact,
    contact_page,
    law,
    paper,
    paper_page,
    remeshed,
    rod,
    segments,
    silicones,
    speed,
    verification,
)
from benchmarks.tables import table
from pneunet.base.files.atomic import write_text
from pneunet.base.files.record import machine, revision

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "bench"
#: part -> (function returning {key: number}, or that and details for the meta data; what it needs and
#: measures)
PARTS = {
    "setup": (
        chain.setup,
        "set-up on a fresh Debian 13 root, taken when the container image is built (make image)",
    ),
    "ranks": (chain.ranks, "largest relative difference between the reference case on 1 and on 2 ranks"),
    "resume": (chain.resume, "a run killed with SIGKILL and resumed on 2 ranks against a whole one"),
    "demo": (chain.demo, "make demo after set-up, wall seconds, and its reduced-against-FE distance"),
    "test": (chain.test, "make test with a cold form cache, wall seconds"),
    "cell": (cell.unit_cell, "unit cell one-sided-w10, 60 deg: cost, mesh study, stiffness; some 5 minutes"),
    "segments": (
        segments.against_segments,
        "the cell against finite segments of 9 and 30 chambers: cost of a step, strains; 10 minutes",
    ),
    "rod": (rod.speed, "what free and loaded shapes of a rod of four segments cost; some seconds"),
    "rod-fe": (
        rod.against_finite_elements,
        "rods with unit cells' laws against finite elements of three bodies; some 20 minutes",
    ),
    "law": (
        law.law,
        (
            "the trained law that comes along: errors on designs it has not seen, the laws compared, cost;"
            " some seconds"
        ),
    ),
    "silicones": (
        silicones.silicones,
        "cells of fitted silicones against neo-Hookean ones of the same initial modulus; some 4 minutes",
    ),
    "remeshed": (
        remeshed.remeshed,
        "held-out cells on another mesh of the same size, against the law's errors; some 15 minutes",
    ),
    "verification": (
        verification.verification,
        "exact solutions, Land, Cook, manufactured solution, patches, energy; some 3 minutes",
    ),
    "contact": (
        contact.contact,
        (
            "self-contact in the unit cell twist-w15: distance, bias, sensitivity, check by third medium; 15"
            " minutes"
        ),
    ),
    "paper": (
        paper.paper,
        (
            "the paper's twisting and helical models beside unit cells, as they are and calibrated; some 10"
            " minutes"
        ),
    ),
    "long": (chain.long_segment, "steps and factorisations of the case one-sided-long; some 2 minutes"),
    "speed": (
        speed.ramps,
        "the same ramp in pneunet, FElupe and NGSolve (installs them on first use); some 15 minutes",
    ),
    "scaling": (
        speed.scaling,
        "seconds of assembly, factorisation and solution on three meshes, and their exponents",
    ),
    "ranks2": (speed.two_ranks, "two ranks against one at some 150k dofs"),
}
MEANING = {
    "setup_seconds": "fresh Debian 13 root to a working `.venv`: apt and PyPI downloads included, wall s",
    "demo_seconds": "`make demo` after set-up, 2 ranks, wall s",
    "test_seconds": "`make test` after set-up with a cold form cache, wall s",
    "demo_reduced_vs_fe_rms_percent_of_length": (
        "demo: reduced against FE at FE's last pressure, RMS paired by arc length, % of length"
    ),
    "demo_fe_vs_target_rms_percent_of_length": (
        "demo: FE centreline against the target, RMS paired by arc length, % of length"
    ),
    "demo_pressure_reached_kPa": "demo: pressure the FE solution reached, kPa",
    "rank_agreement_rel": (
        "reference case, 1 against 2 ranks: largest difference relative to the larger of a result and 1 (0.01"
        " for 1/mm)"
    ),
    "resume_agreement_rel": (
        "reference case to 35 kPa, killed and resumed on 2 ranks: largest difference in displacement over the"
        " largest"
    ),
    "cell_sweep_h2_cpu_seconds": (
        "cell one-sided-w10, 60 deg, 0-50 kPa, 10 levels with stiffness, h = 2 mm: CPU s, meshing included"
    ),
    "cell_sweep_default_cpu_seconds": "the same at the default mesh size, 1.5 mm",
    "cell_mesh_error_rel": (
        "that cell at 1.5 mm: error of (e, k pitch) at 20 and 50 kPa against extrapolation from three graded"
        " meshes"
    ),
    "cell_mesh_error_graded_rel": "the same of the finest graded mesh, 1 mm and 0.2 mm at edges",
    "cell_stiffness_fd_rel": (
        "that cell at 20 kPa, 2 mm: stiffness against central differences of forces, relative to roots of"
        " diagonals"
    ),
    "cell_stiffness_refinement_rel": (
        "that cell at 50 kPa: largest eigenvalue of K(graded 1 mm)^-1 K(graded 1.225 mm) - 1"
    ),
    "cell_stiffness_gauge_rel": (
        "that cell at 20 kPa: change of K with the cut, of its frame-free part with the gauge"
    ),
    "cell_vs_9_segment_step_cost_ratio": (
        "one-sided-w10, 60 deg, h = 2 mm, steps of 5 kPa: CPU s a step, cell over 9 chambers"
    ),
    "cell_vs_30_segment_step_cost_ratio": "the same over 30 chambers",
    "cell_vs_segment_strain_rel": (
        "that cell at 1 mm against the middle of 9 chambers, 20 and 50 kPa: |d(e, k pitch)| / (|k| pitch)"
    ),
    "rod_free_shape_us": (
        "free shape of four segments (12 pieces) at some 200 points, strains given: best us a call"
    ),
    "rod_free_batch_us": "the same for 1000 designs at once (205 points each): us a design",
    "rod_gravity_ms": "that rod hanging under its weight, to 0.05 % of its length: best ms a call",
    "rod_vs_fe_tip_rel_max": (
        "rods with the unit cells' quadratic laws against FE, h = 1 mm, three bodies of 5 chambers, free at"
        " 20 and 50 kPa, hanging and pushed at 20: largest distance of the tips over the length"
    ),
    "rod_vs_fe_rms_rel_max": "the same: largest RMS distance of the centrelines over the length",
    "rod_vs_fe_tip_rel_max_without_ends": "the tips' distance with the end effects switched off",
    "rod_vs_fe_rms_rel_max_without_ends": "the centrelines' distance with the end effects switched off",
    "rod_vs_fe_tip_rel_max_trained": (
        "the tips' distance with the trained law that comes along, whatever mesh that is for"
    ),
    "rod_vs_fe_rms_rel_max_trained": "the centrelines' distance with the trained law",
    "dataset_one_sided": "data set of cells: accepted one-sided designs",
    "dataset_twisting": "data set of cells: accepted twisting designs",
    "dataset_accepted_fraction": "data set of cells: cases accepted over cases computed",
    "law_strain_median_rel": (
        "law, unseen designs, the worse kind: |d(e, k pitch)| over the free strains' norm at top pressure,"
        " median"
    ),
    "law_strain_p95_rel": "the same, 95th percentile",
    "law_tip100_p95_rel": (
        "the same designs: distance of the tips of free segments of 100 mm over 100 mm, 95th percentile"
    ),
    "law_stiffness_p95_rel": "the same designs: largest |1 - eigenvalue| of K_FE^-1 K, 95th percentile",
    "law_force_p95_rel": (
        "the same designs at twice the free strains: error of the forces, whitened by K_FE, 95th percentile"
    ),
    "law_interval_coverage_90": (
        "the same designs: share of free strains within their 90 % intervals, of the kind that is further"
        " from 0.9"
    ),
    "slanted_strain_median_rel": (
        "law, designs at 30 .. 40 deg, beyond the angles that it knows, the worse kind and band: strains,"
        " median"
    ),
    "slanted_strain_p95_rel": "the same, 95th percentile",
    "slanted_tip100_p95_rel": "the same: tips of free segments of 100 mm",
    "slanted_stiffness_p95_rel": "the same: stiffness",
    "law_batch_10k_seconds": (
        "free strains and their slopes of 10,000 (design, pressure), the dearer kind: best CPU s"
    ),
    "law_error_bars_10k_seconds": "90 % intervals of the same free strains: best CPU s",
    "law_stiffness_10k_seconds": "free strains of the same with their tangent stiffness: best CPU s",
    "law_single_us": "free strains of one segment at one pressure, the dearer kind: best CPU us",
    "law_real_silicone_strain_rel_01": (
        "cells of fitted silicones (Yeoh) against neo-Hookean ones of the same initial modulus: largest "
        "difference of the free strains at P/mu = 0.1 over their norm"
    ),
    "law_real_silicone_strain_rel_02": "the same at P/mu = 0.2",
    "remeshed_strain_p95_rel": (
        "held-out cells on another mesh of nearly the same size, judged as the law is, the worse kind: free"
        " strains"
    ),
    "remeshed_tip100_p95_rel": "the same: tips of free segments of 100 mm",
    "remeshed_stiffness_p95_rel": "the same: stiffness",
    "law_load_ms": "reading the law's file: best CPU ms",
    "rod_free_shape_with_law_us": (
        "free shape of four segments at some 200 points, the law's strains included: best CPU us"
    ),
    "sphere_max_rel_error": (
        "inflated sphere: largest relative error of the inner radius at P/mu = 0.1 .. 0.8"
    ),
    "sphere_past_limit_rel_error": (
        "the same under volume control through the limit point to a = 2.2: largest error of the pressure"
    ),
    "tube_max_rel_error": "tube held at its length: largest error of the inner radius at P/mu = 0.1 .. 0.6",
    "capped_tube_max_rel_error": (
        "capped tube: largest error of inner radius and axial stretch at P/mu = 0.1 .. 0.5"
    ),
    "torsion_rel_error": "stretched and twisted solid cylinder: larger error of torque and axial force",
    "flexure_rel_error": "block bent in plane strain, k = 0.1 .. 1.5: largest error of the moment",
    "land1_z_mm": (
        "Land et al. problem 1, 48 x 6 x 6 bricks: deformed z of (10, 0.5, 1); other codes 4.15 .. 4.19 mm"
    ),
    "cook_rel_error": (
        "Cook's membrane, 32 x 32 bricks: error of the corner's rise against its own extrapolated value"
    ),
    "mms_order_u": "manufactured solution, 8^3 to 16^3 bricks: observed order of u in L2",
    "mms_order_p": "the same of p",
    "energy_balance_rel": (
        "shipped body to 20 kPa: work of the pressure (Simpson, 16 intervals) against the stored energy"
    ),
    "contact_tau_50kPa_rad_per_m": (
        "cell twist-w15, 60 deg, h = 2 mm, contact: twist per deformed length at 50 kPa"
    ),
    "contact_cost_factor": (
        "that cell to 50 kPa in 5 recorded levels: CPU time with contact = auto over contact = none"
    ),
    "contact_distance_rel_gap_60": (
        "largest distance of solid walls, + or -, where they push with > 10 % of P, over the gap"
    ),
    "contact_distance_rel_gap_45": "the same at 45 deg",
    "contact_distance_rel_gap_75": "the same at 75 deg",
    "contact_bias_twist_rel": (
        "that cell at 98.5 % of the pressure of first touch: twist with contact over without, minus 1"
    ),
    "contact_bias_curvature_rel": (
        "cell one-sided-w10, 60 deg, 50 kPa, never in contact: |k| with contact over without, minus 1"
    ),
    "contact_parameter_sensitivity_rel": (
        "twist at 50 kPa: change when the penalty's stiffness or onset is halved or doubled, over what "
        "contact adds"
    ),
    "contact_mesh_sensitivity_rel": "what contact adds to the twist at 50 kPa, h = 1.5 mm against 2 mm",
    "contact_force_check_rel": (
        "force between chambers, 10, 30, 50 kPa, walls against a third medium in its limit: largest"
        " difference"
    ),
    "contact_pressed_force_rel": (
        "cylinders pressed together, each turned against the next, h = 0.35 radii: error of the axial force"
    ),
    "contact_segment_vs_cell_rel": (
        "twist in the middle of 5 pairs of chambers, 2 ranks, against the cell, both with contact"
    ),
    "analytic_vs_fe_twist_rel": (
        "twisting tube, nothing fitted (E_t = 3 mu, equal areas), against cells twist-w10, -w12, -w15 with"
        " contact, h = 2 mm, 30 .. 85 deg, 10 .. 50 kPa: median of |tau / tau of FE - 1|, 1 where the tube"
        " has no state; worst: paper-models.md"
    ),
    "analytic_vs_fe_twist_rel_calibrated": (
        "the same with E_t, Ri, Ro and the convention fitted to each case's cells"
    ),
    "analytic_vs_fe_curvature_rel": (
        "one-sided model, nothing fitted, against cells one-sided-w10, h = 2 mm, 30 .. 90 deg, 10 .. 50 kPa: "
        "median of ||k| / |k| of FE - 1|"
    ),
    "analytic_vs_fe_curvature_rel_calibrated": (
        "the same with a factor on 1/mu and its power of 1/sin(angle) fitted to those cells"
    ),
    "long_segment_steps": "case one-sided-long, 26 chambers, 60 deg, 0-50 kPa, h = 2 mm: accepted steps",
    "long_segment_factorisations": "the same: factorisations, failed attempts included",
    "ramp_ratio_same_strategy_h2": (
        "ramp twist-w12 at h = 2 mm, same predictor and lagging: our time over the faster of FElupe and"
        " NGSolve"
    ),
    "ramp_ratio_same_strategy_h1": "the same at h = 1 mm",
    "ramp_ratio_frozen_h1": (
        "that ramp at h = 1 mm: our own stepping's time over theirs with the prototype's predictor and"
        " lagging"
    ),
    "ramp_ratio_stock_h2": (
        "that ramp at h = 2 mm: our own stepping's time over theirs with full Newton and no predictor"
    ),
    "ramp_factorisations_h1": "that ramp at h = 1 mm: factorisations of our own stepping",
    "felupe_agreement_rel": (
        "displacements at 50 kPa against FElupe on the same quadrature, h = 2 mm, relative 2-norm"
    ),
    "ngsolve_agreement_rel": "displacements at 50 kPa against NGSolve, h = 2 mm, relative 2-norm",
    "residual_exponent": "growth of a residual's time with the dofs (h = 2, 1.4, 1 mm)",
    "tangent_exponent": "growth of a tangent's assembly time with the dofs",
    "factorise_exponent": "growth of a factorisation's time with the dofs",
    "solve_exponent": "growth of a solution's time with the dofs",
    "ranks2_speedup_150k": "first steps of the ramp at some 150k dofs: time on 1 rank over time on 2 ranks",
}


def calibration():
    """Best of 5 wall seconds of a fixed pure-Python loop: how fast this machine is right now."""
    best = float("inf")
    for _ in range(5):
        start = time.perf_counter()
        sum(i * i for i in range(1_000_000))
        best = min(best, time.perf_counter() - start)
    return best


def merge(path, entries):
    known = json.loads(path.read_text()) if path.exists() else {}
    write_text(path, json.dumps(known | entries, indent=1, sort_keys=True) + "\n")


def demo_picture():
    """The README's picture: three of the demo report's side by side, at most 256 colours to stay small."""
    from PIL import Image

    parts = [
        Image.open(ROOT / "out" / "demo" / "report" / f"{name}.png").convert("RGB")
        for name in ("target", "reduced", "fe")
    ]
    height = min(part.height for part in parts)
    parts = [part.resize((round(part.width * height / part.height), height)) for part in parts]
    row = Image.new("RGB", (sum(part.width for part in parts), height), "white")
    x = 0
    for part in parts:
        row.paste(part, (x, 0))
        x += part.width
    row.thumbnail((1500, 1500))
    row.quantize(256).save(ROOT / "docs" / "demo.png", optimize=True)


def snapshot():
    """Merge the results into docs/, parts not measured anew kept; write the table of figures and the README's
    picture."""
    if (ROOT / "out" / "demo" / "report").is_dir():
        demo_picture()
    for name in ("results.json", "results.meta.json"):
        merge(ROOT / "docs" / name, json.loads((OUT / name).read_text()))
    results, meta = (
        json.loads((ROOT / "docs" / name).read_text()) for name in ("results.json", "results.meta.json")
    )
    lines = ["# Figures", "", "Made by `make bench` and `python -m benchmarks --snapshot`; do not edit.", ""]
    rows = [
        (f"`{key}`", f"{results[key]:.4g}", meaning.replace("|", "\\|"))
        for key, meaning in MEANING.items()
        if key in results
    ]
    lines += table(["key", "value", "what it is"], rows)
    lines += ["", "| part | date | revision | machine | calibration loop, s |", "|---|---|---|---|---|"]
    for part, m in sorted(meta.items()):
        where = f"{m['machine']['processor']}, {m['machine']['cores']} cores"
        lines.append(f"| {part} | {m['date']} | {m['revision']} | {where} | {m['calibration_seconds']:.3f} |")
    write_text(ROOT / "docs" / "figures.md", "\n".join(lines) + "\n")
    write_text(ROOT / "docs" / "speed.md", speed.page(results, meta))
    if "law" in meta:
        page = ROOT / "docs" / "rod-law.md"
        write_text(page, law.page(page.read_text(), meta["law"]["details"], meta))
    if "rod-fe" in meta:
        page = ROOT / "docs" / "theory-reduced.md"
        write_text(page, rod.page(page.read_text(), meta["rod-fe"]["details"]))
    if "contact" in meta:
        page = ROOT / "docs" / "contact.md"
        write_text(page, contact_page.page(page.read_text(), results, meta["contact"]["details"]))
    if "paper" in meta:
        write_text(ROOT / "docs" / "paper-models.md", paper_page.page(meta, ROOT / "docs"))
    if "verification" in meta:
        write_text(ROOT / "docs" / "verification.md", verification.page(meta, ROOT / "docs"))


def main():
    parser = argparse.ArgumentParser(prog="benchmarks")
    parser.add_argument("--only", choices=PARTS, help="; ".join(f"{k}: {v[1]}" for k, v in PARTS.items()))
    parser.add_argument("--snapshot", action="store_true", help="publish out/bench to docs/")
    a = parser.parse_args()
    if a.snapshot:
        snapshot()
        return
    for part in [a.only] if a.only else PARTS:
        print(f"bench: {part}", flush=True)
        loop = calibration()
        found = PARTS[part][0]()
        figures, details = found if isinstance(found, tuple) else (found, {})
        merge(OUT / "results.json", figures)
        facts = {
            "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "revision": revision(),
            "machine": machine(),
        }
        merge(
            OUT / "results.meta.json",
            {part: {**facts, "calibration_seconds": loop, "keys": sorted(figures), "details": details}},
        )
        for key, value in figures.items():
            print(f"  {key} = {value:.6g}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
