"""Segment and Manipulator: what is refused, and lengths in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Manipulator, Segment
from pneunet.geometry.reference_cases import CASES
from pneunet.geometry.sections import channel_section, core_section, whole_section

ONE_SIDED, TWISTING = Segment("one-sided", 60.0, 3), Segment("twisting", 60.0, 3)
PAPER = NeoHookean(mu=50.0, name="paper")
BARE = {"kind": "passive", "angle": 90.0, "chambers": 0, "plain_length": 20.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "bending"}, "kind = 'bending' .*'one-sided', 'twisting' or 'passive'"),
        ({"angle": 29.9}, r"angle_deg = 29.9 must lie in 30\.\.150"),
        ({"angle": 151.0}, "angle_deg = 151 "),
        ({"angle": float("nan")}, "angle_deg = nan "),
        ({"chambers": 0}, "chambers = 0 must be at least 1"),
        ({"chambers": 1000}, "chambers = 1000: .*at most 2000"),
        ({"gap": -1.0}, "gap_mm = -1 must be larger than 0"),
        ({"wall": 0.0}, "wall_mm = 0 must be larger than 0"),
        ({"wall": float("nan")}, "wall_mm = nan "),
        ({"width": 0.012}, "width_mm = 0.012 .*in metres"),
        ({"side_wall": 6.0}, "side_wall_mm = 6: .* width_mm = 12"),
        ({"channel_width": 10.5}, "channel_width_mm = 10.5 is wider than the cavity"),
        ({"cavity_floor": 1.2}, r"cavity_floor_mm = 1.2 must lie in -1\.\.1 "),
        ({"cavity_floor": -1.2}, r"cavity_floor_mm = -1.2 must lie in -1\.\.1 "),
        ({"kind": "twisting", "cavity_floor": -0.2}, r"cavity_floor_mm = -0.2 must lie in 0\.\.1 "),
        (
            {"chamber_height": 0.5, "top_wall": 0.5},
            "chamber_height_mm = 0.5: .* does not rise above the core",
        ),
        ({"layer_thickness": 0.5}, r"layer_thickness_mm = 0.5 needs a material: write \[layer_material\]"),
        (
            {"layer_thickness": 2.0, "layer_material": PAPER},
            r"layer_thickness_mm = 2 must lie in 0\.05\.\.1\.95: .* base_thickness_mm = 2",
        ),
        ({"layer_thickness": -0.5, "layer_material": PAPER}, "layer_thickness_mm = -0.5 must lie in"),
        ({"layer_material": PAPER}, "layer_thickness_mm is missing or 0"),
        (
            {"kind": "twisting", "layer_thickness": 0.5, "layer_material": PAPER},
            "layer_thickness_mm = 0.5: only a one-sided segment",
        ),
        ({"angle": 90.0, "gap": 4.0}, r"end_margin_mm = 2 .* at least 2\.5 mm is needed with gap_mm = 4"),
        (
            {"fillet": 0.6, "gap": 1.1},
            "fillet_mm = 0.6 cannot be built: at most 0.53 fits, limited by gap_mm",
        ),
        ({"fillet": -0.1}, "fillet_mm = -0.1 must be at least 0"),
        ({**BARE, "fillet": 0.2}, "fillet_mm: a passive segment has no chambers"),
        ({"roll": 45}, "roll_deg = 45 is not known: write 0, 90, 180 or 270"),
        ({"group": 0}, r"pressure_group = 0 must lie in 1\.\.9"),
        ({"plain_length": 9.0}, "plain_length_mm = 9: only a passive segment"),
        ({"kind": "passive"}, "angle_deg, chambers: a passive segment has no chambers: leave this out"),
        ({**BARE, "wall": 1.5}, "^wall_mm: a passive segment has no chambers: leave this out"),
        ({**BARE, "plain_length": 0.0}, "plain_length_mm = 0: give the length of the passive segment"),
        ({**BARE, "channel_width": 12.0}, "channel_width_mm = 12 is not less than width_mm = 12"),
        ({**BARE, "end_margin": 0.4}, "end_margin_mm = 0.4 must be at least 0.5"),
    ],
)
def test_segments_that_cannot_be_built_are_refused(change, message):
    with pytest.raises(InputError, match=message) as error:
        replace(ONE_SIDED, **change)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "name",
    "chamber_height cavity_thickness wall gap top_wall side_wall base_thickness roof channel_width"
    " channel_height end_margin width".split(),
)
def test_every_dimension_must_be_positive(name):
    with pytest.raises(InputError, match=f"^{name}_mm = -0.5 must be larger than 0$"):
        replace(ONE_SIDED, **{name: -0.5})


def test_the_fix_that_an_error_names_is_accepted():
    with pytest.raises(InputError, match="end_margin_mm = 1 .* at least 1.03 mm"):
        replace(ONE_SIDED, angle=90.0, gap=1.05, end_margin=1.0)
    assert replace(ONE_SIDED, angle=90.0, gap=1.05, end_margin=1.03).end_wall >= 0.5


@pytest.mark.parametrize("angle", [45.0, 60.0, 90.0, 120.0])
@pytest.mark.parametrize("chambers", [1, 4])
def test_lengths_in_closed_form(angle, chambers):
    """What is t across the chambers is t/sin(angle) along the axis; slanted ends need W/2 |cot(angle)|
    more."""
    s = Segment(
        "one-sided", angle, chambers, cavity_thickness=2.5, wall=0.8, gap=1.2, width=11.0, end_margin=1.9
    )
    sin, cot = np.sin(np.radians(angle)), 1 / np.tan(np.radians(angle))
    assert s.pitch == pytest.approx(5.3 / sin)
    assert s.active_length == pytest.approx(((chambers - 1) * 5.3 + 4.1) / sin)
    assert s.length == pytest.approx(s.active_length + 2 * (5.5 * abs(cot) + 1.9))
    positions = s.chamber_positions
    assert len(positions) == chambers and np.diff(positions) == pytest.approx(5.3 / sin)
    assert positions.mean() == pytest.approx(s.length / 2)
    # the outermost corner of a chamber is end_margin away from the end, the channel's end by the end wall
    assert positions[0] - 4.1 / sin / 2 - 5.5 * abs(cot) == pytest.approx(1.9)
    assert positions[0] - s.pitch / 2 == pytest.approx(s.end_wall)


def test_heights_follow_the_kind():
    for s, bottom, lowest in ((ONE_SIDED, -3.0, -3.0), (TWISTING, -2.0, -6.0)):
        assert (s.core_top, s.cavity_top, s.chamber_top) == (2.0, 5.0, 6.0)
        assert (s.core_bottom, s.chamber_bottom) == (bottom, lowest)
    assert ONE_SIDED.sides == (1,) and TWISTING.sides == (1, -1)


def test_chambers_across_the_beam_are_exactly_straight():
    assert Segment("one-sided", 90.0, 2).cot == 0.0


def test_mirror_image():
    mirrored = ONE_SIDED.mirrored
    assert mirrored.angle == 120.0 and mirrored.mirrored == ONE_SIDED
    assert mirrored.cot == pytest.approx(-ONE_SIDED.cot) and mirrored.length == pytest.approx(
        ONE_SIDED.length
    )
    assert Manipulator((ONE_SIDED, TWISTING)).mirrored.segments == (mirrored, TWISTING.mirrored)


@pytest.mark.parametrize("segment", [ONE_SIDED, replace(ONE_SIDED, angle=90.0, gap=4.0, end_margin=3.0)])
def test_cells_are_the_same_whatever_the_ends_and_the_number(segment):
    assert segment.key == replace(segment, chambers=9, end_margin=20.0).key
    assert segment.key != replace(segment, wall=1.1).key
    assert segment.key != replace(segment, material=NeoHookean(mu=0.2)).key
    assert segment.key != replace(segment, layer_thickness=0.5, layer_material=PAPER).key


def test_manipulator_adds_up():
    m = Manipulator([ONE_SIDED, TWISTING, replace(ONE_SIDED, angle=100.0, chambers=5)])
    lengths = [s.length for s in m.segments]
    assert m.length == pytest.approx(sum(lengths)) and m.chambers == 11
    assert m.starts == pytest.approx([0.0, lengths[0], lengths[0] + lengths[1]])


def test_joints_that_do_not_fit_are_refused():
    tall = replace(ONE_SIDED, channel_height=6.0, chamber_height=8.0)
    with pytest.raises(InputError, match="segment 2 and 3: the channel of one does not fit into the core"):
        Manipulator((ONE_SIDED, ONE_SIDED, tall))
    with pytest.raises(InputError, match="segment 1 and 2: the channel"):
        Manipulator((replace(ONE_SIDED, width=20.0, channel_width=12.0), ONE_SIDED))
    # enough core in common, but higher than the first one's channel: that one's end would stand open
    low = replace(ONE_SIDED, base_thickness=5.0, roof=0.3, channel_height=1.0, cavity_floor=0.5)
    with pytest.raises(InputError, match="segment 1 and 2: the channel"):
        Manipulator((ONE_SIDED, low))


def test_a_passive_segment_has_the_core_of_what_it_goes_with():
    plain = ONE_SIDED.plain(20.0)
    assert (plain.length, plain.active_length, plain.end_length) == (20.0, 0.0, 10.0)
    assert len(plain.chamber_positions) == len(plain.sides) == 0 and plain.chamber_top == plain.core_top
    for s in (ONE_SIDED, TWISTING, replace(ONE_SIDED, roll=90, layer_thickness=0.5, layer_material=PAPER)):
        plain = s.plain(20.0)
        assert (core_section(plain) == core_section(s)).all() and plain.plain(20.0) == plain
        assert (channel_section(plain) == channel_section(s)).all() and plain.layer_top == s.layer_top
        assert plain.key == replace(plain, plain_length=50.0, roll=0).key


def test_a_roll_turns_the_section_right_handedly_and_leaves_the_cell():
    """Chambers up to z = 6: below at 180, at -y at 90, at +y at 270; in the mirror y = 0 the last two change
    places."""
    sections = {
        0: [[-6, 6], [-3, 6]],
        90: [[-6, 3], [-6, 6]],
        180: [[-6, 6], [-6, 3]],
        270: [[-3, 6], [-6, 6]],
    }
    for roll, section in sections.items():
        s = replace(ONE_SIDED, roll=roll)
        assert whole_section(s).tolist() == section and s.key == ONE_SIDED.key
        assert whole_section(s.mirrored).tolist() == [[-section[0][1], -section[0][0]], section[1]]


def test_a_body_has_no_more_segments_than_tags_tell_apart():
    assert len(Manipulator((ONE_SIDED,) * 100).segments) == 100
    for count in (0, 101):
        with pytest.raises(InputError, match=rf"segment: {count} \[\[segment\]\]: 1 to 100"):
            Manipulator((ONE_SIDED,) * count)


def test_rolled_joints_fit_where_either_channel_stays_covered():
    assert Manipulator((ONE_SIDED, replace(ONE_SIDED, roll=180)))
    across = {"width": 10.0, "channel_width": 2.0}
    assert Manipulator((replace(ONE_SIDED, **across), replace(ONE_SIDED, **across, roll=270)))
    with pytest.raises(InputError, match="the channel .* when they are rolled by 0 and 90 deg"):
        Manipulator((ONE_SIDED, replace(ONE_SIDED, roll=90)))
    thin = replace(ONE_SIDED, roof=0.4, chamber_height=5.0)
    with pytest.raises(InputError, match="segment 1 and 2: the channel .* 0 and 180 deg"):
        Manipulator((replace(ONE_SIDED, channel_height=3.0), replace(thin, roll=180)))


def test_groups_are_neighbours_with_chambers_and_a_cavity_each():
    one, two = ONE_SIDED, replace(ONE_SIDED, group=2)
    body = Manipulator((one.plain(10.0), one, two, two.plain(20.0)))
    assert body.groups == ((0, 1), (2, 3))
    middle, wall = 10.0 + one.length, one.end_wall
    ends = [[2.0, middle - wall], [middle + wall, body.length - 2.0]]
    np.testing.assert_allclose(body.channels, ends, rtol=1e-14)
    assert body.ports == pytest.approx([p + one.chamber_positions[0] for p in (10.0, middle)])
    assert body.pressures((3.0, 4.0)).tolist() == [3.0, 3.0, 4.0, 4.0] and (body.pressures(2.0) == 2.0).all()
    with pytest.raises(InputError, match="give one for all, or one for each of the 2 groups, not 3"):
        body.pressures((1.0, 2.0, 3.0))
    with pytest.raises(InputError, match="pressure_kPa: give one, not 2"):
        Manipulator((one,)).pressures((1.0, 2.0))
    with pytest.raises(InputError, match="segment 1: pressure_group = 2: .* in order from 1: write 1$"):
        Manipulator((two,))
    with pytest.raises(InputError, match="segment 3: pressure_group = 1: .*: write 2 or 3"):
        Manipulator((one, two, one))
    with pytest.raises(InputError, match="pressure_group = 2: none of its segments has chambers"):
        Manipulator((one, two.plain(20.0)))


def test_reference_cases_have_the_heights_and_pitches_of_their_table():
    """Core, chamber, cavity heights and normal pitch as the table of reference cases gives them."""
    table = {
        "one_sided_w10": (-3, 2, 6, 1, 5, 5),
        "twist_w10": (-2, 2, 6, 1, 5, 5),
        "twist_w12": (-2, 2, 7, 0.5, 6, 6),
        "twist_w15": (-2, 2, 9, 0.5, 8, 5),
        "one_sided_long": (-3, 2, 4, -1, 3, 5),
    }
    for name, expected in table.items():
        s = CASES[name](angle=60.0, chambers=5)
        heights = (s.core_bottom, s.core_top, s.chamber_top, s.cavity_floor, s.cavity_top)
        assert (*heights, s.pitch * s.sin) == pytest.approx(expected), name
