"""Files are whole or not there."""

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import (
    atomic_path,
    output_directory,
    read_columns,
    read_csv,
    require_writable,
    write_csv,
    write_text,
)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_nothing_is_left_of_a_file_that_was_interrupted(tmp_path, error):
    with pytest.raises(error):
        with atomic_path(tmp_path / "new.txt") as temporary:
            temporary.write_text("half")
            raise error
    assert list(tmp_path.iterdir()) == []


def test_readers_see_the_old_file_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "deep" / "file.txt"
    write_text(path, "old")
    with atomic_path(path) as temporary:
        assert temporary.suffix == ".txt"  # writers choose their format by it
        temporary.write_text("half")
        assert path.read_text() == "old"
        temporary.write_text("new")
    assert path.read_text() == "new"
    assert [p.name for p in path.parent.iterdir()] == ["file.txt"]
    assert path.stat().st_mode & 0o777 == 0o644


def test_csv_reads_back_to_twelve_digits(tmp_path):
    path = tmp_path / "a b.csv"
    write_csv(path, ["step", "x_mm", "name"], [[1, np.float64(1 / 3), "one, two"], [2, 1e-20, "three"]])
    header, rows = read_csv(path)
    assert header == ["step", "x_mm", "name"] and rows[0] == ["1", "0.333333333333", "one, two"]
    assert read_columns(path, ["x_mm", "step"]) == pytest.approx(
        np.array([[1 / 3, 1], [1e-20, 2]]), rel=1e-12
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"", "is empty"),
        (b"\n , \n", "is empty"),
        (b"\xff\0", "NUL bytes"),
        (b'x_mm,y_mm\n1,"2\n', "quotation mark"),
        (b"x_mm\n1\n", "column 'y_mm' is missing"),
        (b"x_mm,y_mm\n1,two\n", "row 2: 'y_mm' is not a number"),
        (b"x_mm,y_mm\n1,2\n1\n", "row 3: 'y_mm' is not a number"),
    ],
)
def test_csv_that_cannot_be_used_is_named(tmp_path, content, message):
    path = tmp_path / "file.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message) as error:
        read_columns(path, ["x_mm", "y_mm"])
    assert str(error.value).startswith(str(path))


def test_a_folder_that_cannot_be_made_is_bad_input(tmp_path):
    assert output_directory(tmp_path / "a b" / "c").is_dir()
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written to .*-o"):
        output_directory(tmp_path / "file" / "folder")


def test_a_folder_that_cannot_be_made_is_refused_before_long_work(tmp_path):
    (tmp_path / "file").write_text("")
    require_writable(tmp_path / "not" / "yet")
    assert not (tmp_path / "not").exists()
    with pytest.raises(InputError, match="choose another folder"):
        require_writable(tmp_path / "file" / "below")
