"""design.toml: complete and re-runnable, and strict about what it does not know."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.materials.laws import Gent, NeoHookean
from pneunet.geometry import Manipulator, Segment
from pneunet.geometry.designfile import DesignFile, read_design_file, write_design_file
from pneunet.geometry.loading import Control, DeadLoads, Extras

MATERIAL = NeoHookean(mu=0.25, name='soft "A"', source="a \\ b")
DESIGN = DesignFile(
    Manipulator(
        (
            Segment("twisting", 61.23456789, 3, cavity_floor=0.5, gap=2.0, material=MATERIAL),
            Segment("one-sided", 90.0, 4, end_margin=1.5, material=MATERIAL),
            Segment(
                "one-sided",
                120.0,
                1,
                material=Gent(mu=0.5, jm=30.0, bulk_modulus=900.0, elongation_at_break=4.0),
            ),
            Segment(
                "one-sided",
                60.0,
                1,
                layer_thickness=0.3,
                material=MATERIAL,
                layer_material=NeoHookean(mu=50.0, name="paper"),
            ),
        )
    ),
    0.0364,
    name="three pieces",
    base_pose=se3.make_pose(se3.exp_rotation([0.3, -0.2, 1.0]), [1.0, 2.0, 3.0]),
    mesh_size=2.5,
    element="tetrahedra",
    target="a b.csv",
    loads=DeadLoads(gravity=(0.0, 0.0, -9810.0), tip_moment=(0.0, 1.5, 0.0)),
    control=Control("volume", volume_factor=4.0),
    measure=Extras(tip_stiffness=True),
    result={"errors": {"rms_mm": 0.5}, "piece": [{"kind": "twisting"}, {"kind": "bending"}]},
)
MINIMAL = """pressure_kPa = 20
[material]
mu_MPa = 0.3
[[segment]]
kind = "one-sided"
angle_deg = 60
chambers = 3
"""


def test_a_design_reads_back_as_it_was(tmp_path):
    path = tmp_path / "a folder" / "design.toml"
    write_design_file(path, DESIGN)
    back = read_design_file(path)
    assert back.manipulator == DESIGN.manipulator
    assert back.base_pose == pytest.approx(DESIGN.base_pose, abs=1e-15)
    for name in (
        "pressure",
        "name",
        "mesh_size",
        "element",
        "target",
        "result",
        "loads",
        "control",
        "measure",
    ):
        assert getattr(back, name) == getattr(DESIGN, name), name
    first = path.read_text()
    write_design_file(path, back)
    assert path.read_text() == first


def test_rolls_passive_segments_and_pressures_of_groups_read_back(tmp_path):
    path, bend = tmp_path / "design.toml", Segment("one-sided", 90.0, 4, material=MATERIAL)
    other = replace(bend, roll=180, group=2)
    design = DesignFile(Manipulator((bend.plain(12.5), bend, other)), (0.02, 0.0))
    write_design_file(path, design)
    text = path.read_text()
    assert "pressure_kPa = [20.0, 0.0]" in text and text.count("roll_deg = 180\npressure_group = 2") == 1
    passive = text[text.index("[[segment]]") : text.index("[[segment]]", text.index("[[segment]]") + 1)]
    assert "plain_length_mm = 12.5" in passive and "chamber" not in passive and "angle" not in passive
    back = read_design_file(path)
    assert back.manipulator == design.manipulator and back.pressure == (0.02, 0.0)
    assert back.largest_pressure == 0.02 and back.scaled(0.01) == (0.01, 0.0)
    path.write_text(text.replace("[20.0, 0.0]", "15"))
    assert read_design_file(path).pressure == 0.015 and read_design_file(path).scaled(0.01) == 0.01
    for old, new, message in (
        ("[20.0, 0.0]", "[20, 0, 5]", "one for all, or one for each of the 2 groups, not 3"),
        ("[20.0, 0.0]", "[20, -1]", r"pressure_kPa = -1 must lie in 0\.\.2000 kPa"),
        ("[20.0, 0.0]", '[20, "a"]', "'pressure_kPa' must be a finite number, not 'a'"),
        ("[20.0, 0.0]", "[0, 0]", "pressure_kPa = 0 leaves nothing to solve"),
        (
            "plain_length_mm = 12.5",
            "plain_length_mm = 9\nwall_mm = 1",
            "1: wall_mm: a passive segment has no",
        ),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(InputError, match=message) as error:
            read_design_file(path)
        assert "\n" not in str(error.value)


def test_loads_turn_with_the_base():
    """Weight down the target's z, on a body whose axis hangs down, pulls along the axis."""
    hanging = se3.make_pose(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.zeros(3))
    loads = DeadLoads(gravity=(0.0, 0.0, -9810.0)).in_body(hanging)
    assert loads.gravity == pytest.approx((9810.0, 0.0, 0.0)) and loads.tip_force == (0.0, 0.0, 0.0)


