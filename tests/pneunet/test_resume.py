"""`pneunet solve --resume` after real kills, on one and two ranks, and what happens when nothing more can be
written."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from benchmarks.kills import COMMANDS, survived
from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_columns
from pneunet.base.files.schemas import CENTRELINES, SEGMENTS, STEPS
from pneunet.hifi.verification.reference_case import DATA
from tests.pneunet.sayings import said

SOLVE = ["solve", str(DATA / "reference.toml"), "--pressure-kPa", "35"]
#: pneunet with so many bytes a file may have, writing more fails as on a full disk; MPI's own files come
#: before
LIMITED = """import resource, sys
from mpi4py import MPI
from pneunet.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, 2 * (int(sys.argv[1]),))
sys.exit(main(sys.argv[2:]))"""
#: what may be another from run to run
EFFORT = ("iterations", "factorisations", "stability_factorisations", "seconds")
TABLES = {
    "steps.csv": [name for name in STEPS if name not in EFFORT],
    "centrelines.csv": CENTRELINES,
    "segments.csv": SEGMENTS,
}


def solve(folder, *options, ranks=1, limit=None):
    command = [
        sys.executable,
        *(["-c", LIMITED, str(limit)] if limit else ["-m", "pneunet"]),
        *SOLVE,
        "-o",
        str(folder),
        *options,
    ]
    if ranks > 1:
        command = [sys.executable, "-m", "pneunet", "run", "-n", str(ranks), "--", *command]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=DATA.parent.parent)


def reached(folder):
    """Step of the checkpoint, 0 without one."""
    try:
        with np.load(folder / "solve" / "checkpoint.npz") as stored:
            return int(stored["step"][0])
    except FileNotFoundError:
        return 0


def readable(folder):
    """Pressures of solution.pvd, every file of which is read."""
    pyvista = pytest.importorskip("pyvista")
    listed = ElementTree.parse(folder / "solve" / "solution.pvd").findall(".//DataSet")
    for each in listed:
        assert np.isfinite(pyvista.read(folder / "solve" / each.get("file"))["displacement"]).all()
    return [float(each.get("timestep")) for each in listed]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    done = solve(folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def killed(tmp_path_factory, whole):
    """A folder whose run was killed with SIGKILL after its second step."""
    folder = tmp_path_factory.mktemp("killed")
    shutil.copytree(whole / "mesh", folder / "mesh")
    command = [sys.executable, "-m", "pneunet", *SOLVE, "-o", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=DATA.parent.parent)
    deadline = time.monotonic() + 120
    while reached(folder) < 2 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.kill()
    process.wait()
    assert 2 <= reached(folder) < reached(whole)
    return folder


def ranks_of(launcher):
    """Process ids of the ranks that a running `pneunet run` (a pid) has started: the children of its
    mpirun."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents.setdefault(int(stat.read_text().rsplit(")", 1)[1].split()[1]), []).append(
                int(stat.parent.name)
            )
        except (OSError, ValueError):
            continue  # ended just now
    return sorted(rank for mpirun in parents.get(launcher, []) for rank in parents.get(mpirun, []))


@pytest.mark.parametrize("which", [0, 1])
def test_a_rank_that_dies_ends_the_run_and_the_next_goes_on(whole, tmp_path, which):
    shutil.copytree(whole / "mesh", tmp_path / "mesh")
    command = [
        sys.executable,
        "-m",
        "pneunet",
        "run",
        "-n",
        "2",
        "--",
        sys.executable,
        "-m",
        "pneunet",
        *SOLVE,
        "-o",
        str(tmp_path),
    ]
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=DATA.parent.parent
    )
    deadline = time.monotonic() + 120
    while reached(tmp_path) < 2 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(ranks_of(process.pid)[which], signal.SIGKILL)
    told = process.communicate(timeout=30)[1]  # no deadlock
    assert process.returncode == 137
    [line] = said(told)
    assert "a rank was stopped by signal 9" in line and "--resume goes on" in line
    assert "Traceback" not in told
    assert 2 <= reached(tmp_path) < reached(whole)
    done = solve(tmp_path, "--resume", ranks=2)
    assert done.returncode == 0, done.stderr
    columns = TABLES["steps.csv"]
    one, two = (read_columns(folder / "solve" / "steps.csv", columns) for folder in (whole, tmp_path))
    assert two == pytest.approx(one, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_killed_run_ends_at_the_same_result(whole, killed, tmp_path, ranks):
    folder = tmp_path / "run"
    shutil.copytree(killed, folder)
    assert len(readable(folder)) >= 3
    step = reached(folder)
    done = solve(folder, "--resume", ranks=ranks)
    assert done.returncode == 0, done.stderr
    assert f"resumed after step {step}" in done.stdout and f"step {step:3d} " not in done.stdout
    for name, columns in TABLES.items():
        a, b = (read_columns(where / "solve" / name, columns) for where in (whole, folder))
        assert b == pytest.approx(a, rel=1e-8, abs=1e-8), name
    with np.load(whole / "solve" / "checkpoint.npz") as a, np.load(folder / "solve" / "checkpoint.npz") as b:
        last = len(a["parameter"]) - 1
        assert (
            abs(a["displacement_mm"][last] - b["displacement_mm"][last]).max()
            < 1e-8 * abs(a["displacement_mm"][last]).max()
        )
    assert readable(folder) == pytest.approx(readable(whole))


@pytest.mark.parametrize(("ranks", "number"), [(1, signal.SIGTERM), (2, signal.SIGINT)])
def test_an_interrupted_run_says_where_and_the_next_goes_on(whole, tmp_path, ranks, number):
    """The signal is the launcher's alone; a second run in the folder is refused meanwhile."""
    shutil.copytree(whole / "mesh", tmp_path / "mesh")
    command = [sys.executable, "-m", "pneunet", *SOLVE, "-o", str(tmp_path), "--no-fields"]
    if ranks > 1:
        command[3:3] = ["run", "-n", str(ranks)]
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=DATA.parent.parent
    )
    deadline = time.monotonic() + 120
    while reached(tmp_path) < 1 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(number)
    told = process.communicate(timeout=60)[1]
    record = json.loads((tmp_path / "solve" / "run.json").read_text())
    at = f"interrupted at {record['pressure_reached_kPa']:.3g} kPa"
    assert process.returncode == 130 and record["status"] == at
    [line] = said(told)
    assert line.startswith(f"pneunet: {at}; the result up to there is in")
    assert not list((tmp_path / "solve").glob(".*"))
    step = reached(tmp_path)
    assert f"resumed after step {step}" in solve(tmp_path, "--resume", "--no-fields").stdout
    assert reached(tmp_path) == reached(whole)


