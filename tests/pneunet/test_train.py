"""`pneunet train` as a user starts it: the law does not depend on the number of ranks."""

import subprocess
import sys
from pathlib import Path

from pneunet.base.files.dataset import write_dataset
from tests.reduced.made_up_cells import made_up_data

ROOT = Path(__file__).resolve().parents[2]


def train(ranks, folder, name):
    command = [sys.executable, "-m", "pneunet", "train", str(folder / "cells.npz"), "-o", str(folder / name)]
    line = (
        command if ranks == 1 else [sys.executable, "-m", "pneunet", "run", "-n", str(ranks), "--", *command]
    )
    done = subprocess.run(line, capture_output=True, text=True, timeout=200, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_same_law_on_any_number_of_ranks(tmp_path):
    write_dataset(tmp_path / "cells.npz", made_up_data(30))
    text = train(1, tmp_path, "one.npz")
    rows = ["calibrated analytic model", "law_interval_coverage_90"]
    rows += [f"{of}regressor of the states, by the pressure" for of in ("", "analytic model and ")]
    for row in (
        *rows,
        *(
            f"regressor of the states{also}, along their path"
            for also in ("", " and their derivatives by the shape")
        ),
    ):
        assert f"| {row} |" in text
    train(3, tmp_path, "three.npz")
    for suffix in (".npz", ".md"):
        assert (tmp_path / f"one{suffix}").read_bytes() == (tmp_path / f"three{suffix}").read_bytes()


def test_missing_and_meagre_data_are_one_line(tmp_path):
    line = [sys.executable, "-m", "pneunet", "train", str(tmp_path / "none.npz")]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60, cwd=ROOT)
    assert (
        done.returncode == 2
        and done.stderr.count("\n") == 1
        and "make it with pneunet campaign" in done.stderr
    )
