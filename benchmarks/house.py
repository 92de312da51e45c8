"""Figures of the code itself: how much of it there is, how long its import takes, what the type checker
finds, whether the wheel works."""

import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def house():
    """The four figures of the code."""
    # in turns, and the shortest of each: what else the machine does only adds
    times = [[_milliseconds(code) for code in ("pass", "import pneunet")] for _ in range(20)]
    bare, ours = map(min, zip(*times))
    types = _run("-m", "tests.typecheck")
    wheel = _run("-m", "pytest", "-q", "--timeout=3600", "tests/test_packaging.py")
    if wheel.returncode:
        print(wheel.stdout)
    return {
        "python_lines": python_lines(),
        "import_ms": ours - bare,
        "mypy_errors": types.stdout.count(": error: "),
        "wheel_design_ok": int(wheel.returncode == 0 and "skipped" not in wheel.stdout),
    }


def python_lines():
    """Lines that are not blank of the Python files that git has, those of tests left out."""
    done = subprocess.run(
        ["git", "ls-files", "-z", "*.py"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    paths = [ROOT / name for name in done.stdout.split("\0") if name and not name.startswith("tests/")]
    return sum(bool(line.strip()) for path in paths for line in path.read_text().splitlines())


def _milliseconds(code):
    started = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
    return 1e3 * (time.perf_counter() - started)


def _run(*arguments):
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True)