def test_a_short_file_has_the_defaults(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(MINIMAL)
    design = read_design_file(path)
    assert design.manipulator.segments == (Segment("one-sided", 60.0, 3, material=NeoHookean(mu=0.3)),)
    assert (design.pressure, design.mesh_size) == (0.02, 1.5)
    assert (design.base_pose == np.eye(4)).all()


def test_a_layer_takes_its_own_material_or_the_common_one(tmp_path):
    path = tmp_path / "layers.toml"
    layer = "\nlayer_thickness_mm = 0.5\n"
    own = "[segment.layer_material]\nmu_MPa = 70\n"
    segment = MINIMAL[MINIMAL.index("[[segment]]") :].rstrip()
    path.write_text(
        f"{MINIMAL.rstrip()}{layer}{segment}{layer}{own}{segment}\n[layer_material]\nmu_MPa = 50\n"
    )
    segments = read_design_file(path).manipulator.segments
    assert [s.layer_material and s.layer_material.mu for s in segments] == [50.0, 70.0, None]
    assert [s.layer_thickness for s in segments] == [0.5, 0.5, 0.0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "pressure_kPa = 20",
            "pressure_MPa = 0.02",
            "key 'pressure_MPa' has the wrong unit: write 'pressure_kPa'",
        ),
        ("pressure_kPa = 20", "", "key 'pressure_kPa' is missing"),
        ("pressure_kPa = 20", "pressure_kPa = 0", "pressure_kPa = 0 leaves nothing to solve"),
        ("pressure_kPa = 20", "pressure_kPa = 20\nmesh_size_mm = 0.01", "mesh_size_mm = 0.01 must lie in"),
        (
            "pressure_kPa = 20",
            'schema = "other"\npressure_kPa = 20',
            "schema = 'other' is not 'pneunet-design-1'",
        ),
        ("pressure_kPa = 20", "pressure_kPa = 20\nresult = 5", r"\[result\]: must be a table"),
        ("[material]\nmu_MPa = 0.3", "", "key 'material' is missing"),
        ("mu_MPa", "mu_kPa", r"\[material\]: key 'mu_kPa' has the wrong unit: write 'mu_MPa'"),
        (
            MINIMAL,
            "pressure_kPa = 20\nsegment = [1]\nmaterial.mu_MPa = 0.3",
            r"\[\[segment\]\] 1: must be a table",
        ),
        (
            "mu_MPa = 0.3",
            "mu_MPa = 0.3\nlaw = [1]",
            r"\[material\]: unknown law '\[1\]': known laws are neo-Hookean",
        ),
        ("[[segment]]", "[segment]", r"\[\[segment\]\], with double brackets"),
        ("chambers = 3", "chambers = 2.5", r"\[\[segment\]\] 1: 'chambers' must be a whole number"),
        ("chambers = 3", "chambers = 0", r"\[\[segment\]\] 1: chambers = 0"),
        ("angle_deg", "angel_deg", r"\[\[segment\]\] 1: unknown key 'angel_deg': did you mean 'angle_deg'"),
        ("angle_deg = 60", "angle_rad = 1", r"\[\[segment\]\] 1: key 'angle_rad' has the wrong unit"),
        (
            "chambers = 3",
            "chambers = 3\nlayer_thickness_mm = 0.5",
            r"\[\[segment\]\] 1: layer_thickness_mm = 0.5 needs a material",
        ),
        (
            "mu_MPa = 0.3",
            'silicone = "Ecoflex"',
            r"\[material\]: silicone = 'Ecoflex' is not in the table: known are BodyDouble SILK",
        ),
        ("chambers = 3", 'chambers = 3\nmaterial = "soft"', r"\[\[segment\]\] 1 material: must be a table"),
        (
            "chambers = 3",
            "chambers = 3\n[base]\norigin_mm = [1, 2]",
            r"\[base\]: 'origin_mm' must be (a finite number|numbers of shape)",
        ),
        (
            "chambers = 3",
            "chambers = 3\n[base]\norigin_mm = [1, 2, nan]",
            r"\[base\]: 'origin_mm' must be (a finite number|numbers of shape)",
        ),
        (
            "chambers = 3",
            "chambers = 3\n[base]\nrotation = [[1,0,0],[0,1,0],[0,0,-1]]",
            r"\[base\]: 'rotation' is not a rotation matrix",
        ),
        (
            "chambers = 3",
            "chambers = 3\n[base]\norigin = [1, 2, 3]",
            r"\[base\]: key 'origin' has the wrong unit",
        ),
        ("chambers = 3", "chambers = 3\n[[base]]\n", r"\[base\]"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, message):
    path = tmp_path / "bad.toml"
    assert old in MINIMAL
    path.write_text(MINIMAL.replace(old, new))
    with pytest.raises(InputError, match=message) as error:
        read_design_file(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_fillets_read_back_and_need_tetrahedra(tmp_path):
    body = Manipulator((Segment("one-sided", 60.0, 2, fillet=0.4), Segment("twisting", 60.0, 2)))
    write_design_file(tmp_path / "d.toml", DesignFile(body, 0.05, element="tetrahedra"))
    assert read_design_file(tmp_path / "d.toml").manipulator == body
    assert (tmp_path / "d.toml").read_text().count("fillet_mm = 0.4") == 1
    with pytest.raises(InputError, match='fillet_mm = 0.4: a grid of hexahedra .* element = "tetrahedra"'):
        DesignFile(body, 0.05, element="hexahedra")
