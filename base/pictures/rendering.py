"""Pictures of bodies: VTK off-screen (no X needed), one view for all; matplotlib adds scale, axes and colour
bar.

pyvista and matplotlib are imported inside the functions: without them everything else works.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.files.atomic import atomic_path, write_text

PIXELS = (900, 720)
#: points (n, 3) in mm and matplotlib's keywords of a curve that is drawn in front of all bodies
Overlay = tuple[np.ndarray, dict]


#: a view will do if it shows so much of the breadth that the best one shows
OPEN_ENOUGH = 0.6


def camera_angles(points: np.ndarray) -> tuple[float, float]:
    """(elevation, azimuth) in degrees from which a curve (n, 3) with z up is seen well: 25 degrees above, and
    across its longest horizontal direction, turned by 30 degrees so that depth shows; from the other side or
    higher where the curve looks nearly straight from there."""
    centred = np.asarray(points, float) - np.mean(points, axis=0)
    _, _, directions = np.linalg.svd(centred[:, :2], full_matrices=False)
    along = directions[0] * (1 if directions[0] @ (centred[-1] - centred[0])[:2] >= 0 else -1)
    across = float(np.degrees(np.arctan2(along[1], along[0]))) - 90.0
    views = [(elevation, across + turn) for elevation in (25.0, 50.0) for turn in (30.0, -30.0)]
    breadths = [_breadth(centred @ np.column_stack(_image_axes(*view))) for view in views]
    enough = OPEN_ENOUGH * max(breadths) - 1e-9 * np.linalg.norm(centred)  # a straight line: any will do
    return next(view for view, breadth in zip(views, breadths) if breadth >= enough)


def _breadth(image):
    """How far points (n, 2) about their mean spread across their longest direction."""
    return np.linalg.svd(image, compute_uv=False)[-1]


def _image_axes(elevation, azimuth):
    """Unit vectors right and up (3,) of the image that is seen from there, degrees."""
    e, a = np.radians((elevation, azimuth))
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return right, np.array([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)])


def figure(width: float, height: float, layout: Any = None) -> Any:
    """A matplotlib Figure (inches) with the Agg canvas: no window, no global state. layout: as matplotlib's,
    'constrained' for one that makes room for labels and legends."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), facecolor="white", layout=layout)


def save(figure: Any, path: str | Path, dpi: float = 120) -> None:
    """Write a matplotlib Figure; the format follows from the path."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi)


def save_vtk(mesh: Any, path: str | Path) -> None:
    """Write a surface (.vtp) or a grid (.vtu) of pyvista, as ParaView reads it."""
    from vtkmodules import vtkIOXML

    kind = {".vtp": vtkIOXML.vtkXMLPolyDataWriter, ".vtu": vtkIOXML.vtkXMLUnstructuredGridWriter}
    writer: Any = kind[Path(path).suffix]()
    writer.SetInputData(mesh)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()  # VTK itself crashes on a full disk
    writer.Write()
    write_text(path, writer.GetOutputString())


@dataclass(frozen=True)
class View:
    """A parallel projection: focus (3,), unit vectors `right` and `up` (3,) of the image, half height shown
    in mm."""

    focus: np.ndarray
    right: np.ndarray
    up: np.ndarray
    half_height: float

    @property
    def millimetres_per_pixel(self) -> float:
        return 2 * self.half_height / PIXELS[1]

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) columns and rows of points (n, 3) in an image of PIXELS."""
        image = (np.asarray(points) - self.focus) @ np.column_stack([self.right, -self.up])
        return np.array(PIXELS) / 2 - 0.5 + image / self.millimetres_per_pixel


def view_of(points: np.ndarray, margin: float = 1.12) -> View:
    """The View that holds all points (n, 3), seen from `camera_angles`."""
    points = np.asarray(points, float)
    right, up = _image_axes(*camera_angles(points))
    towards = np.cross(right, up)
    image = points @ np.column_stack([right, up, towards])
    middle = (image.min(axis=0) + image.max(axis=0)) / 2
    half = np.ptp(image, axis=0) / 2
    focus = middle @ np.array([right, up, towards])
    return View(focus, right, up, margin * max(half[1], half[0] * PIXELS[1] / PIXELS[0]))


