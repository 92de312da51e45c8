"""Files to start from: each runs as it is, its comments can be used, and nothing is overwritten."""

import re

import pytest

from pneunet.cli import main
from pneunet.start import KINDS, start_text
from tests.pneunet.sayings import refused

#: a line that can be used without its mark
OFFERED = re.compile(r"^# (?=\w+ = )", re.M)


def read(kind, path):
    """What the command of a kind reads first."""
    from pneunet.design.target.file import read_target
    from pneunet.geometry.designfile import read_design_file

    if kind in ("target", "design"):
        return {"target": read_target, "design": read_design_file}[kind](path)
    pytest.importorskip("dolfinx")
    from pneunet.hifi.cell.file import read_cell
    from pneunet.hifi.runs.campaign.file import read_campaign
    from pneunet.hifi.runs.study.file import read_study

    return {"cell": read_cell, "study": read_study, "campaign": read_campaign}[kind](path)


@pytest.mark.parametrize("kind", KINDS)
def test_each_offer_of_its_comments_is_taken(kind, tmp_path):
    path, text = tmp_path / f"{kind}.toml", start_text(kind)
    path.write_text(text)
    offers = list(OFFERED.finditer(text))
    assert len(offers) >= 3
    for offer in offers:
        path.write_text(text[: offer.start()] + text[offer.end() :])
        assert read(kind, path), "an unknown key, or another value, is refused"


@pytest.mark.parametrize("kind", KINDS)
def test_it_runs_as_it_is(kind, tmp_path, monkeypatch, capsys):
    if kind not in ("target", "design"):
        pytest.importorskip("dolfinx")
    monkeypatch.chdir(tmp_path)
    assert main(["init", kind]) == 0
    assert f"then: pneunet {KINDS[kind]} {kind}.toml" in capsys.readouterr().out
    assert main([KINDS[kind], f"{kind}.toml"]) == 0, capsys.readouterr().err
    assert not re.search("failed|error|crashed|refused", capsys.readouterr().out.replace("errors", ""))


def test_it_never_overwrites(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "target.toml").write_text("mine")
    (tmp_path / "nowhere.toml").symlink_to("beyond.toml")
    for line in (["target"], ["design", "nowhere.toml"], ["design", "."]):
        assert "is there already, and is not overwritten" in refused(capsys, tmp_path, "init", *line)
    assert "invalid choice: 'robot'" in refused(capsys, tmp_path, "init", "robot")
    assert main(["init", "target", "new/mine.toml"]) == 0 and (tmp_path / "new/mine.toml").is_file()
