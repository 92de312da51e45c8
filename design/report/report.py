"""`pneunet report`: one self-contained page that shows what was asked, designed, predicted and proven."""

import logging
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_text
from pneunet.base.files.folder import output_folder
from pneunet.base.progress import Pace
from pneunet.base.system.libraries import load_vtk
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.report import figures
from pneunet.design.report.bodies import Scene, read_solution
from pneunet.design.report.comparison import (
    POSITION_BAR,
    STRAIN_BAR,
    Comparison,
    overlaps,
    stopped_short,
    verdict,
)
from pneunet.design.report.drawing import draw_drawing, segment_table
from pneunet.design.report.labels import kPa, material_names, plain, segment_name, signed, significant
from pneunet.design.report.page import document, folded, grid, image, missing, table
from pneunet.design.report.rundata import read_design_folder
from pneunet.design.report.viewing import framed
from pneunet.reduced.choice import choose_law
from pneunet.reduced.rod.laws import SegmentLaw

log = logging.getLogger(__name__)


def write_report(directory: str | Path, law: SegmentLaw | None = None) -> Path:
    """Write directory/report.html and its pictures in directory/report/; returns the path of the page.

    law: a SegmentLaw, by default the one that the folder was designed with. Shows what is there: without a
    mesh or a finite element solution it says so. InputError without design.toml.
    """
    found = read_design_folder(directory)
    load_vtk()
    run = _with_sound_fields(found)
    for text in run.damaged:
        log.warning(f"warning: left out of the report: {text}")
    law = choose_law(run.law) if law is None else law
    with output_folder(run.directory), output_folder(run.directory / "report") as folder:
        return _write(run, law, folder)


def _write(run, law, folder):
    """The path of the page."""
    log.info(f"report of {run.directory}: curves and bodies")
    comparison = Comparison.of(run, law)
    scene = Scene.of(run, comparison, law)
    draw_drawing(run.design, folder / "drawing.png")
    body, pace = _headline(run, comparison), Pace()
    sections = (
        ("Target, prediction, finite elements", lambda: _shapes(run, comparison, scene, folder)),
        ("To turn by hand", lambda: framed(run, law)),
        ("Errors", lambda: _errors(comparison, run)),
        ("Strains of the segments", lambda: _strains(run, comparison)),
        ("Load history", lambda: _history(run, law, folder)),
        ("Where walls touch", lambda: _walls(run, scene, folder)),
        ("Drawing, dimensions, material", lambda: _drawing(run, folder)),
        ("How it was computed", lambda: _computed(run)),
    )
    for number, (title, content) in enumerate(sections, start=1):
        body += f"<section><h2>{escape(title)}</h2>{content()}</section>"
        log.info(f"  {title.lower()}{pace.left(number / len(sections)) * (number < len(sections))}")
    path = run.directory / "report.html"
    write_text(path, document(f"{run.design.name}: report", body, "Lengths in mm, pressures in kPa."))
    log.info(verdict(run, comparison))
    log.info(f"report: {path}")
    return path


def _with_sound_fields(run):
    """The DesignFolder, without a solution's fields where they are damaged."""
    if run.solve is None or run.solve.solution is None:
        return run
    try:
        read_solution(run.solve.solution)
        return run
    except InputError as error:
        told = str(error).removeprefix(f"{run.directory}/")
        return replace(run, solve=replace(run.solve, solution=None), damaged=(*run.damaged, told))


def _headline(run, comparison):
    design, m = run.design, run.design.manipulator
    c = comparison
    errors = c.reduced_target or c.solved_target
    asked = "No target stands beside this design."
    if run.target is not None:
        length = f", {errors.reference_length:.1f} mm long" if errors else ""
        asked = f"A curve of {len(run.target)} points{length} ({design.target or 'target.csv'})."
    names = ", ".join(segment_name(s) for s in m.segments)
    told = f"one pressure of {kPa(design.pressure)}"
    if len(m.groups) > 1:
        told = f"{len(m.groups)} pressure groups at {kPa(design.pressure)}"
    designed = (
        f"{len(m.segments)} segment{'s' * (len(m.segments) > 1)} ({names}), {m.length:.1f} mm long at rest, "
        f"{m.segments[0].width:g} mm wide, {told}."
    )
    out = (
        f"<h1>{escape(design.name)}</h1><p><b>Asked:</b> {escape(asked)}<br><b>Designed:</b>"
        f" {escape(designed)}</p>"
    )
    out += f'<p class="verdict">{escape(verdict(run, comparison))}</p>'
    out += _alarms(run)
    out += "".join(f'<p class="note">Damaged, and left out: {escape(text)}</p>' for text in run.damaged)
    out += "".join(f'<p class="note">{escape(note)}</p>' for note in c.notes)
    if c.reduced_solved:
        out += (
            '<p class="missing">The bars are conventions of this report: an RMS distance of'
            f" {POSITION_BAR:g} % of length, a difference of {STRAIN_BAR:g} % of the largest |k| of a"
            " segment.</p>"
        )
    return out


