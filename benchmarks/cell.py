"""Figures of the unit cell: cost of a sweep, mesh error, stiffness against differences of forces and against
refinement."""

import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.tables import table

PRESSURES = (0.02, 0.05)
#: mesh sizes in mm of the study: uniform, and graded ones in a constant ratio for the extrapolation
UNIFORM = (2.0, 1.5, 1.0, 0.7)
GRADED = (1.5, 1.225, 1.0)


def case(mesh_size, levels=10, graded=False):
    from pneunet.base.materials.laws import NeoHookean
    from pneunet.geometry.reference_cases import CASES
    from pneunet.hifi.cell.file import CellCase

    segment = CASES["one_sided_w10"](angle=60.0, chambers=1, material=NeoHookean(0.2068))
    return CellCase(segment, 0.05, mesh_size, levels, contact="none", graded=graded, element="tetrahedra")


def sweep(what, folder):
    """(CPU seconds, cells, states) of 0-50 kPa, the 6x6 stiffness at each level."""
    from pneunet.hifi.cell.run import solve_cell

    states, started = [], time.process_time()
    _, facts = solve_cell(what, Path(folder) / "cell.npz", states.append)
    return time.process_time() - started, facts["cells"], states


def stiffness_difference(folder, mesh_size=2.0):
    """Largest |K d - (f(+) - f(-))/2| / |K d| over the six strains, in units of the stiffness's own scale."""
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.run import solve_cell

    segment, path = case(mesh_size).segment, Path(folder) / "fd.npz"
    free, _ = solve_cell(CellCase(segment, 0.02, mesh_size, 1, contact="none"), path)
    q = free.strains.vector
    worst = 0.0
    for i, step in enumerate([2e-4] * 3 + [2e-5] * 3):
        forces = []
        for sign in (1, -1):
            wanted = q + sign * step * np.eye(6)[i]
            held, _ = solve_cell(
                CellCase(segment, 0.02, mesh_size, 1, dict(enumerate(wanted)), contact="none"), path
            )
            forces.append(np.concatenate([held.force, held.moment]))
        scale = np.sqrt(np.diag(free.stiffness))
        difference = (forces[0] - forces[1]) / (2 * step) - free.stiffness[:, i]
        worst = max(worst, float(np.abs(difference / (scale * scale[i])).max()))
    return worst


def gauge_difference(folder, mesh_size=2.0, pressure=0.02):
    """Largest relative change when the cut moves (6x6 stiffness) and when the gauge does (what belongs to no
    section frame)."""
    from pneunet.geometry import tags
    from pneunet.geometry.cad.cell import mesh_cell
    from pneunet.geometry.cad.recut import recut
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
    from pneunet.hifi.path.control import LoadControl
    from pneunet.hifi.path.equilibrium import EquilibriumPath
    from pneunet.hifi.path.newton import NewtonOptions
    from pneunet.hifi.path.stepping import StepSize, run_steps

    segment, path, other = case(mesh_size).segment, Path(folder) / "cell.npz", Path(folder) / "recut.npz"
    mesh_cell(segment, mesh_size, path)
    recut(path, other, segment.pitch, 0.9)

    def state(mesh, *gauge):
        system = CellSystem(CellProblem(segment, mesh, *gauge))
        path = EquilibriumPath(system, LoadControl(), NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE))
        run_steps(path, pressure, StepSize(0.005, 1e-4))
        found = system.measure()
        system.destroy()
        return found

    here, cut, walls = state(path), state(other), state(path, (tags.CAVITY,))
    scale = np.sqrt(np.diag(here.stiffness))
    moved = np.abs((cut.stiffness - here.stiffness) / np.outer(scale, scale)).max()
    frames = np.abs(walls.screw_compliance / here.screw_compliance - 1).max()
    single = np.abs((walls.stiffness - here.stiffness) / np.outer(scale, scale)).max()
    return float(max(moved, frames)), {
        "cut": float(moved),
        "screw_compliance": float(frames),
        "single_entries": float(single),
    }


