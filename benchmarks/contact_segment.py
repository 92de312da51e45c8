"""The part `contact-segment`: five pairs of chambers of twist-w15 to 40 kPa, with contact and
without, on as many ranks as it is started on.

    pneunet run -n 2 -- python -m benchmarks.contact_segment FOLDER
writes FOLDER/segment.json: the twist of the middle pitch and the forces between walls, at the pressures of
`LEVELS`, and what it took.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from benchmarks.contact import ELEMENT, SIZE

ROOT = Path(__file__).resolve().parent.parent
CHAMBERS, RANKS = 5, 2
#: MPa. Not to 50 kPa: without contact chambers are far inside one another there, and no state is found from
#: 45 kPa on
LEVELS = (0.01, 0.02, 0.03, 0.04)


def run(folder):
    import time

    from mpi4py import MPI

    from pneunet.base import se3
    from pneunet.base.materials.laws import NeoHookean
    from pneunet.base.strains import RodStrains
    from pneunet.geometry import Manipulator
    from pneunet.geometry.cad.mesh import mesh_manipulator
    from pneunet.geometry.reference_cases import CASES
    from pneunet.hifi.body.manipulator import ManipulatorSolve
    from pneunet.hifi.contact.penalty import WallPenalty
    from pneunet.hifi.fem.agreement import on_rank_0

    segment = CASES["twist_w15"](angle=60.0, chambers=CHAMBERS, material=NeoHookean(0.317))
    comm, body = MPI.COMM_WORLD, Manipulator((segment,))
    on_rank_0(comm, lambda: mesh_manipulator(body, SIZE, folder, element=ELEMENT) and None)
    rows, seconds = [], []

    def note(m):
        stations = solve.sections.stations
        centre, pitch = solve.sections.segment_stations[0][CHAMBERS // 2], segment.pitch
        ends = [int(np.argmin(abs(stations - s))) for s in (centre - pitch / 2, centre + pitch / 2)]
        relative = se3.inverse_pose(m.frames[ends[:1]]) @ m.frames[ends[1:]]
        strains = RodStrains.from_relative_pose(relative, np.diff(stations[ends]))
        forces = np.linalg.norm(solve.problem.contact.forces(), axis=1)
        twist = strains.k[0, 0] / strains.e[0, 0] * 1e3
        rows.append({"pressure_kPa": m.pressure * 1e3, "twist_rad_per_m": twist, "forces_N": forces.tolist()})

    for contact, seen in ((None, lambda m: None), (WallPenalty(), note)):
        solve = ManipulatorSolve(body, folder / "manipulator.npz", contact=contact)
        started = time.process_time()
        solve.run(LEVELS[-1], seen, milestones=LEVELS[:-1], stability=False)
        seconds.append(comm.allreduce(time.process_time() - started))
        dofs = solve.problem.dofs
        solve.destroy()
    kept = [r for r in rows if any(abs(r["pressure_kPa"] - 1e3 * p) < 1e-6 for p in LEVELS)]
    facts = {
        "ranks": comm.size,
        "dofs": dofs,
        "cpu_seconds_without_and_with": seconds,
        "mesh_size_mm": SIZE,
        "chambers": CHAMBERS,
        "levels": kept,
    }
    on_rank_0(comm, lambda: (folder / "segment.json").write_text(json.dumps(facts)) and None)


def beside_cell(twists, folder):
    """({key: value}, details) of the segment on two ranks beside the cell's `twists` {pressure in MPa: rad/m}
    on the same mesh size."""
    from benchmarks.rivals import environment
    from pneunet.base.system import launch

    command = launch.command_line(
        RANKS, ["--", sys.executable, "-m", "benchmarks.contact_segment", str(folder)]
    )
    variables = launch.environment() | environment.ONE_THREAD | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"bench: contact in a segment failed: {done.stderr.strip()[-500:]}")
    facts = json.loads((Path(folder) / "segment.json").read_text())
    for level in facts["levels"]:
        level["cell_twist_rad_per_m"] = min(
            twists.items(), key=lambda item: abs(item[0] * 1e3 - level["pressure_kPa"])
        )[1]
    worst = max(
        abs(level["twist_rad_per_m"] / level["cell_twist_rad_per_m"] - 1) for level in facts["levels"]
    )
    without, with_contact = facts["cpu_seconds_without_and_with"]
    figures = {
        "contact_segment_vs_cell_rel": worst,
        "contact_segment_cost_factor": with_contact / without,
    }
    return figures, facts


if __name__ == "__main__":
    run(Path(sys.argv[1]))