def _alarms(run):
    return "".join(f'<p class="alarm">OVERLAP, not proven: {escape(text)}.</p>' for text in overlaps(run))


def _shapes(run, comparison, scene, folder):
    out = ""
    if run.solve is None:
        out += missing("There is no finite element solution in this folder yet (pneunet solve).")
    elif run.solve.solution is None:
        out += missing("The finite element fields (solve/solution.pvd) are not in this folder.")
    curves = figures.curve_picture(run, comparison, folder)
    bodies = figures.body_pictures(run, scene, folder)
    fields = [b for b in bodies if b[0] in ("fe_displacement.png", "fe_stretch.png", "reference.png")]
    beside = [b for b in bodies if b not in fields]
    return (
        out
        + "<p>Same camera and scale for all pictures but the body at rest.</p>"
        + grid(folder, beside)
        + "".join(image(folder, *c) for c in curves)
        + grid(folder, fields)
    )


def _errors(comparison, run):
    at = f" at {kPa(run.design.scaled(run.solve.pressure))}" if run.solve else ""
    columns = [
        (f"reduced vs target at {kPa(run.design.pressure)}", comparison.reduced_target),
        (f"FE vs target{at}", comparison.solved_target),
        (f"reduced vs FE{at}", comparison.reduced_solved),
    ]
    mark = " (overlaps: not proven)" * bool(overlaps(run))
    columns = [(name + mark * ("FE" in name), e) for name, e in columns if e is not None]
    if not columns:
        return missing("There are no two curves to compare.")

    def both(e, mm, told=significant):
        return f"{told(mm, 3)} mm ({told(e.percent(mm), 2)} %)"

    rows = [
        ["RMS, points paired by arc length"] + [both(e, e.rms) for _, e in columns],
        ["two-sided Hausdorff distance"] + [both(e, e.hausdorff) for _, e in columns],
        ["tip distance"] + [both(e, e.tip) for _, e in columns],
        ["Eq. 27 (sum of squared nearest distances)"]
        + [f"{significant(e.eq27)} mm² over {e.eq27_points} points" for _, e in columns],
        ["length mismatch"] + [both(e, e.length_mismatch, signed) for _, e in columns],
        ["lengths"] + [f"{e.length:.2f} mm vs {e.reference_length:.2f} mm" for _, e in columns],
    ]
    return (
        table(["", *[name for name, _ in columns]], rows)
        + "<p>% of the length of the second curve named.</p>"
    )


def _strains(run, comparison):
    if run.solve is None:
        return missing("Segment strains are measured on the finite element solution, which is not there yet.")
    measured, predicted = run.solve.strains, comparison.strains
    quantities = [
        ("stretch |e|", lambda s: s.stretch, 1.0, 4),
        ("twist k1, rad/m of undeformed length", lambda s: s.k[:, 0], 1e3, 2),
        ("curvature k2 (about the width), 1/m of undeformed length", lambda s: s.k[:, 1], 1e3, 2),
        ("curvature k3 (about the height), 1/m of undeformed length", lambda s: s.k[:, 2], 1e3, 2),
        ("Frenet curvature |k x e|/|e|², 1/m", lambda s: s.frenet_curvature, 1e3, 2),
        ("torsion k.e/|e|² (a twisting segment's tau), rad/m", lambda s: s.frenet_torsion, 1e3, 2),
    ]
    rows: list[str | list[str]] = []
    for i, segment in enumerate(run.design.manipulator.segments):
        rows.append(f"segment {i + 1}: {segment_name(segment)}")
        for label, of, unit, digits in quantities:
            fe = of(measured)[i] * unit
            reduced = None if predicted is None else of(predicted)[i] * unit
            told = "-" if reduced is None else _fixed(reduced, digits)
            ratio = "-" if reduced is None or abs(reduced) < 10.0**-digits else f"{fe / reduced:.3f}"
            rows.append([label, told, _fixed(fe, digits), ratio])
    return (
        _alarms(run)
        + table([f"at {kPa(run.design.scaled(run.solve.pressure))}", "reduced", "FE", "FE / reduced"], rows)
        + "<p>Strains refer to the section frame on the channel axis; |k| and k.e of a uniform screw do not"
        " depend on that choice.</p>"
    )


