"""Generated bad inputs at every door of the command line, and disks that are full."""

import resource

import pytest

from benchmarks.bad_inputs import bad_inputs, good_files
from benchmarks.door import answers
from pneunet.base.files import record
from pneunet.cli import main


def test_generated_bad_inputs_are_one_line_each():
    """200 that the bench does not try; `make bench ONLY=door` tries 1500."""
    found = answers(bad_inputs(200, seed=7))
    assert len(found) == 200
    assert [(bad.arguments, bad.what, got.fault) for bad, got in found if got.fault] == []


def test_the_good_files_are_good(tmp_path, monkeypatch):
    """So that it is the change that is bad."""
    pytest.importorskip("mpi4py")
    from pneunet.base.materials.tensile import read_tensile
    from pneunet.design.target.file import read_target
    from pneunet.geometry.designfile import read_design_file
    from pneunet.hifi.cell.file import read_cell
    from pneunet.hifi.runs.campaign.file import read_campaign
    from pneunet.hifi.runs.study.file import read_study

    (tmp_path / "folder").mkdir()
    for name, content in good_files().items():
        (tmp_path / name).write_bytes(content)
    monkeypatch.chdir(tmp_path)
    for read, name in (
        (read_design_file, "design.toml"),
        (read_target, "target.toml"),
        (read_target, "curve.csv"),
        (read_cell, "cell.toml"),
        (read_study, "study.toml"),
        (read_campaign, "campaign.toml"),
        (read_tensile, "tensile.csv"),
    ):
        assert read(name)


#: command -> bytes that a file may have: below the smallest and below the largest file that it writes
FULL = {
    "design": (("design", "curve.csv", "-o", "out"), (100, 5000)),
    "shape": (("shape", "design.toml", "--pressure-kPa", "5", "-o", "out"), (100, 9000)),
    "mesh": (("mesh", "design.toml", "--mesh-size-mm", "6", "-o", "out"), (2000, 100_000)),
    "report": (("report", "folder"), (2000, 40_000)),
    "fit-material": (("fit-material", "tensile.csv", "-o", "out"), (100, 10_000)),
}


@pytest.mark.parametrize(("arguments", "limits"), FULL.values(), ids=FULL)
def test_a_full_disk_is_one_line_and_leaves_whole_files(tmp_path, monkeypatch, capsys, arguments, limits):
    """Files may grow to so many bytes."""
    pytest.importorskip("pyvista")
    # git, asked for the revision, would be stopped by the limit with the checkout's index half written
    monkeypatch.setattr(record, "ROOT", tmp_path)
    for limit in limits:
        folder = tmp_path / str(limit)
        (folder / "folder").mkdir(parents=True)
        for name, content in good_files().items():
            (folder / name).write_bytes(content)
        monkeypatch.chdir(folder)
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            code = main(list(arguments))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        told = capsys.readouterr().err
        assert code == 2 and told.count("\n") == 1 and "cannot be written to" in told, told
        made = {p for p in folder.rglob("*") if p.is_file()} - {folder / name for name in good_files()}
        assert not [p for p in made if p.name.startswith(".") or not 0 < p.stat().st_size < limit]
