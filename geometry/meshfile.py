"""Tetrahedral meshes as plain arrays: what CAD writes and finite elements read. Data, never code."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.archive import Member, read_archive, write_archive
from pneunet.geometry import tags

#: file of a manipulator's mesh
MESH = "manipulator.npz"
SCHEMA, AGAIN = "pneunet mesh 1", "make it again with pneunet mesh"
MEMBERS = {
    "points": Member("f", ("points", 3)),
    "tetrahedra": Member("i", ("tetrahedra", 4), 0, "points"),
    "tetrahedron_tags": Member("i", ("tetrahedra",), tags.BODY, tags.GAP + 1),
    "facets": Member("i", ("facets", 3), 0, "points"),
    "facet_tags": Member("i", ("facets",), tags.CAVITY, tags.LAST_FACE + 1),
}


@dataclass(frozen=True)
class TetrahedralMesh:
    """points (n, 3) in mm; tetrahedra (m, 4) and tagged facets (k, 3) as numbers of points, with their tags
    (m,) and (k,) of geometry.tags.

    InputError where a tetrahedron has no positive volume.
    """

    points: np.ndarray
    tetrahedra: np.ndarray
    tetrahedron_tags: np.ndarray
    facets: np.ndarray
    facet_tags: np.ndarray

    def __post_init__(self) -> None:
        with np.errstate(all="ignore"):
            volumes, _ = volumes_and_quality(self.points[self.tetrahedra])
        if not len(volumes) or not ((volumes > 0) & np.isfinite(volumes)).all():
            raise InputError("a tetrahedron has no positive volume: take another mesh_size_mm")

    def tagged(self, tag: int) -> np.ndarray:
        """Facets (n, 3) with this tag."""
        return self.facets[self.facet_tags == tag]

    def write(self, path: str | Path, facts: dict[str, Any]) -> None:
        """Write an .npz; facts: what is known of the mesh, a table for JSON."""
        write_archive(path, SCHEMA, facts, asdict(self), compress=True)


def read_mesh(path: str | Path) -> tuple[TetrahedralMesh, dict[str, Any]]:
    """(mesh, facts) of an .npz; InputError naming the file where it is damaged or no mesh."""
    facts, stored = read_archive(path, SCHEMA, "a mesh", AGAIN, {}, lambda about, names: MEMBERS)
    with located(path):
        mesh = TetrahedralMesh(
            *(stored[name].astype(np.float64 if name == "points" else np.int64) for name in MEMBERS)
        )
    return mesh, {name: value for name, value in facts.items() if name != "schema"}


def volumes_and_quality(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed volumes (n,) in mm3 and mean-ratio quality (n,), 1 for a regular tetrahedron, of corners (n, 4,
    3)."""
    edges = corners[:, [1, 2, 3, 2, 3, 3]] - corners[:, [0, 0, 0, 1, 1, 2]]
    volumes = np.einsum("ni,ni->n", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) / 6
    return volumes, 12 * np.cbrt(3 * volumes) ** 2 * np.sign(volumes) / np.einsum("nei,nei->n", edges, edges)


def open_edges(facets: np.ndarray) -> int:
    """Number of edges of a triangle soup (n, 3) that are not shared by exactly two triangles; 0 for a closed
    surface."""
    edges = np.sort(np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    return int(np.count_nonzero(counts != 2))