def _fixed(value, digits):
    """Fixed decimals, and no minus before a zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _history(run, law, folder):
    if run.solve is None:
        return missing("No finite element solution yet.")
    return "".join(image(folder, *p) for p in figures.history_picture(run.design, run.solve, law, folder))


def _walls(run, scene, folder):
    if run.solve is None:
        return missing("No wall distances: there is no finite element solution yet.")
    solve = run.solve
    distances = [d for *_, d in solve.walls]
    out, touching = _alarms(run), sum(d < 0 for d in distances)
    if touching and solve.contact:
        out += f"<p>Walls touch in {touching} of {len(distances)} gaps, held apart by a contact model.</p>"
    elif touching:
        out += f"<p>WALLS OVERLAP in {touching} of {len(distances)} gaps; a real body would be stopped.</p>"
    elif distances:
        out += f"<p>No walls touch in the last step: the smallest distance is {min(distances):.2f} mm.</p>"
    far = solve.steps["body_distance_mm"][-1]
    if np.isfinite(far):
        out += (
            "<p>Coils and segments: the smallest distance between parts that are far apart along the body is"
            f" {far:.2f} mm. Contact between such parts is not modelled.</p>"
        )
    if not distances:
        return out + missing("No wall distances: the body has no gaps.")
    out += grid(folder, figures.touching_picture(run.design, solve, scene, folder))
    out += "".join(image(folder, *p) for p in figures.wall_picture(run.design.manipulator, solve, folder))
    rows = []
    for key in sorted({(a, b) for a, b, _, _ in solve.walls}, key=lambda k: (k[0], -k[1])):
        here = [(d, gap) for a, b, gap, d in solve.walls if (a, b) == key]
        distance, gap = min(here)
        rest = run.design.manipulator.segments[key[0] - 1].gap
        rows.append(
            [
                f"{key[0]}, {'upper' if key[1] > 0 else 'lower'}",
                len(here),
                plain(rest),
                f"{distance:.3f}",
                gap,
                "open" if distance >= 0 else "in contact" if solve.contact else "OVERLAP",
            ]
        )
    return out + table(
        ["segment, side", "gaps", "gap at rest, mm", "smallest distance, mm", "in gap", ""], rows
    )


def _drawing(run, folder):
    rows = segment_table(run.design.manipulator)
    dimensions = table(
        ["segment", *[str(i + 1) for i in range(len(rows[0][1]))]],
        [[label, *values] for label, values in rows],
    )
    called = material_names(run.design.manipulator).items()
    told = table(
        ["material", "law", "shear modulus, MPa", "density, kg/m³", "source"],
        [[name, m.law, plain(m.mu, 4), plain(m.density * 1e12), m.source or "-"] for m, name in called],
    )
    return image(folder, "drawing.png", "All dimensions in mm.") + dimensions + told


def _flat(record, prefix=""):
    """(key, text) of what a nested record says in few words: not the bodies and steps that stand in files of
    their own."""
    for key, value in record.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            yield from _flat(value, f"{name}: ")
        elif isinstance(value, list):
            if value and len(value) <= 8 and not any(isinstance(v, (dict, list)) for v in value):
                yield name, ", ".join(f"{v:.6g}" if isinstance(v, float) else str(v) for v in value)
        elif isinstance(value, bool):
            yield name, "yes" if value else "no"
        elif value is not None and value != "":
            yield name, f"{value:.6g}" if isinstance(value, float) else str(value)


def _computed(run):
    out = ""
    if run.solve is not None:
        solve, steps = run.solve, run.solve.steps
        rows = [
            ["accepted steps", int(steps["step"][-1])],
            ["Newton iterations", int(steps["iterations"].sum())],
            ["factorisations", int(steps["factorisations"].sum())],
            ["seconds in steps", f"{steps['seconds'][-1]:.1f}"],
            ["last pressure, kPa", plain(run.solve.pressure * KPA_PER_MPA)],
            ["reached the design pressure", "no" if stopped_short(run) else "yes"],
            ["walls overlap", "yes" if solve.walls_overlap else "no"],
            ["far parts of the body overlap", "yes" if solve.body_overlap else "no"],
        ]
        out += table(["finite element solution", ""], rows)
    records = [
        ("design (run.json)", run.record),
        ("mesh (mesh/mesh.json)", run.mesh),
        ("finite elements (solve/run.json)", run.solve.record if run.solve else {}),
    ]
    for title, record in records:
        told = table([title, ""], _flat(record))
        out += folded(f"Record of the {title}", told) if record else missing(f"No record of the {title}.")
    return out
