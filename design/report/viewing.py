"""`pneunet view`: a run to turn by hand in a browser, and the same scene within the report."""

import logging
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.atomic import write_text
from pneunet.base.files.folder import output_folder
from pneunet.base.pictures.rendering import camera_angles
from pneunet.design.report.labels import TARGET
from pneunet.design.report.loadsteps import FIELDS, LoadSteps, load_steps
from pneunet.design.report.page import missing
from pneunet.design.report.rundata import DesignFolder, read_design_folder
from pneunet.design.report.window import FILMS, LINE, PLAIN, has_display, shown_fields, window, write_film
from pneunet.reduced.choice import choose_law
from pneunet.reduced.rod.laws import SegmentLaw

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

log = logging.getLogger(__name__)
#: bytes that a page may have, so that a report that holds it stays below 15 MB with all its pictures, and
#: those of plotly's own script in it
LARGEST_PAGE, SCRIPT = 11_000_000, 4_900_000
#: bytes that a number takes in a page: four, in base64
NUMBER = 4 * 4 / 3
PAGE = "view.html"


def run_view(
    run: str | Path,
    directory: str | Path | None = None,
    law: str | None = None,
    film: str | None = None,
    in_window: bool = False,
) -> Path:
    """Write view.html of a design's folder, which turns and inflates in any browser, off line too; its path.

    directory: by default the folder itself. law: of the prediction where there are no finite elements, by
    default the design's. film: '.gif' or '.mp4', writes inflation.gif or .mp4 as well. in_window: open
    pyvista's, which needs a display. InputError where there is no design, or the fields
    are damaged.
    """
    if film and film not in FILMS:
        raise InputError(f"film = '{film}': write {' or '.join(each[1:] for each in FILMS)}")
    if film == ".mp4":
        import imageio_ffmpeg  # noqa: F401  (that it is here is known before anything is written)
    if in_window and not has_display():
        raise InputError("--window: there is no display here: open view.html in a browser instead")
    found = read_design_folder(run)
    for text in found.damaged:
        log.warning(f"warning: left out: {text}")
    log.info(f"view of {run}: its load steps are read")
    used = choose_law(found.law if law is None else law)
    steps = _that_fit(found, used)
    if not steps.solved:
        log.info("no finite element fields in this folder: the reduced model's body is shown")
    with output_folder(directory or run) as folder:
        path = folder / PAGE
        write_text(path, page(steps))
        log.info(f"{len(steps.labels)} steps, {path.stat().st_size / 1e6:.1f} MB: {path}")
        if film:
            log.info("the film follows")
            log.info(f"film: {write_film(steps, folder / f'inflation{film}')}")
    if in_window:
        window(steps).show()
    return path


def framed(run: DesignFolder, law: SegmentLaw) -> str:
    """HTML that holds the page in a frame of another one, or says why there is none."""
    try:
        content = page(_that_fit(run, law))
    except ModuleNotFoundError:
        return missing("To turn the body here: pip install 'pneunet[view]', then the report again.")
    except (ConvergenceError, InputError) as error:
        return missing(f"No body to turn: {error}")
    return (
        f'<iframe class="turn" srcdoc="{escape(content)}" title="the body, to turn" loading="lazy"></iframe>'
        '<p class="missing">Turn and zoom with the mouse; the slider walks over the load steps.</p>'
    )


def _that_fit(run, law):
    """The finest LoadSteps whose page is no larger than LARGEST_PAGE: first the elements' corners alone, then
    fewer steps, the first and the last among them."""
    steps = load_steps(run, law)
    if page_bytes(steps) > LARGEST_PAGE:
        steps = load_steps(run, law, corners=True)
    most = max(2, int((LARGEST_PAGE - SCRIPT) / ((page_bytes(steps) - SCRIPT) / len(steps.labels))))
    if most < len(steps.labels):
        chosen = np.unique(np.linspace(0, len(steps.labels) - 1, most).round().astype(int)).tolist()
        log.info(f"{len(chosen)} of {len(steps.labels)} steps are shown, so that the page stays small")
        steps = steps.of_steps(chosen)
    return steps


def page_bytes(steps: LoadSteps) -> float:
    """About how large the page will be."""
    each = max(1, len(steps.fields)) * 4 * len(steps.points[0]) + 3 * len(steps.lines[0])
    faces = max(1, len(steps.fields)) * 3 * len(steps.triangles)
    return SCRIPT + NUMBER * (each * (len(steps.labels) + 1) + faces)


def page(steps: LoadSteps) -> str:
    """The HTML page of `scene`, self-contained."""
    config = {"displaylogo": False, "responsive": True}
    return scene(steps).to_html(include_plotlyjs=True, config=config, auto_play=False)


