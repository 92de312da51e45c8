"""Figures of cells on grids of hexahedra: how far their strains are from converged ones, what they cost."""

import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from benchmarks.tables import table

KINDS = ("one_sided_w10", "twist_w12")
PRESSURES = (0.02, 0.05)
#: mm: the usual grid; tetrahedra that it is compared with; CELL.toml's `graded`, with layers at planes with
#: re-entrant edges
DEFAULT, TETRAHEDRA, FINE = 1.5, 2.0, 1.0
#: into how many equal parts all room between a cell's planes is cut: nested grids, of which the last two are
#: extrapolated
CUTS = (2, 3, 4)
#: of convergence at edges of 270 degrees: twice the exponent of their singularity
ORDER = 2 * 0.5445
#: whose walls touch, to what pressure in MPa, and its nested grids
TOUCHING, CONTACT_PRESSURE, CONTACT_CUTS = "twist_w15", 0.04, (1, 2, 3)
REPEATS = 3


def case_of(name, size, element="hexahedra", graded=False, pressure=PRESSURES[-1], **more):
    from pneunet.geometry.reference_cases import CASES
    from pneunet.hifi.cell.file import CellCase

    more = {"levels": 5, "contact": "none"} | more
    return CellCase(CASES[name](60.0, 1), pressure, size, graded=graded, element=element, **more)


def vector(strains, pitch):
    """(6,) e and k times the pitch."""
    return np.concatenate([strains[:3], strains[3:] * pitch])


def sweep(case, path):
    """Cost and strains (2, 6) at PRESSURES of 0 to 50 kPa in 5 levels, the stiffness at each."""
    from pneunet.hifi.cell.run import solve_cell

    states, started = [], time.process_time()
    _, facts = solve_cell(case, path, states.append)
    seconds = time.process_time() - started
    at = {round(s.pressure, 6): s for s in states}
    strains = [vector(at[p].strains.vector, case.segment.pitch) for p in PRESSURES]
    stretches = [at[p].largest_stretch for p in PRESSURES]
    return row(seconds, strains, facts, stiffness=True) | {"largest_stretch": stretches}


def row(seconds, strains, facts, stiffness):
    return {
        "cpu_seconds": seconds,
        "cells": facts["cells"],
        "stiffness": stiffness,
        "strains_e_k_pitch": np.array(strains).tolist(),
    }


def cut_cell(segment, cut, path):
    """Write the part of a cell that half turns make whole, one element between two planes, each of them cut;
    its facts. The size, a third of the width, asks for one element more in one place alone: between the
    cavities' floors of a twisting segment, where edges turn with the lean from one side's to the other's."""
    from pneunet.geometry.cad.grid import grid_cell

    return grid_cell(segment, segment.width / 3, path, part=True, cut=cut)


def free_path(segment, path, mesh):
    """What `sweep` gives, of the free states alone, which ask for a fraction of the factorisations. mesh()
    writes to `path`."""
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
    from pneunet.hifi.path.control import LoadControl
    from pneunet.hifi.path.equilibrium import EquilibriumPath
    from pneunet.hifi.path.newton import NewtonOptions
    from pneunet.hifi.path.stepping import StepSize, run_steps

    started, seen = time.process_time(), {}
    facts = mesh()
    system = CellSystem(CellProblem(segment, path))
    options = NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE)
    run_steps(
        EquilibriumPath(system, LoadControl(), options),
        PRESSURES[-1],
        StepSize(0.005, 1e-4, milestones=PRESSURES),
        lambda step: seen.update({step.load: system.state[-6:].copy()}),
    )
    system.destroy()
    strains = [vector(seen[p], segment.pitch) for p in PRESSURES]
    return row(time.process_time() - started, strains, facts, stiffness=False)


def orders_of(strains, parts):
    """Observed orders (rows,) of convergence of rows of strains on three grids, in their norm; parts (3,):
    what their elements' sizes go with one over. nan where no order gives such steps."""
    steps = [np.linalg.norm(b - a, axis=-1) for a, b in zip(strains, strains[1:])]
    a, b, c = parts

    def order(quotient):
        def off(p):
            return (a**-p - b**-p) / (b**-p - c**-p) - quotient

        return brentq(off, 0.01, 20.0) if off(0.01) * off(20.0) < 0 else np.nan

    return np.array([order(quotient) for quotient in np.atleast_1d(steps[0] / steps[1])])


