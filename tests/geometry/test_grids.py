"""Grids of hexahedra: what is in them, that they fit together, that nothing is inside out."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import tags
from pneunet.geometry.grids.body import body_grid
from pneunet.geometry.grids.cell import cell_grid
from pneunet.geometry.grids.sample import random_manipulator, random_segment
from pneunet.geometry.meshfile import open_edges
from pneunet.geometry.parameters import ONE_SIDED, TWISTING, Manipulator, Segment
from pneunet.geometry.reference_cases import CASES
from pneunet.geometry.sections import rotation
from pneunet.geometry.snapping import SNAP, snapped

KINDS = ("one_sided_w10", "twist_w12")


def box_overlap(a, b, c, d):
    return max(0.0, min(b, d) - max(a, c))


def cell_volumes(s):
    """(body, air) of one pitch in mm3, from the boxes that it is made of."""
    core = s.width * (s.core_top - s.core_bottom) * s.pitch
    blocks = s.width * (s.chamber_top - s.core_top) * s.chamber_thickness / s.sin
    channel = s.channel_width * s.channel_height
    half = s.channel_height / 2
    both = s.channel_width * box_overlap(s.cavity_floor, s.cavity_top, -half, half)
    cavities = (s.cavity_width * s.chamber_height - both) * s.cavity_thickness / s.sin
    air = channel * s.pitch + len(s.sides) * cavities
    return core + len(s.sides) * blocks - air, air


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("layer", [None, 0.25])
def test_a_cell_s_volumes_are_those_of_its_boxes(name, layer):
    segment = CASES[name](60.0, 1)
    mesh = cell_grid(segment, 1.5, layer).mesh(air=True)
    air = mesh.cell_tags == tags.AIR
    body, inside = cell_volumes(segment)
    assert mesh.volumes()[~air].sum() == pytest.approx(body, rel=1e-12)
    assert mesh.volumes()[air].sum() == pytest.approx(inside, rel=1e-12)


@pytest.mark.parametrize("angle", [30.0, 90.0, 149.9])
@pytest.mark.parametrize("name", KINDS)
def test_the_grid_depends_smoothly_on_the_angle(name, angle):
    """The same cells at every angle, 90 degrees among them; nodes move by what the angle changes."""
    grids = [cell_grid(CASES[name](a, 1), 1.5 / np.sin(np.radians(a))) for a in (angle, angle + 1e-7)]
    assert (grids[0].kinds == grids[1].kinds).all()
    assert np.abs(grids[0].points - grids[1].points).max() < 1e-6


@pytest.mark.parametrize("name", KINDS)
def test_a_grid_like_another_segment_s_has_its_elements_between_its_own_planes(name):
    like = CASES[name](45.0, 1)
    other = replace(
        like, angle=75.0, width=1.4 * like.width, wall=1.3 * like.wall, roof=0.8 * like.roof, gap=2.9
    )
    grids = [cell_grid(s, 2.0, 0.25, part=True, like=like) for s in (like, other)]
    assert (grids[0].kinds == grids[1].kinds).all()
    assert (grids[0].points == cell_grid(like, 2.0, 0.25, part=True).points).all()
    mesh = grids[1].mesh(air=True)
    air = mesh.cell_tags == tags.AIR
    of_whole = [(4 if name == "twist_w12" else 2) * mesh.volumes()[a].sum() for a in (~air, air)]
    assert of_whole == pytest.approx(cell_volumes(other), rel=1e-12)


def test_planes_that_are_one_here_and_two_there_leave_no_flat_elements():
    like = replace(CASES["twist_w12"](45.0, 1), cavity_floor=0.6)
    flush = replace(like, cavity_floor=like.channel_height / 2)
    mesh = cell_grid(flush, 2.0, part=True, like=like).mesh(air=True)
    assert mesh.volumes().min() > 1e-3
    assert 4 * mesh.volumes().sum() == pytest.approx(sum(cell_volumes(flush)), rel=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"roof": 3.5, "chamber_height": 3.0, "top_wall": 2.0},
        {"cavity_floor": 0.5},
        {"layer_thickness": 0.5, "layer_material": NeoHookean(mu=1.0)},
    ],
    ids=["ceiling within the core", "floor in the channel", "layer"],
)
def test_a_grid_like_another_segment_s_is_refused_where_it_would_miss_a_plane(change):
    like = CASES["one_sided_w10"](45.0, 1)
    with pytest.raises(InputError, match="leave out alike"):
        cell_grid(replace(like, **change), 2.0, like=like)


def matched(points, others):
    """Whether two sets of points are one."""
    a, b = (np.unique(p.round(9) + 0.0, axis=0) for p in (points, others))
    return a.shape == b.shape and np.abs(a - b).max() < 1e-8


@pytest.mark.parametrize("name", KINDS)
def test_half_turns_map_a_cell_s_grid_onto_itself_and_its_part_makes_the_rest(name):
    segment = CASES[name](60.0, 1)
    grid, part = cell_grid(segment, 1.5), cell_grid(segment, 1.5, part=True)
    turns = [np.diag([-1, -1, 1])]
    if name == "twist_w12":
        turns += [np.diag([1, -1, -1]), np.diag([-1, 1, -1])]
    centres = [g.mesh(air=True).points[g.mesh(air=True).cells].mean(axis=1) for g in (grid, part)]
    for turn in turns:
        assert matched(centres[0] @ turn, centres[0])
    assert matched(np.concatenate([centres[1] @ turn for turn in [np.eye(3), *turns]]), centres[0])


@pytest.mark.parametrize("name", KINDS)
def test_a_grid_whose_elements_are_cut_is_nested(name):
    segment = CASES[name](60.0, 1)
    coarse, fine = (cell_grid(segment, 4.0, 0.8, part=True, cut=cut) for cut in (1, 3))
    np.testing.assert_allclose(fine.points[::3, ::3, ::3], coarse.points, atol=1e-12)
    assert (fine.kinds[1::3, 1::3, 1::3] == coarse.kinds).all()


@pytest.mark.parametrize("name", KINDS)
def test_opposite_cuts_of_a_cell_are_images_of_each_other(name):
    segment = CASES[name](60.0, 1)
    points = cell_grid(segment, 1.5).points
    assert points[-1] - points[0] == pytest.approx(
        np.broadcast_to([segment.pitch, 0, 0], points[0].shape), abs=1e-12
    )


def faces_of(cells):
    sides = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    return np.sort(cells[:, sides].reshape(-1, 4), axis=1)


def test_a_body_fits_together_and_its_facets_are_its_surface():
    """Segments of all widths, kinds and angles: every face lies between two cells, or is a tagged facet."""
    body = Manipulator(
        [CASES["one_sided_w10"](60.0, 3), CASES["twist_w15"](120.0, 2), CASES["twist_w12"](90.0, 1)]
    )
    mesh = body_grid(body, 2.0).mesh()
    faces, counts = np.unique(faces_of(mesh.cells), axis=0, return_counts=True)
    assert set(counts) == {1, 2}
    facets = np.unique(np.sort(mesh.facets, axis=1), axis=0)
    assert (facets == faces[counts == 1]).all()
    assert open_edges(mesh.facets) == 0
    assert open_edges(np.concatenate([mesh.tagged(tags.CAVITY), mesh.tagged(tags.CHANNEL)])) == 0
    assert set(mesh.cell_tags) == {tags.BODY, tags.BODY + 1, tags.BODY + 2}


def test_facets_are_named_after_where_they_lie():
    s = CASES["one_sided_w10"](60.0, 3)
    mesh = body_grid(Manipulator([s]), 1.5).mesh()
    at = {tag: mesh.points[mesh.tagged(tag)] for tag in tags.FACE_NAMES}
    assert np.ptp(at[tags.BASE][..., 0]) == 0 and at[tags.TIP][..., 0] == pytest.approx(s.length)
    for each in at[tags.CHANNEL]:
        assert np.isclose(np.abs(each[:, 1]), 1).all() or np.isclose(np.abs(each[:, 2]), 1).all()
    assert np.abs(at[tags.CAVITY][..., 1]).max() == pytest.approx(s.cavity_width / 2)
    assert at[tags.OUTER][..., 2].max() == s.chamber_top
    normals = np.cross(mesh.points[mesh.facets[:, 2]] - mesh.points[mesh.facets[:, 0]],
                       mesh.points[mesh.facets[:, 3]] - mesh.points[mesh.facets[:, 1]]) / 2  # fmt: skip
    # outward everywhere: they add up to nothing, and their flux of the place is three volumes
    assert np.abs(normals.sum(axis=0)).max() < 1e-9
    flux = np.einsum("ni,ni->", normals, mesh.points[mesh.facets].mean(axis=1))
    assert flux == pytest.approx(3 * mesh.volumes().sum(), rel=1e-3)


def test_a_bottom_layer_has_its_thickness():
    s = replace(CASES["one_sided_w10"](60.0, 2), layer_thickness=0.5, layer_material=NeoHookean(1.0))
    mesh = body_grid(Manipulator([s]), 1.5).mesh()
    layer = mesh.cell_tags == tags.LAYER
    assert mesh.volumes()[layer].sum() == pytest.approx(0.5 * s.width * s.length)


def body_volume(manipulator):
    """mm3 of segments whose sections are one: cells, passive ends, and the channel's closed ends."""
    total = 0.0
    for s in manipulator.segments:
        body, _ = cell_volumes(s)
        section = s.width * (s.core_top - s.core_bottom)
        channel = s.channel_width * s.channel_height
        # N cells, but for half a gap at each end; there the core with its channel goes on
        core = section - channel
        total += s.chambers * body - core * s.gap / s.sin + 2 * core * s.end_length
    first, last = manipulator.segments[0], manipulator.segments[-1]
    return total + channel * (first.end_wall + last.end_wall)


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("angles", [(60.0,), (90.0, 40.0)])
def test_a_body_s_volume_is_that_of_its_boxes(name, angles):
    body = Manipulator([CASES[name](a, 3) for a in angles])
    assert body_grid(body, 1.5).mesh().volumes().sum() == pytest.approx(body_volume(body), rel=1e-12)


