"""Pictures of bodies made of quads, without VTK: the farthest face first, each over those behind it.

Good where faces are many and of one size, as those of the reduced model's body are: a picture takes a
hundredth of a second and a tenth of the memory. PIL is imported inside the functions.
"""

from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.pictures.rendering import View, round_length

if TYPE_CHECKING:
    from PIL.Image import Image

#: drawn so many times larger, then averaged: smooth edges
FINER = 2
#: part of a colour without light, and what a face turned to the light has more
AMBIENT, DIFFUSE = 0.5, 0.5
#: where the light comes from: right, up, towards the viewer
LIGHT = np.array([-0.35, 0.5, 0.8]) / np.linalg.norm([-0.35, 0.5, 0.8])
EDGE, TEXT, AXES = (92, 100, 108), (0, 0, 0), (48, 54, 61)


def sharp_edges(quads: np.ndarray) -> np.ndarray:
    """(m, 4) bool of quads (m, 4): whether the edge from a corner to the next one belongs to no other
    quad."""
    ends = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    _, index, count = np.unique(ends @ [quads.max() + 1, 1], return_inverse=True, return_counts=True)
    return (count[index] == 1).reshape(quads.shape)


def paint(
    view: View, vertices: np.ndarray, quads: np.ndarray, colours: np.ndarray, pixels: tuple[int, int]
) -> "Image":
    """PIL's Image of a closed body: vertices (n, 3) in mm, quads (m, 4) turned outwards, colours (m, 3) up to
    255."""
    from PIL import Image, ImageDraw

    width, height = (FINER * size for size in pixels)
    axes = np.array([view.right, view.up, np.cross(view.right, view.up)])
    seen = (vertices - view.focus) @ axes.T
    corners = seen[quads]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    front = np.flatnonzero(normals[:, 2] > 0)
    order = front[np.argsort(corners[front, :, 2].mean(axis=1), kind="stable")]
    scale = height / (2 * view.half_height)
    points = np.array([width / 2, height / 2]) + scale * corners[order, :, :2] * [1, -1]
    shade = AMBIENT + DIFFUSE * np.maximum(normals[order] @ LIGHT, 0)
    fills = (np.minimum(colours[order] * (shade / shade.max())[:, None], 255)).astype(int)
    image = Image.new("RGB", (width, height), "white")
    draw = ImageDraw.Draw(image)
    for outline, fill, sharp in zip(points.tolist(), map(tuple, fills.tolist()), sharp_edges(quads)[order]):
        draw.polygon([tuple(point) for point in outline], fill=fill)
        for i in np.flatnonzero(sharp):
            draw.line([*outline[i], *outline[(i + 1) % 4]], fill=EDGE, width=FINER)
    return image.reduce(FINER)


def write_text_on(image: "Image", at: tuple[float, float], text: str, size: float, anchor: str) -> None:
    """Black text; `at` in pixels from the upper left corner, anchor as PIL's."""
    from PIL import ImageDraw, ImageFont

    ImageDraw.Draw(image).text(at, text, fill=TEXT, font=ImageFont.load_default(size), anchor=anchor)


def show_scale_and_axes(image: "Image", view: View) -> None:
    """A bar of a round length in mm at the lower right, the directions of x, y and z at the lower left."""
    from PIL import ImageDraw

    (width, height), draw = image.size, ImageDraw.Draw(image)
    unit, text = height / 100, height / 28
    length = round_length(0.4 * view.half_height)
    bar, x, y = length * height / (2 * view.half_height), width - 3 * unit, height - 3 * unit
    draw.line([x - bar, y, x, y], fill=TEXT, width=max(2, round(unit / 2)))
    write_text_on(image, (x - bar / 2, y - unit), f"{length:g} mm", text, "mb")
    origin = np.array([10 * unit, height - 10 * unit])
    for i, name in enumerate("xyz"):
        step = 6 * unit * np.array([view.right[i], -view.up[i]])
        size = np.linalg.norm(step)
        if size < 0.15 * 6 * unit:
            continue
        tip, along = origin + step, step / size
        aside = np.array([-along[1], along[0]])
        draw.line([*origin, *tip], fill=AXES, width=max(1, round(unit / 4)))
        head = (tip, *(tip - unit * (1.6 * along + side * aside) for side in (0.6, -0.6)))
        draw.polygon([tuple(corner) for corner in head], fill=AXES)
        write_text_on(image, tuple(tip + 2 * unit * along), name, text, "mm")
