"""`pneunet run`: ranks, arguments, streams and exit codes, as a user sees them."""

import signal
import subprocess
import sys
import time

import pytest

from pneunet.base.errors import InputError
from pneunet.base.system import launch
from pneunet.base.system.processes import environment_without_launcher
from pneunet.cli import COMMANDS

RUN = [sys.executable, "-m", "pneunet", "run", "-n"]
START = "import sys; from pneunet.base.system import launch; "
SIZE = "from mpi4py import MPI; c = MPI.COMM_WORLD; s = c.allreduce(c.rank); c.rank or print(c.size, s)"


def run(ranks, *command, **options):
    """`pneunet run` in a process of its own, since it hands its standard streams on."""
    line = [*RUN, str(ranks), *command]
    return subprocess.run(line, capture_output=True, text=True, timeout=120, **options)


@pytest.mark.parametrize("ranks", [1, 2, 5])
def test_ranks_find_each_other_also_more_than_cores(ranks):
    done = run(ranks, "--", "python", "-c", SIZE)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(ranks), str(ranks * (ranks - 1) // 2)]


def test_children_of_a_process_that_uses_mpi_alone_are_under_no_launcher():
    child = "from pneunet.base.system.log import under_launcher as u; print(u(), flush=True)"
    code = (
        f"from mpi4py import MPI; import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    )
    environment = environment_without_launcher()
    alone = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert alone.stdout.split() == ["False"], alone.stderr
    assert run(2, "--", "python", "-c", child).stdout.split() == ["True", "True"]


def test_arguments_with_spaces_and_input_reach_the_program():
    code = "import sys; print(repr(sys.argv[1]), sys.stdin.read())"
    done = run(1, "--", "python", "-c", code, "a  b; 'c'", input="from stdin")
    assert done.stdout.strip() == repr("a  b; 'c'") + " from stdin"


def test_exit_code_of_the_program_is_handed_on():
    assert run(2, "--", "python", "-c", "raise SystemExit(3)").returncode == 3


def test_killed_rank_is_reported():
    done = run(2, "--", "python", "-c", "import os; os.kill(os.getpid(), 9)")
    assert done.returncode == 137
    assert "signal 9" in done.stderr


@pytest.mark.parametrize(
    ("ranks", "command", "message"),
    [
        (0, ["--", "true"], "at least 1"),
        (1_000_000_000, ["--", "true"], "at most"),
        (2, [], "no command"),
        (2, ["--"], "no command"),
        (2, ["--", "no-such-program"], "no-such-program not found"),
        (2, ["--", "a\x1b]0;b\x9b\r" + 5000 * "c"], "a\\x1b]0;b\\x9b\\rccc"),
    ],
)
def test_mistakes_get_one_line(ranks, command, message):
    done = run(ranks, *command)
    assert done.returncode == 2
    assert message in done.stderr and len(done.stderr.splitlines()) == 1 and len(done.stderr) < 1100
    assert done.stderr.strip().isprintable()


def test_without_dashes_it_is_a_subcommand_of_pneunet():
    line = launch.command_line(4, ["solve", "design.toml"])
    assert line[:3] == ["mpirun", "-n", "4"]
    assert line[3].endswith("/pneunet") and line[4:] == ["solve", "design.toml"]


def test_what_knows_no_ranks_is_refused_on_several():
    assert launch.command_line(1, ["mesh", "design.toml"])[4:] == ["mesh", "design.toml"]
    with pytest.raises(
        InputError, match="run: mesh works on one rank: leave out run -n 2, which is for 'design', 'solve', "
    ):
        launch.command_line(2, ["mesh", "design.toml"])
    assert set(launch.PARALLEL) < set(COMMANDS)


def test_started_from_within_an_mpi_rank():
    inner = START + f"sys.exit(launch.run(2, ['--', 'python', '-c', {SIZE!r}]))"
    outer = (
        f"import subprocess, sys; from mpi4py import MPI; subprocess.run([sys.executable, '-c', {inner!r}],"
        " check=True)"
    )
    done = run(1, "--", "python", "-c", outer)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["2", "1"]


def test_one_thread_a_rank_unless_the_user_says_otherwise(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    assert launch.environment()["OMP_NUM_THREADS"] == "1"
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    assert launch.environment()["OMP_NUM_THREADS"] == "4"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupting_it_leaves_no_ranks_behind(tmp_path, number):
    beat = tmp_path / "beat"
    ranks = f"import time\nwhile True: open({str(beat)!r}, 'a').write('x'); time.sleep(0.05)"
    line = [*RUN, "2", "--", "python", "-c", ranks]
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while not beat.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(number)
    told = process.communicate(timeout=60)[1]
    assert process.returncode == 130 and told.splitlines()[-1] == "pneunet: interrupted"
    time.sleep(0.5)
    size = beat.stat().st_size
    time.sleep(0.5)
    assert beat.stat().st_size == size > 0


def test_the_working_folder_lends_no_modules(tmp_path):
    for name in ("base", "design", "numpy", "csv"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(9)")
    line = [sys.executable, "-m", "pneunet", "fit-material", "none.csv"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and "none.csv: no such file" in done.stderr