def test_a_taper_is_a_frustum():
    """Two cores of different width: between them, over half the margins, the width goes over linearly."""
    a, b = CASES["one_sided_w10"](90.0, 1), CASES["one_sided_w10"](90.0, 1)
    b = replace(b, width=14.0, end_margin=4.0)
    body = Manipulator([a, b])
    joint = (a.width * 1 + b.width * 2) / 3
    taper = (a.width + joint) / 2 * 1 + (joint + b.width) / 2 * 2
    height, channel = a.core_top - a.core_bottom, a.channel_width * a.channel_height
    tapers = taper * height - 3 * channel
    flat = (a.width * height - channel) * 1 + (b.width * height - channel) * 2
    exact = body_volume(body) + tapers - flat
    assert body_grid(body, 1.5).mesh().volumes().sum() == pytest.approx(exact, rel=1e-12)


def test_a_joint_of_sections_that_are_rolled_against_each_other_keeps_either_segment():
    """The twisting segment's chambers stand out sideways, where the one-sided has nothing."""
    a = CASES["one_sided_w10"](60.0, 2)
    b = replace(CASES["twist_w12"](60.0, 1), width=6.0, roll=90, channel_width=2.0)
    volumes = [body_grid(Manipulator(m), 2.0).mesh().volumes().sum() for m in ([a], [b], [a, b])]
    plugs = sum(s.channel_width * s.channel_height * s.end_wall for s in (a, b))
    # but for the tapers, which keep each dimension's volume and not quite their product's
    assert volumes[2] == pytest.approx(volumes[0] + volumes[1] - plugs, abs=0.01 * volumes[2])


