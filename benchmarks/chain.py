"""Figures of the whole chain: set-up, demo, tests, agreement of ranks."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def setup():
    """Seconds that containers/setup.sh took on a fresh Debian 13 root, as it noted while the image was
    built."""
    script = (
        '. containers/tool.sh; tool="$(container_tool)"; in_image "$1" cat /opt/pneunet/.venv/setup-seconds'
    )
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            ["bash", "-c", script, "bash", folder], cwd=ROOT, capture_output=True, text=True
        )
    if done.returncode or not done.stdout.split():
        sys.exit(f"bench: no image to ask; run make image first ({done.stderr.strip()[-200:]})")
    return {"setup_seconds": sum(float(word) for word in done.stdout.split())}


def ranks():
    """Largest relative difference between 1 and 2 ranks over the numbers of
    hifi/verification/reference_case.py."""
    from pneunet.hifi.verification import reference_case

    with tempfile.TemporaryDirectory() as folder:
        one, two = (reference_case.on_ranks(n, Path(folder) / f"{n}.json") for n in (1, 2))
    return {"rank_agreement_rel": reference_case.largest_difference(one, two)}


def resume():
    """Largest displacement difference, relative to the largest displacement, of a killed and resumed run from
    a whole one."""
    import numpy as np

    from tests.pneunet.test_resume import SOLVE, reached, solve

    with tempfile.TemporaryDirectory() as folder:
        whole, killed = Path(folder) / "whole", Path(folder) / "killed"
        solve(whole, "--no-fields").check_returncode()
        command = [sys.executable, "-m", "pneunet", *SOLVE, "-o", str(killed), "--no-fields"]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
            while reached(killed) < 2 and process.poll() is None:
                time.sleep(0.01)
            process.kill()
        step = reached(killed)
        solve(killed, "--no-fields", "--resume", ranks=2).check_returncode()
        ends = []
        for each in (whole, killed):
            with np.load(each / "solve" / "checkpoint.npz") as stored:
                ends.append(stored["displacement_mm"][len(stored["parameter"]) - 1])
    a, b = ends
    return {"resume_agreement_rel": float(np.abs(a - b).max() / np.abs(a).max())}, {"killed_after_step": step}


def demo():
    """`make demo` from an empty output folder."""
    import shutil

    shutil.rmtree(ROOT / "out" / "demo", ignore_errors=True)
    start = time.perf_counter()
    subprocess.run(["make", "demo"], cwd=ROOT, check=True)
    seconds = time.perf_counter() - start
    from pneunet.design.report.comparison import Comparison
    from pneunet.design.report.rundata import read_design_folder
    from pneunet.reduced import choose_law

    designed = read_design_folder(ROOT / "out" / "demo")
    comparison = Comparison.of(designed, choose_law(designed.law))
    run = json.loads((ROOT / "out" / "demo" / "solve" / "run.json").read_text())
    return {
        "demo_seconds": seconds,
        "demo_reduced_vs_fe_rms_percent_of_length": comparison.reduced_solved.percent(
            comparison.reduced_solved.rms
        ),
        "demo_fe_vs_target_rms_percent_of_length": comparison.solved_target.percent(
            comparison.solved_target.rms
        ),
        "demo_pressure_reached_kPa": run["pressure_reached_kPa"],
    }


def test():
    """`make test` with a form cache of its own that starts empty."""
    with tempfile.TemporaryDirectory() as cache:
        start = time.perf_counter()
        subprocess.run(["make", "test"], cwd=ROOT, check=True, env={**os.environ, "XDG_CACHE_HOME": cache})
        return {"test_seconds": time.perf_counter() - start}


def long_segment():
    """Steps and factorisations of the case one-sided-long, 26 chambers at 60 degrees, 0-50 kPa, mesh 2 mm."""
    from pneunet.geometry import Manipulator
    from pneunet.geometry.cad.mesh import mesh_manipulator
    from pneunet.geometry.reference_cases import CASES
    from pneunet.hifi.body.manipulator import ManipulatorSolve

    body = Manipulator((CASES["one_sided_long"](angle=60.0, chambers=26),))
    with tempfile.TemporaryDirectory() as folder:
        mesh_manipulator(body, 2.0, folder, "tetrahedra")
        solve = ManipulatorSolve(body, Path(folder) / "manipulator.npz")
        start, result = time.perf_counter(), solve.run(0.05)
        seconds = time.perf_counter() - start
    figures = {
        "long_segment_steps": len(result.steps),
        "long_segment_factorisations": solve.system.factorisations,
    }
    details = {
        "dofs": solve.problem.dofs,
        "ranks": 1,
        "wall_seconds": seconds,
        "failed_attempts": len(result.failures),
    }
    solve.destroy()
    return figures, details
