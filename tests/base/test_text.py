"""Encoding, dialect, header and units of strangers' files are found; what is no text or number is refused."""

import os
from pathlib import Path

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files import text as text_files
from pneunet.base.files.text import read_numbers_table, read_text

PEOPLE = Path(__file__).parents[1] / "data" / "people"
VALUES = [[0.0, 1.5, -2e-3], [10.25, 3.0, 4.0], [20.5, 5.0, 6.5]]


def written(values, delimiter, decimal):
    rows = (delimiter.join(f"{v:.3f}".replace(".", decimal) for v in row) for row in values)
    return "\n".join(rows) + "\n"


def values(table):
    return np.column_stack([table.numbers(i) for i in range(table.width)])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_encodings(tmp_path, encoding):
    path = tmp_path / "a.csv"
    path.write_bytes("Länge µm²;°C\r\n1;2\r\n".encode(encoding))
    assert read_text(path) == "Länge µm²;°C\r\n1;2\r\n"
    assert read_numbers_table(path).header == ("Länge µm²", "°C")


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("delimiter", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]
)
def test_dialects(tmp_path, delimiter, decimal, newline):
    path, numbers = tmp_path / "a.csv", written(VALUES, delimiter, decimal)
    above = "Operator: Smith, J; Lab, 7400 Annecy, France\nSpeed;450\n\n"
    names = delimiter.join(("Time", "Load", "Strain"))
    for text, first_row in ((numbers, 1), (f"{names}\n{numbers}", 2), (f"{above}{names}\n\n{numbers}", 6)):
        path.write_bytes(text.replace("\n", newline).encode())
        table = read_numbers_table(path)
        assert values(table) == pytest.approx(np.array(VALUES)) and table.first_row == first_row
        assert table.header == (("Time", "Load", "Strain") if first_row > 1 else ())


def test_quoted_decimal_commas_and_files_of_people(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text('"x, mm","y"\n"0,5","1,5"\n')
    assert values(read_numbers_table(path)).tolist() == [[0.5, 1.5]]
    assert values(read_numbers_table(PEOPLE / "byte_order_mark_bare.csv"))[1].tolist() == [30, 0, 5]
    assert values(read_numbers_table(PEOPLE / "semicolon.csv"))[1].tolist() == [35.106, 0, 11.342]


@pytest.mark.parametrize("head", ["", "x y\n", "# x y\n", "#x y\n", "made by a plotter\nx   y\n"])
def test_columns_between_blanks(tmp_path, head):
    path = tmp_path / "a.dat"
    path.write_text(head + "  0,5  1\n 1,5   2\n")
    table = read_numbers_table(path)
    assert values(table).tolist() == [[0.5, 1], [1.5, 2]] and table.header == (("x", "y") if head else ())


def test_the_header_is_the_row_that_numbers_follow_and_units_may_stand_below_it():
    table = read_numbers_table(PEOPLE / "units_in_second_row.csv")
    assert table.header[3:] == ("Tensile strain", "Tensile stress") and table.units[3:] == ("(%)", "(kPa)")
    assert table.index("Tensile stress") == 4 and table.first_row == 3
    table = read_numbers_table(PEOPLE / "results_table_above.csv")
    assert table.header[0] == "Time (s)" and table.units == ("",) * 5 and table.first_row == 5


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("a,b\n1,2\n3,4\n\na,b\n5,6\n", [2, 3, 6]),  # files one below the other
        ("a,b\n1,2\n3,4\na,b\n5,6\n", [2, 3, 5]),
        ("a,b\n1,2\npause\n3,4\n", [2, 4]),  # a remark is no header
        ("u,v,w\n7,8,9\n,,\na,b\n1,2\n3,4\n5,6\n", [5, 6, 7]),
        ("a,b\n1,2\n,\n3,4\n,\n", [2, 3, 4, 5]),  # lost markers
    ],
)
def test_rows_of_a_table_are_all_there_is_under_its_header(tmp_path, text, rows):
    path = tmp_path / "a.csv"
    path.write_text(text)
    table = read_numbers_table(path)
    assert (table.header, table.lines) == (("a", "b"), rows)
    lost = [not any(row) for row in table.rows]
    assert np.isnan(table.numbers(0, gaps=True)).tolist() == lost
    if any(lost):
        with pytest.raises(InputError, match="a.csv row 3: is empty under 'a': correct the cell or delete"):
            table.numbers(0)


