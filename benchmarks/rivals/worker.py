"""One measurement in a process of its own: `python worker.py CODE TASK MESH_FOLDER [RESULT.npz [TOLERANCE]]`.

CODE: pneunet, felupe or ngsolve. TASK: a strategy of `ramp`, "operations", or for pneunet "best" (hifi's own
stepping). Timed is the ramp: assembly, analysis and factorisation, solutions, updates. Not timed: imports,
compilation, reading the mesh, spaces and sparsity patterns, one assembly to warm up. Prints one line of JSON;
RESULT.npz holds points (n, 3) and displacements (n, 3) in mm at the last load (of one rank).
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import ramp


def make_body(code, task, folder):
    if code == "pneunet":
        from our_body import BestBody, OurBody

        return (BestBody if task == "best" else OurBody)(folder / "manipulator.npz")
    mesh = dict(np.load(folder / "mesh.npz"))
    if code == "felupe":
        from felupe_body import FElupeBody

        return FElupeBody(mesh)
    from ngsolve_body import NGSolveBody

    return NGSolveBody(mesh)


def main(code, task, folder, result=None, tolerance=ramp.RELATIVE_TOLERANCE):
    body = make_body(code, task, Path(folder))
    body.warm_up()
    wall, cpu = time.perf_counter(), time.process_time()
    facts = ramp.TASKS[task](body, float(tolerance))
    facts |= {
        "seconds": time.perf_counter() - wall,
        "cpu_seconds": time.process_time() - cpu,
        "dofs": body.dofs,
    }
    if result:
        points, displacements = body.displacements()
        np.savez(result, points=points, displacements=displacements)
    if body.speaks:
        print(json.dumps(facts))


if __name__ == "__main__":
    main(*sys.argv[1:])
