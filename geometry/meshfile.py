"""Meshes of tetrahedra or hexahedra as plain arrays: what CAD and grids write and finite elements read. Data,
never code."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.archive import Member, read_archive, write_archive
from pneunet.geometry import tags
from pneunet.geometry.hexahedra import CORNERS, gauss, hexahedron_volumes, jacobians, scaled_determinants

#: file of a manipulator's mesh
MESH = "manipulator.npz"
SCHEMA, AGAIN = "pneunet mesh 2", "make it again with pneunet mesh"
#: corners of a cell and of its facets
TETRAHEDRA, HEXAHEDRA = (4, 3), (8, 4)
ELEMENTS = {"hexahedra": HEXAHEDRA, "tetrahedra": TETRAHEDRA}
#: what bodies and cells are meshed with where nobody says
USUAL_ELEMENT = "hexahedra"


def _members(about, names):
    with located("member 'about': element"):
        if about["element"] not in ELEMENTS:
            raise InputError(f"'{about['element']}' is none of {', '.join(ELEMENTS)}: {AGAIN}")
    of_cell, of_facet = ELEMENTS[about["element"]]
    return {
        "points": Member("f", ("points", 3)),
        "cells": Member("i", ("cells", of_cell), 0, "points"),
        "cell_tags": Member("i", ("cells",), tags.BODY, tags.GAP + 1),
        "facets": Member("i", ("facets", of_facet), 0, "points"),
        "facet_tags": Member("i", ("facets",), tags.CAVITY, tags.LAST_FACE + 1),
    }


@dataclass(frozen=True)
class VolumeMesh:
    """points (n, 3) in mm; cells (m, 4) or (m, 8) and tagged facets (k, 3) or (k, 4) as numbers of points,
    with their tags (m,) and (k,) of geometry.tags.

    Corners of a hexahedron go round its bottom, then round its top (gmsh, VTK). InputError where a cell has
    no positive volume, a hexahedron not everywhere.
    """

    points: np.ndarray
    cells: np.ndarray
    cell_tags: np.ndarray
    facets: np.ndarray
    facet_tags: np.ndarray

    def __post_init__(self) -> None:
        with np.errstate(all="ignore"):
            smallest = self.smallest_volumes()
        if not len(smallest) or not ((smallest > 0) & np.isfinite(smallest)).all():
            raise InputError(f"one of the {self.element} has no positive volume: take another mesh_size_mm")

    @property
    def element(self) -> str:
        """One of ELEMENTS."""
        return next(name for name, (corners, _) in ELEMENTS.items() if corners == self.cells.shape[1])

    def volumes(self) -> np.ndarray:
        """(m,) mm3."""
        corners = self.points[self.cells]
        if self.element == "hexahedra":
            return hexahedron_volumes(corners)
        return volumes_and_quality(corners)[0]

    def smallest_volumes(self) -> np.ndarray:
        """(m,) mm3: of a hexahedron the smallest of its determinants at its corners and 27 Gauss points."""
        if self.element == "hexahedra":
            places = np.concatenate([CORNERS, gauss(3)[0]])
            return jacobians(self.points[self.cells], places).min(axis=1)
        return self.volumes()

    def qualities(self) -> np.ndarray:
        """(m,) 1 for regular cells: mean ratios of tetrahedra, scaled determinants of hexahedra, the smallest
        of their corners."""
        corners = self.points[self.cells]
        if self.element == "hexahedra":
            return scaled_determinants(corners).min(axis=1)
        return volumes_and_quality(corners)[1]

    def areas(self, tag: int) -> np.ndarray:
        """(n,) mm2 of the facets with this tag, their corners taken to lie in a plane."""
        corners = self.points[self.tagged(tag)]
        return np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=1)).sum(axis=1), axis=1) / 2

    def tagged(self, tag: int) -> np.ndarray:
        """Facets (n, 3) or (n, 4) with this tag."""
        return self.facets[self.facet_tags == tag]

    def require_tags(self, layered: Sequence[bool], groups: int) -> None:
        """InputError unless cells and facets have the tags of a body whose segments are `layered` or not, of
        so many pressure groups."""
        cells = {tags.BODY + i for i in range(len(layered))}
        cells |= {tags.LAYER + i for i, layer in enumerate(layered) if layer}
        known, met = set(tags.face_names(groups)), set(self.facet_tags.tolist())
        if set(self.cell_tags.tolist()) != cells or not met <= known or not known - {tags.OUTER} <= met:
            raise InputError(f"its tags are not those of this body: {AGAIN}")

    def write(self, path: str | Path, facts: dict[str, Any]) -> None:
        """Write an .npz; facts: what is known of the mesh, a table for JSON."""
        write_archive(path, SCHEMA, {"element": self.element, **facts}, asdict(self), compress=True)


def read_mesh(path: str | Path) -> tuple[VolumeMesh, dict[str, Any]]:
    """(mesh, facts) of an .npz; InputError naming the file where it is damaged or no mesh."""
    facts, stored = read_archive(path, SCHEMA, "a mesh", AGAIN, {"element": str}, _members)
    with located(path):
        mesh = VolumeMesh(
            **{
                name: values.astype(np.float64 if name == "points" else np.int64)
                for name, values in stored.items()
            }
        )
    return mesh, {name: value for name, value in facts.items() if name != "schema"}


def volumes_and_quality(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed volumes (n,) in mm3 and mean-ratio quality (n,), 1 for a regular tetrahedron, of corners (n, 4,
    3)."""
    edges = corners[:, [1, 2, 3, 2, 3, 3]] - corners[:, [0, 0, 0, 1, 1, 2]]
    volumes = np.einsum("ni,ni->n", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) / 6
    return volumes, 12 * np.cbrt(3 * volumes) ** 2 * np.sign(volumes) / np.einsum("nei,nei->n", edges, edges)


def open_edges(facets: np.ndarray) -> int:
    """Number of edges of a soup of polygons (n, corners) that are not shared by exactly two of them; 0 for a
    closed surface."""
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return int(np.count_nonzero(counts != 2))
