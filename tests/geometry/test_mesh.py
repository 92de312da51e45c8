"""Meshes: as large as the CAD, closed, tagged, and refused where they would be unfit for use."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.geometry import Manipulator, Segment, tags
from pneunet.geometry.cad import cell, mesh
from pneunet.geometry.cad.grid import grid_cell
from pneunet.geometry.grids.cell import cell_grid
from pneunet.geometry.meshfile import MESH, open_edges, read_mesh, volumes_and_quality

ONE_SIDED, TWISTING = Segment("one-sided", 70.0, 2), Segment("twisting", 60.0, 2, gap=2.0, cavity_floor=0.5)
BOTH = Manipulator((TWISTING, replace(ONE_SIDED, width=10.0)))


@pytest.fixture(scope="module")
def meshed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("a mesh")
    return folder, mesh.mesh_manipulator(BOTH, 4.0, folder, "tetrahedra")


def test_facts_agree_with_the_cad(meshed):
    folder, facts = meshed
    assert facts["mesh_volume_mm3"] == pytest.approx(facts["body_mm3"], rel=1e-9)
    assert facts["cavity_closed"] and facts["nothing_intersects"]
    assert 0 < facts["smallest_quality"] <= facts["quality_5_percent"] <= 1
    first, last = BOTH.segments
    areas = facts["areas"]
    assert areas["base_mm2"] == pytest.approx(first.width * (first.core_top - first.core_bottom))
    assert areas["tip_mm2"] == pytest.approx(last.width * (last.core_top - last.core_bottom))
    assert facts["mesh_size_mm"] == 4.0 and facts["segments"] == mesh.segment_tables(BOTH)
    assert json.loads((folder / "mesh.json").read_text()) == facts
    assert read_mesh(folder / MESH)[1] == facts
    written = {"manipulator.msh", "manipulator.npz", "manipulator.step", "mesh.json"}
    assert {p.name for p in folder.iterdir()} == written


def test_tagged_faces_lie_where_their_names_say(meshed):
    folder, facts = meshed
    first, last = BOTH.segments
    stored, _ = read_mesh(folder / MESH)

    def facets(tag):
        return stored.points[stored.tagged(tag)]

    assert facets(tags.BASE)[..., 0] == pytest.approx(0.0, abs=1e-9)
    assert facets(tags.TIP)[..., 0] == pytest.approx(BOTH.length)
    cavity = np.concatenate([facets(tags.CAVITY), facets(tags.CHANNEL)])
    channel = facets(tags.CHANNEL)
    # the divergence theorem on the tagged surface gives the CAD's cavity volume: it is all there, and closed
    normals = np.cross(cavity[:, 1] - cavity[:, 0], cavity[:, 2] - cavity[:, 0]) / 2
    assert abs(np.einsum("nk,nk->", cavity.mean(axis=1), normals) / 3) == pytest.approx(facts["cavity_mm3"])
    assert normals.sum(axis=0) == pytest.approx(0.0, abs=1e-9)
    # the channel's wall: on its four sides, on the axis from half a pitch before the first chamber to half a
    # pitch after the last, and its ends lean
    x, y, z = np.moveaxis(channel, 2, 0)
    on_side = np.ptp(y, axis=1) < 1e-9
    assert abs(y[on_side]) == pytest.approx(2.0) and abs(z[~on_side]) == pytest.approx(1.0)
    assert np.ptp(z[~on_side], axis=1) == pytest.approx(0.0, abs=1e-9)
    leans = [s.end_wall / s.end_length * abs(s.cot) * s.channel_width / 2 for s in BOTH.segments]
    ends = (
        first.chamber_positions[0] - first.pitch / 2 - leans[0],
        BOTH.length - last.end_wall + leans[1],
    )
    assert (x.min(), x.max()) == pytest.approx(ends)
    assert set(stored.cell_tags) == {tags.BODY, tags.BODY + 1}


def test_each_pressure_group_has_a_closed_cavity_between_bulkheads(tmp_path):
    """As large as the CAD's, by the divergence theorem on its own faces; the channels end where the
    parameters say."""
    bend = replace(ONE_SIDED, angle=90.0, chambers=1)
    other = replace(bend, roll=180, group=2)
    body = Manipulator((bend, other, other.plain(8.0)))
    facts = mesh.mesh_manipulator(body, 4.0, tmp_path, "tetrahedra")
    stored, _ = read_mesh(tmp_path / MESH)
    total = 0.0
    for group, ends in enumerate(body.channels, start=1):
        facets = stored.points[np.concatenate([stored.tagged(tag) for tag in tags.cavity_tags(group)])]
        normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0]) / 2
        total += abs(np.einsum("nk,nk->", facets.mean(axis=1), normals) / 3)
        channel = stored.points[stored.tagged(tags.cavity_tags(group)[1])]
        assert (channel[..., 0].min(), channel[..., 0].max()) == pytest.approx(tuple(ends))
        assert abs(channel[..., 1]).max() == pytest.approx(2.0)
        assert np.sign(facets[..., 2].sum()) == (1 if group == 1 else -1)  # chambers above, and below
    assert total == pytest.approx(facts["cavity_mm3"])
    assert set(facts["areas"]) == {f"{name}_mm2" for name in tags.face_names(2).values()}
    assert min(facts["areas"].values()) > 0


def test_a_rounded_body_meshes_in_tetrahedra_alone(tmp_path):
    body, sharp = (Manipulator((replace(ONE_SIDED, chambers=1, fillet=r),)) for r in (0.4, 0.0))
    facts, of_sharp = (mesh.mesh_manipulator(b, 2.0, tmp_path, "tetrahedra") for b in (body, sharp))
    assert facts["segments"][0]["fillet_mm"] == 0.4 and "fillet_mm" not in of_sharp["segments"][0]
    assert facts["mesh_volume_mm3"] == pytest.approx(facts["body_mm3"], rel=5e-3)
    assert facts["cavity_mm3"] < 0.999 * of_sharp["cavity_mm3"]
    with pytest.raises(InputError, match="fillet_mm = 0.4: a grid of hexahedra has sharp edges"):
        mesh.mesh_manipulator(body, 2.0, tmp_path, "hexahedra")
    with pytest.raises(InputError, match="fillet_mm = 0.4: a cell has sharp edges"):
        cell.mesh_cell(body.segments[0], 2.0, tmp_path / "cell.npz")


def test_the_same_mesh_again(meshed, tmp_path):
    again = mesh.mesh_manipulator(BOTH, 4.0, tmp_path, "tetrahedra")
    assert {k: v for k, v in again.items() if k != "seconds"} == {
        k: v for k, v in meshed[1].items() if k != "seconds"
    }


@pytest.mark.parametrize("angle", [45.0, 135.0])
def test_mirror_designs_mesh_to_equal_volumes(angle, tmp_path):
    facts, other = (
        mesh.mesh_manipulator(Manipulator((replace(ONE_SIDED, angle=a),)), 4.0, tmp_path, "tetrahedra")
        for a in (angle, 180 - angle)
    )
    assert facts["mesh_volume_mm3"] == pytest.approx(other["mesh_volume_mm3"], rel=1e-9)
    for name, area in facts["areas"].items():
        assert area == pytest.approx(other["areas"][name], rel=1e-9), name


@pytest.mark.parametrize("size", [0.02, 0.1])
def test_a_mesh_beyond_any_memory_is_refused_at_once(size, tmp_path):
    long = Manipulator((replace(ONE_SIDED, chambers=30),))
    with pytest.raises(InputError, match="mesh_size_mm = .* choose a coarser mesh"):
        mesh.mesh_manipulator(long, size, tmp_path / "mesh")
    for mesh_cell in (cell.mesh_cell, grid_cell):
        with pytest.raises(InputError, match="mesh_size_mm = .* choose a coarser mesh"):
            mesh_cell(replace(ONE_SIDED, width=500.0, wall=0.05), size, tmp_path / "cell.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_cell_with_a_base_thicker_than_its_chambers_are_high_is_whole(tmp_path):
    body = replace(ONE_SIDED, base_thickness=12.0, chamber_height=3.0)
    grid = cell_grid(body, 6.0).mesh()
    facts = cell.mesh_cell(body, 6.0, tmp_path / "cell.npz")
    assert facts["body_mm3"] == pytest.approx(grid.volumes().sum(), rel=1e-9)


def test_nothing_is_left_of_a_mesh_that_fails(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh, "open_edges", lambda nodes: 1)
    with pytest.raises(InputError, match="not closed"):
        mesh.mesh_manipulator(Manipulator((ONE_SIDED,)), 4.0, tmp_path)
    assert list(tmp_path.glob("*.msh")) == list(tmp_path.glob("*.json")) == list(tmp_path.glob(".*")) == []


def test_quality_and_volume_of_tetrahedra():
    regular = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    volumes, quality = volumes_and_quality(
        np.stack([regular, corner, corner[[1, 0, 2, 3]], corner * [1, 1, 0]])
    )
    assert abs(volumes) == pytest.approx([8 / 3, 1 / 6, 1 / 6, 0]) and volumes[1] == -volumes[2] > 0
    assert abs(quality[0]) == pytest.approx(1.0) and quality[3] == 0.0 and quality[2] == -quality[1] < 0


def test_open_edges_of_a_tetrahedrons_surface():
    closed = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    assert open_edges(closed) == 0
    assert open_edges(closed[1:]) == 3  # a hole
    assert open_edges(np.concatenate([closed, [[0, 1, 4]]])) == 3  # a fin
