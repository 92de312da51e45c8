"""`pneunet shape`: the reduced model alone, at any pressures: centrelines, bodies, a picture and an
animation."""

import logging
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.atomic import atomic_path, write_csv
from pneunet.base.files.folder import output_folder
from pneunet.base.files.record import write_record
from pneunet.base.files.schemas import SHAPES
from pneunet.base.pictures.painting import paint, show_scale_and_axes, write_text_on
from pneunet.base.pictures.rendering import view_of
from pneunet.base.pictures.vtp import write_quads
from pneunet.base.progress import progress
from pneunet.base.units import in_MPa
from pneunet.design.design import Design
from pneunet.design.report.labels import kPa, plain, rgb, segment_colour
from pneunet.design.search.doubts import WARN, tell_doubts
from pneunet.geometry.designfile import read_design_file
from pneunet.reduced.choice import choose_law
from pneunet.reduced.rod.centreline import Centreline
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.outline import body_surface
from pneunet.reduced.rod.overlap import overlap_doubts
from pneunet.reduced.rod.prediction import doubts

log = logging.getLogger(__name__)
STEPS, FILM = 5, "inflation.gif"
FRAMES = 24
FRAME_PIXELS, PANEL_PIXELS = (540, 432), (600, 480)
#: of a frame
COLOURS = 64
#: mm, of the faces of pictures
SPACING = 2.0


def run_shape(
    design_path: str | Path,
    pressures_kPa: Sequence[float] | None,
    directory: str | Path,
    law: SegmentLaw | None = None,
    outside: str = WARN,
) -> Path:
    """Shapes of a design's file at pressures, by default STEPS of them up to the design's, in
    directory/shape.

    law: by default the trained one that comes along. outside: 'warn' or 'refuse' where the law doubts the
    design at one of the pressures. centrelines.csv (pressure_kPa, s_mm, x_mm, y_mm, z_mm in target
    coordinates), body_<pressure>kPa.vtp, bodies.png, inflation.gif, run.json. InputError on bad input and for
    doubts that are refused. Pressures beyond the law's limit: the others are written, then ConvergenceError
    names what is there. Returns the folder.
    """
    design = Design(read_design_file(design_path), choose_law() if law is None else law)
    if pressures_kPa is None:
        pressures_kPa = sorted({design.pressure_kPa * i / STEPS for i in range(1, STEPS + 1)})
    if not len(pressures_kPa):
        raise InputError("--pressure-kPa: give at least one pressure")
    count = len(design.manipulator.segments)
    log.info(
        f"shape: {design.content.name}, {count} segment{'s' * (count > 1)} at {_list(pressures_kPa)} kPa"
    )
    with output_folder(Path(directory) / "shape") as folder:
        _predict(folder, design_path, design, pressures_kPa, outside)
    return folder


def _predict(folder, design_path, design, pressures_kPa, outside):
    """The shapes of `run_shape`, what is to be said of them, and their files."""
    shapes: dict[float, Centreline] = {}
    failed: dict[float, str] = {}
    for p in sorted(set(pressures_kPa)):
        try:
            shapes[p] = design.predict(p)
        except ConvergenceError as error:
            failed[p] = str(error)
    if not shapes:
        raise ConvergenceError(f"no shape at {_list(failed)} kPa: {next(iter(failed.values()))}")
    doubted = doubts(
        design.manipulator, [design.content.scaled(in_MPa(p)) for p in pressures_kPa], design.law
    )
    overlaps = ((p, text) for p, line in shapes.items() for text in overlap_doubts(design.manipulator, line))
    doubted += tuple(f"from {plain(p)} kPa on {text}" for p, text in islice(overlaps, 1))
    tell_doubts(doubted, design.law, outside)
    _write(folder, design_path, design, shapes, failed, doubted)


