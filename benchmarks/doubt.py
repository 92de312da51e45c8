"""Figures of the law's doubt: what it and error bars cost, how well it agrees with the exact deviation of its
Gaussian processes; and what `pneunet shape` of the demo costs, most of which it once was."""

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.rod import best_seconds

ROOT = Path(__file__).resolve().parent.parent
#: random designs of each kind, as a campaign draws them, at pressures up to the training's highest; and the
#: same as far out of the middle again as so many times, at up to twice that
DESIGNS, TOP, OUT = 4000, 0.35, 1.6
PRESSURE = 0.02  # MPa


def doubt():
    """The part `doubt`."""
    from pneunet.reduced.choice import shipped_law

    law = shipped_law()
    found = {kind: agreement(law.kinds[kind]) for kind in law.kinds}
    figures = {
        "law_doubt_agreement": min(rows["agreement"] for kind in found.values() for rows in kind.values()),
        "law_doubt_hidden_rel": max(rows["hidden"] for kind in found.values() for rows in kind.values()),
    }
    return figures | costs() | shape_command(), found


def agreement(law):
    """{"in range" and "around it": how a KindLaw's verdicts compare with those of its exact deviation}."""
    from pneunet.geometry.shape_numbers import numbers_of
    from pneunet.hifi.runs.campaign.sample import RANGES, segments

    random = np.random.default_rng(1)
    shape, _ = numbers_of(segments(law.kind, RANGES[law.kind], DESIGNS, 12345))
    pressure = random.uniform(0, TOP, DESIGNS)
    further = shape.mean(axis=0) + random.uniform(1, OUT, (DESIGNS, 1)) * (shape - shape.mean(axis=0))
    further[:, :13] = np.maximum(further[:, :13], 0.02)
    inside = (law.excess(shape, pressure)[:, [*range(len(law.low)), -1]] == 0).all(axis=1)
    return {
        "in range": compared(law, shape[inside], pressure[inside]),
        "around it": compared(law, further, random.uniform(0, 2 * TOP, DESIGNS)),
    }


def compared(law, shape, pressure):
    """The share of states whose verdict is the exact one's; the largest exact deviation, over the largest
    that counts as known, of those told known; and the shares doubted and decided by landmarks."""
    _, _, there = law.path.at(shape, pressure)
    exact = law.path.learned.processes[0].deviation(there)[:, 0]
    told = law.path.deviation(there, law.known) > law.known
    return {
        "states": len(told),
        "agreement": float((told == (exact > law.doubt)).mean()),
        "hidden": float(exact[~told].max() / law.doubt),
        "doubted": float(told.mean()),
        "decided by landmarks": float((law.path.deviation(there, np.inf) <= law.known).mean()),
    }


def costs():
    """What calls of the shipped law cost, the dearer kind's, CPU time on one core."""
    from pneunet.geometry.reference_cases import CASES

    both = [costs_of(case) for case in (CASES["twist_w12"](60.0, 5), CASES["one_sided_w10"](60.0, 6))]
    return {name: max(one[name] for one in both) for name in both[0]}


def costs_of(segment):
    from pneunet.geometry.shape_numbers import numbers_of
    from pneunet.reduced import read_law
    from pneunet.reduced.choice import SHIPPED

    law, (shape, _), pressure = read_law(SHIPPED), numbers_of([segment]), np.array([0.1])
    section, known = law.of(segment), law.kinds[segment.kind]
    doubted = replace(known, doubt=1e-6)  # whatever landmarks say, all inducing points are asked
    start = time.process_time()
    doubted.excess(shape, pressure)
    first = time.process_time() - start
    _, beyond, there = known.path.at(shape, pressure)
    state = shape, pressure, there, beyond
    section.half_width(PRESSURE)
    return {
        "law_doubt_first_ms": 1e3 * first,
        "law_doubt_us": 1e6 * best_seconds(lambda: known.excess_there(*state), 50),
        "law_doubt_open_us": 1e6 * best_seconds(lambda: doubted.excess_there(*state), 50),
        "law_doubt_whole_us": 1e6 * best_seconds(lambda: law.excess(segment, PRESSURE), 50),
        "law_error_bar_us": 1e6 * best_seconds(lambda: section.half_width(PRESSURE), 20),
    }


def shape_command():
    """`pneunet shape` of the demo's design, in a process of its own, after one that leaves the modules
    compiled."""
    with tempfile.TemporaryDirectory() as folder:
        design = Path(folder) / "design.toml"
        run("design", "design/data/octopus.toml", "-o", folder)
        run("shape", str(design))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        peak = run("shape", str(design))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"shape_command_cpu_seconds": seconds, "shape_command_peak_MB": peak}


def run(*arguments):
    """A pneunet command's largest memory, MB; its processor time is counted among the children's."""
    code = (
        "import sys; from pneunet.cli import main; sys.argv[0] = 'pneunet'\n"
        "try: main()\n"
        "finally: print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0], file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return int(done.stderr.split()[-1]) / 1024
