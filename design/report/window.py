"""A run's load steps in a window of pyvista's, with a slider, and as a film of the inflation."""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import atomic_path
from pneunet.base.pictures.painting import write_text_on
from pneunet.base.pictures.rendering import PIXELS, render, view_of
from pneunet.base.progress import progress
from pneunet.design.report.labels import TARGET, segment_colour
from pneunet.design.report.loadsteps import FIELDS, LoadSteps

LINE, PLAIN = "#111111", segment_colour(0)
FILM_PIXELS, FILM_SECONDS = (720, 576), 4.0
FILMS = (".gif", ".mp4")


def has_display() -> bool:
    """Whether a window can be opened."""
    return sys.platform in ("win32", "darwin") or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


def shown_fields(steps: LoadSteps) -> list[str]:
    """Keys of FIELDS that a body can be coloured by; [""] where there are none."""
    return [key for key in FIELDS if key in steps.fields] or [""]


def _meshes(steps, i, key):
    """[(pyvista mesh, keywords)] of a step, the body coloured by a field."""
    import pyvista

    body = pyvista.PolyData.from_regular_faces(steps.points[i], steps.triangles)
    look: dict[str, Any] = {"color": PLAIN, "smooth_shading": False}
    if key:
        body.point_data[key] = steps.fields[key][i]
        look = {"scalars": key, "clim": steps.limits(key), "cmap": FIELDS[key][2]}
    things = [(body, look)]
    things.append((pyvista.lines_from_points(steps.lines[i]).tube(radius=0.4), {"color": LINE}))
    if steps.target is not None:
        things.append((pyvista.lines_from_points(steps.target).tube(radius=0.5), {"color": TARGET}))
    return things


def _drawn_in_front(image, view, line, colour, dash=0):
    """A line (n, 3) over a film's image; dash: points from one gap to the next, 0: no gaps."""
    from PIL import ImageDraw

    pixels = view.pixels(line) * (FILM_PIXELS[1] / PIXELS[1])
    draw = ImageDraw.Draw(image)
    for i, (a, b) in enumerate(zip(pixels, pixels[1:])):
        if not dash or i % dash < dash / 2:
            draw.line([*a, *b], fill=colour, width=3)


def write_film(steps: LoadSteps, path: Path) -> Path:
    """The inflation as a GIF or MP4, by its ending: each step with its pressure, centreline and target dashed
    in front of the body; the path. InputError for another ending."""
    from PIL import Image

    if path.suffix not in FILMS:
        raise InputError(f"{path}: a film is one of {', '.join(FILMS)}")
    view, key, images = view_of(np.vstack(steps.points)), shown_fields(steps)[0], []
    for i in progress(range(len(steps.labels)), "frames of the film"):
        images.append(Image.fromarray(render(view, _meshes(steps, i, key), FILM_PIXELS)))
        _drawn_in_front(images[-1], view, steps.lines[i], LINE)
        if steps.target is not None:
            _drawn_in_front(images[-1], view, steps.target, TARGET, dash=max(2, len(steps.target) // 20))
        write_text_on(images[-1], (20, 16), steps.labels[i], 24, "la")
    per_second = max(2.0, len(images) / FILM_SECONDS)
    with atomic_path(path) as temporary:
        if path.suffix == ".gif":
            frames = [image.quantize(64) for image in images]
            durations = [round(1000 / per_second)] * (len(frames) - 1) + [1200]
            frames[0].save(temporary, save_all=True, append_images=frames[1:], duration=durations, loop=0)
        else:
            import imageio_ffmpeg

            writer = imageio_ffmpeg.write_frames(str(temporary), FILM_PIXELS, fps=per_second)
            writer.send(None)
            for image in images:
                writer.send(np.ascontiguousarray(image))
            writer.close()
    return path


def window(steps: LoadSteps, off_screen: bool = False) -> Any:
    """pyvista's Plotter with a slider over the load steps, the last one first; the key t makes the body
    translucent, c colours it by the next field. `show()` opens it and returns when it is closed."""
    import pyvista

    plotter: Any = pyvista.Plotter(title=steps.name, off_screen=off_screen)
    plotter.set_background("white")
    keys, last = shown_fields(steps), len(steps.labels) - 1
    now: dict[str, Any] = {"step": last, "key": 0, "opacity": 1.0}

    def draw():
        key = keys[now["key"]]
        for title in list(plotter.scalar_bars.keys()):
            plotter.remove_scalar_bar(title, render=False)
        for number, (mesh, look) in enumerate(_meshes(steps, now["step"], key)):
            bar = {"title": FIELDS[key][0], "color": "black"} if "scalars" in look else None
            look |= {"opacity": 1.0 if number else now["opacity"]}
            plotter.add_mesh(mesh, name=str(number), reset_camera=False, scalar_bar_args=bar, **look)
        told = f"{steps.labels[now['step']]}\nt: see through" + "\nc: another colour" * (len(keys) > 1)
        plotter.add_text(told, name="label", color="black", font_size=12)

    def to_step(value):
        now["step"] = round(value)
        draw()

    def next_colour():
        now["key"] = (now["key"] + 1) % len(keys)
        draw()

    def see_through():
        now["opacity"] = 1.3 - now["opacity"]
        draw()

    plotter.add_slider_widget(to_step, (0, last), value=last, title="load step", color="black", fmt="%.0f")
    plotter.add_key_event("c", next_colour)
    plotter.add_key_event("t", see_through)
    plotter.add_axes(color="black")
    plotter.reset_camera()
    return plotter