def test_a_checkpoint_that_is_damaged_is_named(whole, tmp_path):
    from pneunet.hifi.runs.solve.checkpoint import read_checkpoint

    kept = whole / "solve" / "checkpoint.npz"
    with np.load(kept) as stored:
        arrays = dict(stored)
    identity = json.loads(bytes(arrays["about"]))["belongs_to"]
    assert read_checkpoint(whole / "solve", identity)["stage"]
    path, bad = tmp_path / "checkpoint.npz", arrays["displacement_mm"].copy()
    bad[0, 0, 0] = np.nan
    for changed, told in (
        ({"displacement_mm": bad}, "member 'displacement_mm': holds nan"),
        ({"displacement_mm": bad[:, 1:]}, "member 'displacement_mm': has shape"),
        ({"load": arrays["load"].astype(str)}, "member 'load': its type is of kind 'U'"),
        ({"step": arrays["step"] * np.nan}, "members 'step', 'load' hold no accepted step"),
        ({"trusted": None}, "member 'trusted': is missing"),
    ):
        np.savez(path, **{name: value for name, value in (arrays | changed).items() if value is not None})
        with pytest.raises(InputError, match=f"checkpoint.npz: {told}.*solve without --resume$"):
            read_checkpoint(tmp_path, identity)
    path.write_bytes(kept.read_bytes()[:5000])
    with pytest.raises(InputError, match="checkpoint.npz: not a checkpoint .*solve without --resume$"):
        read_checkpoint(tmp_path, identity)


def test_resume_says_what_it_cannot_go_on_from(whole, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(whole, folder)
    told = solve(folder, "--resume").stdout
    assert "complete" in told and "done" not in told
    for options, message in (
        (["--mesh-size-mm", "4"], "add --mesh-size-mm 3"),
        (["--pressure-kPa", "5"], "has passed"),
    ):
        refused = solve(folder, "--resume", *options)
        assert refused.returncode == 2 and message in refused.stderr and len(refused.stderr.splitlines()) == 1
    steps = folder / "solve" / "steps.csv"
    rows = steps.read_text()
    steps.write_text(rows.replace("\n0,", "\nx,", 1))
    refused = solve(folder, "--resume")
    assert refused.returncode == 2 and "steps.csv: row 2 is damaged: solve without --resume" in refused.stderr
    steps.write_text(rows + rows.splitlines()[-1] + "\n")
    assert "steps.csv: rows are missing, or there twice" in solve(folder, "--resume").stderr
    steps.write_text(rows)
    (folder / "solve" / "checkpoint.npz").unlink()
    assert (
        "starting from the beginning"
        in solve(folder, "--resume", "--pressure-kPa", "1", "--no-fields").stdout
    )


def test_a_mesh_is_data(whole, tmp_path):
    """A stranger's folder: its .msh is a script, its mesh.json fits the body; then its .npz is damaged."""
    shutil.copytree(whole / "mesh", tmp_path / "mesh")
    stored = tmp_path / "mesh" / "manipulator.npz"
    stored.unlink()
    obeyed = tmp_path / "obeyed"
    stored.with_suffix(".msh").write_text(f'SystemCall "touch {obeyed}";\n')
    told = solve(tmp_path, "--no-fields", "--pressure-kPa", "1")
    assert told.returncode == 0 and "meshed anew" in told.stdout and stored.exists(), told.stderr
    assert not obeyed.exists()
    stored.write_bytes(stored.read_bytes()[:-2000])
    told = solve(tmp_path, "--no-fields", "--pressure-kPa", "1", ranks=2)
    [line] = said(told.stderr)
    assert told.returncode == 2 and str(stored) in line and "Traceback" not in told.stderr


@pytest.mark.parametrize(
    ("ranks", "limit", "options"),
    [(1, 400_000, ["--no-fields"]), (2, 400_000, ["--no-fields"]), (2, 100_000, [])],
)
def test_a_full_disk_ends_in_one_line(whole, tmp_path, ranks, limit, options):
    """Files may grow to so many bytes: the tables' size is below both, a checkpoint above the first, a .vtu
    above the second."""
    shutil.copytree(whole / "mesh", tmp_path / "mesh")
    failed = solve(tmp_path, *options, ranks=ranks, limit=limit)
    assert failed.returncode == 2, failed.stdout + failed.stderr
    assert (
        failed.stderr.count("cannot be written to") == 1
        and "--resume" in failed.stderr
        and "Traceback" not in failed.stderr
    )
    assert not list((tmp_path / "solve").glob(".*"))


@pytest.mark.parametrize("command", COMMANDS)
def test_a_run_killed_at_a_random_moment_runs_again_as_if_nothing_had_been(command):
    assert survived(command, 1) == [True]
