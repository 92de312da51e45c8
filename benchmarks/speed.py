"""How fast the finite elements are: against FElupe and NGSolve on the same mesh, over mesh size, on two
ranks.

Every measurement is a process of its own, one after another, one thread a rank, the codes in turn; the least
wall seconds count, all of them are kept in the details (results.meta.json), process seconds too. `page`
writes docs/speed.md.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.rivals import environment, meshes
from benchmarks.tables import table
from pneunet.base.system import launch

ROOT = Path(__file__).resolve().parent.parent
MESHES = ROOT / "out" / "bench" / "speed"
WORKER = ROOT / "benchmarks" / "rivals" / "worker.py"
RIVALS = ("felupe", "ngsolve")
CODES = ("pneunet", *RIVALS)
NAMES = {"pneunet": "pneunet", "felupe": "FElupe", "ngsolve": "NGSolve"}
OPERATIONS = ("residual", "tangent", "factorise", "solve")
TIGHT = 1e-11  # relative tolerance where displacements are compared
#: mm: the coarse grid of the ramps, and that of usual size
COARSE, DEFAULT = 4.0, 1.5
SCALING_MESHES = (COARSE, 2.0, 1.25)
RANKS_MESH = 1.2  # mm, some 150k dofs


def mesh(size):
    return meshes.make(MESHES / f"hexahedra-{size:g}", size)


def work(code, task, size, *more, ranks=1):
    """Facts (a dict) that benchmarks/rivals/worker.py prints about this code, task and mesh size."""
    arguments = [str(a) for a in (WORKER, code, task, mesh(size), *more)]
    if code == "pneunet":
        command = (
            launch.command_line(ranks, ["--", sys.executable, *arguments])
            if ranks > 1
            else [sys.executable, *arguments]
        )
        variables = launch.environment() | environment.ONE_THREAD | {"PYTHONPATH": str(ROOT)}
    else:
        command, variables = [environment.python(), *arguments], environment.variables()
    done = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"bench: {code} {task} at {size:g} mm failed: {done.stderr.strip()[-500:]}")
    facts = json.loads(done.stdout.strip().splitlines()[-1])
    print(
        f"  {code} {task} h={size:g} ranks={ranks}: {facts['seconds']:.2f} s, of the processor"
        f" {facts['cpu_seconds']:.2f}",
        flush=True,
    )
    return facts


def in_turn(runs, repeats):
    """{label: facts of its fastest run, with all seconds} of runs {label: (code, task, size, *more)}, the
    labels in turn."""
    done = {label: [] for label in runs}
    for _ in range(repeats):
        for label, arguments in runs.items():
            done[label].append(work(*arguments))
    return {label: noted(all_of_it) for label, all_of_it in done.items()}


def noted(all_of_it):
    best = min(all_of_it, key=lambda facts: facts["seconds"])
    wall, cpu = ([facts[name] for facts in all_of_it] for name in ("seconds", "cpu_seconds"))
    return best | {
        "all_seconds": wall,
        "all_cpu_seconds": cpu,
        "median_seconds": float(np.median(wall)),
        "largest_seconds": max(wall),
    }


def ratio(ours, theirs):
    """Our least seconds over those of the faster of theirs."""
    return ours["seconds"] / min(facts["seconds"] for facts in theirs)


def ramps():
    """(figures, details) of the ramp twist-w12, 60 degrees, three pairs of chambers, 0 to 50 kPa."""
    same = {(code, "same"): (code, "same") for code in CODES}
    stock = {(code, "stock"): (code, "stock") for code in RIVALS}
    best = {("pneunet", "best"): ("pneunet", "best")}
    coarse = in_turn({label: (*run, COARSE) for label, run in (same | best | stock).items()}, 3)
    default = in_turn({label: (*run, DEFAULT) for label, run in (same | best).items()}, 2)

    def theirs(facts, strategy):
        return [facts[code, strategy] for code in RIVALS]

    ours, our_best = ("pneunet", "same"), ("pneunet", "best")
    figures = {
        "ramp_ratio_same_strategy_coarse": ratio(coarse[ours], theirs(coarse, "same")),
        "ramp_ratio_same_strategy": ratio(default[ours], theirs(default, "same")),
        "ramp_ratio_best": ratio(default[our_best], theirs(default, "same")),
        "ramp_ratio_stock_coarse": ratio(coarse[our_best], theirs(coarse, "stock")),
        "ramp_factorisations": default[our_best]["factorisations"],
    }
    found = [
        (size, *label, facts)
        for size, by_label in ((COARSE, coarse), (DEFAULT, default))
        for label, facts in by_label.items()
    ]
    runs = [
        {"mesh_size_mm": size, "code": code, "strategy": strategy, **facts}
        for size, code, strategy, facts in found
    ]
    return figures | agreement(), {"runs": runs}


def agreement():
    """Relative difference (2-norm over common points) of the displacements at 50 kPa, tight tolerance, on
    the coarse grid."""
    from scipy.spatial import cKDTree

    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for code in CODES:
            path = Path(folder) / f"{code}.npz"
            work(code, "same", COARSE, path, TIGHT)
            found[code] = dict(np.load(path))
    ours = found["pneunet"]
    tree = cKDTree(ours["points"])
    figures = {}
    for code in RIVALS:
        distance, which = tree.query(found[code]["points"])
        assert distance.max() < 1e-9, "not the same mesh"
        theirs = found[code]["displacements"]
        figures[f"{code}_agreement_rel"] = float(
            np.linalg.norm(ours["displacements"][which] - theirs) / np.linalg.norm(theirs)
        )
    return figures


def scaling():
    """(figures, details): seconds of our operations on three meshes and the exponents of their growth with
    the dofs."""
    rows = [{"mesh_size_mm": size, **work("pneunet", "operations", size)} for size in SCALING_MESHES]
    dofs = np.log([row["dofs"] for row in rows])
    exponents = {name: np.polyfit(dofs, np.log([row[name] for row in rows]), 1)[0] for name in OPERATIONS}
    return {f"{name}_exponent": float(value) for name, value in exponents.items()}, {"operations": rows}


def two_ranks():
    """(figures, details): the first two steps of the ramp at some 150k dofs on one and on two ranks, best of
    two."""
    done = {1: [], 2: []}
    for _ in range(2):
        for ranks, all_of_it in done.items():
            all_of_it.append(work("pneunet", "begin", RANKS_MESH, ranks=ranks))
    facts = {ranks: noted(all_of_it) for ranks, all_of_it in done.items()}
    return {"ranks2_speedup_150k": facts[1]["seconds"] / facts[2]["seconds"]}, {
        "ranks": [{"ranks": r, **f} for r, f in facts.items()]
    }


def page(results, meta):
    """docs/speed.md from the figures and the details of the parts; parts not measured are left out."""
    details = {part: meta.get(part, {}).get("details", {}) for part in ("speed", "scaling", "ranks2")}
    lines = [
        "# Speed",
        "",
        "Made by `make bench` and `python -m benchmarks --snapshot` (benchmarks/speed.py); do not edit.",
        "",
        *ABOUT,
    ]
    if details["speed"]:
        lines += [
            "",
            "## The same ramp in three codes",
            "",
            *_ramp_table(details["speed"]["runs"]),
            "",
            *_figures(results, RAMP_FIGURES),
        ]
    if details["scaling"]:
        lines += [
            "",
            "## Our operations over the number of unknowns",
            "",
            *_scaling_table(results, details["scaling"]["operations"]),
        ]
    if details["ranks2"]:
        lines += ["", "## Two ranks", "", *_ranks_table(results, details["ranks2"]["ranks"])]
    return "\n".join(lines) + "\n"


ABOUT = """\
**Problem.** Case twist-w12 (60 degrees, three pairs of chambers), neo-Hookean, incompressible, Q2/Q1 on
the sheared grid of hexahedra, clamped at its base, follower pressure 0 to 50 kPa, relative tolerance 1e-8 of
the pressure load, 27 Gauss points (9 on facets). All codes build the same vertices and cells and integrate at
the same points. *h* is the largest element, 1.5 mm the usual one.

