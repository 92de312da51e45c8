"""Tables of every kind of run read back as numpy structured arrays, whatever stands in them."""

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_csv
from pneunet.base.files.schemas import CELL, CENTRELINES, ENDING, SEGMENTS, STEPS, STRAINS, WALLS, read_table


@pytest.mark.parametrize("columns", [STEPS, CENTRELINES, SEGMENTS, CELL], ids=lambda columns: columns[2])
def test_tables_of_numbers_read_back(tmp_path, columns):
    values = np.random.default_rng(1).normal(size=(3, len(columns)))
    write_csv(tmp_path / "table.csv", columns, values)
    table = read_table(tmp_path / "table.csv", columns)
    assert table.dtype.names == columns and len(table) == 3
    for name, column in zip(columns, values.T):
        assert table[name] == pytest.approx(column, rel=1e-11)


def test_walls_keep_their_side_in_words(tmp_path):
    write_csv(tmp_path / "walls.csv", WALLS, [[1, "top", 1, 1.5, 0.7], [1, "bottom", 1, 1.5, np.inf]])
    walls = read_table(tmp_path / "walls.csv", WALLS[-2:])
    assert walls["side"].tolist() == ["top", "bottom"] and walls["distance_mm"].tolist() == [0.7, np.inf]
    assert walls[walls["side"] == "top"]["gap_mm"] == 1.5


def test_a_study_has_columns_of_its_own_and_cells_left_empty(tmp_path):
    """The name of a case may look like a number, a reason may be missing everywhere."""
    columns = ["case", "silicone", "angle_deg", "pressure_kPa", *STRAINS, *ENDING]
    rows = [
        ["12345e678901", "Ecoflex 00-30", 60, 10.0, *range(6), "done", "", 3.5, 200],
        ["", "DragonSkin 10", 90, "", *[""] * 6, "refused", "", "", ""],
    ]
    write_csv(tmp_path / "study.csv", columns, rows)
    with open(tmp_path / "study.csv", "a") as stream:
        stream.write("2cd907a6e41e,Ecoflex 00-30\n")
    table = read_table(tmp_path / "study.csv")
    assert table["case"].tolist() == ["12345e678901", "", "2cd907a6e41e"]
    assert table["silicone"][1] == "DragonSkin 10" and table["reason"].tolist() == [""] * 3
    assert table["pressure_kPa"] == pytest.approx([10.0, np.nan, np.nan], nan_ok=True)
    assert table[table["status"] == "done"]["k2_per_mm"] == 4.0


def test_what_is_missing_or_no_number_is_named(tmp_path):
    path = tmp_path / "steps.csv"
    path.write_text("step,pressure_kPa\n")
    assert len(read_table(path, ("step",))) == 0
    path.write_text("step,pressure_kPa\n0,0\n1,much\n")
    assert read_table(path)["pressure_kPa"][1] == "much"
    with pytest.raises(InputError, match="'pressure_kPa' holds words"):
        read_table(path, ("step", "pressure_kPa"))
    with pytest.raises(InputError, match="column 'volume_mm3' is missing"):
        read_table(path, ("volume_mm3",))
    with pytest.raises(InputError, match="no such file"):
        read_table(tmp_path / "none.csv")
