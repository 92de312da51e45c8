"""The moulds in one picture, each as it lies on the bed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pneunet.base.files.atomic import atomic_path
from pneunet.base.pictures.depth import shaded
from pneunet.base.pictures.painting import write_text_on
from pneunet.base.pictures.rendering import View
from pneunet.geometry.moulds.part import Part

PIXELS, COLUMNS, COLOUR, LABEL = (420, 230), 3, (176, 196, 222), 30
#: degrees above the bed, and about the vertical
ELEVATION, AZIMUTH = 38.0, -65.0


def view(points: np.ndarray) -> View:
    """The View from above and before that fills PIXELS with points (n, 3)."""
    up_by, turned = np.radians([ELEVATION, AZIMUTH])
    right = np.array([-np.sin(turned), np.cos(turned), 0.0])
    up = np.array([-np.sin(up_by) * np.cos(turned), -np.sin(up_by) * np.sin(turned), np.cos(up_by)])
    towards = np.cross(right, up)
    seen = points @ np.column_stack([right, up, towards])
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = max(high[1] - low[1], (high[0] - low[0]) * PIXELS[1] / PIXELS[0]) / 2
    return View((low + high) / 2 @ np.array([right, up, towards]), right, up, 1.06 * half)


def write_moulds_picture(path: Path, parts: Sequence[Part]) -> None:
    """Write a PNG of all parts, each filling its place, with name and count."""
    from PIL import Image

    rows = -(-len(parts) // COLUMNS)
    height = PIXELS[1] + LABEL
    sheet = Image.new("RGB", (COLUMNS * PIXELS[0], rows * height), "white")
    for number, part in enumerate(parts):
        image = Image.fromarray(
            shaded(view(part.points), part.points, part.triangles, COLOUR, PIXELS).astype(np.uint8)
        )
        x, y = PIXELS[0] * (number % COLUMNS), height * (number // COLUMNS)
        sheet.paste(image, (x, y + LABEL))
        size = " x ".join(f"{v:.0f}" for v in part.size)
        count = f"{part.count} x " if part.count > 1 else ""
        write_text_on(sheet, (x + 8, y + LABEL / 2), f"{count}{part.name}   {size} mm", 15, "lm")
    with atomic_path(path) as temporary:
        sheet.quantize(64).save(temporary, optimize=True)
