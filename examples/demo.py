"""The whole chain on a raw curve, the octopus as points and section frames: design, shape, mesh, finite
elements on 2 ranks, report.

Run by `make demo`; each link is the command a user would type. `python examples/demo.py FOLDER` works in
another folder than out/demo.
"""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: mm: a coarse grid, so that a laptop has the answer in a minute or two
GRID = ("--mesh-size-mm", "4")


def step(*arguments, may_stop_short=False):
    """Run one pneunet command, showing it; exit with its code if it fails."""
    print(f"\n$ pneunet {' '.join(arguments)}", flush=True)
    code = subprocess.run([sys.executable, "-m", "pneunet", *arguments], cwd=ROOT).returncode
    if code and not (may_stop_short and code == 2):
        sys.exit(code)


def main(out):
    started = time.perf_counter()
    design = str(out / "design.toml")
    # an earlier design's, perhaps an earlier version's
    shutil.rmtree(ROOT / out / "solve", ignore_errors=True)
    step("design", "examples/curves/octopus.csv", "-o", str(out))
    step("shape", design)
    step("mesh", design, *GRID)
    # a load that cannot be reached leaves the result up to there, and the report says so
    step("run", "-n", "2", "solve", design, *GRID, may_stop_short=True)
    step("report", str(out))
    seconds = time.perf_counter() - started
    (ROOT / out / "demo.json").write_text(json.dumps({"seconds": seconds}) + "\n")
    print(f"\ndemo: {seconds:.0f} s; open {ROOT / out / 'report.html'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo"))
