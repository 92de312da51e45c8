"""Pictures of bodies: VTK off-screen (no X needed), one view for all; matplotlib adds scale, axes and colour bar."""

from dataclasses import dataclass

import numpy as np

from base import se3
from design.labels import TARGET, segment_colour
from design.pictures import camera_angles, figure, save

PIXELS = (900, 720)


@dataclass(frozen=True)
class View:
    """A parallel projection: focus (3,), unit vectors `right` and `up` (3,) of the image, half height shown in mm."""

    focus: np.ndarray
    right: np.ndarray
    up: np.ndarray
    half_height: float

    @property
    def millimetres_per_pixel(self):
        return 2 * self.half_height / PIXELS[1]


def view_of(points, margin=1.12):
    """The View that holds all points (n, 3), seen from `pictures.camera_angles`."""
    points = np.asarray(points, float)
    elevation, azimuth = np.radians(camera_angles(points))
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.array([-np.sin(elevation) * np.cos(azimuth), -np.sin(elevation) * np.sin(azimuth), np.cos(elevation)])
    towards = np.cross(right, up)
    image = points @ np.column_stack([right, up, towards])
    middle = (image.min(axis=0) + image.max(axis=0)) / 2
    half = np.ptp(image, axis=0) / 2
    focus = middle @ np.array([right, up, towards])
    return View(focus, right, up, margin * max(half[1], half[0] * PIXELS[1] / PIXELS[0]))


def render(view, things, pixels=PIXELS):
    """Image (height, width, 3) of [(pyvista mesh, keywords of Plotter.add_mesh)]."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    # without X, VTK tries it first and warns before it falls back to EGL or OSMesa
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    plotter = pyvista.Plotter(off_screen=True, window_size=list(pixels))
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


def tube(points, radius=0.9, colour=TARGET):
    """A curve (n, 3) as something to render."""
    import pyvista

    return pyvista.lines_from_points(np.asarray(points, float)).tube(radius=radius), {"color": colour}


def body_mesh(manipulator, pressure, law, base_pose):
    """The reduced model's body (pyvista.PolyData, mm, target coordinates), cell data "segment" 1.. ."""
    import pyvista

    from reduced.body import body_surface

    vertices, quads, segments = body_surface(manipulator, pressure, law, base_pose=base_pose)
    mesh = pyvista.PolyData(vertices, np.column_stack([np.full(len(quads), 4), quads]).ravel())
    mesh.cell_data["segment"] = segments + 1
    return mesh


def painted(mesh):
    """A body in the colours of its segments, with its sharp edges, as things to render."""
    from matplotlib.colors import to_rgb

    mesh = mesh.copy()
    segments = np.asarray(mesh.cell_data["segment"]) - 1
    colours = np.array([to_rgb(segment_colour(i)) for i in range(segments.max() + 1)])
    mesh.cell_data["colour"] = (255 * colours[segments]).astype(np.uint8)
    return [(mesh, {"scalars": "colour", "rgb": True, "preference": "cell"}), edges(mesh)]


def edges(mesh, angle=35):
    """Sharp edges and rims of a surface as thin dark lines."""
    found = mesh.extract_feature_edges(feature_angle=angle, boundary_edges=True, non_manifold_edges=False)
    return found, {"color": "#3b434b", "line_width": 1.5, "lighting": False}


def read_solution(path):
    """The last step of a ParaView collection as the undeformed pyvista grid with its point data."""
    import pyvista

    reader = pyvista.get_reader(str(path))
    reader.set_active_time_value(reader.time_values[-1])
    return reader.read()[0]


def deformed_surface(grid, base_pose):
    """(surface, sharp edges) of a solution, moved by its displacement and into target coordinates; point data
    "displacement length" (mm) beside the solver's own."""
    surface = grid.extract_surface(nonlinear_subdivision=1)
    surface.point_data["displacement length"] = np.linalg.norm(surface.point_data["displacement"], axis=1)
    # the edges of the undeformed shape, carried along: a bent wall gets none
    lines, look = edges(surface)
    for mesh in (surface, lines):
        mesh.points = se3.transform(base_pose, mesh.points + mesh.point_data["displacement"])
    return surface, (lines, look)


def coloured(surface, name, limits, cmap):
    """A surface coloured by point data."""
    return surface, {"scalars": name, "clim": limits, "cmap": cmap}


def write_picture(path, view, image, title, bar=None):
    """PNG of a rendered image with a title, a scale in mm, the directions of the axes and, when `bar` = (label,
    limits, cmap) is given, a colour bar."""
    height = 5.95 + (0.85 if bar else 0.0)
    fig = figure(7.0, height)
    picture = 5.6 / height
    show(fig.add_axes([0, 1 - picture - 0.35 / height, 1, picture]), view, image)
    fig.text(0.02, 1 - 0.09 / height, title, fontsize=15, weight="bold", va="top")
    if bar:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        label, limits, cmap = bar
        cax = fig.add_axes([0.1, 0.62 / height, 0.8, 0.15 / height])
        fig.colorbar(ScalarMappable(Normalize(*limits), cmap), cax=cax, orientation="horizontal")
        cax.set_xlabel(label, fontsize=13)
        cax.tick_params(labelsize=12)
    save(fig, path, dpi=100)


def show(ax, view, image):
    """A rendered image in matplotlib axes, with scale and directions."""
    ax.imshow(image)
    ax.set_axis_off()
    _scale_bar(ax, view)
    _triad(ax, view)


def _scale_bar(ax, view):
    wanted = 0.2 * PIXELS[0] * view.millimetres_per_pixel
    decade = 10 ** np.floor(np.log10(wanted))
    length = decade * max(n for n in (1, 2, 5) if n * decade <= wanted)
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
            arrowprops={"arrowstyle": "-|>", "color": "#30363d", "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0},
        )
        ax.text(*(origin + step * (1 + 16 / np.linalg.norm(step))), name, ha="center", va="center", fontsize=13)