@pytest.mark.parametrize(
    "cell",
    [
        "1_0",
        "١٢",
        "１",
        "nan",
        "inf",
        "-Infinity",
        "1" + "0" * 400,
        "1e999",
        "0x10",
        "1,234.5",
        "1 2",
        "True",
    ],
)
def test_what_only_python_takes_for_a_number_is_refused(tmp_path, cell):
    path = tmp_path / "a.csv"
    path.write_text(f'x,y\n1,2\n3,"{cell}"\n')
    with pytest.raises(InputError, match="a.csv row 3: '.{1,40}' is not a finite number under 'y': correct"):
        read_numbers_table(path).numbers(1)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "holds no rows of numbers"),
        (b"a,b\n", "holds no rows of numbers"),
        (b"a,b\n1,\x002\n", "row 2: holds NUL bytes, so it is no text"),
        (b"a,b\n\x1b[31m1,2\n", "row 2: holds the control character 0x1b"),
        ("a,b\n1,2\n".encode("utf-16-le"), "holds NUL bytes"),
        (b"a,b\n1,\x81\n", "is text in no encoding known here: save it as UTF-8"),
        (b"PK\x03\x04xlsx", "is a spreadsheet or an archive, not text: save the sheet as CSV"),
        (b'a,b\n1,"2\n3,4\n', "row 2: a quotation mark is missing"),
        (
            b'a,b\n1,"' + b"2\n" * 6000 + b'"\n',
            "row 2: a quotation mark is missing, or a cell has over 10000",
        ),
        (
            b'a,b\n1,"' + b"2" * 131_073 + b'"\n',
            "row 2: a quotation mark is missing, or a cell has over 10000",
        ),
        (
            b"a,b\n1,2\n0,5,0,25\n",
            "row 3: 4 cells in 2 columns: with decimal commas, save it with semicolons",
        ),
        (b"a;b\n0,5;1\n1.5;2\n", r"decimal commas \(row 2\) and decimal points \(row 3\): write one"),
    ],
)
def test_what_is_no_table_of_numbers_is_refused_in_one_line(tmp_path, data, message):
    path = tmp_path / "a.csv"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message) as error:
        read_numbers_table(path)
    said = str(error.value)
    assert said.startswith(str(path)) and said.isprintable() and len(said) < len(str(path)) + 200


def test_columns_are_asked_for_by_names_that_are_there_once(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x,x,y\n1,2,3\n")
    table = read_numbers_table(path)
    assert table.index("y") == 2
    for name, message in (("x", "column 'x' is there twice: rename one"), ("z", "column 'z' is missing")):
        with pytest.raises(InputError, match=message):
            table.index(name)


def test_what_is_no_regular_file_is_refused_at_once(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.setattr(text_files, "LARGEST_TEXT", 2_000_000)
    monkeypatch.setattr(text_files, "MOST_ROWS", 1000)
    (tmp_path / "large").write_text("1,2\n" * 500_001)
    (tmp_path / "long").write_text("1,2\n" * 1001)
    for path, message in (
        (tmp_path / "none.csv", "no such file"),
        (tmp_path, "is a folder"),
        (tmp_path / "pipe", "is a pipe or a device, not a regular file"),
        ("/dev/zero", "is a pipe or a device"),
        (tmp_path / "large", "is over 2 MB"),
        (tmp_path / "long", "has over 1000 rows: thin it out"),
        (tmp_path / ("n" * 300), "cannot be read"),
        (f"{tmp_path}/a\0b", "must not hold a NUL"),
    ):
        with pytest.raises(InputError, match=message):
            read_numbers_table(path)
