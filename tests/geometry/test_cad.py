"""CAD volumes against closed forms derived here.

A plan parallelogram of normal thickness t between y = -b/2 and b/2 has area t b / sin(angle), wherever it is
cut by planes of constant y. So, per side of the core and chamber: outer block above the core t_c W / sin;
cavity t b / sin times its height; what it shares with the channel, t w / sin times the height from its floor
to the channel's top. The channel runs one pitch per chamber, and through the joints from one segment's last
cell to the next one's first.
"""

from dataclasses import replace

import gmsh
import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Manipulator, Segment, tags
from pneunet.geometry.cad import body as cad
from pneunet.geometry.grids.planes import snapped
from pneunet.geometry.reference_cases import CASES

ONE_SIDED, TWISTING = (
    Segment("one-sided", 60.0, 3),
    Segment("twisting", 60.0, 3, cavity_floor=0.5, chamber_height=5.5),
)


def built(*segments):
    """CAD volumes (body, cavity) in mm3 of a manipulator."""
    with cad.session():
        volumes = cad.build(Manipulator(segments))
    return volumes["body_mm3"], volumes["cavity_mm3"]


def outer_volume(s):
    core = s.length * s.width * (s.core_top - s.core_bottom)
    block = (s.cavity_thickness + 2 * s.wall) / s.sin * s.width * (s.chamber_top - s.core_top)
    return core + len(s.sides) * s.chambers * block


def cavity_volume(s):
    channel = s.chambers * s.pitch * s.channel_width * s.channel_height
    plan = s.cavity_thickness / s.sin  # per unit of width
    shared = plan * s.channel_width * (s.channel_height / 2 - s.cavity_floor)
    return channel + len(s.sides) * s.chambers * (
        plan * (s.width - 2 * s.side_wall) * s.chamber_height - shared
    )


def joint_volume(s):
    """Channel through one end of a segment that is joined."""
    return s.channel_width * s.channel_height * (s.length - s.chambers * s.pitch) / 2


@pytest.mark.parametrize("angle", [45.0, 60.0, 90.0, 120.0])
@pytest.mark.parametrize("kind", ["one-sided", "twisting"])
@pytest.mark.parametrize("floor", [1.0, 0.4, 0.0])
def test_volumes_of_one_segment(kind, angle, floor):
    s = Segment(kind, angle, 3, cavity_floor=floor, chamber_height=4.5)
    body, cavity = built(s)
    s = snapped(s)
    assert cavity == pytest.approx(cavity_volume(s), rel=1e-9)
    assert body == pytest.approx(outer_volume(s) - cavity_volume(s), rel=1e-9)


@pytest.mark.parametrize(
    "segment",
    [
        replace(ONE_SIDED, cavity_floor=-1.0),
        replace(ONE_SIDED, chambers=1),
        replace(TWISTING, chambers=1, angle=120.0),
        replace(ONE_SIDED, channel_width=10.0, gap=8.0, end_margin=3.0),
        replace(
            ONE_SIDED,
            width=20.0,
            side_wall=2.0,
            roof=0.4,
            base_thickness=1.1,
            top_wall=1.7,
            wall=0.6,
            gap=3.1,
        ),
    ],
    ids=[
        "floor on the channel's",
        "one chamber",
        "one pair",
        "channel as wide as the cavity",
        "all walls different",
    ],
)
def test_volumes_at_the_limits(segment):
    assert built(segment) == pytest.approx(
        (outer_volume(segment) - cavity_volume(segment), cavity_volume(segment))
    )


@pytest.mark.parametrize("name", CASES)
def test_volumes_of_the_reference_cases(name):
    s = CASES[name](angle=60.0, chambers=26 if name == "one_sided_long" else 3)
    assert built(s) == pytest.approx((outer_volume(s) - cavity_volume(s), cavity_volume(s)))


def test_a_manipulator_is_the_sum_of_its_segments_and_the_channel_through_the_joints():
    segments = (TWISTING, replace(ONE_SIDED, base_thickness=1.0), replace(TWISTING, angle=110.0, chambers=2))
    body, cavity = built(*segments)
    joints = sum(map(joint_volume, (*segments, segments[1])))
    assert cavity == pytest.approx(sum(map(cavity_volume, segments)) + joints, rel=1e-9)
    assert body + cavity == pytest.approx(sum(map(outer_volume, segments)), rel=1e-9)


