"""Runs that are killed with SIGKILL at random moments, and run again: the result is that of a run that nobody
killed, and nothing is left."""

import random
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np

from pneunet.base.files.dataset import read_dataset
from pneunet.base.files.schemas import CENTRELINE, CENTRELINES, read_table
from pneunet.hifi.verification.reference_case import DATA

KILLS, SEED, TOLERANCE = 20, 1, 1e-8
#: of each as little as shows a run that is killed half way
CAMPAIGN = """kinds = ["one-sided"]
designs = 2
held_out_every = 2
levels = 2
top_pressure_over_mu = 0.05
[[mesh]]
name = "coarse"
mesh_size_mm = 8
prescribed = 1
"""
TARGET = """points = "arc.csv"
pressure_kPa = 30
[vary]
chamber_height_mm = [3, 6]
[[piece]]
kind = "bending"
length_mm = 94.2
"""
#: a quarter of a circle
ARC = "x_mm,y_mm,z_mm\n" + "".join(
    f"{60 * np.sin(a):.9g},0,{60 * np.cos(a) - 60:.9g}\n" for a in np.linspace(0, np.pi / 2, 16)
)


def _columns(path, names):
    table = read_table(path, names)
    return np.concatenate([np.ravel(np.asarray(table[name], float)) for name in names])


def _solved(folder):
    with np.load(folder / "solve" / "checkpoint.npz") as stored:
        last = stored["displacement_mm"][len(stored["parameter"]) - 1]
    return np.concatenate([_columns(folder / "solve" / "centrelines.csv", CENTRELINES), last.ravel()])


def _gathered(folder):
    data = read_dataset(folder / "cells.npz")
    return np.concatenate([np.ravel(a) for a in (data.pressure, data.strains, data.forces, data.stiffness)])


def _designed(folder):
    found = tomllib.loads((folder / "design.toml").read_text())
    segments = [v for segment in found["segment"] for v in segment.values() if isinstance(v, float)]
    line = _columns(folder / "centreline.csv", CENTRELINE)
    return np.concatenate([[found["pressure_kPa"], *segments], line])


#: command -> (its arguments, what it is given when it goes on, what it has found as numbers)
COMMANDS = {
    "solve": (
        [str(DATA / "reference.toml"), "--mesh-size-mm", "6", "--pressure-kPa", "20", "--no-fields"],
        ["--resume"],
        _solved,
    ),
    "campaign": (["campaign.toml"], [], _gathered),
    "design": (["arc.toml", "--law", "analytic"], [], _designed),
}


def survived(command: str, kills: int) -> list[bool]:
    """Of each of `kills` runs whether, killed and run again, it ended as a run that nobody killed."""
    arguments, going_on, found = COMMANDS[command]
    moments = random.Random(f"{command} {SEED}")
    line, out = [sys.executable, "-P", "-m", "pneunet", command, *arguments, "-o"], []
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / "campaign.toml").write_text(CAMPAIGN)
        (Path(place) / "arc.toml").write_text(TARGET)
        (Path(place) / "arc.csv").write_text(ARC)

        def start(folder, *options):
            return subprocess.Popen([*line, folder, *options], cwd=place, stdout=subprocess.DEVNULL)

        def finish(process):
            if process.wait():
                raise RuntimeError(f"{process.args} ended with exit code {process.returncode}")

        started = time.perf_counter()
        finish(start("whole"))
        length, whole = time.perf_counter() - started, found(Path(place) / "whole")
        for number in range(kills):
            folder, share, ended = Path(place) / str(number), moments.uniform(0.05, 0.95), True
            while ended:  # before its moment: this machine has become faster
                process = start(folder)
                try:
                    process.wait(share * length)
                    shutil.rmtree(folder)
                    length /= 2
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
                    ended = False
            finish(start(folder, *going_on))
            again = found(folder)
            same = again.shape == whole.shape and np.allclose(
                again, whole, rtol=TOLERANCE, atol=TOLERANCE * np.nanmax(np.abs(whole)), equal_nan=True
            )
            out.append(bool(same) and not list(folder.rglob(".*")))
    return out


def kills():
    """Of 20 killed runs of solve, campaign and design each, those that ended well."""
    alive = {command: survived(command, KILLS) for command in COMMANDS}
    return {"kills_survived_of_60": sum(map(sum, alive.values()))}, alive