**Solvers.** One thread each, at the fastest of the settings tried
([which](decisions.md#rivals-run-at-their-fastest-settings)):

- pneunet: MUMPS LDL^T on OpenBLAS;
- FElupe: numpy assembly by its own integral forms, a hand-written energy, only the upper triangle assembled
  into a fixed pattern; MKL PARDISO LDL^T with METIS, two-level factorisation, no iterative refinement;
- NGSolve: an energy compiled to C++, symmetric storage; the same MKL PARDISO.

**Strategies.**

- *same*: steps to 2.5, 5, 10 .. 50 kPa, quadratic extrapolation, a new factorisation when an iteration
  lowers the residual by less than 3.3 times;
- *best*: `hifi`'s own stepping (its factorisations include the tangent's assembly);
- *stock*: full Newton without predictor in steps of 2.5 kPa, the largest that arrive.

Timed is the ramp: assembly, symbolic and numeric factorisation, solutions and updates. Meshing, imports,
compilation and sparsity patterns are not timed.""".splitlines()
RAMP_FIGURES = {
    "ramp_ratio_same_strategy_coarse": "same strategy, h = 4 mm, ours over the faster of theirs",
    "ramp_ratio_same_strategy": "same strategy, h = 1.5 mm",
    "ramp_ratio_best": "our best strategy over their *same*, h = 1.5 mm",
    "ramp_ratio_stock_coarse": "our best strategy over their *stock*, h = 4 mm",
    "felupe_agreement_rel": "displacements at 50 kPa against FElupe, relative",
    "ngsolve_agreement_rel": "displacements at 50 kPa against NGSolve, relative",
}


def _figures(results, meaning):
    return table(
        ["what", "value"], [[text, f"{results[key]:.3g}"] for key, text in meaning.items() if key in results]
    )


def _ramp_table(runs):
    rows = []
    for f in sorted(
        runs, key=lambda f: (-f["mesh_size_mm"], ("same", "best", "stock").index(f["strategy"]), f["seconds"])
    ):
        seconds = [f"{f[name]:.2f}" for name in ("seconds", "median_seconds", "largest_seconds")]
        parts = [f"{f['parts'][name]:.2f}" if name in f["parts"] else "" for name in OPERATIONS]
        counts = [f["iterations"], f["factorisations"]]
        rows.append(
            [
                f["mesh_size_mm"],
                f["dofs"],
                f["strategy"],
                NAMES[f["code"]],
                *seconds,
                f"{f['cpu_seconds']:.2f}",
                *counts,
                *parts,
            ]
        )
    head = [
        "h, mm",
        "dofs",
        "strategy",
        "code",
        "least s",
        "median",
        "largest",
        "processor s",
        "iterations",
        "factorisations",
    ]
    return table([*head, *(f"{name}, s" for name in OPERATIONS)], rows)


def _scaling_table(results, operations):
    rows = [[f["mesh_size_mm"], f["dofs"], *(f"{f[name]:.4f}" for name in OPERATIONS)] for f in operations]
    rows.append(["exponent", "", *(f"{results[f'{name}_exponent']:.2f}" for name in OPERATIONS)])
    return table(["h, mm", "dofs", *(f"{name}, s" for name in OPERATIONS)], rows)


def _ranks_table(results, runs):
    rows = [[f["ranks"], f["dofs"], f"{f['seconds']:.2f}", f"{f['largest_seconds']:.2f}"] for f in runs]
    speedup = (
        f"Two ranks are {results['ranks2_speedup_150k']:.2f} times as fast as one on the ramp's first two"
        " steps."
    )
    return [*table(["ranks", "dofs", "least s", "largest s"], rows), "", speedup]