def unit_cell():
    """The part `cell`: ({key: value}, details)."""
    from pneunet.hifi.cell.file import CellCase

    default = CellCase.mesh_size
    with tempfile.TemporaryDirectory() as folder:
        sweep(case(2.5), folder)  # compiles the forms
        runs = {(size, False): sweep(case(size), folder) for size in UNIFORM}
        runs |= {(size, True): sweep(case(size, 5, True), folder) for size in GRADED}
        difference, gauge = stiffness_difference(folder), gauge_difference(folder)
    strains = {}
    for key, (_, _, states) in runs.items():
        at = {round(s.pressure, 6): s for s in states}
        strains[key] = np.array(
            [[*at[p].strains.e, *(at[p].strains.k * case(1.0).segment.pitch)] for p in PRESSURES]
        )
    coarse, middle, fine = (strains[size, True] for size in GRADED)
    norm = np.linalg.norm(fine - np.eye(6)[0], axis=1)
    # Richardson with the ratio that the three graded meshes show, in the norm, at each pressure
    ratio = np.linalg.norm(middle - coarse, axis=1) / np.linalg.norm(fine - middle, axis=1)
    extrapolated = fine + (fine - middle) / (ratio - 1)[:, None]
    error = {
        key: float((np.linalg.norm(q - extrapolated, axis=1) / norm).max()) for key, q in strains.items()
    }
    stiffness = [runs[size, True][2][-1].stiffness for size in GRADED[1:]]
    eigenvalues = np.linalg.eigvals(np.linalg.solve(stiffness[1], stiffness[0])).real
    figures = {
        "cell_sweep_h2_cpu_seconds": runs[2.0, False][0],
        "cell_sweep_default_cpu_seconds": runs[default, False][0],
        "cell_mesh_error_rel": error[default, False],
        "cell_mesh_error_graded_rel": error[GRADED[-1], True],
        "cell_stiffness_fd_rel": difference,
        "cell_stiffness_gauge_rel": gauge[0],
        "cell_stiffness_refinement_rel": float(np.abs(eigenvalues - 1).max()),
    }
    study = [
        {
            "mesh_size_mm": size,
            "graded": graded,
            "levels": len(states) - 1,
            "cells": cells,
            "cpu_seconds": seconds,
            "strain_error_rel": error[size, graded],
            "strains_e_k_pitch": strains[size, graded].tolist(),
        }
        for (size, graded), (seconds, cells, states) in runs.items()
    ]
    order = (np.log(ratio) / np.log(GRADED[0] / GRADED[1])).tolist()
    return figures, {
        "mesh_study": study,
        "extrapolated": extrapolated.tolist(),
        "observed_order": order,
        "gauge": gauge[1],
    }


STUDY = """\
One-sided-w10, 60 degrees, mu = 0.2068 MPa, the section frame on the channel's axis. Graded meshes shrink
to a fifth of their size at the body's edges, where stresses are singular. Their three sizes are in a
constant ratio. The extrapolated values take the ratio of their differences, so that the order is observed,
not assumed. Errors are norms of (e, k pitch) over the norm of the extrapolated strain, the larger of 20 and
50 kPa. Sweeps are 0 to 50 kPa with the stiffness at every level.""".splitlines()


def section(details):
    """Lines on the mesh study and the gauge for docs/verification.md."""
    rows = []
    for r in details["mesh_study"]:
        _, strains = r["strains_e_k_pitch"]
        kind = "graded" if r["graded"] else "uniform"
        row = [
            f"{r['mesh_size_mm']:g} {kind}",
            r["cells"],
            *(f"{strains[i]:.4f}" for i in (0, 1, 3, 4)),
            f"{r['strain_error_rel']:.1e}",
        ]
        rows.append([*row, f"{r['cpu_seconds']:.0f} ({r['levels']} levels)"])
    last = details["extrapolated"][1]
    rows.append(["extrapolated", "", *(f"{last[i]:.4f}" for i in (0, 1, 3, 4)), "", ""])
    orders, gauge = details["observed_order"], details["gauge"]
    lines = ["## The unit cell's mesh", "", *STUDY, ""]
    lines += table(["mesh, mm", "cells", "e1", "e2", "k1 pitch", "k2 pitch", "error", "processor s"], rows)
    lines += [
        "",
        f"Strains at 50 kPa. Observed orders: {orders[0]:.2f} at 20 kPa, {orders[1]:.2f} at 50 kPa.",
    ]
    lines += [
        "",
        f"With the same tetrahedra cut elsewhere the stiffness agrees to {gauge['cut']:.0e}. With the gauge"
        " on the cavity's walls the screw compliance agrees to ",
    ]
    lines[-1] += (
        f"{gauge['screw_compliance']:.0e}; single entries of the stiffness, which belong to the frame,"
        " change by "
    )
    lines[-1] += f"{gauge['single_entries']:.0%}."
    return lines