def test_rolled_passive_and_grouped_segments_add_up_too():
    """The second group's cavity ends with its own cells; a passive segment is core, and channel but for what
    closes its end. Cores and channels are squares about the axis, so that no taper comes in."""
    narrow = replace(ONE_SIDED, width=6.0, channel_width=2.0, base_thickness=2.0, roof=2.0)
    segments = [narrow.plain(9.0), narrow, replace(narrow, roll=90)]
    twist = replace(TWISTING, width=6.0, channel_width=2.0, roof=2.0, roll=90, group=2)
    segments += [replace(narrow, angle=120.0, roll=180, group=2), twist]
    with cad.session():
        volumes = cad.build(Manipulator(segments))
        tops = {}
        for _, tag in gmsh.model.getPhysicalGroups(3):
            boxes = [gmsh.model.getBoundingBox(3, v) for v in gmsh.model.getEntitiesForPhysicalGroup(3, tag)]
            tops[tag - tags.BODY] = [
                f(b[i] for b in boxes) for f, i in ((min, 1), (min, 2), (max, 4), (max, 5))
            ]
    cavities = sum(map(cavity_volume, segments[1:])) + (9.0 - 2.0) * 2.0 * 2.0
    cavities += sum(joint_volume(s) for s in (narrow, narrow, narrow, segments[3], twist))
    assert volumes["cavity_mm3"] == pytest.approx(cavities, rel=1e-9)
    outer = sum(map(outer_volume, segments))
    assert volumes["body_mm3"] + volumes["cavity_mm3"] == pytest.approx(outer, rel=1e-9)
    expected = {0: (-3, -3, 3, 3), 1: (-3, -3, 3, 6), 2: (-6, -3, 3, 3), 3: (-3, -6, 3, 3), 4: (-7, -3, 7, 3)}
    assert tops == {i: pytest.approx(bounds, abs=1e-5) for i, bounds in expected.items()}


@pytest.mark.parametrize("name", ["one_sided_w10", "twist_w12"])
def test_mirror_designs_have_equal_volumes(name):
    s = CASES[name](angle=50.0, chambers=3)
    assert built(s.mirrored, ONE_SIDED.mirrored) == pytest.approx(built(s, ONE_SIDED), rel=1e-9)


def test_a_bottom_layer_is_a_volume_of_its_own_and_changes_no_other():
    layered = replace(ONE_SIDED, layer_thickness=0.4, layer_material=NeoHookean(mu=50.0))
    between = replace(TWISTING, roof=2.0)
    segments = (layered, between, replace(layered, angle=90.0, layer_thickness=0.7))
    plain = (ONE_SIDED, between, replace(ONE_SIDED, angle=90.0))
    with cad.session():
        volumes = cad.build(Manipulator(segments))
        parts = {
            tag: sum(gmsh.model.occ.getMass(3, v) for v in gmsh.model.getEntitiesForPhysicalGroup(3, tag))
            for _, tag in gmsh.model.getPhysicalGroups(3)
        }
    for tag, s in ((tags.LAYER, segments[0]), (tags.LAYER + 2, segments[2])):
        assert parts[tag] == pytest.approx(s.length * s.width * s.layer_thickness)
    assert sorted(parts) == [tags.BODY, tags.BODY + 1, tags.BODY + 2, tags.LAYER, tags.LAYER + 2]
    assert sum(parts.values()) == pytest.approx(volumes["body_mm3"])
    assert (volumes["body_mm3"], volumes["cavity_mm3"]) == pytest.approx(built(*plain))


@pytest.mark.parametrize("kind", ["one-sided", "twisting"])
def test_fillets_take_and_give_what_rounded_edges_do(kind):
    """At 90 degrees: (1 - pi / 4) r^2 a length of edge, more inside at corners, where three edges make a
    ball's eighth."""
    r = 0.3
    s = Segment(kind, 90.0, 2, cavity_floor=1.0, gap=1.5, fillet=r)
    body, cavity = built(s)
    plain = built(replace(s, fillet=0.0))
    corner, ball = (1 - np.pi / 4) * r**2, (1 - np.pi / 6) * r**3
    count = s.chambers * len(s.sides)
    edges = 4 * (s.chamber_height - r) + 2 * (s.cavity_thickness + s.cavity_width - 4 * r)
    lost = count * (corner * edges + 4 * ball)
    assert cavity == pytest.approx(plain[1] - lost, rel=1e-6)
    # outside feet gain as much as tops lose
    assert body == pytest.approx(plain[0] + lost, rel=1e-6)


def spoilt(segment, **change):
    """A segment whose validation was passed by: what the CAD's own checks are for."""
    segment = replace(segment)
    for name, value in change.items():
        object.__setattr__(segment, name, value)
    return segment


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        (spoilt(ONE_SIDED, side_wall=0.0), "breaks through the outer surface"),
        (spoilt(ONE_SIDED, top_wall=-0.5), "breaks through the outer surface"),
        (spoilt(ONE_SIDED, base_thickness=0.0), "breaks through the outer surface"),
        (spoilt(TWISTING, side_wall=-1.0), "breaks through the outer surface|pieces instead of 1"),
        (spoilt(TWISTING, wall=-0.2, gap=2.0), "breaks through the outer surface|pieces instead of 1"),
    ],
)
def test_a_cavity_that_breaks_through_is_refused(segment, message):
    with pytest.raises(InputError, match=message):
        built(segment)


def test_an_error_leaves_no_session_behind():
    before = built(ONE_SIDED)
    with pytest.raises(InputError):
        built(spoilt(ONE_SIDED, side_wall=0.0))
    assert built(ONE_SIDED) == before