def _write(folder, design_path, design, shapes, failed, doubted):
    """The files of `run_shape`."""
    write_csv(
        folder / "centrelines.csv",
        SHAPES,
        [[p, s, *point] for p, line in shapes.items() for s, point in zip(line.s, line.points)],
    )
    log.info(f"centrelines at {_list(shapes)} kPa: {folder / 'centrelines.csv'}")
    for p, line in shapes.items():
        tip = ", ".join(f"{x:.1f}" for x in line.points[-1])
        log.info(f"  {_each(design, p):>10}: length {line.length:.1f} mm, tip at ({tip}) mm")
    try:
        _pictures(design, shapes, folder)
    except ImportError as error:
        log.info(f"no pictures: {error}; install them with: pip install 'pneunet[pictures]'")
    write_record(
        folder,
        design=str(design_path),
        law=design.law.name,
        doubts=list(doubted),
        pressures_kPa=list(shapes),
        failed_kPa={plain(p): why for p, why in failed.items()},
    )
    if failed:
        first = min(failed)
        raise ConvergenceError(
            f"no shape at {_list(failed)} kPa ({failed[first]}); kept in {folder}: {_list(shapes)} kPa"
        )


def _each(design, pressure):
    """'20 kPa', or '20 / 10 kPa' of two pressure groups, where the largest is that many kPa."""
    return kPa(design.content.scaled(in_MPa(pressure)))


def _list(pressures):
    return ", ".join(plain(p) for p in pressures)


def _pictures(design, shapes, folder):
    bodies = _bodies(design, progress(shapes.values(), "bodies"))
    files = {f"body_{plain(p)}kPa.vtp": body for p, body in zip(shapes, bodies)}
    earlier = {*folder.glob("body_*kPa.vtp"), *folder.glob(FILM)}
    for old in earlier - {folder / name for name in files}:
        old.unlink()  # of an earlier run at other pressures
    for name, (vertices, quads, segments) in files.items():
        write_quads(folder / name, vertices, quads, {"segment": segments + 1})
    titles = [_each(design, p) for p in shapes]
    _picture_of_all(design.content.name, titles, bodies, folder / "bodies.png")
    log.info(f"bodies at every pressure: {folder / 'bodies.png'}")
    highest = max(shapes)
    if highest > 0:
        log.info(f"{FRAMES} frames of the inflation follow")
        _animation(design, highest, folder / FILM)
        log.info(f"inflation from 0 to {plain(highest)} kPa: {folder / FILM}")


def _bodies(design, lines):
    """`body_surface` along centrelines."""
    return [body_surface(design.manipulator, line, SPACING) for line in lines]


def _view(bodies):
    """The View that holds them all."""
    return view_of(np.vstack([vertices for vertices, _, _ in bodies]))


def _painted(view, body, pixels):
    vertices, quads, segments = body
    colours = np.array([rgb(segment_colour(i)) for i in range(segments.max() + 1)])
    return paint(view, vertices, quads, colours[segments], pixels)


def _picture_of_all(name, titles, bodies, path):
    """One panel a pressure, same camera and scale."""
    from PIL import Image

    (width, height), view, columns = PANEL_PIXELS, _view(bodies), min(len(bodies), 3)
    rows, top = -(-len(bodies) // columns), height // 10
    sheet = Image.new("RGB", (columns * width, rows * height + top), "white")
    for number, (title, body) in enumerate(zip(titles, bodies)):
        panel = _painted(view, body, PANEL_PIXELS)
        show_scale_and_axes(panel, view)
        write_text_on(panel, (20, 16), title, height / 24, "la")
        sheet.paste(panel, (number % columns * width, top + number // columns * height))
    write_text_on(sheet, (20, 14), f"{name}: reduced model", height / 18, "la")
    with atomic_path(path) as temporary:
        sheet.save(temporary)


def _animation(design, highest, path):
    """A GIF that inflates to `highest` (kPa) and holds; 24 frames of a few kB each."""
    from PIL import Image

    pressures, frames = highest * np.linspace(0, 1, FRAMES), []
    bodies = _bodies(design, map(design.predict, progress(pressures, "bodies")))
    view = _view(bodies)
    for p, body in progress(zip(pressures, bodies), "frames", FRAMES):
        frame = _painted(view, body, FRAME_PIXELS)
        write_text_on(frame, (12, 10), f"{p:.0f} kPa", FRAME_PIXELS[1] / 22, "la")
        frames.append(frame.quantize(COLOURS, Image.Quantize.FASTOCTREE))
    durations = [90] * (FRAMES - 1) + [1200]
    with atomic_path(path) as temporary:
        frames[0].save(temporary, save_all=True, append_images=frames[1:], duration=durations, loop=0)
