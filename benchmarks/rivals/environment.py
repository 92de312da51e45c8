"""The environment of the other codes: made once under out/bench, from PyPI, never a dependency."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
VENV = HERE.parents[1] / "out" / "bench" / "rivals-venv"
REQUIREMENTS = HERE / "requirements.txt"
#: one thread for every library of every code
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}


def python():
    """Path of its interpreter; the first call installs, later ones look at a stamp."""
    interpreter, stamp = VENV / "bin" / "python", VENV / "stamp"
    key = hashlib.sha256(REQUIREMENTS.read_bytes() + str(VENV).encode()).hexdigest()
    if not (stamp.exists() and stamp.read_text() == key):
        print("bench: installing FElupe, NGSolve and MKL into an environment of their own", flush=True)
        shutil.rmtree(VENV, ignore_errors=True)
        subprocess.run(["/usr/bin/python3", "-m", "venv", VENV], check=True)
        options = ["--quiet", "--no-deps", "--only-binary", ":all:", "--disable-pip-version-check"]
        subprocess.run([interpreter, "-m", "pip", "install", *options, "-r", REQUIREMENTS], check=True)
        stamp.write_text(key)
    if shutil.which("c++") is None:
        sys.exit("bench: NGSolve compiles its forms with c++, which is not here: install g++")
    return interpreter


def variables():
    """Environment variables of a run there: its programs (NGSolve's compiler script) first on PATH, one
    thread."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    }
    return kept | ONE_THREAD | {"PATH": f"{VENV / 'bin'}{os.pathsep}{os.environ.get('PATH', os.defpath)}"}
