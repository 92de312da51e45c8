"""Moulds: layers against the CAD's volume, and by manifold3d, which shares nothing with the CAD kernel, that
each mould is closed, can be pulled, and that together they leave the body."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.stl import read_stl, write_stl
from pneunet.geometry.cad import body as cad
from pneunet.geometry.cad.moulds import body_part, mould_parts
from pneunet.geometry.meshfile import open_edges
from pneunet.geometry.moulds.layers import cut, runs
from pneunet.geometry.moulds.parameters import Moulds, printed
from pneunet.geometry.moulds.part import Part, cast, outward, undercut
from pneunet.geometry.parameters import Manipulator, Segment

CORE = {"roof": 1.5, "channel_width": 3.0}
EXACT = Moulds(shrinkage=0.0)
PASSIVE = Segment("passive", 90.0, 0, plain_length=8.0, **CORE)


def one_sided(angle=60.0, **more):
    return Segment("one-sided", angle, 2, **(CORE | more))


def twisting(angle=60.0, **more):
    return Segment("twisting", angle, 2, **(CORE | more))


BODIES = {
    "one-sided": (one_sided(),),
    "low floor": (one_sided(110.0, cavity_floor=-0.5), PASSIVE),
    "twisting": (twisting(),),
    "twisting, floor 0": (twisting(cavity_floor=0.0),),
    "both, two groups": (one_sided(90.0), twisting(120.0, group=2)),
    "above and below": (one_sided(), one_sided(70.0, roll=180)),
    "rolled": (one_sided(cavity_floor=0.4), one_sided(90.0, roll=270, group=2)),
    # the channel's roof dips below one split plane and its floor rises above the other
    "tapers": (twisting(110.0), replace(PASSIVE, channel_height=1.4, channel_width=2.0, width=9.0)),
}


def of_layers(body):
    """mm3 of silicone in all layers."""
    return sum(sum(layer.volumes.values()) for run in runs(body) for layer in run.layers)


@pytest.mark.parametrize("name", BODIES)
def test_moulds_are_closed_can_be_pulled_and_leave_the_body(name):
    body = Manipulator(BODIES[name])
    parts = list(mould_parts(body, EXACT))
    facts = [part.check() for part in parts]
    assert all(f["open_edges"] == 0 for f in facts) and sum("undercut_mm2" in f for f in facts) >= 2
    whole, left = body_part(body, EXACT, ports=False), cast(parts)
    assert left.volume() == pytest.approx(whole.volume, rel=1e-9)
    assert whole.volume == pytest.approx(of_layers(body), rel=1e-9)
    assert (left - whole.manifold()).volume() < 1e-9 * whole.volume
    assert (whole.manifold() - left).volume() < 1e-9 * whole.volume


def test_triangles_turn_outwards_whatever_their_order_and_into_voids():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    shell = corners * 10 - 1  # with a tetrahedron as its void
    points, right = np.concatenate([shell, corners]), np.concatenate([tetrahedron, tetrahedron[:, ::-1] + 4])
    random = np.random.default_rng(1)
    for _ in range(20):
        mixed = np.where(random.integers(2, size=(8, 1)) == 1, right[:, ::-1], right)
        assert (outward(points, mixed) == right).all()
    assert Part("hollow", "", points, right).volume == pytest.approx((1000 - 1) / 6)
    assert (outward(points, right[1:]) == right[1:]).all()


@pytest.mark.parametrize(
    "segments",
    [BODIES["both, two groups"] + (one_sided(roll=90, group=2), twisting(group=3)), BODIES["tapers"]],
    ids=["rolled", "tapers"],
)
def test_layers_volumes_are_the_cads(segments):
    body = Manipulator(segments)
    with cad.session():
        volumes = cad.build(body)
    assert of_layers(body) == pytest.approx(volumes["body_mm3"], rel=1e-12)


def test_where_bodies_are_split():
    def planes(*segments):
        return [(run.planes, len(run.parts)) for run in runs(Manipulator(segments))]

    assert planes(one_sided(cavity_floor=0.4)) == [((0.4,), 1)]
    assert planes(twisting(cavity_floor=0.0)) == [((0.0,), 1)]
    assert planes(one_sided(), PASSIVE, twisting()) == [((-1.0, 1.0), 3)]
    assert planes(one_sided(), one_sided(roll=180)) == [((-1.0, 1.0), 2)]
    assert planes(one_sided(), one_sided(roll=90)) == [((1.0,), 1), ((1.0,), 1)]
    assert planes(one_sided(), one_sided(cavity_floor=0.4)) == [((1.0,), 1), ((0.4,), 1)]


def test_a_split_elsewhere_leaves_the_same_body_or_is_refused():
    body = Manipulator((one_sided(cavity_floor=0.2),))
    parts = list(mould_parts(body, Moulds(shrinkage=0.0, split=0.7)))
    assert [part.check() for part in parts]
    assert cast(parts).volume() == pytest.approx(body_part(body, EXACT, ports=False).volume, rel=1e-9)
    with pytest.raises(InputError, match="split_mm = 0.1: must lie in 0.2..1"):
        runs(body, 0.1)
    with pytest.raises(InputError, match="both sides"):
        runs(Manipulator((twisting(),)), 0.5)


def test_an_undercut_is_seen():
    """A mushroom: a wide lid on a narrow stem."""
    import manifold3d

    stem, lid = manifold3d.Manifold.cube([1, 1, 2]), manifold3d.Manifold.cube([3, 2, 1]).translate([0, 0, 2])
    mesh = (stem + lid).to_mesh64()
    points, triangles = np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, int)
    part = Part("mushroom", "", points, triangles, silicone=np.array([[-1, -1, 0], [4, 4, 3.0]]))
    assert undercut(part) == pytest.approx(5.0)
    with pytest.raises(InputError, match="could not be pulled out"):
        part.check()
    with pytest.raises(InputError, match="not closed"):
        Part("open", "", points, triangles[1:]).check()


def test_draft_and_fillets_thicken_walls_alone():
    """Cores lose half a degree's wedge at all four sides, and their corners; the outside gains the fins'."""
    body, moulds = Manipulator((one_sided(90.0),)), Moulds(shrinkage=0.0, draft=0.5, fillet=0.5)
    parts = list(mould_parts(body, moulds))
    assert [part.check() for part in parts]
    whole, left = body_part(body, EXACT, ports=False).manifold(), cast(parts)
    assert (whole - left).volume() < 1e-9
    s, t = body.segments[0], np.tan(np.radians(0.5))
    h, fin = s.chamber_height, s.chamber_top - s.core_top
    cores = (s.cavity_thickness + s.cavity_width) * t * h**2 - 4 * t**2 * h**3 / 3
    corners = (4 - np.pi) * 0.5**2 * h
    outside, channel = s.width * t * fin**2, 2.0 * t * s.channel_height**2 / 2
    length = np.ptp(body.channels[0])
    expected = 2 * (cores + corners + outside) + channel * length
    assert (left - whole).volume() == pytest.approx(expected, rel=0.05)


def test_rounded_chambers_are_cast_as_the_cad_has_them_but_for_chords():
    body = Manipulator((one_sided(fillet=0.4),))
    parts = list(mould_parts(body, EXACT))
    assert [part.check() for part in parts]
    rounded, sharp = (body_part(b, EXACT, ports=False) for b in (body, Manipulator((one_sided(),))))
    left = cast(parts)
    off = (left - rounded.manifold()).volume() + (rounded.manifold() - left).volume()
    assert off < 0.1 * abs(rounded.volume - sharp.volume) and off < 2e-3 * rounded.volume


def test_draft_of_the_sides_widens_them_towards_the_split():
    """By a wedge at either side of each layer."""
    body, moulds = Manipulator((one_sided(90.0),)), Moulds(shrinkage=0.0, draft_outside=2.0)
    parts = list(mould_parts(body, moulds))
    assert [part.check() for part in parts]
    whole, left = body_part(body, EXACT, ports=False).manifold(), cast(parts)
    assert (whole - left).volume() < 1e-9
    s, t = body.segments[0], np.tan(np.radians(2.0))
    below = s.cavity_floor - s.core_bottom
    wedges = s.length * t * below**2  # the lower layer's, both sides
    high, rise = s.chamber_top - s.cavity_floor, s.chamber_top - s.core_top
    wedges += 2 * s.chamber_thickness * t * rise**2 + s.length * t * (high**2 - rise**2)
    assert (left - whole).volume() == pytest.approx(wedges, rel=1e-6)


def test_moulds_make_up_for_shrinkage():
    body = Manipulator((twisting(), PASSIVE))
    grown = cast(mould_parts(body, Moulds(shrinkage=0.02))).volume()
    assert grown * 0.98**3 == pytest.approx(body_part(body, EXACT, ports=False).volume, rel=1e-9)


def test_long_moulds_are_cut_to_the_bed_and_leave_the_same_body():
    body = Manipulator((Segment("one-sided", 60.0, 6, **CORE), PASSIVE))
    moulds = Moulds(shrinkage=0.0, bed_length=60.0)
    parts = list(mould_parts(body, moulds))
    assert [part.check() for part in parts] and max(part.size[0] for part in parts) <= 60.0
    assert {"upper-tray-1", "upper-tray-2", "lower-plate-2", "jig-1"} <= {part.name for part in parts}
    assert cast(parts).volume() == pytest.approx(body_part(body, EXACT, ports=False).volume, rel=1e-9)


def test_cuts_are_few_about_equal_and_at_good_places():
    assert cut(0, 100, 200, np.array([50.0])) == [0, 100]
    assert cut(0, 300, 200, np.array([140.0, 199.0])) == [0, 140, 300]
    assert cut(0, 300, 100, np.array([90.0])) == pytest.approx([0, 100, 200, 300])


def test_what_does_not_go_with_the_body_is_refused():
    body = Manipulator((one_sided(),))
    for moulds, told in (
        (Moulds(bed_width=20.0), "bed_width_mm = 20: 'upper-tray' needs 28.0 mm"),
        (Moulds(draft=5.0), "draft_deg = 5: fins and cores of segment 1"),
        (Moulds(fillet=1.2), "fillet_mm = 1.2"),
        (Moulds(port=3.0), "port_mm = 3"),
    ):
        with pytest.raises(InputError, match=told):
            list(mould_parts(body, moulds))
    with pytest.raises(InputError, match="flange_mm = 5"):
        Moulds(flange=5.0, dowel=4.0)
    assert printed(body, EXACT) == body


def euler(part):
    """Vertices - edges + faces of a closed surface of triangles: 2 for every ball."""
    return len(part.points) - len(part.triangles) // 2


def test_the_body_as_cast_has_ports_and_its_stl_reads_back(tmp_path):
    body = Manipulator(BODIES["both, two groups"])
    closed, part = (body_part(body, EXACT, ports=ports) for ports in (False, True))
    # two tubes join three closed surfaces: the outside and two cavities
    assert euler(closed) == 6 and euler(part) == 2
    removed = closed.volume - part.volume
    s = body.segments[0]
    wall = (s.width - s.channel_width) / 2
    assert 0.8 * np.pi * 0.9**2 * wall < removed < 2.2 * np.pi * 0.9**2 * wall
    write_stl(tmp_path / "body.stl", part.points[part.triangles], part.name)
    triangles = read_stl(tmp_path / "body.stl")
    _, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    assert open_edges(index.reshape(-1, 3)) == 0
