"""Target, reduced prediction and finite elements of one run against each other, all in target coordinates."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pneunet.base import se3
from pneunet.base.errors import ConvergenceError
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.report.labels import kPa, plain, significant
from pneunet.design.report.rundata import DesignFolder
from pneunet.design.target.metrics import Errors, compare
from pneunet.geometry.designfile import DesignFile
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.prediction import doubts, predict_design, segment_strains

#: how far prediction and finite elements may be apart before the verdict looks for a cause: % of length (RMS
#: of points paired by arc length), % of the largest |k| of a segment
POSITION_BAR, STRAIN_BAR = 2.0, 5.0
#: mm; a coarser one may be the cause
USUAL_MESH = DesignFile.mesh_size


@dataclass(frozen=True)
class Comparison:
    """Curves (n, 3) in mm in target coordinates, and `Errors` between them; None where a part is missing.

    reduced: at the design pressure. solved: finite elements at their last pressure; reduced_at_solve,
    strains: the reduced model re-evaluated there. nearest: (pressure in MPa, Errors) of the step nearest to
    the target. notes: what a reader must know to read the numbers rightly. doubted: whether the law doubts
    the design, as the notes then say.
    """

    reduced: np.ndarray | None
    reduced_at_solve: np.ndarray | None
    strains: RodStrains | None
    solved: np.ndarray | None
    reduced_target: Errors | None
    solved_target: Errors | None
    reduced_solved: Errors | None
    notes: tuple[str, ...]
    nearest: tuple[float, Errors] | None = None
    doubted: bool = False

    @classmethod
    def of(cls, run: DesignFolder, law: SegmentLaw) -> "Comparison":
        """What a folder holds against what a law predicts."""
        design = run.design
        doubted = doubts(design.manipulator, [design.pressure], law)
        notes = [f"The law '{law.name}' of the reduced model is in doubt: {text}." for text in doubted]
        solved = at_solve = None
        reduced = _predict(design, design.pressure, law, notes)
        if run.centreline is not None and reduced is not None:
            difference = compare(run.centreline[1], reduced.points)
            if difference.hausdorff > 1e-3 * difference.reference_length:
                notes.append(
                    f"centreline.csv differs by up to {difference.hausdorff:.2f} mm from what the model gives"
                    " for design.toml now: it was edited, or predicted by another model. The report shows"
                    " the model's curve."
                )
        nearest = None
        if run.stale:
            notes.append(
                "The finite element solution in this folder is of another body: its dimensions, materials or"
                " loads are not those of design.toml. It is not shown; run pneunet solve again."
            )
        if run.solve is not None:
            notes += _loading(run)
            if run.target is not None:
                nearest = _nearest(run)
            solved = se3.transform(design.base_pose, smooth(run.solve.s, run.solve.points))
            if stopped_short(run):
                last = kPa(design.scaled(run.solve.pressure))
                notes.append(
                    f"The finite element solution stops at {last}, below the design pressure of "
                    f"{kPa(design.pressure)}. It is compared with the reduced model at {last}; "
                    "its distance to the target is that of a body not fully inflated."
                )
            at_solve = _predict(design, design.scaled(run.solve.pressure), law, notes)
        points, there = (None if line is None else line.points for line in (reduced, at_solve))
        return cls(
            points,
            there,
            None if at_solve is None else segment_strains(design.manipulator, at_solve),
            solved,
            _errors(points, run.target),
            _errors(solved, run.target),
            _errors(there, solved),
            tuple(dict.fromkeys(notes)),
            nearest,
            bool(doubted),
        )


def _loading(run):
    """Sentences on what acted in the finite elements beside a growing pressure."""
    record, notes = run.solve.record, []
    if run.design.loads:
        notes.append(f"Dead loads act: {run.design.loads.text()}.")
    if record.get("control", "pressure") != "pressure":
        notes.append(
            f"The finite elements were walked by {record['control']}: their last pressure is not one that was"
            " asked for."
        )
    for point in record.get("limit_points", []):
        notes.append(
            f"The pressure has a limit point ({point['kind']}) of {plain(point['pressure_kPa'])} kPa at a"
            f" cavity volume of {point['volume_mm3']:.4g} mm3: a body on a pressure source jumps there."
        )
    return notes


def smooth(s: np.ndarray, points: np.ndarray, spacing: float = 1.0) -> np.ndarray:
    """Points (m, 3) about `spacing` mm apart on the cubic spline through section origins (n, 3) at s (n,) mm:
    the stations of the finite element solution lie a pitch apart, and their chords cut corners."""
    fine = np.linspace(s[0], s[-1], int(np.ceil((s[-1] - s[0]) / spacing)) + 1)
    return CubicSpline(s, points)(fine)


def _nearest(run):
    """(pressure in MPa, Errors) of the accepted step that is nearest to the target."""
    tried = []
    for pressure, s, points in run.solve.history:
        tried.append((pressure, compare(se3.transform(run.design.base_pose, smooth(s, points)), run.target)))
    return min(tried, key=lambda item: item[1].rms)


def stopped_short(run: DesignFolder) -> bool:
    """Whether the finite element solution ended below the design pressure (by more than rounding)."""
    return run.solve is not None and run.solve.pressure < run.design.largest_pressure * (1 - 1e-6)


def _predict(design, pressure, law, notes):
    try:
        return predict_design(design, pressure, law)
    except ConvergenceError as error:
        notes.append(f"The reduced model has no solution at {kPa(pressure)}: {error}")
        return None


def _errors(curve, reference):
    return None if curve is None or reference is None else compare(curve, reference)


def overlaps(run: DesignFolder) -> list[str]:
    """Sentences on what overlaps in the finite element solution: walls, parts of the body; [] when nothing
    does."""
    solve = run.solve
    if solve is None:
        return []
    told = []
    if solve.walls_overlap:
        depth = max([0.0] + [-distance for *_, distance in solve.walls])
        now = f", by up to {depth:.2f} mm at the end" if depth > 0 else ""
        told.append(
            f"Walls overlap {_from(solve.record, 'first_touch')}{now}; contact is not part of this solution"
        )
    if solve.body_overlap:
        depth = -solve.steps["body_distance_mm"][-1]
        now = f", by up to {depth:.2f} mm at the end" if depth > 0 else ""
        told.append(
            "Parts of the body that are far apart along it overlap"
            f" {_from(solve.record, 'first_body_touch')}{now}; their contact is not modelled"
        )
    return told


def _from(record, name):
    """'from 7.3 kPa on' of run.json's first touch."""
    pressure, dead = record.get(f"{name}_kPa"), record.get(f"{name}_dead_load_fraction")
    if pressure is None:
        return "at some load"
    if dead and not pressure > 0:
        return f"from {100 * dead:.3g} % of the dead loads on"
    return f"from {pressure:.2f} kPa on"


