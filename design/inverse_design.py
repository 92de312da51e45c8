"""Inverse design: from what is wanted to what to cast, and at what pressure."""

import logging
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.folder import output_folder
from pneunet.base.files.schemas import STRAINS
from pneunet.base.files.toml import to_table
from pneunet.base.materials.laws import PAPER_TWISTING
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.design import Design, chosen_law
from pneunet.design.search.aims import OBJECTIVES, PAIRED
from pneunet.design.search.doubts import WARN, WAYS, tell_doubts
from pneunet.design.search.inverse import search
from pneunet.design.search.tolerances import largest, tolerances
from pneunet.design.search.wanted import wanted
from pneunet.design.target.extraction import Extracted, rates
from pneunet.design.target.target import Target
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.parameters import PASSIVE, TWISTING
from pneunet.reduced.rod.laws import SegmentLaw

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
    log.info(f"target {target.name}: {len(target.points)} points; {target.base_told}")
    asked = wanted(target, law)
    target = asked.target
    log.info(f"{asked.note}: {len(asked.pieces)} pieces, {target.length:.2f} mm")
    for i, piece in enumerate(asked.pieces, start=1):
        log.info(f"  piece {i}: {describe(piece)}")
    for text in asked.notes:
        log.info(f"  {text}")
    found = search(target, asked.pieces, law, objective)
    best = found.best
    content = DesignFile(
        best.manipulator, best.pressure, name=target.name, base_pose=best.base_pose, loads=target.loads
    )
    effort = {
        "inputs": {"target": target.source or target.name, "objective": objective},
        "evaluations": found.evaluations,
        "wall_seconds": round(time.perf_counter() - started, 2),
    }
    spread = tolerances(best.at.body, best.at.shapes[0], target.casting, law)
    design = Design(content, law, target, found.active, effort, spread, found.alternatives, found.stopped_by)
    tell_doubts(design.doubts, law, outside)
    content.result.update(
        {
            "split": asked.note,
            "notes": list(asked.notes),
            "objective": objective,
            "law": law.name,
            "followed": design.followed,
            "doubts": list(design.doubts),
            "active_bounds": list(found.active),
            "flush_underside_costs_mm": round(found.flush_costs, 4),
            "target_error": design.errors.table() if design.errors else {},
            "shape_error": [e.table() for e in design.further_errors],
            "tolerances": spread.table(),
            "alternative": [_table(c) for c in found.alternatives],
            "piece": [
                {**piece.table(), "predicted": predicted(piece.kind, RodStrains(e, k))}
                for piece, e, k in zip(asked.pieces, design.strains.e, design.strains.k)
            ],
        }
    )
    return design


def _table(candidate):
    """A Candidate in numbers, for result tables."""
    segments = candidate.manipulator.segments
    return {
        "rms_mm": round(candidate.rms, 4),
        "pressure_kPa": [round(KPA_PER_MPA * float(P), 3) for P in candidate.pressures],
        "segment": [to_table(s) for s in segments],
    }


def as_target(target: Target | str | Path | np.ndarray) -> Target:
    """A Target from itself, from its file or from points (n, 3) in mm; InputError for one that cannot be."""
    if isinstance(target, Target):
        return target
    return Target.read(target) if isinstance(target, str | Path) else Target(target)


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
    for text in (*summary(design), *answer(design)):
        log.info(text)
    return design


def describe(piece: Extracted) -> str:
    """One line about an `Extracted` piece, in the field's units."""
    table = piece.table()
    rolled = f", rolled by {piece.roll:g} deg" * bool(piece.roll)
    told = [f"{name} {table[key]:.4g} {unit}" for key, (name, unit) in RATES.items() if key in table]
    note = f" ({piece.note})" if piece.note else ""
    return f"{piece.kind:8s} {piece.length:6.1f} mm, {', '.join(told)}{rolled}{note}"


def predicted(kind: str, strains: RodStrains) -> dict[str, float]:
    """What the law predicts for the active part of a piece's segment, by file key; rates per deformed
    length."""
    table = {"stretch": strains.stretch} | dict(zip(STRAINS[3:], strains.k))
    return {key: float(value) for key, value in table.items()} | rates(kind, strains)


