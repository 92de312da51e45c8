"""run.json: how a result came to be."""

import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

from pneunet.base.files.atomic import write_text


def revision():
    """Git revision of the source tree, with '-dirty' when it has local changes; 'unknown' outside a
    checkout."""
    root = Path(__file__).resolve().parent.parent
    try:
        out = subprocess.run(
            ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            timeout=10,
        )
    except (OSError, subprocess.TimeoutExpired):
        return "unknown"
    return out.stdout.strip() if out.returncode == 0 else "unknown"


def machine():
    """Processor, cores, system and Python of this machine."""
    model = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def write_record(directory, name="run.json", **entries):
    """Write run.json: command, time, revision, machine, and whatever the caller knows (inputs, versions,
    steps)."""
    record = {
        "command": " ".join(Path(a).name if i == 0 else a for i, a in enumerate(sys.argv)),
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "revision": revision(),
        "machine": machine(),
        **entries,
    }
    write_text(Path(directory) / name, json.dumps(record, indent=1, default=float) + "\n")
    return record