def verdict(run: DesignFolder, comparison: "Comparison") -> str:
    """The result in one honest sentence, and what forbids to trust it: a solution in which walls overlap
    confirms nothing."""
    c, wanted, solve = comparison, kPa(run.design.pressure), run.solve
    promise = ""
    if c.reduced_target:
        promise = f"for {wanted} the reduced model promises the target within {_mm(c.reduced_target)}"
    if solve is None:
        if promise:
            return f"F{promise[1:]}; there is no finite element solution to compare it with yet."
        return "There is neither a target nor a finite element solution to judge the prediction by."
    pressure = kPa(run.design.scaled(solve.pressure))
    if c.reduced_solved is None:
        sentence = f"At {pressure} the finite element solution has no reduced prediction to be compared with"
    else:
        away = _strain_difference(run, c)
        bars = f"; bar {POSITION_BAR:g} %", f" (bar {STRAIN_BAR:g} %)"
        position_bar, strain_bar = ("", "") if overlaps(run) else bars
        sentence = (
            f"At {pressure} the finite element solution of the whole manipulator and the reduced prediction"
            f" differ by {_mm(c.reduced_solved, position_bar)}, and |k| of a segment by up to"
            f" {significant(away, 2)} %{strain_bar}"
        )
        beyond = c.reduced_solved.percent(c.reduced_solved.rms) > POSITION_BAR or away > STRAIN_BAR
        if beyond and not overlaps(run):
            sentence += f". Beyond the bar; possible causes: {_causes(run, c)}"
    if promise:
        sentence += (
            f". F{promise[1:]}; at {pressure} the finite element body misses it by {_mm(c.solved_target)}"
        )
    elif c.solved_target:
        sentence += f". The finite element body misses the target by {_mm(c.solved_target)}"
    if stopped_short(run):
        asked = solve.record.get("pressure_kPa", np.inf) / KPA_PER_MPA
        reason = "stopped short of"
        if solve.record.get("control", "pressure") != "pressure":
            reason = "ends below"
        elif asked < run.design.largest_pressure * (1 - 1e-6):
            reason = "was asked for less than"
        sentence += f"; the solution {reason} the design pressure, {wanted}"
    if c.nearest and c.nearest[0] < solve.pressure:
        at = kPa(run.design.scaled(c.nearest[0]))
        sentence += f". Its step nearest to the target is at {at}, with {_mm(c.nearest[1])}"
    if overlaps(run):
        sentence = "NOT PROVEN. " + ". ".join(
            [sentence, *overlaps(run), "The finite element shape is not what a real body would take"]
        )
    return sentence + "."


def _strain_difference(run, comparison):
    """Largest |k_reduced - k_FE| over the segments, % of the largest |k| in FE: shows what positions do
    not."""
    solved = run.solve.strains.k
    away = np.linalg.norm(comparison.strains.k - solved, axis=1).max()
    return 100 * float(away / np.linalg.norm(solved, axis=1).max())


def _causes(run, comparison):
    """What, beside the reduced model itself, may have set prediction and finite elements apart."""
    size = run.solve.record.get("mesh_size_mm") or run.design.mesh_size
    coarse = size > USUAL_MESH
    causes = f"{'a coarse mesh' if coarse else 'the mesh'} ({size:g} mm; solve on a finer one to see)"
    return causes + ", what the law of the reduced model is in doubt about" * comparison.doubted


def _mm(errors, bar=""):
    percent = significant(errors.percent(errors.rms), 2)
    return f"{significant(errors.rms, 2)} mm RMS ({percent} % of length{bar})"
