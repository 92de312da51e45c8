"""The engine of studies and campaigns, with cases that really crash, hang and eat memory, on one rank, and
on three, of which one hands out."""

import importlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pneunet.hifi.runs.campaign.file import read_campaign
from pneunet.hifi.runs.case_process import FUNCTIONS
from pneunet.hifi.runs.study.file import read_study
from tests.pneunet.sayings import said
from tests.toy_cases import ENDINGS

ROOT = Path(__file__).resolve().parents[2]


def command(ranks, directory, which, *options):
    line = [sys.executable, "-m", "tests.toy_cases", str(directory), which, *options]
    return line if ranks == 1 else [sys.executable, "-m", "pneunet", "run", "-n", str(ranks), "--", *line]


def run(*arguments):
    """(lines of progress, records) of the program in tests.toy_cases."""
    done = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=120, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    *progress, records = done.stdout.splitlines()
    return progress, json.loads(records)


def is_alive(number):
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.parametrize("ranks", [1, 3])
def test_every_way_to_end_is_recorded_and_stops_no_other_case(tmp_path, ranks):
    directory = tmp_path / "cases"
    progress, records = run(ranks, directory, "endings")
    *endings, mpi, again = records
    assert {r["function"].partition(":")[2]: r["status"] for r in endings} == ENDINGS
    assert mpi["result"] == 1  # a rank's child is no rank
    assert endings[0]["result"] == 9 and again == endings[0]  # one case, listed twice, is one
    for record in endings[1:]:
        assert record["reason"] and record["result"] is None
    assert not is_alive(int(Path(f"{directory}.grandchild").read_text()))
    assert len(progress) == len(ENDINGS) + 1 and all("ETA" in line for line in progress)
    folders = [p for p in directory.iterdir() if p.is_dir()]
    assert len(folders) == len(ENDINGS) + 1
    for folder in folders:
        assert json.loads((folder / "record.json").read_text()) in records
    assert [p.read_text() for p in directory.glob("*/note.txt")] == ["of this case"]


@pytest.mark.parametrize("ranks", [1, 3])
def test_a_killed_run_goes_on_where_it_was(tmp_path, ranks):
    directory, journal = tmp_path / "cases", tmp_path / "cases.journal"
    process = subprocess.Popen(
        command(ranks, directory, "naps"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT
    )
    deadline = time.monotonic() + 60
    while len(list(directory.glob("*/record.json"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    finished = {p: p.stat().st_mtime_ns for p in directory.glob("[!.]*/record.json")}
    assert 3 <= len(finished) < 8
    progress, records = run(ranks, directory, "naps")
    assert [r["inputs"]["x"] for r in records] == list(range(8)) and {r["status"] for r in records} == {
        "done"
    }
    # a rank may finish one more
    assert progress[0].startswith(f"{len(finished)} of 8 cases are finished") or ranks > 1
    assert all(p.stat().st_mtime_ns == at for p, at in finished.items())
    begun = journal.read_text().split()
    assert all(begun.count(str(json.loads(p.read_text())["inputs"]["x"])) == 1 for p in finished)
    assert not list(directory.glob(".*-*"))


@pytest.mark.parametrize("ranks", [1, 3])
def test_an_interrupted_run_ends_in_order_and_the_next_goes_on(tmp_path, ranks):
    directory = tmp_path / "cases"
    line = [*command(ranks, directory, "naps")]
    process = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    deadline = time.monotonic() + 60
    while len(list(directory.glob("[!.]*/record.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    told = process.communicate(timeout=60)[1]
    finished = len(list(directory.glob("*/record.json")))
    assert process.returncode == 130 and 2 <= finished < 8
    [line] = said(told)
    assert line.startswith(f"pneunet: interrupted: {finished} of 8 cases are finished")
    assert all(not path.name.startswith(".") for path in directory.iterdir())
    _, records = run(ranks, directory, "naps")
    assert {r["status"] for r in records} == {"done"}


def test_failures_are_computed_again_when_asked(tmp_path):
    directory = tmp_path / "cases"
    run(1, directory, "failures")
    again, _ = run(1, directory, "failures")
    assert again == [
        f"4 of 4 cases are finished in {directory}, 2 of them failed (--retry computes those again)"
    ]
    progress, _ = run(1, directory, "failures", "--retry")
    assert len([line for line in progress if "ETA" in line]) == 2


def test_two_runs_do_not_work_in_one_folder(tmp_path):
    process = subprocess.Popen(command(1, tmp_path / "cases", "naps"), stdout=subprocess.DEVNULL, cwd=ROOT)
    try:
        while not list(tmp_path.glob("cases/.pneunet-*")):
            time.sleep(0.01)
        process.send_signal(signal.SIGSTOP)  # it holds the lock for as long as it lives
        refused = subprocess.run(
            command(1, tmp_path / "cases", "none"), capture_output=True, text=True, timeout=60, cwd=ROOT
        )
    finally:
        process.kill()
        process.wait()
    assert "another run is at work in it" in refused.stderr


#: what the study's silicone was when its cases were first named
FIRST_MATERIAL = """mu_MPa = 0.1931
density_kg_per_m3 = 1080
elongation_at_break_percent = 620
name = "Dragon Skin 20"
source = "technical bulletin, from memory, not compared since; mu from its 100 % modulus, 49 psi / 1.75"
"""


def test_folders_of_finished_cases_keep_their_names(tmp_path):
    """Wherever their functions move: weeks of computing are found again."""
    campaign = read_campaign(ROOT / "examples" / "campaigns" / "cells-v2.toml")
    assert campaign.designs[0].case.name == "0f7bf976e33d"
    text = (ROOT / "examples" / "studies" / "angles.toml").read_text()
    first = text.replace("pressure_kPa = 25", "pressure_kPa = 40")
    first = first.replace('silicone = "Dragon Skin 20"', FIRST_MATERIAL)
    for tables, name in ((text, "8c574ce92949"), (first, "3d5e1e507d49")):
        (tmp_path / "study.toml").write_text(tables)
        assert read_study(tmp_path / "study.toml").cases[0].case.name == name
    for place in FUNCTIONS.values():
        module, name = place.split(":")
        assert callable(getattr(importlib.import_module(module), name))
