"""Inverse design: from what is wanted to what to cast, and at what pressure."""

import logging
import textwrap
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError, located
from pneunet.base.files.folder import output_folder
from pneunet.base.files.schemas import STRAINS
from pneunet.base.files.toml import to_table
from pneunet.base.materials.laws import PAPER_TWISTING
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.design import Design, chosen_law
from pneunet.design.report.labels import kPa
from pneunet.design.search.aims import OBJECTIVES, PAIRED
from pneunet.design.search.doubts import WARN, WAYS, tell_doubts
from pneunet.design.search.inverse import Map, search
from pneunet.design.search.tolerances import largest, tolerances
from pneunet.design.search.wanted import wanted
from pneunet.design.target.extraction import Extracted, rates
from pneunet.design.target.metrics import FOLLOWED
from pneunet.design.target.target import BENDING, HELICAL, Target
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
#: of the design's pressure: less is what the casting grid leaves of a limit, not a limit that is exceeded
ROUNDED = 0.98
#: of a terminal
COLUMNS = 100
#: rad of torsion along a helical piece, below which it is told as what it is, bending
FLAT = 1e-6
#: dimensions that are named as those that move the shape most
MOST = 4
log = logging.getLogger(__name__)


def inverse_design(
    target: Target | str | Path | np.ndarray,
    *,
    law: str | SegmentLaw = "trained",
    objective: str = PAIRED,
    outside: str = WARN,
    mapping: Map = map,
) -> Design:
    """The Design whose predicted centreline lies on the target; writes and prints nothing.

    target: a Target, its file, or points (n, 3) in mm. law: 'trained', 'analytic', a law's file (.npz) or a
    SegmentLaw. objective: 'paired' or 'eq27' (docs/use-design.md). outside: 'warn' or 'refuse' a design that
    the law doubts. mapping: a `map` that spreads the starts, over processes for instance; the answer does not
    depend on it. InputError on bad input, ConvergenceError where the law has no answer.
    """
    started = time.perf_counter()
    for name, value, known in (("objective", objective, OBJECTIVES), ("outside", outside, WAYS)):
        if value not in known:
            raise InputError(f"{name} = '{value}' is not known: write {' or '.join(known)}")
    law, target = chosen_law(law), as_target(target)
    log.info(f"target {target.name}: {len(target.points)} points; {target.base_told}")
    asked = wanted(replace(target, material=target.softest), law)
    target = replace(asked.target, material=target.material)
    count = len(asked.pieces)
    told = [f"{asked.note}: {count} piece{'s' * (count > 1)}, {target.length:.2f} mm"]
    told += [f"  piece {i}: {describe(piece)}" for i, piece in enumerate(asked.pieces, start=1)]
    for text in wrapped((*told, *(f"  {note}" for note in asked.notes))):
        log.info(text)
    with located(target.source) if target.source else nullcontext():
        found = search(target, asked.pieces, law, objective, mapping=mapping)
    best = found.best
    chosen = best.manipulator.segments[0].material
    target = replace(target, material=chosen)
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
    if target.loads and not design.followed:
        log.info("not followed: once more without gravity, to tell whether the weight is the cause")
        cause = weight_told(asked.target, asked.pieces, law, objective, mapping)
        design = replace(design, stopped_by=cause or found.stopped_by)
    tell_doubts(design.doubts, law, outside)
    content.result.update(
        {
            "split": asked.note,
            "notes": list(asked.notes),
            "objective": objective,
            "law": law.name,
            "silicone": chosen.name,
            "mu_MPa": round(chosen.mu, 6),
            "followed": design.followed,
            "doubts": list(design.doubts),
            "active_bounds": list(found.active),
            "pressure_limits": list(_pressure_limits(content, law)),
            "flush_underside_costs_mm": round(found.flush_costs, 4),
            "target_error": design.errors.table() if design.errors else {},
            "shape_error": [e.table() for e in design.further_errors],
            "tip_errors_mm": list(design.tip_errors),
            "tolerances": spread.table(),
            "alternative": [_table(c, best) for c in found.alternatives],
            "piece": [
                {**piece.table(), "predicted": predicted(piece.kind, RodStrains(e, k))}
                for piece, e, k in zip(found.pieces, design.strains.e, design.strains.k)
            ],
        }
    )
    return design


