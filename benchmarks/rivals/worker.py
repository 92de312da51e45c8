"""One ramp in a process of its own: `python worker.py CODE STRATEGY MESH_FOLDER RESULT.npz [TOLERANCE]`.

Timed is the ramp: assembly, analysis and factorisation, solutions, updates. Not timed: imports, compilation, reading the
mesh, spaces and sparsity patterns, one assembly to warm up. Prints one line of JSON; RESULT.npz holds points (n, 3) and
displacements (n, 3) in mm at the last load.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np


def make_body(code, folder):
    if code == "pneunet":
        from our_body import OurBody

        return OurBody(folder / "manipulator.msh")
    mesh = dict(np.load(folder / "mesh.npz"))
    if code == "felupe":
        from felupe_body import FElupeBody

        return FElupeBody(mesh)
    from ngsolve_body import NGSolveBody

    return NGSolveBody(mesh)


def main(code, strategy, folder, result, tolerance=None):
    from ramp import RELATIVE_TOLERANCE, STRATEGIES

    body = make_body(code, Path(folder))
    body.balance(0.0)
    for name in body.seconds:
        body.seconds[name] = 0.0
    wall, cpu = time.perf_counter(), time.process_time()
    steps = STRATEGIES[strategy](body, float(tolerance or RELATIVE_TOLERANCE))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    points, displacements = body.displacements()
    np.savez(result, points=points, displacements=displacements)
    facts = {"seconds": wall, "cpu_seconds": cpu, "dofs": body.dofs, "factorisations": body.factorisations}
    print(json.dumps(facts | {"iterations": sum(s[1] for s in steps), "steps": steps, "parts": body.seconds}))


if __name__ == "__main__":
    main(*sys.argv[1:])
