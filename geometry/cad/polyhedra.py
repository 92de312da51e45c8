"""Solids between corners in gmsh's OpenCASCADE: planes, and where four corners lie in none the bilinear face
through their edges, which is what a face of a trilinear element is."""

import gmsh
import numpy as np

from pneunet.geometry.ends import Bar, PlacedSegment
from pneunet.geometry.parameters import TWISTING
from pneunet.geometry.sections import rotation

#: mm: corners that are farther from a plane make a bilinear face
_FLAT = 1e-7


def polyhedron(points: np.ndarray, faces: list[list[int]]) -> int:
    """Volume tag of what closed loops of corners (n, 3) bound."""
    occ = gmsh.model.occ
    bilinear = [_is_bilinear(points[face]) for face in faces]
    sides = [[tuple(sorted(pair)) for pair in zip(face, face[1:] + face[:1])] for face in faces]
    curved = {side for loop, saddle in zip(sides, bilinear) if saddle for side in loop}
    tags = [occ.addPoint(*point) for point in points]
    # a filling needs Bezier curves, straight as they are
    edges = {
        (a, b): occ.addBezier([tags[a], tags[b]]) if (a, b) in curved else occ.addLine(tags[a], tags[b])
        for a, b in dict.fromkeys(side for loop in sides for side in loop)
    }
    surfaces = []
    for loop, saddle in zip(sides, bilinear):
        wire = occ.addCurveLoop([edges[side] for side in loop])
        surfaces.append(occ.addBezierFilling(wire) if saddle else occ.addPlaneSurface([wire]))
    return occ.addVolume([occ.addSurfaceLoop(surfaces, sewing=True)])


def _is_bilinear(corners):
    if len(corners) != 4:
        return False
    a, b, c = corners[1:] - corners[0]
    normal = np.cross(a, c)
    return abs(b @ normal) > _FLAT * np.linalg.norm(normal)


def lofted(rings: np.ndarray) -> int:
    """Volume tag of what lies between rings of four corners, (n, 4, 3): planes from each to the next."""
    return _solid([_ring(ring) for ring in rings])


def ring(x: float, section: np.ndarray) -> np.ndarray:
    """(4, 3) the corners of a section (2, 2), going round."""
    (y0, y1), (z0, z1) = section
    return np.array([[x, y0, z0], [x, y1, z0], [x, y1, z1], [x, y0, z1]])


def bar_solid(bar: Bar) -> int:
    """Volume tag of a bar with upright ends."""
    return lofted(np.array([ring(x, section) for x, section in zip(bar.x, bar.sections)]))


def channel_solid(part: PlacedSegment) -> int:
    """Volume tag of a segment's channel; where it is closed, its end leans as the chambers do there."""
    bar = part.channel
    rings = [_ring(ring(x, section)) for x, section in zip(bar.x, bar.sections)]
    for i, slant in zip((0, -1), part.slants):
        if slant:
            rings[i] = _leaning(part, bar.x[i], bar.sections[i], slant)
    return _solid(rings)


def _ring(corners):
    """(four chains of corners (2, 3) from one corner to the next, caps as loops of places (n, 3))."""
    return [corners[[i, (i + 1) % 4]] for i in range(4)], [corners]


def _leaning(part, x, section, slant):
    """As `_ring`; in a twisting segment the lean has a kink at each floor."""
    turn = rotation(part.segment)[1:, 1:]
    own = ring(x, section)[:, 1:] @ turn
    low, high = own[:, 1].min(), own[:, 1].max()
    floor = part.segment.cavity_floor if part.segment.kind == TWISTING else high
    levels = np.unique([low, *(z for z in (-floor, floor) if low < z < high), high])

    def at(places):
        places = places @ turn.T
        return np.column_stack([x + slant * part.lean(places), places])

    chains = []
    for a, b in zip(own, np.roll(own, -1, axis=0)):
        z = levels if b[1] > a[1] else levels[::-1]
        chains.append(at(np.array([a, b]) if a[1] == b[1] else np.column_stack([np.full(len(z), a[0]), z])))
    y0, y1 = own[:, 0].min(), own[:, 0].max()
    caps = [at(np.array([[y0, a], [y1, a], [y1, b], [y0, b]])) for a, b in zip(levels, levels[1:])]
    return chains, caps


def _solid(rings):
    """Between rings, and the caps of the first and the last."""
    faces = [*rings[0][1], *rings[-1][1]]
    for (one, _), (other, _) in zip(rings, rings[1:]):
        faces += [np.concatenate([a, b[::-1]]) for a, b in zip(one, other)]
    corners = np.concatenate(faces)
    _, first, index = np.unique(corners.round(9), axis=0, return_index=True, return_inverse=True)
    stops = np.cumsum([len(face) for face in faces])
    loops = [part.tolist() for part in np.split(index.ravel(), stops[:-1])]
    return polyhedron(corners[first], loops)
