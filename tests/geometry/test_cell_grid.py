"""The cell as a tensor grid: the same body and air as the CAD's, conforming, and mapped to itself by the half turn."""

from dataclasses import replace

import gmsh
import numpy as np
import pytest

from base.errors import InputError
from base.materials import NeoHookean
from geometry import cad
from geometry.cell import AIR, GAP, mesh_cell
from geometry.cell_grid import cell_grid, mesh_cell_grid
from tests.cases import CASES

LAYER = dict(layer_thickness=0.5, layer_material=NeoHookean(2.0))


def segment(angle, name="one_sided_w10", **changes):
    return replace(CASES[name](angle=angle, chambers=1), **changes)


def read(path):
    """(points (n, 3), {(dimension, physical tag): nodes (m, 3 or 4)}) of a gmsh file."""
    with cad.session():
        gmsh.open(str(path))
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        order = np.argsort(tags)
        groups = {}
        for dim, tag in gmsh.model.getPhysicalGroups():
            kind = {2: 2, 3: 4}[dim]
            nodes = [gmsh.model.mesh.getElementsByType(kind, e)[1] for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)]
            groups[dim, tag] = np.searchsorted(tags[order], np.concatenate(nodes)).reshape(-1, dim + 1)
        return coordinates.reshape(-1, 3)[order], groups


def volume(points, cells):
    a, b, c, d = (points[cells[:, i]] for i in range(4))
    return np.abs(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)).sum() / 6


def area(points, facets):
    a, b, c = (points[facets[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize(
    "built",
    [segment(60.0), segment(120.0), segment(90.0, **LAYER), segment(60.0, "one_sided_long"), segment(60.0, roof=0.3)],
    ids=["60", "mirrored", "square with a layer", "floor below the channel's top", "thin roof"],
)
def test_body_air_and_walls_are_those_of_the_cad(built, tmp_path):
    ours, theirs = mesh_cell_grid(built, 2.0, tmp_path / "grid.msh"), mesh_cell(built, 2.5, tmp_path / "cad.msh")
    for name in ("body_mm3", "air_mm3"):
        assert ours[name] == pytest.approx(theirs[name], rel=1e-9)
    (points, grid), (cad_points, other) = read(tmp_path / "grid.msh"), read(tmp_path / "cad.msh")
    assert sum(volume(points, cells) for (dim, _), cells in grid.items() if dim == 3) == pytest.approx(ours["body_mm3"] + ours["air_mm3"])
    for tag in (cad.BODY, cad.LAYER, AIR):
        if (3, tag) in other:
            assert volume(points, grid[3, tag]) == pytest.approx(volume(cad_points, other[3, tag]), rel=1e-9)
    # the cut runs elsewhere, but one period of a wall is as large wherever it begins
    for tag in (cad.CHANNEL, cad.CAVITY):
        assert area(points, grid[2, tag]) == pytest.approx(area(cad_points, other[2, tag]), rel=1e-9)


def test_neighbours_share_whole_facets_and_the_cuts_match(tmp_path):
    built = segment(60.0)
    mesh_cell_grid(built, 2.0, tmp_path / "grid.msh", gaps=True)
    points, groups = read(tmp_path / "grid.msh")
    assert volume(points, groups[3, GAP]) == pytest.approx(
        built.gap / built.sin * built.width * (built.chamber_top - built.core_top), rel=1e-9
    )
    cells = np.concatenate([nodes for (dim, _), nodes in groups.items() if dim == 3])
    facets = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
    facets, count = np.unique(facets, axis=0, return_counts=True)
    assert count.max() == 2
    # all that is open is the hull of a parallelepiped: gaps are meshed too
    height = built.chamber_top - built.core_bottom
    hull = 2 * built.pitch * (built.width + height) + 2 * built.width / built.sin * height
    assert area(points, facets[count == 1]) == pytest.approx(hull, rel=1e-9)
    middles = points[facets[count == 1]].mean(axis=1)
    xi = middles[:, 0] - built.cot * middles[:, 1]
    left, right = (middles[np.abs(xi - x) < 1e-9, 1:] for x in (-built.pitch / 2, built.pitch / 2))
    assert sorted(map(tuple, left.round(9))) == sorted(map(tuple, right.round(9)))


def test_the_half_turn_maps_the_mesh_to_itself(tmp_path):
    mesh_cell_grid(segment(60.0), 2.0, tmp_path / "grid.msh")
    points, groups = read(tmp_path / "grid.msh")
    for cells in groups.values():
        middles = points[cells].mean(axis=1)
        turned = middles * [-1, -1, 1]
        assert sorted(map(tuple, (middles + 0.0).round(8) + 0.0)) == sorted(map(tuple, (turned + 0.0).round(8) + 0.0))


@pytest.mark.parametrize(("coarse", "fine", "growth"), [(1.5, 0.2, 6.0), (0.5, 0.05, 2.0)])
def test_layers_at_sharp_edges_are_thin_and_even_in_number_across_the_turn(coarse, fine, growth):
    built = segment(60.0)
    planes = cell_grid(built, coarse, fine, growth).planes
    half = built.cavity_thickness / 2 / built.sin
    for p, sharp in zip(planes, (half, built.cavity_width / 2, built.cavity_top)):
        steps, at = np.diff(p), int(np.abs(p - sharp).argmin())
        assert p[at] == pytest.approx(sharp, abs=1e-12)
        assert steps[[at - 1, at]].max() <= fine + 1e-12 and steps.max() <= coarse + 1e-12
    assert len(planes[0]) % 2 == len(planes[1]) % 2 == 1


def test_chambers_that_slant_both_ways_are_refused(tmp_path):
    with pytest.raises(InputError, match="only a one-sided segment"):
        mesh_cell_grid(CASES["twist_w12"](angle=60.0, chambers=1), 2.0, tmp_path / "grid.msh")


@pytest.mark.parametrize("built", [segment(60.0), segment(60.0, "twist_w12")], ids=["one-sided", "twisting"])
def test_the_cad_s_mesh_gets_finer_at_the_edges_alone(built, tmp_path):
    sizes = []
    for edge_size in (None, 0.6):
        facts = mesh_cell(built, 2.0, tmp_path / "cell.msh", edge_size=edge_size)
        points, groups = read(tmp_path / "cell.msh")
        sizes.append(facts["cells"])
        assert volume(points, groups[3, cad.BODY]) == pytest.approx(facts["body_mm3"], rel=1e-9)
    assert 1.5 * sizes[0] < sizes[1] < (2.0 / 0.6) ** 3 * sizes[0]