def render(view: View, things: Iterable[tuple[Any, dict]], pixels: tuple[int, int] = PIXELS) -> np.ndarray:
    """Image (height, width, 3) of [(pyvista mesh, keywords of Plotter.add_mesh)]."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    # without X, VTK tries it first and warns before it falls back to EGL or OSMesa
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(pixels))
    plotter.set_background("white")
    towards = np.cross(view.right, view.up)
    for mesh, keywords in things:
        if mesh.n_lines:  # in front of the faces they lie on
            mesh = mesh.translate(0.15 * towards)
        plotter.add_mesh(mesh, **{"show_scalar_bar": False, "ambient": 0.35, "diffuse": 0.75, **keywords})
    plotter.enable_parallel_projection()
    distance = 20 * view.half_height
    plotter.camera.focal_point = view.focus
    plotter.camera.position = view.focus + distance * towards
    plotter.camera.up = view.up
    plotter.camera.parallel_scale = view.half_height
    plotter.camera.clipping_range = (0.1 * distance, 2 * distance)
    plotter.enable_anti_aliasing("ssaa")
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(image)[..., :3]


def edges(mesh: Any, angle: float = 35) -> tuple[Any, dict]:
    """Sharp edges and rims of a surface as thin dark lines."""
    found = mesh.extract_feature_edges(feature_angle=angle, boundary_edges=True, non_manifold_edges=False)
    return found, {"color": "#3b434b", "line_width": 1.5, "lighting": False}


def coloured(surface: Any, name: str, limits: tuple[float, float], cmap: str) -> tuple[Any, dict]:
    """A surface coloured by point data."""
    return surface, {"scalars": name, "clim": limits, "cmap": cmap}


def write_picture(
    path: str | Path,
    view: View,
    image: np.ndarray,
    title: str,
    bar: tuple[str, tuple[float, float], str] | None = None,
    extend: str = "neither",
    overlays: Sequence[Overlay] = (),
) -> None:
    """PNG of a rendered image with a title, a scale in mm, the directions of the axes and, when `bar` =
    (label, limits, cmap) is given, a colour bar; extend: as matplotlib's, the ends beyond which there are
    values."""
    height = 5.95 + (0.85 if bar else 0.0)
    fig = figure(7.0, height)
    picture = 5.6 / height
    show(fig.add_axes([0, 1 - picture - 0.35 / height, 1, picture]), view, image, overlays)
    fig.text(0.02, 1 - 0.09 / height, title, fontsize=15, weight="bold", va="top")
    if bar:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        label, limits, cmap = bar
        cax = fig.add_axes([0.1, 0.62 / height, 0.8, 0.15 / height])
        fig.colorbar(
            ScalarMappable(Normalize(*limits), cmap), cax=cax, orientation="horizontal", extend=extend
        )
        cax.set_xlabel(label, fontsize=13)
        cax.tick_params(labelsize=12)
    save(fig, path, dpi=100)


def show(ax: Any, view: View, image: np.ndarray, overlays: Sequence[Overlay] = ()) -> None:
    """A rendered image in matplotlib axes, with scale and directions."""
    from matplotlib.patheffects import withStroke

    ax.imshow(image)
    ax.set_axis_off()
    for points, style in overlays:
        ax.plot(*view.pixels(points).T, **style, path_effects=[withStroke(linewidth=4.5, foreground="white")])
    _scale_bar(ax, view)
    _triad(ax, view)


def round_length(wanted: float) -> float:
    """1, 2 or 5 times a power of ten, at most what is wanted."""
    decade = 10 ** np.floor(np.log10(wanted))
    return float(decade * max(n for n in (1, 2, 5) if n * decade <= wanted))


def _scale_bar(ax, view):
    length = round_length(0.2 * PIXELS[0] * view.millimetres_per_pixel)
    pixels = length / view.millimetres_per_pixel
    x, y = PIXELS[0] - 30, PIXELS[1] - 22
    ax.plot([x - pixels, x], [y, y], color="black", linewidth=2.2, solid_capstyle="butt")
    ax.text(x - pixels / 2, y - 8, f"{length:g} mm", ha="center", va="bottom", fontsize=13)


def _triad(ax, view):
    """Directions of x, y, z, drawn long where they lie in the image."""
    origin, length = np.array([75.0, PIXELS[1] - 75.0]), 46.0
    for i, name in enumerate("xyz"):
        step = length * np.array([view.right[i], -view.up[i]])
        if np.linalg.norm(step) < 0.15 * length:
            continue
        ax.annotate(
            "",
            xy=origin + step,
            xytext=origin,
            arrowprops={
                "arrowstyle": "-|>",
                "color": "#30363d",
                "linewidth": 1.2,
                "shrinkA": 0,
                "shrinkB": 0,
            },
        )
        ax.text(
            *(origin + step * (1 + 16 / np.linalg.norm(step))), name, ha="center", va="center", fontsize=13
        )
