"""Figures of the container image: its tests pass, and it computes what this machine computes."""

import json
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
TESTED = ROOT / "out" / "image-test"
#: of `make demo`: here, in the image
NATIVE, IMAGE = ROOT / "out" / "demo", ROOT / "out" / "image-demo"
DEMO = """. containers/tool.sh; tool="$(container_tool)"
rm -rf "$1"; mkdir -p "$1"; [ "$(id -u)" != 0 ] || chown 4711:4711 "$1"
in_image "$1" python /opt/pneunet/examples/demo.py /data/demo"""


def image():
    """`make image-test`, and the demo in the image beside that of `make demo`, which must be there."""
    from pneunet.hifi.verification.reference_case import largest_difference

    if not (NATIVE / "solve" / "run.json").exists():
        raise SystemExit("bench: no demo to compare with; run make demo first")
    subprocess.run(["make", "image-test"], cwd=ROOT, check=True)
    suite = ElementTree.parse(TESTED / "tests.xml").getroot().find("testsuite")
    counts = {name: int(suite.get(name)) for name in ("tests", "failures", "errors", "skipped")}
    native, inside = (json.loads((TESTED / f"{name}.json").read_text()) for name in ("native", "image"))
    subprocess.run(["bash", "-c", DEMO, "bash", str(IMAGE)], cwd=ROOT, check=True)
    figures = {
        "image_tests_passed": counts["tests"] - sum(counts[n] for n in ("failures", "errors", "skipped")),
        "image_vs_native_same_mesh_rel": largest_difference(native, inside),
        "image_vs_native_demo_rel": demo_difference(NATIVE, IMAGE / "demo"),
    }
    return figures, counts | {"skipped because": reasons(suite)}


def reasons(suite):
    """{why tests were skipped: how many}."""
    found = [each.get("message") for each in suite.iter("skipped")]
    return {why: found.count(why) for why in sorted(set(found))}


def demo_difference(one, two):
    """Of the last states that finite elements reached in two folders, the largest of: distance between
    centrelines at equal arc length over the length, relative difference of pressures, of volumes."""
    from pneunet.design.report.rundata import read_design_folder

    a, b = (read_design_folder(folder).solve for folder in (one, two))
    points = np.column_stack([np.interp(a.s, b.s, x) for x in b.points.T])
    apart = np.linalg.norm(points - a.points, axis=1).max() / a.s[-1]
    ours, theirs = ([each.pressure, each.steps["volume_mm3"][-1]] for each in (a, b))
    return float(max(apart, *abs(np.divide(theirs, ours) - 1)))
