"""`pneunet design`: from a target file to a folder with a design, its prediction and its errors."""

import time
from pathlib import Path

import numpy as np
import scipy

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import output_directory, require_writable, write_csv
from pneunet.base.files.record import write_record
from pneunet.base.files.schemas import CENTRELINE, TARGET
from pneunet.design.search.doubts import WARN, told_doubts
from pneunet.design.search.inverse import solve
from pneunet.design.search.problem import OBJECTIVES, PAIRED
from pneunet.design.target.extraction import extract
from pneunet.design.target.file import read_target
from pneunet.design.target.metrics import compare
from pneunet.design.target.segmentation import NOTE, split
from pneunet.design.target.target import HELICAL, TWISTING
from pneunet.geometry.designfile import Design, write_design
from pneunet.geometry.parameters import TWISTING as TWISTING_KIND
from pneunet.reduced import predict
from pneunet.reduced.choice import choose_law

GIVEN_NOTE = "split given by the user"


def run_design(target_path, directory, law=None, objective=PAIRED, say=print, outside=WARN):
    """Design a manipulator for the target in a CSV or TOML file; returns the `Design`.

    law: a SegmentLaw, by default the trained one that comes along. objective: 'paired' or 'eq27' (see
    docs/use-design.md). outside: 'warn' or 'refuse' a design that the law doubts. Writes design.toml,
    target.csv, centreline.csv, design.png and run.json in `directory`, all of them once the design is found.
    InputError before anything is written; ConvergenceError where the law has no answer.
    """
    started = time.perf_counter()
    if objective not in OBJECTIVES:
        raise InputError(f"objective = '{objective}' is not known: write {' or '.join(OBJECTIVES)}")
    law = choose_law() if law is None else law
    target = read_target(target_path)
    require_writable(directory)
    pieces, note = (target.pieces, GIVEN_NOTE) if target.pieces else (split(target.points), NOTE)
    say(f"target {target.name}: {len(target.points)} points, {target.length:.2f} mm; {note}")
    wanted = extract(target, pieces)
    for i, piece in enumerate(wanted, start=1):
        say(f"  piece {i}: {describe(piece)}")
    solution = solve(target, wanted, law, objective, say)
    doubted = told_doubts(solution.manipulator, solution.pressure, law, outside, say)

    line = predict(solution.manipulator, solution.pressure, law, 1.0, solution.base_pose)
    errors = compare(line.points, target.points)
    result = {
        "split": note,
        "objective": objective,
        "law": law.name,
        "doubts": list(doubted),
        "active_bounds": list(solution.active),
        "grown_ranges": list(solution.grown),
        "target_error": errors.table(),
        "piece": [
            {**piece.table(), "predicted": predicted(piece.kind, law.strains(segment, solution.pressure))}
            for piece, segment in zip(wanted, solution.manipulator.segments)
        ],
    }
    design = Design(
        solution.manipulator,
        solution.pressure,
        name=target.name,
        base_pose=solution.base_pose,
        target="target.csv",
        result=result,
    )
    directory = output_directory(directory)
    write_csv(directory / "target.csv", TARGET, target.points)
    write_csv(directory / "centreline.csv", CENTRELINE, np.column_stack([line.s, line.points]))
    write_design(directory / "design.toml", design)
    seconds = time.perf_counter() - started
    write_record(
        directory,
        inputs={"target": Path(target_path).name, "objective": objective, "law": law.name},
        versions={"numpy": np.__version__, "scipy": scipy.__version__},
        wall_seconds=round(seconds, 2),
        evaluations=solution.evaluations,
        doubts=list(doubted),
    )
    for text in summary(design, solution, errors, seconds):
        say(text)
    _draw(directory, say)
    return design


def describe(piece):
    """One line about an `Extracted` piece, in the field's units."""
    table = piece.table()
    names = [
        ("tau_rad_per_mm", "tau", "rad/mm"),
        ("curvature_per_m", "curvature", "1/m"),
        ("torsion_rad_per_m", "torsion", "rad/m"),
        ("cylinder_curvature_per_m", "cylinder curvature", "1/m"),
        ("pitch_mm", "pitch", "mm"),
    ]
    rates = ", ".join(f"{name} {table[key]:.4g} {unit}" for key, name, unit in names if key in table)
    note = f" ({piece.note})" if piece.note else ""
    return f"{piece.kind:8s} {piece.length:6.1f} mm, {rates}{note}"


def predicted(kind, strains):
    """What the law predicts for the active part of a piece's segment, by file key; rates per deformed
    length."""
    table = {
        "stretch": float(strains.stretch),
        "k1_rad_per_mm": float(strains.k[0]),
        "k2_per_mm": float(strains.k[1]),
        "k3_per_mm": float(strains.k[2]),
    }
    if kind == TWISTING:
        table["tau_rad_per_mm"] = float(strains.twist_per_deformed_length)
    else:
        table["curvature_per_m"] = 1e3 * float(strains.frenet_curvature)
    if kind == HELICAL:
        table["torsion_rad_per_m"] = 1e3 * float(strains.frenet_torsion)
        table["cylinder_curvature_per_m"] = 1e3 * float(strains.helix_cylinder_curvature)
        table["pitch_mm"] = float(strains.helix_pitch)
    return table


def summary(design, solution, errors, seconds):
    """Lines of the table that a design run ends with."""
    yield "  segment    angle  chambers  height    base     gap  length   wanted   reached (active part)"
    for i, (segment, piece) in enumerate(zip(design.manipulator.segments, design.result["piece"]), start=1):
        base = f"{segment.base_thickness:6.2f}" if segment.kind != TWISTING_KIND else "     -"
        yield (
            f"  {i} {segment.kind:9s}{segment.angle:6.1f}  {segment.chambers:8d} "
            f" {segment.chamber_height:6.2f}  {base}  {segment.gap:6.2f}  {segment.length:6.1f}  "
            f" {_rates(piece)}   {_rates(piece['predicted'])}"
        )
    length = f"undeformed length {design.manipulator.length:.1f} mm"
    yield f"pressure {1e3 * design.pressure:.2f} kPa, {length}, {seconds:.0f} s"
    yield "errors of the reduced prediction:"
    for text in errors.lines():
        yield "  " + text
    if solution.grown:
        yield "ranges that were widened: " + "; ".join(solution.grown)
    yield "active bounds: " + ("; ".join(solution.active) or "none")


def _rates(table):
    if "tau_rad_per_mm" in table:
        return f"tau {1e3 * table['tau_rad_per_mm']:.1f} rad/m"
    return f"curvature {table['curvature_per_m']:.1f}, torsion {table.get('torsion_rad_per_m', 0.0):.1f} 1/m"


def _draw(directory, say):
    try:
        from pneunet.design.report.pictures import draw_design

        draw_design(directory)
    except ImportError:
        say("no picture: matplotlib is missing, install it with: pip install 'pneunet[pictures]'")
