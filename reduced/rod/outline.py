"""The deformed body in three dimensions (paper, Sec. II.B, Eqs 22-26, stretch included).

Outline of the undeformed body - the core's box and the chambers' slanted blocks of each segment - carried by
the section frames of a predicted centreline: the point (s, y, z) goes to c(s) + Q(s) (0, y, z)/sqrt(lambda),
so that the solid keeps its volume. Chambers move with the sections; their swelling is not part of the rod.
"""

import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.geometry.sections import rotation
from pneunet.reduced.rod.centreline import Centreline


def _box(divisions):
    """Surface of the unit cube: corners (n, 3) and quads (m, 4) turned outwards; divisions (3,) per
    direction."""
    points, quads, count = [], [], 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        nu, nv = divisions[u], divisions[v]
        grid_u, grid_v = np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(0, 1, nv + 1), indexing="ij")
        index = np.arange((nu + 1) * (nv + 1)).reshape(nu + 1, nv + 1)
        around = [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]
        face = np.stack(around, axis=-1).reshape(-1, 4)
        for side in (0.0, 1.0):
            corners = np.empty((index.size, 3))
            corners[:, axis], corners[:, u], corners[:, v] = side, grid_u.ravel(), grid_v.ravel()
            points.append(corners)
            quads.append(count + (face if side else face[:, ::-1]))
            count += index.size
    return np.concatenate(points), np.concatenate(quads)


def segment_outline(segment: Segment, spacing: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Undeformed outline of one segment from x = 0, in the body's axes: vertices (n, 3) in mm and quads (m,
    4), turned outwards."""
    s = segment

    def divisions(length):
        return max(int(np.ceil(length / spacing - 1e-9)), 1)

    across, height = divisions(s.width), s.core_top - s.core_bottom
    cube, quads = _box((divisions(s.length), across, divisions(height)))
    vertices = [cube * [s.length, s.width, height] + [0, -s.width / 2, s.core_bottom]]
    all_quads, count = [quads], len(cube)
    thickness, height = s.chamber_thickness / s.sin, s.chamber_top - s.core_top
    cube, quads = _box((divisions(thickness), across, divisions(height)))
    for centre in s.chamber_positions:
        y = (cube[:, 1] - 0.5) * s.width
        z = s.core_top + cube[:, 2] * height
        x = (cube[:, 0] - 0.5) * thickness + y * s.cot
        for side in s.sides:  # the second set is the first turned by half a turn about x
            vertices.append(np.stack([centre + x, side * y, side * z], axis=1))
            all_quads.append(quads + count)
            count += len(cube)
    return np.concatenate(vertices) @ rotation(s).T, np.concatenate(all_quads)


def body_surface(
    manipulator: Manipulator, line: Centreline, spacing: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The deformed outline of a manipulator along a Centreline of it.

    Returns vertices (n, 3) in mm, quads (m, 4) of vertex numbers, and the segment's index of each quad (m,).
    spacing: edge length along the body, mm.
    """
    if not spacing > 0:
        raise InputError(f"spacing = {spacing:g} mm must be larger than 0")
    stretch = line.strains.stretch
    vertices, quads, owner, count = [], [], [], 0
    for i, (segment, start) in enumerate(zip(manipulator.segments, manipulator.starts)):
        points, faces = segment_outline(segment, spacing)
        s = np.clip(points[:, 0] + start, line.s[0], line.s[-1])
        interval = np.clip(np.searchsorted(line.s, s, side="right") - 1, 0, len(stretch) - 1)
        section = points[:, 1:] / np.sqrt(stretch[interval])[:, None]
        frames = line.at(s)
        vertices.append(frames[:, :3, 3] + np.einsum("nij,nj->ni", frames[:, :3, 1:3], section))
        quads.append(faces + count)
        owner.append(np.full(len(faces), i))
        count += len(points)
    return np.concatenate(vertices), np.concatenate(quads), np.concatenate(owner)
