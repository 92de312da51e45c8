"""`python -m benchmarks [--only PART] [--snapshot]`: measure figures into out/bench/results.json.

Parts merge into the file; results.meta.json beside it says for each part when, at which revision, on which
machine and how fast a fixed calibration loop ran. --snapshot copies both to docs/ and rewrites the table
docs/figures.md.
"""

import argparse
import json
import sys
import time
import tomllib
from pathlib import Path

from benchmarks import (
    cell,
    cell_grids,
    chain,
    clamp,
    cluster,
    compare,
    contact,
    contact_page,
    design,
    docs,
    door,
    doubt,
    grids,
    house,
    image,
    kills,
    law,
    moulds,
    notebooks,
    paper,
    paper_page,
    people,
    rod,
    segmentation,
    segments,
    silicones,
    speed,
    verification,
    workspace,
)
from benchmarks.tables import table
from pneunet.base.files.atomic import write_text
from pneunet.base.files.record import machine, revision

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "bench"
#: part -> (function returning {key: number}, or that and details for the meta data; what it needs and
#: measures)
PARTS = {
    "setup": (
        chain.setup,
        "set-up on a fresh Debian 13 root, taken when the container image is built (make image)",
    ),
    "ranks": (chain.ranks, "largest relative difference between the reference case on 1 and on 2 ranks"),
    "resume": (chain.resume, "a run killed with SIGKILL and resumed on 2 ranks against a whole one"),
    "kills": (kills.kills, "60 runs killed with SIGKILL at random moments and run again; some 6 minutes"),
    "demo": (chain.demo, "make demo after set-up, wall seconds, and its reduced-against-FE distance"),
    "test": (chain.test, "make test with a cold form cache, wall seconds"),
    "ci": (
        cluster.ci,
        "continuous integration from a clean clone, caches and images made anew, wall minutes; half an hour",
    ),
    "image": (
        image.image,
        "make image-test (all tests in the image), its demo beside that of make demo; some 20 minutes",
    ),
    "slurm": (
        cluster.on_slurm,
        "a study and a solve on a real SLURM, put back into the queue midway; needs slurm-wlm; a minute",
    ),
    "door": (
        door.door,
        "1500 generated bad inputs at every door of the command line: one line each; some 5 minutes",
    ),
    "docs": (docs.docs, "the commands of all pages, and the build of their site; some 10 minutes"),
    "house": (
        house.house,
        "lines of Python, time of the import, type errors, the wheel's test; 3 minutes",
    ),
    "cell": (cell.unit_cell, "unit cell one-sided-w10, 60 deg: cost, mesh study, stiffness; some 5 minutes"),
    "grids": (grids.made, "grids of 10,000 random segments and 500 random manipulators; some 4 minutes"),
    "cad-grids": (grids.described_by_cad, "CAD of the demo, reference cases, 40 random ones; some 6 minutes"),
    "cell-grids": (
        cell_grids.cells,
        "cells of both kinds on grids of hexahedra: errors, orders, cost; some 30 minutes",
    ),
    "contact-grids": (
        cell_grids.contact_cells,
        "a cell whose walls touch on grids of hexahedra: errors, orders; some 3 minutes",
    ),
    "body-grids": (grids.bodies, "the tip of a body at rest on grids and tetrahedra; some 3 minutes"),
    "segments": (
        segments.against_segments,
        "the cell against finite segments of 9 and 30 chambers: cost of a step, strains; 10 minutes",
    ),
    "rod": (rod.speed, "what free and loaded shapes of a rod of four segments cost; some seconds"),
    "rod-fe": (
        rod.against_finite_elements,
        "rods with unit cells' laws against finite elements of three bodies; some 20 minutes",
    ),
    "clamp": (clamp.clamp, "lengths that a clamp holds of rectangles, beside formulas; a minute"),
    "law": (
        law.law,
        (
            "the trained law that comes along: errors on designs it has not seen, the laws compared, cost;"
            " some seconds"
        ),
    ),
    "doubt": (
        doubt.doubt,
        "the law's doubt: cost, agreement with the exact deviation; `pneunet shape` of the demo; a minute",
    ),
    "workspace": (workspace.hundred_thousand, "100,000 shapes of one to three segments; some seconds"),
    "moulds": (
        moulds.moulds,
        "moulds of 20 random bodies by a second kernel: closed, no undercut, the body they leave; a minute",
    ),
    "silicones": (
        silicones.silicones,
        "the law against cells of fitted silicones; some 4 minutes",
    ),
    "segmentation": (
        segmentation.segmentation,
        "the split of 200 random targets against the pieces that they are made of; some 30 seconds",
    ),
    "people": (people.people, "files as people bring them against the right answer of each; some minutes"),
    "compare": (
        compare.compare,
        "public measurements: the clamped beam's drops beside a rod's and a body's; half a minute",
    ),
    "view": (
        compare.view,
        "sizes of the demo's page of `pneunet view` and of its report, after make demo; some seconds",
    ),
    "notebooks": (notebooks.notebooks, "the notebooks of examples/notebooks, executed; a minute"),
    "silicone-table": (silicones.table_of_silicones, "rows of the table of silicones with a test as source"),
    "design": (
        design.design,
        "designs of random targets and of the paper's raw curves, seconds, derivatives; some 15 minutes",
    ),
    "verification": (
        verification.verification,
        "exact solutions, Land, Cook, manufactured solution, patches, energy; some 3 minutes",
    ),
    "contact": (
        contact.contact,
        (
            "self-contact in the unit cell twist-w15: distance, bias, sensitivity, check by third medium; 5"
            " minutes"
        ),
    ),
    "contact-segment": (
        contact.in_a_segment,
        "self-contact in five pairs of chambers on 2 ranks against the cell: twist, cost; some 15 minutes",
    ),
    "paper": (
        paper.paper,
        (
            "the paper's twisting and helical models beside unit cells, as they are and calibrated; some 10"
            " minutes"
        ),
    ),
    "long": (chain.long_segment, "steps and factorisations of the case one-sided-long; some 2 minutes"),
    "speed": (
        speed.ramps,
        "the same ramp in pneunet, FElupe and NGSolve (installs them on first use); some 15 minutes",
    ),
    "scaling": (
        speed.scaling,
        "seconds of assembly, factorisation and solution on three meshes, and their exponents",
    ),
    "ranks2": (speed.two_ranks, "two ranks against one at some 150k dofs"),
}
#: figure -> what it is
MEANING = tomllib.loads(Path(__file__).with_name("figures.toml").read_text())