def weight_told(
    target: Target, pieces: Sequence[Extracted], law: SegmentLaw, objective: str = PAIRED, mapping: Map = map
) -> str:
    """That its own weight keeps a body off a target with gravity, in words; "" where the search does not come
    near without gravity either."""
    try:
        free = search(replace(target, gravity=(0.0, 0.0, 0.0)), pieces, law, objective, 0, mapping).best
    except ConvergenceError:
        return ""
    if free.rms > FOLLOWED * target.length:
        return ""
    return (
        f"its own weight is the cause: without gravity a body comes within {free.rms:.2g} mm RMS; make it"
        " shorter, of a stiffer silicone, or give no gravity"
    )


def _table(candidate, best):
    """A Candidate in numbers, for result tables; of its segments what differs from the best one's."""
    segments, one = candidate.manipulator.segments, candidate.pressures.shape[1] == 1
    pairs = [(to_table(s), to_table(b)) for s, b in zip(segments, best.manipulator.segments)]
    return {
        "rms_mm": round(candidate.centreline_rms, 4),
        "misfit_mm": round(candidate.rms, 4),
        "silicone": segments[0].material.name,
        "mu_MPa": round(segments[0].material.mu, 6),
        "pressure_kPa": (KPA_PER_MPA * candidate.pressures.squeeze(axis=1 if one else ())).round(3).tolist(),
        "segment": [{k: v for k, v in own.items() if b.get(k) != v} for own, b in pairs],
    }


def as_target(target: Target | str | Path | np.ndarray) -> Target:
    """A Target from itself, from its file or from points (n, 3) in mm; InputError for one that cannot be."""
    if isinstance(target, Target):
        return target
    return Target.read(target) if isinstance(target, str | Path) else Target(target)


def run_design(
    target: str | Path,
    directory: str | Path,
    law: SegmentLaw,
    objective: str = PAIRED,
    outside: str = WARN,
    mapping: Map = map,
) -> Design:
    """`pneunet design`: the inverse design of a target's file, saved in a folder, with its table on the
    screen.

    Nothing is written before the design is found. InputError and ConvergenceError as for inverse_design.
    """
    wanted = Target.read(target)
    with output_folder(directory) as folder:
        design = inverse_design(wanted, law=law, objective=objective, outside=outside, mapping=mapping)
        design.write(folder)
    for text in wrapped((*summary(design), *answer(design))):
        log.info(text)
    return design


def describe(piece: Extracted) -> str:
    """One line about an `Extracted` piece, in the field's units."""
    kind, table = piece.kind, piece.table()
    if kind == HELICAL and abs(piece.twist * piece.length) < FLAT:
        kind = BENDING
        table = rates(kind, piece.strains)
    rolled = f", rolled by {piece.roll:g} deg" * bool(piece.roll)
    told = [f"{name} {table[key]:.4g} {unit}" for key, (name, unit) in RATES.items() if key in table]
    note = f" ({piece.note})" if piece.note else ""
    return f"{kind:8s} {piece.length:6.1f} mm, {', '.join(told)}{rolled}{note}"


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
    yield f"pressure {kPa(design.content.pressure)}, {length}, {seconds:.1f} s"
    if design.errors:
        guided = design.target is not None and design.target.guided
        yield f"errors of the reduced prediction{' against the guide, which need not be met' * guided}:"
        yield from ("  " + text for text in design.errors.lines())
    shapes = design.target.shapes if design.target else ()
    for i, (shape, e) in enumerate(zip(shapes, design.further_errors), start=1):
        told = f"RMS {e.rms:.3f} mm ({e.percent(e.rms):.2f} % of length), tip {e.tip:.3f} mm"
        yield f"shape {i} at {kPa(shape.pressures)}: {told}"
    tip = design.target.tip if design.target else None
    tips = zip(tip.pressures, design.tip_errors) if tip else ()
    yield from _listed("points of the tip", (f"at {kPa(float(P))}: {away:.3f} mm away" for P, away in tips))
    yield from _listed("active bounds", design.active_bounds or ["none"])
    if flush := design.content.result.get("flush_underside_costs_mm"):
        yield f"flush undersides cost {flush:.2f} mm ([casting] allow_steps = true allows steps)"
    if design.tolerances:
        yield from _listed("what moves it most", map(str, largest(design.tolerances.effects, MOST)))
    yield from _listed("alternatives", (f"{i}: {c}" for i, c in enumerate(design.alternatives, start=1)))
    yield from _listed("limits of the pressure", design.content.result.get("pressure_limits", ()))


