"""The pages: what of them is run, and how long their site takes to build."""

import json
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def docs():
    """Runs the commands of all pages, then builds the site; a page or link that is wrong ends the bench.

    Details: the counts of each page.
    """
    subprocess.run([sys.executable, "-m", "docs.site.run"], cwd=ROOT, check=True)
    counts = json.loads((ROOT / "out" / "pages" / "commands.json").read_text())
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict"], cwd=ROOT, check=True)
    seconds = time.perf_counter() - start
    subprocess.run([sys.executable, "-m", "docs.site.look"], cwd=ROOT, check=True)
    executed = counts["total"]["commands"] + counts["total"]["python"]
    return {"docs_build_seconds": seconds, "docs_commands_executed": executed}, counts
