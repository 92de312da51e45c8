"""The unit cell against finite segments of 9 and 30 chambers: what a step costs, and the strains in the
middle."""

import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.tables import table

CHAMBERS = (9, 30)
COST_MESH, COST_LEVELS, COST_PRESSURE = 3.0, 4, 0.02  # mm; equal steps to that pressure in MPa
STRAIN_MESH, STRAIN_PRESSURE = 1.5, 0.05


def segment(chambers):
    from pneunet.base.materials.laws import NeoHookean
    from pneunet.geometry.reference_cases import CASES

    return CASES["one_sided_w10"](angle=60.0, chambers=chambers, material=NeoHookean(0.2068))


def walk(system, path, pressure, levels):
    """Process seconds a converged step in equal steps to `pressure`, the tangent factorised and measured
    nowhere but by Newton."""
    from pneunet.hifi.path.stepping import StepSize, run_steps

    step = pressure / levels
    begun = time.process_time()
    result = run_steps(path, pressure, StepSize(step, 1e-3 * step, largest=step))
    return (time.process_time() - begun) / len(result.steps), {
        "steps": len(result.steps),
        "factorisations": system.factorisations,
    }


def cell_step(folder):
    from pneunet.geometry.cad.grid import grid_cell
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.system import CellSystem
    from pneunet.hifi.path.control import LoadControl
    from pneunet.hifi.path.equilibrium import EquilibriumPath

    grid_cell(segment(1), COST_MESH, folder / "cell.npz", part=True)
    system = CellSystem(CellProblem(segment(1), folder / "cell.npz"))
    seconds, facts = walk(system, EquilibriumPath(system, LoadControl()), COST_PRESSURE, COST_LEVELS)
    facts["unknowns"] = system.problem.unknowns
    system.destroy()
    return seconds, facts


def segment_step(folder, chambers):
    solve = finite(folder, chambers, COST_MESH)
    seconds, facts = walk(solve.system, solve.path, COST_PRESSURE, COST_LEVELS)
    facts["unknowns"] = solve.problem.dofs
    solve.destroy()
    return seconds, facts


def finite(folder, chambers, mesh_size):
    from pneunet.geometry import Manipulator
    from pneunet.geometry.cad.mesh import mesh_manipulator
    from pneunet.hifi.body.manipulator import ManipulatorSolve

    body = Manipulator((segment(chambers),))
    mesh_manipulator(body, mesh_size, folder / str(chambers), "hexahedra")
    return ManipulatorSolve(body, folder / str(chambers) / "manipulator.npz")


def middle(folder):
    """{pressure: (e (3,), k (3,))} over the two pitches around the middle chamber of the 9-chamber segment at
    STRAIN_MESH."""
    from pneunet.base import se3
    from pneunet.base.strains import RodStrains

    solve = finite(folder, CHAMBERS[0], STRAIN_MESH)
    stations = solve.sections.segment_stations[0]
    ends = [
        int(np.argmin(abs(solve.sections.stations - s)))
        for s in (stations[CHAMBERS[0] // 2 - 1], stations[CHAMBERS[0] // 2 + 1])
    ]
    seen = {}

    def note(m):
        relative = se3.inverse_pose(m.frames[ends[:1]]) @ m.frames[ends[1:]]
        strains = RodStrains.from_relative_pose(relative, np.diff(m.stations[ends]))
        seen[m.pressure] = strains.e[0], strains.k[0]

    solve.run(STRAIN_PRESSURE, note, milestones=(0.02,), stability=False)
    dofs = solve.problem.dofs
    solve.destroy()
    return {p: seen[p] for p in (0.02, STRAIN_PRESSURE)}, dofs


def against_segments():
    """The part `segments`: ({key: value}, details)."""
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.run import solve_cell

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cell_step(folder)  # compiles the forms
        costs = {"cell": cell_step(folder), **{n: segment_step(folder, n) for n in CHAMBERS}}
        states = []
        case = CellCase(segment(1), STRAIN_PRESSURE, STRAIN_MESH, 5, element="hexahedra")
        solve_cell(case, folder / "fine.npz", states.append)
        found, dofs = middle(folder)
    pitch, errors, rows = segment(1).pitch, [], []
    for pressure, (e, k) in found.items():
        state = min(states, key=lambda s: abs(s.pressure - pressure))
        here, there = (
            np.concatenate([e, k * pitch]) for e, k in ((state.strains.e, state.strains.k), (e, k))
        )
        errors.append(float(np.linalg.norm(here - there) / (np.linalg.norm(k) * pitch)))
        rows.append(
            {
                "pressure_kPa": pressure * 1e3,
                "cell": here.tolist(),
                "middle_of_9": there.tolist(),
                "difference_rel": errors[-1],
            }
        )
    figures = {f"cell_vs_{n}_segment_step_cost_ratio": costs["cell"][0] / costs[n][0] for n in CHAMBERS}
    figures["cell_vs_segment_strain_rel"] = max(errors)
    details = {
        "cost": {str(n): {"seconds_a_step": s, **facts} for n, (s, facts) in costs.items()},
        "strains_e_k_pitch": rows,
        "dofs": dofs,
    }
    return figures, details


def section(details):
    """Lines on cell and segments for docs/verification.md."""
    names = ["e1", "e2", "e3", "k1 pitch", "k2 pitch", "k3 pitch"]
    lines = [
        "",
        (
            f"Strains at a mesh of {STRAIN_MESH:g} mm ({details['dofs']} dofs in the segment), where the"
            " middle is two pitches:"
        ),
        "",
    ]
    lines = ["## The unit cell and finite segments", *lines]
    rows = []
    for r in details["strains_e_k_pitch"]:
        for key, text in (("cell", "cell"), ("middle_of_9", "middle of 9 chambers")):
            rows.append([f"{r['pressure_kPa']:g}", text, *(f"{v:.4f}" for v in r[key])])
        rows[-1].append(f"{r['difference_rel']:.2e}")
        rows[-2].append("")
    lines += table(["kPa", "body", *names, "difference over k pitch"], rows)
    lines += [
        "",
        (
            f"Cost of a step of {COST_PRESSURE / COST_LEVELS * 1e3:g} kPa at {COST_MESH:g} mm, processor"
            " seconds, same Newton:"
        ),
        "",
    ]
    costs = [
        [n, c["unknowns"], c["steps"], c["factorisations"], f"{c['seconds_a_step']:.2f}"]
        for n, c in details["cost"].items()
    ]
    return lines + table(["chambers", "unknowns", "steps", "factorisations", "s a step"], costs)
