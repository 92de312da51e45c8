"""run.json tells how a result came to be."""

import json
import os
import sys

import numpy as np

from pneunet.base.files import record


def test_record_holds_how_and_what(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/some/where/pneunet", "solve", "my design.toml"])
    written = record.write_record(tmp_path, ranks=2, seconds=np.float64(1.5), steps=[{"pressure_kPa": 2.0}])
    read = json.loads((tmp_path / "run.json").read_text())
    assert read == written
    assert read["command"] == "pneunet solve my design.toml"  # the machine's path to the program is left out
    assert read["ranks"] == 2 and read["seconds"] == 1.5 and read["steps"] == [{"pressure_kPa": 2.0}]
    assert read["machine"]["cores"] == os.cpu_count() and read["machine"]["processor"]
    assert read["date"].endswith("Z") and read["revision"]


def test_revision_without_git_is_unknown(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    assert record.revision() == "unknown"