def _listed(heading: str, rows: Iterable[str]) -> Iterator[str]:
    """The heading, then a row a line; nothing without rows."""
    for i, row in enumerate(rows):
        if i == 0:
            yield f"{heading}:"
        yield f"  {row}"


def _pressure_limits(content, law):
    """A text each, lowest first."""
    from pneunet.design.workshop.limits import limits

    for limit in limits(content, law):
        exceeded = " (EXCEEDED)" * (limit.pressure < ROUNDED * content.largest_pressure)
        yield f"{kPa(limit.pressure)}{exceeded}: {limit.reason}"


def wrapped(lines: Iterable[str], width: int = COLUMNS) -> Iterator[str]:
    """Lines no wider than a terminal; what goes on is indented further."""
    for text in lines:
        indent = " " * (len(text) - len(text.lstrip()))
        yield from textwrap.wrap(
            text,
            width,
            subsequent_indent=indent + "    ",
            drop_whitespace=True,
            break_long_words=False,
            break_on_hyphens=False,
        )


def answer(design: Design) -> Iterator[str]:
    """The last lines: followed or not, how far the real body may be, what was assumed; in plain words."""
    errors, spread, target = design.errors, design.tolerances, design.target
    if errors is None or spread is None or target is None:
        return
    rms = f"RMS {errors.rms:.2f} mm ({errors.percent(errors.rms):.2f} % of length)"
    told, share = [rms], [f"{100 * errors.not_followed:.0f} % of length"]
    if target.guided:
        told, share = [], []
    if design.tip_errors:
        told.append(f"tip at most {max(design.tip_errors):.2f} mm from its points")
    if design.followed:
        castings = f"castings within the tolerances will be off by {spread.rms:.2f} mm RMS"
        yield f"followed: {'; '.join((*told, castings))}"
    else:
        of_its_own = "no bound stops it: few pieces of constant strain do not follow this curve"
        yield f"NOT followed: {'; '.join((*share, *told, design.stopped_by or of_its_own))}"
    if spread.law_rms is None or spread.law_tip is None:
        yield f"how far the real body may be: the law '{design.law.name}' does not know"
    else:
        yield (
            f"the real body may be {spread.law_rms:.1f} mm RMS and {spread.law_tip:.1f} mm at the tip from"
            " this prediction (90 % of cases)"
        )
    silicone, casting = f"{target.material.name}, mu = {target.material.mu:.4g} MPa", target.casting
    if casting.silicones:
        count = len(casting.silicones)
        yield f"chosen of {count} silicones: {silicone}" if count > 1 else f"silicone: {silicone}"
    elif casting.moduli:
        low, high = casting.moduli
        yield f"chosen modulus: mu = {target.material.mu:.4g} MPa, of {low:g}..{high:g} MPa"
    elif target.material == PAPER_TWISTING:
        yield f"ASSUMED silicone: {silicone}; give yours as [material] in a target's TOML"
