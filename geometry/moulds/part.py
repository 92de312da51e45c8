"""`Part`: a printed mould as triangles, lying as it is printed, and what must be true of it.

A mould lies on the bed with what forms the silicone upwards, and is pulled away from the silicone along its
own -z. It can be if, where silicone is, its sections never grow upwards: no undercut, and no overhang to
print.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pneunet.base.errors import InputError
from pneunet.geometry.meshfile import open_edges

#: mm2: what rounding leaves of a section
NOTHING = 1e-5


@dataclass(frozen=True, eq=False)
class Part:
    """points (n, 3) in mm and triangles (m, 3), outward; count: how many to print; does: what it is for.

    places: (4, 4) each, from the frame it is printed in to the body's axes, one for every layer that it
    forms. silicone (2, 3): lowest and highest
    corner of the box with all the silicone that it forms, as printed; None where it forms none.
    """

    name: str
    does: str
    points: np.ndarray
    triangles: np.ndarray
    count: int = 1
    places: tuple[np.ndarray, ...] = (np.eye(4),)
    silicone: np.ndarray | None = None

    @property
    def size(self) -> np.ndarray:
        """(3,) of its bounding box, mm."""
        return np.ptp(self.points, axis=0)

    @property
    def volume(self) -> float:
        """mm3"""
        a, b, c = (self.points[self.triangles[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    def manifold(self) -> Any:
        """manifold3d's Manifold, in the frame it is printed in."""
        return as_manifold(self.points, self.triangles, self.name)

    def check(self) -> dict[str, float]:
        """{"open_edges", "volume_mm3", "undercut_mm2"}; the last with manifold3d alone. InputError when the
        surface is not closed, not manifold, inside out or undercut."""
        facts: dict[str, float] = {"open_edges": open_edges(self.triangles), "volume_mm3": self.volume}
        if facts["open_edges"] or not facts["volume_mm3"] > 0:
            raise InputError(
                f"{self.name}: its surface is not closed: walls of the body touch or cut each other"
            )
        try:
            import trimesh

            surface = trimesh.Trimesh(self.points, self.triangles, process=False)
            if not surface.is_volume:
                raise InputError(f"{self.name}: trimesh finds no volume in it: walls touch or cut each other")
            self.manifold()
        except ModuleNotFoundError:
            return facts
        if self.silicone is not None:
            facts["undercut_mm2"] = undercut(self)
            if facts["undercut_mm2"] > NOTHING:
                raise InputError(f"{self.name}: a section grows upwards: it could not be pulled out")
        return facts


def outward(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Triangles (m, 3) of the closed surface of one solid, of points (n, 3), in the order of corners by which
    their normals point out of it, into its voids too; as they are where it is not closed."""
    if open_edges(triangles):
        return triangles
    m = len(triangles)
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    pairs = np.lexsort(np.sort(edges, axis=1).T).reshape(-1, 2)
    (i, j), (a, b) = pairs.T // 3, edges[pairs.T, 0]
    # a triangle as it is (i) goes with its neighbour as it is (j) or turned (j + m): the way that they run
    # along their edge must be opposite
    rows, columns = np.concatenate([i, i + m]), np.concatenate([j + m * (a == b), j + m * (a != b)])
    graph = coo_array((np.ones(len(rows)), (rows, columns)), (2 * m, 2 * m))
    as_is, turned = connected_components(graph, directed=False)[1].reshape(2, m)
    found = np.where((as_is > turned)[:, None], triangles[:, ::-1], triangles)
    shell, corners = np.unique(np.minimum(as_is, turned), return_inverse=True)[1], points[found]
    volumes = np.bincount(shell, np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))
    wanted = -np.ones(len(volumes))
    wanted[np.abs(volumes).argmax()] = 1
    return np.where((volumes * wanted < 0)[shell][:, None], found[:, ::-1], found)


def as_manifold(points: np.ndarray, triangles: np.ndarray, name: str = "surface") -> Any:
    """manifold3d's Manifold of a closed surface; InputError when it is none."""
    import manifold3d

    mesh = manifold3d.Mesh64(np.ascontiguousarray(points, float), np.ascontiguousarray(triangles, np.uint64))
    found = manifold3d.Manifold(mesh)
    if found.status() != manifold3d.Error.NoError or found.is_empty():
        raise InputError(
            f"{name}: is not manifold ({found.status()}): walls of the body touch or cut each other"
        )
    return found


def undercut(part: Part) -> float:
    """mm2 by which sections of a part, where silicone is, grow from one height to the next higher."""
    import manifold3d

    assert part.silicone is not None, "a part that forms silicone"
    (x0, y0, z0), (x1, y1, z1) = part.silicone
    solid = part.manifold()
    corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    window = manifold3d.CrossSection([np.array(corners)])
    inside = part.points[(part.points[:, 2] > z0) & (part.points[:, 2] < z1), 2]
    levels = np.unique(np.append(inside, [z0, z1]).round(6))
    levels = levels[np.append(True, np.diff(levels) > 1e-5)]
    sections = [solid.slice(float(z)) ^ window for z in (levels[1:] + levels[:-1]) / 2]
    return max(((upper - lower).area() for lower, upper in zip(sections, sections[1:])), default=0.0)


def cast(parts: Iterable[Part]) -> Any:
    """manifold3d's Manifold, in the body's axes and the moulds' size, of all that silicone fills: what the
    moulds leave of the boxes that it lies in, layer by layer."""
    import manifold3d

    layers: dict[tuple, Any] = {}
    for part in parts:
        if part.silicone is None:
            continue
        low, high = part.silicone
        for place in part.places:
            layer = tuple(np.sort(moved(part.silicone, place), axis=0).round(6).ravel())
            if layer not in layers:
                layers[layer] = manifold3d.Manifold.cube(high - low).translate(low).transform(place[:3])
            layers[layer] -= part.manifold().transform(place[:3])
    return sum(layers.values(), manifold3d.Manifold())


def moved(points: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Points (n, 3) by a rigid motion (4, 4)."""
    return points @ place[:3, :3].T + place[:3, 3]
