"""Files are whole or not there."""

import os
import re

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import (
    atomic_path,
    read_columns,
    read_csv,
    temporary_beside,
    write_csv,
    write_text,
)
from pneunet.base.files.dataset import read_dataset
from pneunet.base.files.folder import output_folder
from pneunet.base.files.reading import read_json
from pneunet.base.files.toml import read_toml


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


@pytest.mark.parametrize(("umask", "rights"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_files_have_the_rights_that_the_user_gives(tmp_path, umask, rights):
    before = os.umask(umask)
    try:
        write_text(tmp_path / "file", "")
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == rights


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


def test_a_folder_that_cannot_be_made_is_bad_input_and_an_empty_one_goes_again(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written to .*-o"):
        with output_folder(tmp_path / "file" / "folder"):
            pass
    with output_folder(tmp_path / "a b" / "c") as folder:
        assert folder.is_dir()
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_one_run_works_in_a_folder_at_a_time(tmp_path, monkeypatch):
    monkeypatch.setattr("pneunet.base.files.folder.PATIENCE_SECONDS", 0.0)
    with output_folder(tmp_path / "out") as folder:
        with pytest.raises(InputError, match=f"{folder}: another run is at work"):
            with output_folder(folder):
                pass
        (folder / "result").touch()
    with output_folder(folder):
        pass
    assert [p.name for p in folder.iterdir()] == ["result"]


def test_a_lock_that_is_a_link_is_not_followed(tmp_path):
    (tmp_path / "mine").write_text("precious")
    (tmp_path / ".lock").symlink_to("mine")
    with pytest.raises(InputError, match="cannot be written to"):
        with output_folder(tmp_path):
            pass
    assert (tmp_path / "mine").read_text() == "precious"


def test_what_killed_runs_left_goes_and_nothing_of_anybody_else(tmp_path):
    ours = [temporary_beside(tmp_path / name) for name in ("design.png", "a-case")]
    ours[0].touch()
    ours[1].mkdir()
    theirs = [tmp_path / name for name in (".design-abcd1234.png", ".pneunet-notes-a.md", ".pneunet-1234")]
    for path in [*theirs, ours[1] / "log.txt"]:
        path.touch()
    with output_folder(tmp_path):
        assert sorted(tmp_path.iterdir()) == sorted([*theirs, tmp_path / ".lock"])
    assert sorted(tmp_path.iterdir()) == sorted(theirs)


OUTLANDISH = {
    "5000 digits": ("a = " + "1" * 5000, "not valid TOML"),
    "400 zeros": ("a = 1" + "0" * 400, "'a' is larger than any number can be here"),
    "hexadecimal": ("a = 0x" + "f" * 5000, "'a' is larger than any number can be here"),
    "1e300 in a list": ("[b]\na = [[1, 1e300]]", "'a' is larger than any number can be here"),
    "nesting": ("a = " + "[" * 2000 + "]" * 2000, "brackets within brackets without end"),
    "less nesting": ("a = " + "[" * 30 + "]" * 30, "'a' is nested more than 20 deep"),
    "NUL": ('a = "b\\u0000c"', "'a' holds control characters"),
    "escape in a key": ('"\\u001b[2J" = 1', "holds control characters"),
    "a long text": ('a = "' + "x" * 20_000 + '"', "a text of over 10000 characters"),
    "another encoding": ("a = 1".encode("utf-16"), "not text in UTF-8"),
    "Arabic digits": ("a = \u0665", "not valid TOML"),
}


@pytest.mark.parametrize(("content", "message"), OUTLANDISH.values(), ids=OUTLANDISH)
def test_what_toml_can_say_and_no_quantity_is(tmp_path, content, message):
    path = tmp_path / "file.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=re.escape(message)) as error:
        read_toml(path)
    assert str(error.value).startswith(f"{path}: ") and len(str(error.value)) < 300


@pytest.mark.parametrize("read", [read_toml, read_json, read_csv, read_dataset])
def test_pipes_devices_and_huge_files_are_refused_at_once(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    with open(tmp_path / "huge", "wb") as stream:
        stream.truncate(5 << 30)
    for path, message in (
        (tmp_path / "pipe", "is a pipe or a device, not a regular file"),
        ("/dev/zero", "is a pipe or a device"),
        (tmp_path / "huge", "is over"),
        (tmp_path, "is a folder"),
        (tmp_path / ("n" * 300), "cannot be read"),
        (f"{tmp_path}/a\0b", "must not hold a NUL"),
    ):
        with pytest.raises(InputError, match=message):
            read(path)


@pytest.mark.parametrize("content", ["[1]", "5", "{", "[" * 100_000, '{"a": ' + "1" * 5000 + "}", ""])
def test_json_that_is_no_table_is_named(tmp_path, content):
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(InputError, match="run.json: (not valid JSON|must hold a JSON object)"):
        read_json(tmp_path / "run.json")
