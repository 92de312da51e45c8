"""Inverse design: from what is wanted to what to cast, and at what pressure."""

import logging
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.folder import output_folder
from pneunet.base.files.schemas import STRAINS
from pneunet.base.strains import RodStrains
from pneunet.design.design import Design, chosen_law
from pneunet.design.search.aims import OBJECTIVES, PAIRED
from pneunet.design.search.doubts import WARN, WAYS, tell_doubts
from pneunet.design.search.inverse import search
from pneunet.design.target.extraction import Extracted, extract, rates
from pneunet.design.target.segmentation import NOTE, split
from pneunet.design.target.target import Target
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import TWISTING
from pneunet.reduced.rod.laws import SegmentLaw

GIVEN_NOTE = "split given by the user"
#: file key -> (word, unit) of a piece's rates
RATES = {
    "tau_rad_per_mm": ("tau", "rad/mm"),
    "curvature_per_m": ("curvature", "1/m"),
    "torsion_rad_per_m": ("torsion", "rad/m"),
    "cylinder_curvature_per_m": ("cylinder curvature", "1/m"),
    "pitch_mm": ("pitch", "mm"),
}
log = logging.getLogger(__name__)


def inverse_design(
    target: Target | str | Path | np.ndarray,
    *,
    law: str | SegmentLaw = "trained",
    objective: str = PAIRED,
    outside: str = WARN,
) -> Design:
    """The Design whose predicted centreline lies on the target; writes and prints nothing.

    target: a Target, its file, or points (n, 3) in mm. law: 'trained', 'analytic', a law's file (.npz) or a
    SegmentLaw. objective: 'paired' or 'eq27' (docs/use-design.md). outside: 'warn' or 'refuse' a design that
    the law doubts. InputError on bad input, ConvergenceError where the law has no answer.
    """
    started = time.perf_counter()
    for name, value, known in (("objective", objective, OBJECTIVES), ("outside", outside, WAYS)):
        if value not in known:
            raise InputError(f"{name} = '{value}' is not known: write {' or '.join(known)}")
    law, target = chosen_law(law), as_target(target)
    pieces, note = (target.pieces, GIVEN_NOTE) if target.pieces else (split(target.curve), NOTE)
    log.info(f"target {target.name}: {len(target.points)} points, {target.length:.2f} mm; {note}")
    wanted = extract(target, pieces)
    for i, piece in enumerate(wanted, start=1):
        log.info(f"  piece {i}: {describe(piece)}")
    found = search(target, wanted, law, objective)
    content = DesignFile(found.manipulator, found.pressure, name=target.name, base_pose=found.base_pose)
    effort = {
        "inputs": {"target": target.source or target.name, "objective": objective},
        "evaluations": found.evaluations,
        "wall_seconds": round(time.perf_counter() - started, 2),
    }
    design = Design(content, law, target, found.active, effort)
    tell_doubts(design.doubts, law, outside)
    content.result.update(
        {
            "split": note,
            "objective": objective,
            "law": law.name,
            "doubts": list(design.doubts),
            "active_bounds": list(found.active),
            "flush_underside_costs_mm": round(found.flush_costs, 4),
            "target_error": design.errors.table() if design.errors else {},
            "piece": [
                {**piece.table(), "predicted": predicted(piece.kind, RodStrains(e, k))}
                for piece, e, k in zip(wanted, design.strains.e, design.strains.k)
            ],
        }
    )
    return design


def as_target(target: Target | str | Path | np.ndarray) -> Target:
    """A Target from itself, from its file or from points (n, 3) in mm; InputError for one that cannot be."""
    if isinstance(target, Target):
        return target
    return Target.read(target) if isinstance(target, str | Path) else Target(np.asarray(target, float))


def run_design(
    target: str | Path, directory: str | Path, law: SegmentLaw, objective: str = PAIRED, outside: str = WARN
) -> Design:
    """`pneunet design`: the inverse design of a target's file, saved in a folder, with its table on the
    screen.

    Nothing is written before the design is found. InputError and ConvergenceError as for inverse_design.
    """
    wanted = Target.read(target)
    with output_folder(directory) as folder:
        design = inverse_design(wanted, law=law, objective=objective, outside=outside)
        design.write(folder)
    for text in summary(design):
        log.info(text)
    return design


def describe(piece: Extracted) -> str:
    """One line about an `Extracted` piece, in the field's units."""
    table = piece.table()
    told = [f"{name} {table[key]:.4g} {unit}" for key, (name, unit) in RATES.items() if key in table]
    note = f" ({piece.note})" if piece.note else ""
    return f"{piece.kind:8s} {piece.length:6.1f} mm, {', '.join(told)}{note}"


def predicted(kind: str, strains: RodStrains) -> dict[str, float]:
    """What the law predicts for the active part of a piece's segment, by file key; rates per deformed
    length."""
    table = {"stretch": strains.stretch} | dict(zip(STRAINS[3:], strains.k))
    return {key: float(value) for key, value in table.items()} | rates(kind, strains)


def summary(design: Design) -> Iterator[str]:
    """Lines of the table that `pneunet design` ends with."""
    yield "  segment    angle  chambers  height    base     gap  length   wanted   reached (active part)"
    m = design.manipulator
    for i, (segment, piece) in enumerate(zip(m.segments, design.content.result["piece"]), start=1):
        base = f"{segment.base_thickness:6.2f}" if segment.kind != TWISTING else "     -"
        yield (
            f"  {i} {segment.kind:9s}{segment.angle:6.1f}  {segment.chambers:8d} "
            f" {segment.chamber_height:6.2f}  {base}  {segment.gap:6.2f}  {segment.length:6.1f}  "
            f" {_rates(piece)}   {_rates(piece['predicted'])}"
        )
    length, seconds = f"undeformed length {m.length:.1f} mm", design.effort["wall_seconds"]
    yield f"pressure {design.pressure_kPa:.2f} kPa, {length}, {seconds:.0f} s"
    if design.errors:
        yield "errors of the reduced prediction:"
        yield from ("  " + text for text in design.errors.lines())
    yield "active bounds: " + ("; ".join(design.active_bounds) or "none")


def _rates(table):
    if "tau_rad_per_mm" in table:
        return f"tau {1e3 * table['tau_rad_per_mm']:.1f} rad/m"
    return f"curvature {table['curvature_per_m']:.1f}, torsion {table.get('torsion_rad_per_m', 0.0):.1f} 1/m"