def summary(design: Design) -> Iterator[str]:
    """Lines of the table of what to cast that `pneunet design` prints."""
    yield "  segment      angle  chambers  height    wall    base     gap  length"
    for i, s in enumerate(design.manipulator.segments, start=1):
        name = f"  {i} {s.kind:9s}"
        if s.kind == PASSIVE:
            yield f"{name}  {'':38s}{s.base_thickness:6.2f}        {s.length:7.1f}"
            continue
        base = "     -" if s.kind == TWISTING else f"{s.base_thickness:6.2f}"
        rolled = f"   rolled by {s.roll} deg" * bool(s.roll)
        yield (
            f"{name} {s.angle:6.1f}  {s.chambers:8d}  {s.chamber_height:6.2f}  {s.wall:6.2f}  {base}"
            f"  {s.gap:6.2f} {s.length:7.1f}{rolled}"
        )
    length, seconds = f"undeformed length {design.manipulator.length:.1f} mm", design.effort["wall_seconds"]
    yield f"pressure {design.pressure_kPa:.2f} kPa, {length}, {seconds:.1f} s"
    if design.errors:
        yield "errors of the reduced prediction:"
        yield from ("  " + text for text in design.errors.lines())
    shapes = design.target.shapes if design.target else ()
    for i, (shape, e) in enumerate(zip(shapes, design.further_errors), start=1):
        told = f"RMS {e.rms:.3f} mm ({e.percent(e.rms):.2f} % of length), tip {e.tip:.3f} mm"
        yield f"shape {i} at {KPA_PER_MPA * shape.pressures[0]:.2f} kPa: {told}"
    yield "active bounds: " + ("; ".join(design.active_bounds) or "none")
    if flush := design.content.result.get("flush_underside_costs_mm"):
        yield f"flush undersides cost {flush:.2f} mm ([casting] allow_steps = true allows steps)"
    if design.tolerances:
        yield "what moves it most: " + "; ".join(
            f"{'segment ' + str(e.segment) + ' ' if e.segment else ''}{e.name.rsplit('_', 1)[0]}"
            f" {e.change}: {e.rms:.2f} mm RMS, {e.tip:.2f} mm at the tip"
            for e in largest(design.tolerances.effects, 4)
        )
    for i, candidate in enumerate(design.alternatives, start=1):
        yield f"alternative {i}: {candidate}"


def answer(design: Design) -> Iterator[str]:
    """The last lines: followed or not, how far the real body may be, what was assumed; in plain words."""
    errors, spread, target = design.errors, design.tolerances, design.target
    if errors is None or spread is None or target is None:
        return
    rms = f"RMS {errors.rms:.2f} mm ({errors.percent(errors.rms):.2f} % of length)"
    if design.followed:
        yield f"followed: {rms}; castings within the tolerances will be off by {spread.rms:.2f} mm RMS"
    else:
        of_its_own = "no bound stops it: few pieces of constant strain do not follow this curve"
        stopped = design.stopped_by or of_its_own
        yield f"NOT followed: {100 * errors.not_followed:.0f} % of length; {rms}; {stopped}"
    if spread.law_rms is None or spread.law_tip is None:
        yield f"how far the real body may be: the law '{design.law.name}' does not know"
    else:
        rms, tip = np.hypot(spread.law_rms, spread.mesh_rms), np.hypot(spread.law_tip, spread.mesh_tip)
        yield (
            f"the real body may be {rms:.1f} mm RMS and {tip:.1f} mm at the tip from this prediction:"
            f" {spread.law_tip:.1f} mm (90 % of cases) for the law, {spread.mesh_tip:.1f} mm for the mesh of"
            " its cells, which is a little too stiff"
        )
    if target.material is PAPER_TWISTING:
        material = f"{target.material.name}, mu = {target.material.mu:g} MPa"
        yield f"ASSUMED silicone: {material}; give yours as [material] in a target's TOML"
