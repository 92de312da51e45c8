"""Figures of the unit cell: cost of a sweep, mesh error, stiffness against differences of forces and against refinement."""

import tempfile
import time
from pathlib import Path

import numpy as np

PRESSURES = (0.02, 0.05)
SIZES = (2.0, 1.5, 1.0, 0.8)


def case(mesh_size):
    from base.materials import NeoHookean
    from hifi.cell_run import CellCase
    from tests.cases import CASES

    segment = CASES["one_sided_w10"](angle=60.0, chambers=1, material=NeoHookean(0.2068))
    return CellCase(segment, 0.05, mesh_size, 10)


def sweep(mesh_size, folder):
    """(CPU seconds, cells, states) of 0-50 kPa in 10 levels, the 6x6 stiffness at each."""
    from hifi.cell_run import solve_cell

    states, started = [], time.process_time()
    _, facts = solve_cell(case(mesh_size), Path(folder) / f"{mesh_size}.msh", states.append)
    return time.process_time() - started, facts["cells"], states


def stiffness_difference(folder, mesh_size=2.0):
    """Largest |K d - (f(+) - f(-))/2| / |K d| over the six strains, in units of the stiffness's own scale."""
    from hifi.cell_run import CellCase, solve_cell

    segment, path = case(mesh_size).segment, Path(folder) / "fd.msh"
    free, _ = solve_cell(CellCase(segment, 0.02, mesh_size, 1), path)
    q = np.concatenate([free.strains.e, free.strains.k])
    worst = 0.0
    for i, step in enumerate([2e-4] * 3 + [2e-5] * 3):
        forces = []
        for sign in (1, -1):
            wanted = q + sign * step * np.eye(6)[i]
            held, _ = solve_cell(CellCase(segment, 0.02, mesh_size, 1, dict(enumerate(wanted))), path)
            forces.append(np.concatenate([held.force, held.moment]))
        scale = np.sqrt(np.diag(free.stiffness))
        difference = (forces[0] - forces[1]) / (2 * step) - free.stiffness[:, i]
        worst = max(worst, float(np.abs(difference / (scale * scale[i])).max()))
    return worst


def unit_cell():
    """The part `cell`: ({key: value}, details)."""
    from hifi.cell_run import CellCase

    with tempfile.TemporaryDirectory() as folder:
        sweep(2.5, folder)  # compiles the forms
        runs = {size: sweep(size, folder) for size in SIZES}
        strains = {}
        for size, (_, _, states) in runs.items():
            at = {round(s.pressure, 6): s for s in states}
            strains[size] = np.array([[*at[p].strains.e, *(at[p].strains.k * case(size).segment.pitch)] for p in PRESSURES])
        finest, finer = SIZES[-1], SIZES[-2]
        # Richardson with the order that singular corners leave, one in the mesh size; stated, not fitted
        extrapolated = strains[finest] + (strains[finest] - strains[finer]) * finest / (finer - finest)
        norm = np.linalg.norm(extrapolated - np.eye(6)[0], axis=1)
        error = {s: float((np.linalg.norm(q - extrapolated, axis=1) / norm).max()) for s, q in strains.items()}
        stiffness = {s: runs[s][2][-1].stiffness for s in (finest, finer)}
        eigenvalues = np.linalg.eigvals(np.linalg.solve(stiffness[finest], stiffness[finer])).real
        default = CellCase.mesh_size
        figures = {
            "cell_sweep_h2_cpu_seconds": runs[2.0][0],
            "cell_sweep_default_cpu_seconds": runs[default][0],
            "cell_mesh_error_rel": error[default],
            "cell_stiffness_fd_rel": stiffness_difference(folder),
            "cell_stiffness_refinement_rel": float(np.abs(eigenvalues - 1).max()),
        }
        study = {
            str(s): {"cells": runs[s][1], "cpu_seconds": runs[s][0], "strain_error_rel": error[s], "strains_e_k_pitch": strains[s].tolist()}
            for s in SIZES
        }
    return figures, {"mesh_study_20_and_50_kPa": study, "extrapolated": extrapolated.tolist()}