def scene(steps: LoadSteps) -> "Figure":
    """A plotly Figure: the body in each of its colours (buttons), the centreline and the target, with a
    slider over the load steps."""
    from plotly import graph_objects as go

    keys, last = shown_fields(steps), len(steps.labels) - 1

    def moving(i):
        """What changes from step to step."""
        x, y, z = steps.points[i].astype(np.float32).T
        bodies = [go.Mesh3d(x=x, y=y, z=z, **_intensity(steps, key, i)) for key in keys]
        return [*bodies, go.Scatter3d(**_line(steps.lines[i]))]

    figure = go.Figure(moving(last))
    for trace, key in zip(figure.data, keys):
        trace.update(_look(steps, key), visible=key == keys[0])
    figure.data[-1].update(mode="lines", line={"color": LINE, "width": 5}, name="centreline")
    if steps.target is not None:
        look = {"mode": "lines", "line": {"color": TARGET, "width": 6, "dash": "dash"}}
        figure.add_trace(go.Scatter3d(**_line(steps.target), **look, name="target"))
    traces = list(range(len(keys) + 1))
    figure.frames = [go.Frame(data=moving(i), name=str(i), traces=traces) for i in range(last + 1)]
    _controls(figure, steps, keys, last)
    return figure


def _line(points):
    x, y, z = np.asarray(points, np.float32).T
    return {"x": x, "y": y, "z": z}


def _intensity(steps, key, i):
    return {"intensity": np.asarray(steps.fields[key][i], np.float32)} if key else {}


def _look(steps, key):
    """Of a body that stays the same over all steps."""
    i, j, k = steps.triangles.T.astype(np.int32)
    light = {"ambient": 0.55, "diffuse": 0.6, "specular": 0.15, "roughness": 0.7}
    look = {"i": i, "j": j, "k": k, "lighting": light, "name": "body", "hoverinfo": "skip"}
    if not key:
        return look | {"color": PLAIN}
    (low, high), (label, _, colours) = steps.limits(key), FIELDS[key]
    bar = {"title": {"text": label, "side": "right"}, "len": 0.75}
    return look | {"colorscale": colours, "cmin": low, "cmax": high, "colorbar": bar}


def _controls(figure, steps, keys, last):
    """Slider, buttons, camera and axes that stand still."""
    at_once = {"mode": "immediate", "frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
    slider = {
        "active": last,
        "currentvalue": {"prefix": "load step: "},
        "pad": {"t": 30},
        "steps": [
            {"label": label, "method": "animate", "args": [[str(i)], at_once]}
            for i, label in enumerate(steps.labels)
        ],
    }
    play = {"fromcurrent": False, "frame": {"duration": 250, "redraw": True}, "transition": {"duration": 0}}
    traces = list(range(len(keys)))
    row: dict[str, Any] = {"type": "buttons", "direction": "right", "y": 1.0, "yanchor": "bottom"}
    row |= {"xanchor": "left"}
    film = [{"label": "inflate", "method": "animate", "args": [None, play]}]
    solid = [
        {"label": label, "method": "restyle", "args": [{"opacity": opacity}, traces]}
        for label, opacity in (("solid", 1.0), ("see through", 0.3))
    ]
    menus = [row | {"x": 0.0, "buttons": film, "showactive": False}, row | {"x": 0.1, "buttons": solid}]
    if len(keys) > 1:
        colours = [
            {
                "label": FIELDS[key][0].partition(",")[0],
                "method": "restyle",
                "args": [{"visible": [other == key for other in keys]}, traces],
            }
            for key in keys
        ]
        menus.append(row | {"x": 0.0, "y": 1.1, "buttons": colours})
    everything = np.vstack([*steps.points, *([] if steps.target is None else [steps.target])])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.03 * (high - low).max()
    low, high = low - margin, high + margin
    size = 1.5 * (high - low) / np.linalg.norm(high - low)
    elevation, azimuth = np.radians(camera_angles(steps.points[-1]))
    eye = 1.5 * np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    axes = {
        f"{name}axis": {"range": [float(a), float(b)], "title": {"text": f"{name}, mm"}}
        for name, a, b in zip("xyz", low, high)
    }
    figure.update_layout(
        title={"y": 0.98, "text": f"{steps.name}: {'finite elements' if steps.solved else 'reduced model'}"},
        scene=axes
        | {
            "aspectmode": "manual",
            "aspectratio": dict(zip("xyz", map(float, size))),
            "camera": {"eye": dict(zip("xyz", map(float, eye)))},
        },
        sliders=[slider],
        updatemenus=menus,
        legend={"x": 0.0, "y": 0.0},
        margin={"l": 0, "r": 0, "t": 140, "b": 10},
        height=760,
    )