def extrapolated(middle, fine, ratio):
    """The limit at ORDER."""
    return fine + (fine - middle) / (ratio**ORDER - 1)


def errors_of(strains, limit):
    """(2,) of (e, k pitch), over the norm of the limit's strain."""
    return np.linalg.norm(strains - limit, axis=-1) / np.linalg.norm(limit - np.eye(6)[0], axis=-1)


def in_turns(runs):
    """{name: its cheapest row} of runs {name: function}, REPEATS times in turns."""
    done = [{name: run() for name, run in runs.items()} for _ in range(REPEATS)]
    return {name: min((each[name] for each in done), key=lambda row: row["cpu_seconds"]) for name in runs}


def study(name, folder):
    """Rows of one segment without contact, {mesh: row}, and what they converge to."""
    from pneunet.hifi.cell.run import mesh_of

    path = folder / "cell.npz"
    cases = {
        "tetrahedra": case_of(name, TETRAHEDRA, "tetrahedra"),
        "default": case_of(name, DEFAULT),
    }
    segment, fine = cases["default"].segment, case_of(name, FINE, graded=True)
    for element in ("tetrahedra", "hexahedra"):
        sweep(case_of(name, 4.0, element), path)  # compiles the forms
    runs = {mesh: lambda case=case: sweep(case, path) for mesh, case in cases.items()}
    for mesh, case in cases.items():
        runs[f"{mesh}, free"] = lambda case=case: free_path(segment, path, lambda: mesh_of(case, path))
    found = in_turns(runs)
    found["fine"] = sweep(fine, path)
    print(f"  {name}, {FINE:g} mm: {found['fine']}", flush=True)
    for cut in CUTS:
        told = found[f"cut, {cut}"] = free_path(segment, path, lambda cut=cut: cut_cell(segment, cut, path))
        print(f"  {name}, cut in {cut}: {told}", flush=True)
    strains = [np.array(found[f"cut, {cut}"]["strains_e_k_pitch"]) for cut in CUTS]
    limit = extrapolated(*strains[1:], CUTS[2] / CUTS[1])
    for each in found.values():
        each["error_rel"] = errors_of(np.array(each["strains_e_k_pitch"]), limit).tolist()
    orders = orders_of(strains, CUTS).tolist()
    return {"case": name, "meshes": found, "extrapolated": limit.tolist(), "orders": orders}


def contact_cells():
    """The part `contact-grids`: ({key: value}, details), the top state of a segment whose walls touch, on the
    usual grid and nested ones. (Without contact its nested grids find no state beyond 28 kPa.)"""
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.run import follow_path, mesh_of

    case = case_of(TOUCHING, DEFAULT, pressure=CONTACT_PRESSURE, contact="auto", levels=1)
    segment, found = case.segment, {}
    for mesh in ("default", *CONTACT_CUTS):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "touching.npz"
            facts = mesh_of(case, path) if mesh == "default" else cut_cell(segment, mesh, path)
            state = follow_path(case, CellProblem(segment, path, contact=case.penalty))
        strains = vector(state.strains.vector, segment.pitch).tolist()
        found[str(mesh)] = {"cells": facts["cells"], "strains_e_k_pitch": strains}
        print(f"  {mesh}: {found[str(mesh)]}", flush=True)
    three = np.array([found[str(cut)]["strains_e_k_pitch"] for cut in CONTACT_CUTS])
    limit = extrapolated(*three[1:], CONTACT_CUTS[2] / CONTACT_CUTS[1])
    for each in found.values():
        each["error_rel"] = float(errors_of(np.array(each["strains_e_k_pitch"]), limit))
    order = float(orders_of(three, CONTACT_CUTS)[0])
    figures = {"cell_contact_grid_error_rel": found["default"]["error_rel"]}
    return figures, {"meshes": found, "extrapolated": limit.tolist(), "order": order}


