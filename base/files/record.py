"""run.json: how a result came to be."""

import json
import os
import platform
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pneunet.base.files.atomic import write_text
from pneunet.base.files.reading import read_json
from pneunet.base.files.versions import versions

#: folder that holds the packages of a checkout
ROOT = Path(__file__).resolve().parents[2]


def revision() -> str:
    """Git revision of the checkout that this code runs from, with '-dirty' when it has local changes, or what
    a copy without history says it is of; the package's version where the code is installed, whatever
    repository that is in."""
    told = ROOT / ".revision"
    if told.exists():
        return told.read_text().strip()
    if (ROOT / ".git").exists() and (ROOT / "pyproject.toml").exists():
        line = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=12"]
        try:
            return subprocess.run(line, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
        except (OSError, subprocess.SubprocessError):
            pass  # no git
    return version("pneunet")


def read_record(path: str | Path) -> dict:
    """The JSON object in a file, {} where there is no file; InputError for anything else."""
    return read_json(path) if Path(path).exists() else {}


def machine() -> dict:
    """Processor, cores, system and Python of this machine."""
    model = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        model = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def write_record(directory: str | Path, name: str = "run.json", **entries: Any) -> dict:
    """Write run.json: command, time, revision, versions, machine, and whatever the caller knows (inputs,
    steps)."""
    record = {
        "command": " ".join(Path(a).name if i == 0 else a for i, a in enumerate(sys.argv)),
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "revision": revision(),
        "versions": versions(),
        "machine": machine(),
        **entries,
    }
    write_text(Path(directory) / name, json.dumps(record, indent=1, default=float) + "\n")
    return record
