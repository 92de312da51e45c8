"""Figures of self-contact in the unit cell twist-w15: distances, bias, sensitivity, an independent method, cost."""

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

SIZE, FINER = 2.0, 1.5
TOP = 0.05


def segment(name="twist_w15", angle=60.0, mu=0.317):
    from base.materials import NeoHookean
    from tests.cases import CASES

    return CASES[name](angle=angle, chambers=1, material=NeoHookean(mu))


def run(folder, body, contact, pressure=TOP, levels=5, size=SIZE, medium=None):
    """(states, CPU seconds, path of the mesh, pressure of first touch or None)."""
    from hifi.cell_run import solve_cell
    from hifi.cellfile import CellCase

    case = CellCase(body, pressure, size, levels, contact=contact)
    case = replace(case, medium=medium) if medium else case
    path, states, touches = Path(folder) / f"{time.monotonic_ns()}.msh", [], []
    started = time.process_time()
    solve_cell(case, path, states.append, on_touch=touches.append)
    return states, time.process_time() - started, path, touches[0] if touches else None


def twist(state):
    """tau in rad/m of deformed length."""
    return state.strains.k[0] / state.strains.e[0] * 1e3


def farthest(states, gap):
    """Largest distance of walls where they push at each other, either side of zero, over the gap."""
    return max(max(abs(s.contact.nearest), abs(s.contact.farthest)) / gap for s in states if s.contact and s.contact.area)


def bias(folder, body, pressure, measure):
    """Relative difference of `measure` between the third medium and none at a pressure (MPa) at which nothing touches."""
    with_medium, without = (measure(run(folder, body, contact, pressure, 1)[0][-1]) for contact in ("third-medium", "none"))
    return abs(with_medium / without - 1)


def force_check(body, states, path):
    """({key: worst relative difference of the resultant from the penalty's at 10, 30 and 50 kPa}, [(kPa, N, N), ...]).

    Where the penalty finds no equilibrium its force is None, and there is no figure.
    """
    from benchmarks import wall_penalty
    from hifi.solver import NotConverged
    from hifi.walls import CellWalls

    rows = []
    for state in states:
        if any(abs(state.pressure - p) < 1e-9 for p in (0.01, 0.03, 0.05)):
            problem = wall_penalty.PenaltyCell(body, path, CellWalls)
            strains = np.concatenate([state.strains.e, state.strains.k])
            try:
                forces = wall_penalty.solve(problem, state.pressure, state.array, strains)[-1][0]
                checked = float(np.linalg.norm(forces, axis=1).max())
            except NotConverged:
                checked = None
            rows.append((state.pressure * 1e3, state.contact.force, checked))
    if any(checked is None for _, _, checked in rows):
        return {}, rows
    return {"contact_force_check_rel": max(abs(a / b - 1) for _, a, b in rows)}, rows


def contact():
    """The part `contact`: ({key: value}, details)."""
    from hifi.contact import ThirdMedium

    with tempfile.TemporaryDirectory() as folder:
        body = segment()
        run(folder, body, "third-medium", 0.001, 1, 3.0)  # compiles the forms
        run(folder, body, "none", 0.001, 1, 3.0)
        states, seconds, path, touch = run(folder, body, "auto")
        loose, loose_seconds, _, _ = run(folder, body, "none")
        one_sided = segment("one_sided_w10", mu=0.2068)
        figures = {
            "contact_tau_50kPa_rad_per_m": twist(states[-1]),
            "contact_cost_factor": seconds / loose_seconds,
            "contact_distance_rel_gap_60": farthest(states, body.gap),
            "contact_bias_twist_rel": bias(folder, body, 0.985 * touch, twist),
            "contact_bias_curvature_rel": bias(folder, one_sided, TOP, lambda s: np.linalg.norm(s.strains.k)),
        }
        for angle in (45, 75):
            figures[f"contact_distance_rel_gap_{angle}"] = farthest(run(folder, segment(angle=float(angle)), "auto")[0], body.gap)
        increment = twist(states[-1]) - twist(loose[-1])
        scaled = [twist(run(folder, body, "third-medium", levels=1, medium=ThirdMedium().scaled(f))[0][-1]) for f in (0.5, 2.0)]
        figures["contact_parameter_sensitivity_rel"] = max(abs(t - twist(states[-1])) for t in scaled) / increment
        fine = [twist(run(folder, body, c, levels=1, size=FINER)[0][-1]) for c in ("third-medium", "none")]
        figures["contact_mesh_sensitivity_rel"] = abs((fine[0] - fine[1]) / increment - 1)
        check, forces = force_check(body, states, path)
        figures |= check
    details = {
        "first_touch_kPa": touch * 1e3,
        "tau_kPa_with_and_without": [[s.pressure * 1e3, twist(s), twist(t)] for s, t in zip(states, loose)],
        "force_kPa_medium_and_penalty_N": forces,
        "tau_50kPa_halved_and_doubled_medium": scaled,
    }
    return figures, details