@pytest.mark.parametrize("roll", [90, 180, 270])
def test_a_rolled_segment_is_the_turned_one(roll):
    s = replace(CASES["one_sided_w10"](60.0, 2), layer_thickness=0.5, layer_material=NeoHookean(1.0))
    plain, rolled = (body_grid(Manipulator([each]), 2.0).mesh() for each in (s, replace(s, roll=roll)))
    turn = rotation(replace(s, roll=roll))
    for tag in np.unique(plain.cell_tags):
        centres = [m.points[m.cells[m.cell_tags == tag]].mean(axis=1) for m in (plain, rolled)]
        assert matched(centres[0] @ turn.T, centres[1])
    for tag in tags.FACE_NAMES:
        centres = [m.points[m.tagged(tag)].mean(axis=1) for m in (plain, rolled)]
        assert matched(centres[0] @ turn.T, centres[1])


def test_a_passive_segment_is_core_and_a_group_of_its_own_has_a_cavity_of_its_own():
    s = CASES["one_sided_w10"](60.0, 2)
    passive = Manipulator([s, s.plain(10.0), s])
    own = Manipulator([s, s.plain(10.0), replace(s, group=2)])
    section = s.width * (s.core_top - s.core_bottom) - s.channel_width * s.channel_height
    volumes = [body_grid(m, 1.5).mesh().volumes().sum() for m in (Manipulator([s, s]), passive, own)]
    assert volumes[1] - volumes[0] == pytest.approx(10 * section)
    bulkhead = s.channel_width * s.channel_height * (s.plain(10.0).end_wall + s.end_wall)
    assert volumes[2] - volumes[1] == pytest.approx(bulkhead)


def test_planes_that_all_but_meet_become_one():
    s = Segment(ONE_SIDED, 60.0, 2, cavity_floor=0.96, channel_width=9.85, width=12.0)
    t = snapped(s)
    assert t.cavity_floor == 1.0 and t.channel_width == t.cavity_width
    assert t.cavity_top == pytest.approx(s.cavity_top)
    assert snapped(t) == t
    assert snapped(Segment(TWISTING, 60.0, 2, cavity_floor=0.0)).cavity_floor == SNAP / 2


def test_random_segments_and_bodies_are_nowhere_inside_out():
    """A mesh refuses cells that are not positive at every corner and Gauss point."""
    random = np.random.default_rng(7)
    for _ in range(60):
        segment = random_segment(random)
        for part in (False, True):
            mesh = cell_grid(segment, 2.0, part=part).mesh(air=True)
            body, air = cell_volumes(snapped(segment))
            share = (4 if segment.kind == TWISTING else 2) if part else 1
            assert mesh.volumes().sum() * share == pytest.approx(body + air, rel=1e-9)
    for _ in range(10):
        mesh = body_grid(random_manipulator(random), 2.5).mesh()
        assert open_edges(mesh.facets) == 0
