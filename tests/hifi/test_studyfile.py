"""STUDY.toml spread out into cases: what is varied, in which order, and where it ends up in the body."""

from types import SimpleNamespace

import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.toml import toml_text
from pneunet.base.materials.laws import silicone
from pneunet.geometry.designfile import design_from_tables
from pneunet.geometry.reference_cases import CASES
from pneunet.hifi.cell.file import CellCase, cell_from_tables, cell_tables
from pneunet.hifi.runs.study.file import read_study, value_of
from pneunet.hifi.runs.study.picture import draw

SEGMENT = {"kind": "one-sided", "angle_deg": 60.0}
CELL = {"pressure_kPa": 10.0, "material": {"mu_MPa": 0.3, "density_kg_per_m3": 1000.0}, "segment": SEGMENT}
TWO = {
    "pressure_kPa": 10.0,
    "material": {"mu_MPa": 0.3},
    "segment": [SEGMENT | {"chambers": 2}, SEGMENT | {"chambers": 3, "material": {"mu_MPa": 0.5}}],
}


def study(folder, **tables):
    (folder / "study.toml").write_text(toml_text(tables))
    return read_study(folder / "study.toml")


def cells(of):
    return [cell_from_tables(c.case.inputs, "") for c in of.cases]


def test_a_grid_is_the_full_product_in_the_order_written(tmp_path):
    found = study(
        tmp_path, kind="cell", base=CELL, levels=3, grid={"angle_deg": [60, 90], "pressure_kPa": [5, 10, 20]}
    )
    assert found.variables == ("angle_deg", "pressure_kPa")
    got = [(c.segment.angle, c.pressure, c.levels) for c in cells(found)]
    assert got == [(a, pytest.approx(p / 1e3), 3) for a in (60, 90) for p in (5, 10, 20)]


def test_a_list_goes_through_the_grid_case_by_case(tmp_path):
    found = study(
        tmp_path,
        kind="cell",
        base=CELL,
        case=[{"wall_mm": 1.2}, {"gap_mm": 1.5}],
        grid={"angle_deg": [60, 75]},
    )
    assert [(c.segment.wall, c.segment.gap, c.segment.angle) for c in cells(found)] == [
        (1.2, 1.0, 60.0),
        (1.2, 1.0, 75.0),
        (1.0, 1.5, 60.0),
        (1.0, 1.5, 75.0),
    ]
    # the table's columns show the body's value where another case varies it
    assert [value_of("wall_mm", c) for c in found.cases] == [1.2, 1.2, 1.0, 1.0]


def test_a_named_silicone_replaces_the_material_and_keys_change_values_in_it(tmp_path):
    listed = [
        {"silicone": "Dragon Skin 30"},
        {"mu_MPa": 0.2},
        {"density_kg_per_m3": 900.0, "silicone": "Dragon Skin 30"},
    ]
    listed += [{"material": {"law": "Yeoh", "c10_MPa": 0.1}}]
    named, softer, lighter, yeoh = (
        c.segment.material for c in cells(study(tmp_path, kind="cell", base=CELL, case=listed))
    )
    assert named == silicone("Dragon Skin 30")
    assert (softer.mu, softer.density) == (0.2, pytest.approx(1e-9))
    assert (lighter.mu, lighter.density) == (named.mu, pytest.approx(0.9e-9))
    assert (yeoh.law, yeoh.c10) == ("Yeoh", 0.1)


def test_segments_of_a_manipulator_are_varied_together_or_one_alone(tmp_path):
    listed = [{"angle_deg": 75.0}, {"segment.2.angle_deg": 80.0}, {"segment.2.material.mu_MPa": 0.7}]
    found = study(tmp_path, kind="manipulator", base=TWO, case=listed)
    bodies = [design_from_tables(c.case.inputs["design"], "").manipulator.segments for c in found.cases]
    assert [[s.angle for s in body] for body in bodies] == [[75, 75], [60, 80], [60, 60]]
    assert [[s.material.mu for s in body] for body in bodies] == [[0.3, 0.5], [0.3, 0.5], [0.3, 0.7]]
    assert [value_of("segment.2.angle_deg", c) for c in found.cases] == [75, 80, 60]


def test_the_body_may_stand_in_a_file(tmp_path):
    (tmp_path / "body.toml").write_text(toml_text(TWO))
    found = study(tmp_path, kind="manipulator", base="body.toml", grid={"wall_mm": [1, 1.2]})
    inline = study(tmp_path, kind="manipulator", base=TWO, grid={"wall_mm": [1, 1.2]})
    assert [c.case for c in found.cases] == [c.case for c in inline.cases]


def test_a_combination_that_is_no_body_keeps_its_reason(tmp_path):
    found = study(tmp_path, kind="cell", base=CELL, grid={"side_wall_mm": [1, 7]})
    good, bad = found.cases
    assert good.case and bad.case is None and "side_wall_mm = 7: two side walls do not fit" in bad.refusal


@pytest.mark.parametrize(
    "varied",
    [{"case": [{}]}, {"grid": {"pressure_kPa": [[20, 10], [10, 20]]}}],
    ids=["nothing", "a list"],
)
def test_a_study_of_one_body_as_it_is_and_one_of_lists_are_drawn(tmp_path, varied):
    base = TWO | {"segment": [s | {"pressure_group": i} for i, s in enumerate(TWO["segment"], start=1)]}
    found = study(tmp_path, kind="manipulator", base=base, **varied)
    strains = {"k_norm_per_mm": "0.01", "k1_rad_per_mm": "0", "k2_per_mm": "0.01"}
    levels = [{"pressure_kPa": p} | strains for p in "12"]
    table = SimpleNamespace(of=lambda case: ({"status": "done"}, levels))
    assert draw(found, table, tmp_path / "study.png") and (tmp_path / "study.png").stat().st_size > 10_000


def test_segments_are_tables(tmp_path):
    with pytest.raises(InputError, match="segments are written .base.segment., or"):
        study(tmp_path, kind="segment", base=CELL | {"segment": 3}, grid={"angle_deg": [60]})


def test_a_case_is_known_by_its_complete_inputs(tmp_path):
    """The same body under another spelling is the same case; another mesh is another one."""
    spelt = study(
        tmp_path,
        kind="cell",
        base=CELL | {"mesh_size_mm": 1.5},
        case=[{"segment.angle_deg": 75, "wall_mm": 1}],
    )
    grid = study(tmp_path, kind="cell", base=CELL, grid={"angle_deg": [75.0], "mesh_size_mm": [1.5, 2]})
    assert spelt.cases[0].case.name == grid.cases[0].case.name != grid.cases[1].case.name


def test_the_tables_of_a_cell_read_back():
    segment = CASES["one_sided_w10"](
        angle=60.0, chambers=1, layer_thickness=0.5, layer_material=silicone("Mold Star 20T")
    )
    for case in (
        CellCase(segment, 0.0123, 2.5, 3, {4: 0.002}, element="tetrahedra"),
        CellCase(CASES["twist_w12"](angle=45.0, chambers=1), 0.05, control="volume", volume_factor=3.0),
    ):
        assert cell_from_tables(cell_tables(case), "") == case