def cells():
    """The part `cell-grids`: ({key: value}, details)."""
    with tempfile.TemporaryDirectory() as name:
        studies = [study(kind, Path(name)) for kind in KINDS]

    def worst(mesh, what="error_rel"):
        return float(max(np.max(each["meshes"][mesh][what]) for each in studies))

    def ratio(of):
        seconds = [{mesh: row["cpu_seconds"] for mesh, row in each["meshes"].items()} for each in studies]
        return max(each[f"default{of}"] / each[f"tetrahedra{of}"] for each in seconds)

    def stretch_change(each):
        default, fine = (np.array(each["meshes"][m]["largest_stretch"]) for m in ("default", "fine"))
        return np.abs(fine / default - 1).max()

    return {
        "cell_grid_error_rel": worst("default"),
        "cell_fine_grid_error_rel": worst("fine"),
        "cell_finest_grid_error_rel": worst(f"cut, {CUTS[-1]}"),
        "cell_tetrahedra_error_rel": worst("tetrahedra"),
        "stretch_mesh_rel": float(max(stretch_change(each) for each in studies)),
        "cell_grid_order": float(np.min([each["orders"] for each in studies])),
        "cell_default_vs_tets_ratio": ratio(""),
        "cell_default_vs_tets_free_ratio": ratio(", free"),
        "cell_fine_cpu_seconds": worst("fine", "cpu_seconds"),
        "cell_default_cpu_seconds": worst("default", "cpu_seconds"),
    }, {"studies": studies}


ABOUT = f"""\
Both kinds at 60 degrees on sheared grids of hexahedra, half a cell or a quarter, 0 to 50 kPa. *Layers*: one
element of a fifth of the largest on each side of planes with re-entrant edges. *Cut*: all room between two
planes of the cell in so many equal parts, which makes nested grids. The limit is extrapolated from the last
two of these at order {ORDER:.2f}, the least that edges of 270 degrees allow; the observed order of the three
stands below. Where that is higher, errors are told too large. Errors are norms of (e, k pitch) over the norm
of the extrapolated strain. Processor seconds are of five levels with the stiffness at each, or of the free
states alone.""".splitlines()
CONTACT = f"""\
Unit cell {TOUCHING}, 60 degrees, at {1e3 * CONTACT_PRESSURE:g} kPa, where walls hold each other: the usual
grid, and all room between two planes of the cell in so many equal parts; errors against the last two of
these, extrapolated at order {ORDER:.2f}. *No order*: the steps from grid to grid fall more slowly than any
order allows, so that the limit is further off than the extrapolated strains.""".splitlines()


def told_order(order):
    return f"order {order:.2f}" if np.isfinite(order) else "no order"


def section(details):
    """Lines on `cell-grids` for docs/verification.md."""
    lines = ["## The unit cell on grids", "", *ABOUT, ""]
    names = {"tetrahedra": f"tetrahedra, {TETRAHEDRA:g} mm", "default": f"hexahedra, {DEFAULT:g} mm"}
    names |= {"fine": f"layers, {FINE:g} mm"} | {f"cut, {cut}": f"cut in {cut}" for cut in CUTS}
    rows = []
    for each in details["studies"]:
        for mesh, r in each["meshes"].items():
            strains = [f"{r['strains_e_k_pitch'][1][i]:.4f}" for i in (0, 1, 3, 4)]
            errors = [f"{error:.2%}" for error in r["error_rel"]]
            told = f"{r['cpu_seconds']:.1f}{', with stiffness' * r['stiffness']}"
            name = names[mesh.removesuffix(", free")]
            rows.append([each["case"], name, r["cells"], *strains, *errors, told])
        limit = each["extrapolated"][1]
        strains = [f"{limit[i]:.4f}" for i in (0, 1, 3, 4)]
        orders = [told_order(order) for order in each["orders"]]
        rows.append([each["case"], "extrapolated", "", *strains, *orders, ""])
    head = ["case", "mesh", "cells", "e1", "e2", "k1 pitch", "k2 pitch", "error at 20 kPa", "at 50 kPa"]
    lines += table([*head, "processor s"], rows)
    return [*lines, "", "Strains at 50 kPa."]


def contact_section(details):
    """Lines on `contact-grids` for docs/verification.md."""
    rows = []
    for mesh, r in details["meshes"].items():
        name = f"hexahedra, {DEFAULT:g} mm" if mesh == "default" else f"cut in {mesh}"
        strains = [f"{r['strains_e_k_pitch'][i]:.4f}" for i in (0, 3)]
        rows.append([name, r["cells"], *strains, f"{r['error_rel']:.2%}"])
    strains = [f"{details['extrapolated'][i]:.4f}" for i in (0, 3)]
    rows.append(["extrapolated", "", *strains, told_order(details["order"])])
    lines = ["## Touching walls on grids", "", *CONTACT, ""]
    return lines + table(["mesh", "cells", "e1", "k1 pitch", "error"], rows)