def calibration():
    """Best of 5 wall seconds of a fixed pure-Python loop: how fast this machine is right now."""
    best = float("inf")
    for _ in range(5):
        start = time.perf_counter()
        sum(i * i for i in range(1_000_000))
        best = min(best, time.perf_counter() - start)
    return best


def merge(path, entries, kept=None):
    """What the file holds with the entries added, as far as it is among those `kept` (default: all)."""
    known = json.loads(path.read_text()) if path.exists() else {}
    known = {key: value for key, value in (known | entries).items() if kept is None or key in kept}
    write_text(path, json.dumps(known, indent=1, sort_keys=True) + "\n")
    return known


def demo_picture():
    """The README's picture: three of the demo report's side by side, at most 256 colours to stay small."""
    from PIL import Image

    parts = [
        Image.open(ROOT / "out" / "demo" / "report" / f"{name}.png").convert("RGB")
        for name in ("target", "reduced", "fe")
    ]
    height = min(part.height for part in parts)
    parts = [part.resize((round(part.width * height / part.height), height)) for part in parts]
    row = Image.new("RGB", (sum(part.width for part in parts), height), "white")
    x = 0
    for part in parts:
        row.paste(part, (x, 0))
        x += part.width
    row.thumbnail((1500, 1500))
    row.quantize(256).save(ROOT / "docs" / "demo.png", optimize=True)


def snapshot():
    """Merge the results into docs/, parts not measured anew kept and such that are gone dropped; write the
    table of figures and the README's picture."""
    if (ROOT / "out" / "demo" / "report").is_dir():
        demo_picture()

    def merged(name, kept):
        return merge(ROOT / "docs" / name, json.loads((OUT / name).read_text()), kept)

    meta = merged("results.meta.json", PARTS)
    # a figure that its part gives no longer is of older code than its date says
    results = merged("results.json", {key for m in meta.values() for key in m["keys"]} & set(MEANING))
    lines = ["# Figures", "", "Made by `make bench` and `python -m benchmarks --snapshot`; do not edit.", ""]
    rows = [
        (f"`{key}`", f"{results[key]:.4g}", meaning.replace("|", "\\|"))
        for key, meaning in MEANING.items()
        if key in results
    ]
    lines += table(["key", "value", "what it is"], rows)
    lines += ["", "| part | date | revision | machine | calibration loop, s |", "|---|---|---|---|---|"]
    for part, m in sorted(meta.items()):
        where = f"{m['machine']['processor']}, {m['machine']['cores']} cores"
        lines.append(f"| {part} | {m['date']} | {m['revision']} | {where} | {m['calibration_seconds']:.3f} |")
    write_text(ROOT / "docs" / "figures.md", "\n".join(lines) + "\n")
    write_text(ROOT / "docs" / "speed.md", speed.page(results, meta))
    if "law" in meta:
        page = ROOT / "docs" / "rod-law.md"
        write_text(page, law.page(page.read_text(), meta["law"]["details"], meta))
    page = ROOT / "docs" / "theory-reduced.md"
    if "rod-fe" in meta:
        write_text(page, rod.page(page.read_text(), meta["rod-fe"]["details"]))
    if "clamp" in meta:
        write_text(page, clamp.page(page.read_text(), meta["clamp"]["details"]))
    if "contact" in meta:
        page = ROOT / "docs" / "contact.md"
        write_text(page, contact_page.page(page.read_text(), results, meta))
    if "paper" in meta:
        write_text(ROOT / "docs" / "paper-models.md", paper_page.page(meta, ROOT / "docs"))
    if "verification" in meta:
        write_text(ROOT / "docs" / "verification.md", verification.page(meta, ROOT / "docs"))


def main():
    parser = argparse.ArgumentParser(prog="benchmarks")
    parser.add_argument("--only", choices=PARTS, help="; ".join(f"{k}: {v[1]}" for k, v in PARTS.items()))
    parser.add_argument("--snapshot", action="store_true", help="publish out/bench to docs/")
    a = parser.parse_args()
    if a.snapshot:
        snapshot()
        return
    for part in [a.only] if a.only else PARTS:
        print(f"bench: {part}", flush=True)
        loop = calibration()
        found = PARTS[part][0]()
        figures, details = found if isinstance(found, tuple) else (found, {})
        merge(OUT / "results.json", figures)
        facts = {
            "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "revision": revision(),
            "machine": machine(),
        }
        merge(
            OUT / "results.meta.json",
            {part: {**facts, "calibration_seconds": loop, "keys": sorted(figures), "details": details}},
        )
        for key, value in figures.items():
            print(f"  {key} = {value:.6g}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
