"""Figures of running elsewhere: jobs on a real SLURM that is started for it, continuous integration from a
clean clone."""

import csv
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pneunet.base.files.reading import read_json
from tests import slurm
from tests.pneunet.test_resume import SOLVE

ROOT = Path(__file__).resolve().parent.parent
STUDY = """kind = "cell"
levels = 2
[base]
pressure_kPa = 10
mesh_size_mm = 3
material.mu_MPa = 0.3
[base.segment]
kind = "one-sided"
[grid]
angle_deg = [60, 70, 80, 90]
"""
#: images of podman and buildah in a folder
STORAGE = """[storage]
driver = "overlay"
graphroot = "{folder}/images"
runroot = "{folder}/run"
"""


def on_slurm():
    """A study and a solve by examples/slurm/job.sh, both told in the midst that their time is over: jobs that
    went back into the queue, on from what was on disk, and to the end."""
    if why := slurm.missing():
        sys.exit(f"bench: {why}")
    with slurm.private_slurm() as env, tempfile.TemporaryDirectory() as folder:
        env["PNEUNET"] = str(Path(sys.executable).with_name("pneunet"))
        done = [_study(env, Path(folder)), _solve(env, Path(folder))]
        version = subprocess.check_output(["sbatch", "--version"], env=env, text=True).strip()
    return {"slurm_jobs_resumed_of_2": sum(done)}, {"version": version}


def _study(env, folder):
    """Whether the second start left the first one's cases as they were and did the others."""
    (folder / "study.toml").write_text(STUDY)
    records = folder / "study" / "cases"
    job = slurm.Job.submit(env, folder, ["study", "study.toml", "-o", "study"])
    job.wait_for(lambda: list(records.glob("*/record.json")))
    job.time_is_over()
    kept = {path: path.stat().st_mtime_ns for path in records.glob("*/record.json")}
    job.wait_for(lambda: job.state() == "COMPLETED")
    with open(folder / "study" / "study.csv", newline="") as stream:
        finished = [row for row in csv.DictReader(stream) if row["pressure_kPa"] == "10"]
    same = all(path.stat().st_mtime_ns == written for path, written in kept.items())
    return same and 1 <= len(kept) < 4 and [row["status"] for row in finished] == 4 * ["done"]


def _solve(env, folder):
    """Whether the second start went on from a step of the first and reached its end."""
    out = folder / "solve"
    job = slurm.Job.submit(env, folder, [*SOLVE, "-o", out, "--resume"])
    job.wait_for((out / "solve" / "checkpoint.npz").exists)
    job.time_is_over()
    job.wait_for(lambda: job.state() == "COMPLETED")
    record = read_json(out / "solve" / "run.json")
    return record["resumed_after_step"] >= 1 and record["status"].startswith("reached")


def ci():
    """Minutes that .ci/run takes in a clean clone, with empty caches of compiled forms and of pip, and of
    images where podman or buildah keeps them. Debian packages that this machine has are not installed
    again."""
    with tempfile.TemporaryDirectory() as folder:
        clone, storage = Path(folder) / "clone", Path(folder) / "storage.conf"
        subprocess.run(["git", "clone", "-q", ROOT, clone], check=True)
        storage.write_text(STORAGE.format(folder=folder))
        cold = {"XDG_CACHE_HOME": f"{folder}/cache", "CONTAINERS_STORAGE_CONF": str(storage), "CI": "true"}
        start = time.perf_counter()
        subprocess.run(
            ["bash", ".ci/run"], cwd=clone, env=os.environ | cold, stdin=subprocess.DEVNULL, check=True
        )
        return {"ci_minutes_cold": (time.perf_counter() - start) / 60}
