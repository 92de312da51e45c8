"""Figures of the rod: what free and loaded shapes cost, and how far they are from finite elements of the same
mesh size."""

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.tables import below_mark, table

PRESSURE = 0.02
MESH_SIZE = 1.0
SHARES = (0.4, 1.0)  # of the top pressure at which shapes are compared
TOP = 0.05


def best_seconds(call, calls):
    """Smallest mean of 15 rows of calls, CPU s a call (one thread): other work on the machine only ever
    adds."""
    best = np.inf
    for _ in range(15):
        start = time.process_time()
        for _ in range(calls):
            call()
        best = min(best, (time.process_time() - start) / calls)
    return best


def four_segments():
    """A Rod of four segments of both kinds: the analytic model's free strains, the bare cores' stiffness."""
    from pneunet.geometry import Manipulator
    from pneunet.geometry.reference_cases import CASES
    from pneunet.reduced import AnalyticLaw, QuadraticLaw, Rod
    from pneunet.reduced.rod.quadratic import passive_law

    twist, bend = CASES["twist_w12"], CASES["one_sided_w10"]
    body = Manipulator((twist(60.0, 5), bend(60.0, 6), twist(120.0, 5), bend(90.0, 6)))
    laws = []
    for segment in body.segments:
        strains = AnalyticLaw().strains(segment, PRESSURE)
        laws.append(QuadraticLaw([PRESSURE], [strains.vector], passive_law(segment).stiffnesses))
    return Rod.of(body, laws, PRESSURE)


def speed():
    """The part `rod`."""
    from pneunet.base.strains import RodStrains
    from pneunet.geometry.loading import DeadLoads
    from pneunet.reduced import centreline, free_shapes

    rod, gravity = four_segments(), DeadLoads((0.0, 0.0, -9810.0))
    lengths, strains = rod.lengths, rod.free_strains
    spacing = lengths.sum() / 195
    many = RodStrains.of_vector(np.tile(strains.vector, (1000, 1, 1)))
    rows = np.tile(lengths, (1000, 1))
    state = rod.equilibrium(gravity)
    details = {
        "points": len(centreline(lengths, strains, spacing).s),
        "length_mm": lengths.sum(),
        "tip_moved_by_gravity_mm": float(np.linalg.norm(state.tip[:3, 3] - rod.free().points[-1])),
        "error_estimate_mm": state.error,
        "iterations": state.iterations,
        "elements": len(state.force),
    }
    figures = {
        "rod_free_shape_us": 1e6 * best_seconds(lambda: centreline(lengths, strains, spacing), 100),
        "rod_free_batch_us": 1e3 * best_seconds(lambda: free_shapes(rows, many, 17), 1),
        "rod_gravity_ms": 1e3 * best_seconds(lambda: rod.equilibrium(gravity), 10),
    }
    return figures, details


def compare(rod, loads, fe):
    """(tip, RMS) distance of the rod's section frames from the measured ones, over the length at rest."""
    line = rod.equilibrium(loads).line
    apart = np.linalg.norm(
        line.at(np.minimum(fe.stations, line.s[-1]))[:, :3, 3] - fe.frames[:, :3, 3], axis=1
    )
    length = rod.lengths.sum()
    return float(apart[-1] / length), float(np.sqrt(np.mean(apart**2)) / length)


def against_finite_elements():
    """The part `rod-fe`: laws from the unit cells' states, bodies of five chambers, one mesh size; beside it
    the trained law."""
    from pneunet.geometry import Manipulator
    from pneunet.geometry.cad.mesh import mesh_manipulator
    from pneunet.geometry.loading import DeadLoads
    from pneunet.geometry.reference_cases import CASES
    from pneunet.hifi.body.manipulator import ManipulatorSolve
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.run import solve_cell
    from pneunet.reduced import QuadraticLaw, Rod, shipped_law

    rows, trained = [], shipped_law()
    with tempfile.TemporaryDirectory() as folder:
        for name, angle in (("one_sided_w10", 60.0), ("one_sided_w10", 90.0), ("twist_w12", 60.0)):
            body = Manipulator((CASES[name](angle=angle, chambers=5),))
            states = []
            solve_cell(
                CellCase(replace(body.segments[0], chambers=1), TOP, MESH_SIZE, 10),
                Path(folder) / "cell.npz",
                states.append,
            )
            law = QuadraticLaw.of_states(states)
            # moves the tips by 20 to 26 % of the length
            push = 0.6 * law.stiffnesses[0][4, 4] / body.length**2
            mesh_manipulator(body, MESH_SIZE, folder)
            for what, loads, top in (
                ("free", DeadLoads(), TOP),
                ("hanging", DeadLoads((0.0, 0.0, -9810.0)), SHARES[0] * TOP),
                ("pushed", DeadLoads(tip_force=(0.0, 0.0, push)), SHARES[0] * TOP),
            ):
                solve, marks, seen = (
                    ManipulatorSolve(body, Path(folder) / "manipulator.npz", loads=loads),
                    [s * TOP for s in SHARES],
                    [],
                )
                solve.run(top, seen.append, [m for m in marks if m <= top], stability=False)
                solve.destroy()
                for fe in [m for m in seen if m.pressure in marks]:
                    tip, rms = compare(Rod.of(body, law, fe.pressure), loads, fe)
                    bare_tip, bare_rms = compare(Rod.of(body, law, fe.pressure, end_effects=False), loads, fe)
                    trained_tip, trained_rms = compare(Rod.of(body, trained, fe.pressure), loads, fe)
                    row = {
                        "case": f"{name}, {angle:g} deg, {what}",
                        "pressure_kPa": fe.pressure * 1e3,
                        "tip": tip,
                        "rms": rms,
                    }
                    row |= {
                        "tip_without": bare_tip,
                        "rms_without": bare_rms,
                        "tip_trained": trained_tip,
                        "rms_trained": trained_rms,
                    }
                    rows.append(row)
                    print("  ", rows[-1], flush=True)
    figures = {
        "rod_vs_fe_tip_rel_max": max(r["tip"] for r in rows),
        "rod_vs_fe_rms_rel_max": max(r["rms"] for r in rows),
        "rod_vs_fe_tip_rel_max_without_ends": max(r["tip_without"] for r in rows),
        "rod_vs_fe_rms_rel_max_without_ends": max(r["rms_without"] for r in rows),
        "rod_vs_fe_tip_rel_max_trained": max(r["tip_trained"] for r in rows),
        "rod_vs_fe_rms_rel_max_trained": max(r["rms_trained"] for r in rows),
    }
    return figures, {"mesh_size_mm": MESH_SIZE, "rows": rows}


def page(text, details):
    """docs/theory-reduced.md, of which `text` is the present one, with the table below its mark made anew."""

    def percent(row, which):
        return f"{100 * row['tip' + which]:.1f}; {100 * row['rms' + which]:.1f}"

    ways = {"with end effects": "", "without": "_without", "trained law": "_trained"}
    rows = [
        (r["case"], f"{r['pressure_kPa']:.0f}", *[percent(r, way) for way in ways.values()])
        for r in details["rows"]
    ]
    units = (
        f"Distances in % of the length: tip; RMS of the section frames. h = {details['mesh_size_mm']:g} mm."
    )
    return below_mark(
        text,
        "rod-fe",
        ["## Rods against finite elements", "", units, "", *table(["case", "kPa", *ways], rows)],
    )
