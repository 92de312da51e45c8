"""Figures of the rod: what free and loaded shapes cost, and how far they are from finite elements."""

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.cell_grids import ORDER
from benchmarks.tables import below_mark, table

PRESSURE = 0.02
MESH_SIZE = 1.5
#: (size in mm, graded) of cells: the body's grid, and two of one shape in the ratio 2
GRIDS = {"body": (MESH_SIZE, False), "coarser": (2.5, True), "fine": (1.25, True)}
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


def cell_laws(segment, folder):
    """{grid of GRIDS: QuadraticLaw of the cell's states up to TOP}."""
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.run import solve_cell
    from pneunet.reduced import QuadraticLaw

    laws = {}
    for name, (size, graded) in GRIDS.items():
        states = []
        case = CellCase(replace(segment, chambers=1), TOP, size, 5, contact="none", graded=graded)
        solve_cell(case, folder / "cell.npz", states.append)
        laws[name] = QuadraticLaw.of_states(states)
    return laws


def computed(body, mesh, loads, top):
    """The states (Measured) of a body under loads at those SHARES of TOP that are at most `top`."""
    from pneunet.hifi.body.manipulator import ManipulatorSolve

    marks, seen = [s * TOP for s in SHARES if s * TOP <= top], []
    solve = ManipulatorSolve(body, mesh, loads=loads)
    solve.run(top, seen.append, marks, stability=False)
    solve.destroy()
    return [m for m in seen if m.pressure in marks]


def distances(body, loads, fe, laws, trained):
    """{way: {"tip", "rms"}} of one state: distances of section frames over the length at rest."""
    from pneunet.reduced import Rod

    def points(law, **options):
        line = Rod.of(body, law, fe.pressure, **options).equilibrium(loads).line
        return line.at(np.minimum(fe.stations, line.s[-1]))[:, :3, 3]

    solved, rods = fe.frames[:, :3, 3], {grid: points(law) for grid, law in laws.items()}
    beyond = (rods["fine"] - rods["coarser"]) / (2**ORDER - 1)
    converged = solved + rods["fine"] + beyond - rods["body"]
    pairs = {
        "cell": (rods["body"], solved),
        "without": (points(laws["body"], end_effects=False), solved),
        "trained": (points(trained), converged),
        "mesh": (converged, solved),
    }
    apart = {way: np.linalg.norm(a - b, axis=1) / body.length for way, (a, b) in pairs.items()}
    return {
        way: {"tip": float(far[-1]), "rms": float(np.sqrt(np.mean(far**2)))} for way, far in apart.items()
    }


def against_finite_elements():
    """The part `rod-fe`: rods with laws from the unit cells' states against bodies of five chambers on the
    same grid; the trained law against the converged bodies.

    Those are the computed ones moved by what rods of cells on finer grids, extrapolated, differ from rods of
    cells on the body's.
    """
    from pneunet.geometry import Manipulator
    from pneunet.geometry.cad.mesh import mesh_manipulator
    from pneunet.geometry.loading import DeadLoads
    from pneunet.geometry.meshfile import MESH
    from pneunet.geometry.reference_cases import CASES
    from pneunet.reduced import shipped_law

    rows, trained = [], shipped_law()
    with tempfile.TemporaryDirectory() as folder:
        for name, angle in (("one_sided_w10", 60.0), ("one_sided_w10", 90.0), ("twist_w12", 60.0)):
            body = Manipulator((CASES[name](angle=angle, chambers=5),))
            laws = cell_laws(body.segments[0], Path(folder))
            # moves the tips by 20 to 26 % of the length
            push = 0.6 * laws["body"].stiffnesses[0][4, 4] / body.length**2
            mesh_manipulator(body, MESH_SIZE, folder)
            for what, loads, top in (
                ("free", DeadLoads(), TOP),
                ("hanging", DeadLoads((0.0, 0.0, -9810.0)), SHARES[0] * TOP),
                ("pushed", DeadLoads(tip_force=(0.0, 0.0, push)), SHARES[0] * TOP),
            ):
                for fe in computed(body, Path(folder) / MESH, loads, top):
                    row = {"case": f"{name}, {angle:g} deg, {what}", "pressure_kPa": fe.pressure * 1e3}
                    rows.append(row | distances(body, loads, fe, laws, trained))
                    print("  ", rows[-1], flush=True)

    def worst(way, distance):
        return max(r[way][distance] for r in rows)

    figures = {
        f"rod_vs_fe_{distance}_rel_max{of}": worst(way, distance)
        for way, of in (("cell", ""), ("without", "_without_ends"), ("trained", "_trained"))
        for distance in ("tip", "rms")
    }
    return figures, {"mesh_size_mm": MESH_SIZE, "rows": rows}


def page(text, details):
    """docs/theory-reduced.md, of which `text` is the present one, with the table below its mark made anew."""

    def percent(distances):
        return f"{100 * distances['tip']:.1f}; {100 * distances['rms']:.1f}"

    ways = {
        "cells' law": "cell",
        "without end effects": "without",
        "trained law, converged body": "trained",
        "converged from computed body": "mesh",
    }
    rows = [
        (r["case"], f"{r['pressure_kPa']:.0f}", *(percent(r[way]) for way in ways.values()))
        for r in details["rows"]
    ]
    units = (
        "Distances in % of the length: tip; RMS of the section frames. Hexahedra of"
        f" {details['mesh_size_mm']:g} mm."
    )
    return below_mark(
        text,
        "rod-fe",
        ["## Rods against finite elements", "", units, "", *table(["case", "kPa", *ways], rows)],
    )
