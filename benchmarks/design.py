"""The part `design`: random targets, the paper's own as raw curves, seconds, derivatives."""

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace

import numpy as np

from benchmarks import design_targets
from pneunet.base.curve import Curve
from pneunet.design.target.metrics import compare

#: of the length: bars of a design that follows its target
RMS, HAUSDORFF = 5e-3, 1.5e-2


def designed(case):
    """(seconds of CPU, [Errors against the exact curve of each shape], Design) of a Case."""
    from pneunet.design.inverse_design import inverse_design

    start = time.process_time()
    design = inverse_design(case.target)
    seconds = time.process_time() - start
    lines = [design.prediction, *design.further_predictions]
    return seconds, [compare(line.points, Curve(exact)) for line, exact in zip(lines, case.exact)], design


def row(case):
    """What a Case came to, for the meta data; nan where nothing was found."""
    told = {"name": case.target.name, "length_mm": case.target.length, "unseen": case.unseen}
    try:
        seconds, errors, design = designed(case)
    except Exception as error:  # a target that ends without a design counts as missed
        return told | {
            "rms_rel": [np.nan],
            "hausdorff_rel": np.nan,
            "error": f"{type(error).__name__}: {error}",
        }
    rms = [e.rms / e.reference_length for e in errors]
    found = {
        "rms_rel": rms,
        "hausdorff_rel": max(e.hausdorff / e.reference_length for e in errors),
        "segments": len(design.manipulator.segments),
        "followed": design.followed,
        "seconds": seconds,
    }
    return told | found


def rows(cases):
    """A row of each, shown as they come."""
    out = []
    for case in cases:
        out.append(row(case))
        print("  ", out[-1], flush=True)
    return out


def share(found, rms, hausdorff=np.inf):
    """Of rows: those whose shapes all lie within both, of the length."""
    met = [max(r["rms_rel"]) <= rms and r["hausdorff_rel"] <= hausdorff for r in found]
    return float(np.mean(met))


def random_targets():
    """Figures of the random targets, and the rows."""
    found = {
        name: rows(cases())
        for name, cases in (
            ("reachable", design_targets.reachable),
            ("planar", design_targets.planar),
            ("gravity", design_targets.under_gravity),
            ("pressures", design_targets.two_pressures),
        )
    }
    figures = {
        "design_reachable_success": share(found["reachable"], RMS, HAUSDORFF),
        "design_planar_success": share(found["planar"], RMS),
        "design_gravity_rms_rel_max": float(max(max(r["rms_rel"]) for r in found["gravity"])),
        "design_two_pressures_success": share(found["pressures"], 1e-2),
    }
    return figures, found


def raw(name):
    """The shipped target's curve without its split; those with a twist at the base get the section frames of
    the rod that they are points of."""
    from pneunet.base.strains import RodStrains
    from pneunet.design.target.target import Target
    from pneunet.reduced.rod.centreline import centreline

    target = Target.read(name)
    if not any(p.kind == "twisting" for p in target.pieces):
        return replace(target, pieces=())
    rates = [[p.twist or 0.0, p.curvature or 0.0, 0.0] for p in target.pieces]
    strains = RodStrains([[1.0, 0, 0]] * len(rates), rates)
    line = centreline([p.length for p in target.pieces], strains, 1.0)
    frames = line.at(np.clip(target.curve.arc_lengths, 0, line.s[-1]))
    assert np.linalg.norm(frames[:, :3, 3] - target.points, axis=1).max() < 0.05  # they are its points
    return replace(target, pieces=(), frames=frames[:, :3, :3])


def papers_targets():
    """RMS of the raw octopus and tentacle2 in mm, of vase and pear over the length."""
    from pneunet.design.inverse_design import inverse_design

    errors = {name: inverse_design(raw(name)).errors for name in ("octopus", "tentacle2", "vase", "pear")}
    figures = {f"{name}_raw_rms_mm": errors[name].rms for name in ("octopus", "tentacle2")}
    for name in ("vase", "pear"):
        figures[f"{name}_raw_rms_rel"] = errors[name].rms / errors[name].reference_length
    return figures


def seconds():
    """CPU seconds of a raw 200-point curve to four segments, files and picture included, in a process that
    has imported everything; and of the whole command."""
    code = (
        "import sys, time; from benchmarks.design import four_segments; from pathlib import Path;"
        "print(four_segments(Path(sys.argv[1])))"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, "-c", code, folder], capture_output=True, text=True, check=True, env=environment
        )
        command = [
            sys.executable,
            "-m",
            "pneunet",
            "design",
            f"{folder}/curve.csv",
            "-o",
            f"{folder}/command",
        ]
        before = os.times()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
        after = os.times()
    spent = after.children_user - before.children_user + after.children_system - before.children_system
    return {"design_seconds_4seg": float(done.stdout.split()[-1]), "design_command_seconds": spent}


def four_segments(folder):
    """CPU seconds of the design of the first random target with four segments, 200 points of it."""
    from pneunet.design.inverse_design import run_design
    from pneunet.geometry.parameters import Manipulator, Segment
    from pneunet.reduced import predict, shipped_law

    angles, counts = (60.0, 90.0, 115.0), (7, 8, 7)
    bent = [Segment("one-sided", a, n, chamber_height=4.5, gap=1.5) for a, n in zip(angles, counts)]
    twist = Segment("twisting", 65.0, 6, gap=2.0, cavity_floor=0.5, chamber_height=5.5)
    line = predict(Manipulator((bent[0], twist, *bent[1:])), 0.04, shipped_law(), 0.5)
    even = np.interp(np.linspace(0, line.length, 200), line.arc_length, line.s)
    noise = 0.1 * np.random.default_rng(design_targets.SEED).standard_normal((200, 3))
    points = line.at(even)[:, :3, 3] + noise
    np.savetxt(folder / "curve.csv", points, "%.4f", ",", header="x_mm,y_mm,z_mm", comments="")
    run_design(folder / "curve.csv", folder / "first", shipped_law())  # imports, caches
    start = time.process_time()
    run_design(folder / "curve.csv", folder / "second", shipped_law())
    return time.process_time() - start


def gradient():
    """Largest difference of the search's derivatives from differences of the fourth order, over the largest
    column."""
    from pneunet.reduced import shipped_law
    from tests.design.test_gradient import differences, problem

    these = problem(shipped_law())
    x, scale = these.x + np.append(0 * these.x[:-3], [0.1, -0.2, 0.15]), these.bounds[2]
    at = these.evaluate(x)
    error = np.linalg.norm((at.jacobian - differences(these.evaluate, x, scale)) * scale, axis=0).max()
    return {"design_gradient_rel": float(error / np.linalg.norm(at.jacobian * scale, axis=0).max())}


def design():
    """The part `design`."""
    figures, found = random_targets()
    return figures | papers_targets() | seconds() | gradient(), found
