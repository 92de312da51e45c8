"""Pictures of triangles, large and small, without VTK: the nearest face at every pixel, edges where it
turns."""

import numpy as np

from pneunet.base.pictures.painting import AMBIENT, DIFFUSE, EDGE, FINER, LIGHT
from pneunet.base.pictures.rendering import View

#: cosine between two faces that an edge is drawn between
SHARP = 0.95


def shaded(
    view: View,
    points: np.ndarray,
    triangles: np.ndarray,
    colour: tuple[int, int, int],
    pixels: tuple[int, int],
) -> np.ndarray:
    """(height, width, 3) up to 255 of a closed surface: points (n, 3) in mm, triangles (m, 3) outward."""
    width, height = (FINER * size for size in pixels)
    axes = np.array([view.right, view.up, np.cross(view.right, view.up)])
    seen = (points - view.focus) @ axes.T
    scale = height / (2 * view.half_height)
    corners = seen[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    at = np.array([width / 2, height / 2]) + scale * corners[..., :2] * [1, -1]
    depth, face = np.full((height, width), -np.inf), np.full((height, width), -1)
    for i in np.flatnonzero(normals[:, 2] > 1e-6):
        _draw(at[i], corners[i, :, 2], i, depth, face)
    solid = face >= 0
    normal = np.where(solid[..., None], normals[face], 0.0)
    shade = AMBIENT + DIFFUSE * np.maximum(normals @ LIGHT, 0)
    image = np.full((height, width, 3), 255.0)
    image[solid] = np.array(colour) * np.minimum(shade[face[solid]] / shade.max(), 1)[:, None]
    edge = np.zeros_like(solid)
    for axis in (0, 1):
        a, b = (np.take(normal, range(k, normal.shape[axis] - 1 + k), axis) for k in (0, 1))
        step = np.abs(np.diff(np.where(solid, depth, view.focus @ axes[2] - 1e6), axis=axis)) > 20 / scale
        turned = (np.einsum("ijk,ijk->ij", a, b) < SHARP) & (np.abs(a) + np.abs(b)).any(axis=-1)
        edge[: edge.shape[0] - (axis == 0), : edge.shape[1] - (axis == 1)] |= turned | step
    image[edge] = EDGE
    return image.reshape(pixels[1], FINER, pixels[0], FINER, 3).mean(axis=(1, 3))


def _draw(corners, depths, number, depth, face):
    """Put a triangle (3, 2) in pixels where it is nearest."""
    height, width = depth.shape
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 1, [width, height])
    if (high <= low).any():
        return
    x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
    (ax, ay), (bx, by), (cx, cy) = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if abs(area) < 1e-12:
        return
    v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
    w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
    z = depths[0] + v * (depths[1] - depths[0]) + w * (depths[2] - depths[0])
    room = (slice(low[1], high[1]), slice(low[0], high[0]))
    nearer = (v >= -1e-9) & (w >= -1e-9) & (v + w <= 1 + 1e-9) & (z > depth[room])
    depth[room][nearer] = z[nearer]
    face[room][nearer] = number
