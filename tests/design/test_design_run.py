import json

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_columns
from pneunet.design.inverse_design import run_design
from pneunet.design.report.comparison import Comparison
from pneunet.design.report.rundata import read_design_folder
from pneunet.design.target.metrics import compare
from pneunet.geometry.designfile import read_design_file
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced import predict
from tests.design.toy_law import ToyLaw

POINTS = ("x_mm", "y_mm", "z_mm")


@pytest.fixture
def helix(tmp_path):
    segment = Segment("one-sided", 65.0, 12)
    points = predict(Manipulator((segment,)), 0.04, ToyLaw()).points + [10.0, 20.0, 30.0]
    np.savetxt(tmp_path / "helix.csv", points, fmt="%.4f", delimiter=",")
    return tmp_path / "helix.csv"


def test_a_bare_csv_becomes_a_folder_that_reads_back(helix, tmp_path, caplog):
    caplog.set_level("INFO", "pneunet")
    design = run_design(helix, tmp_path / "out", ToyLaw())
    out = tmp_path / "out"
    assert any("automatic split" in line for line in caplog.messages)
    again = read_design_file(out / "design.toml")
    assert again.manipulator == design.manipulator and again.target == "target.csv"
    assert again.pressure == pytest.approx(design.content.pressure, rel=1e-12)
    target = read_columns(out / again.target, POINTS)
    line = read_columns(out / "centreline.csv", ("s_mm", *POINTS))
    assert np.allclose(target[0], line[0, 1:]) and line[-1, 0] == pytest.approx(design.manipulator.length)
    repeated = predict(again.manipulator, again.pressure, ToyLaw(), 1.0, again.base_pose).points
    assert np.allclose(repeated, line[:, 1:], atol=1e-6)
    errors = compare(line[:, 1:], target)
    assert errors.rms < 0.4  # 0.5 % of length; the split and the round numbers of the drawing cost something
    written = again.result["target_error"]
    assert written["rms_mm"] == pytest.approx(errors.rms, rel=1e-6) and written[
        "eq27_sum_mm2"
    ] == pytest.approx(errors.eq27, rel=1e-6)
    assert {"hausdorff_mm", "tip_mm", "length_mismatch_mm"} <= set(written)
    assert "automatic split" in again.result["split"] and again.result["piece"][0]["kind"] == "helical"
    assert json.loads((out / "run.json").read_text())["inputs"]["law"] == "toy"


def test_the_same_input_gives_the_same_design(helix, tmp_path):
    for name in ("a", "b"):
        run_design(helix, tmp_path / name, ToyLaw())
    assert (tmp_path / "a/design.toml").read_text() == (tmp_path / "b/design.toml").read_text()


class Doubtful(ToyLaw):
    def doubts(self, segment, pressure):
        return ("it is a toy",)


def test_what_the_law_doubts_is_said_once_and_kept_or_refused(helix, tmp_path, caplog):
    with pytest.raises(InputError, match="the law 'toy' doubts the design: segment 1: it is a toy"):
        run_design(helix, tmp_path / "out", Doubtful(), outside="refuse")
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match="outside = 'ignore' is not known"):
        run_design(helix, tmp_path / "out", Doubtful(), outside="ignore")
    caplog.clear()
    design = run_design(helix, tmp_path / "out", Doubtful())
    assert caplog.messages.count("warning: segment 1: it is a toy") == 1
    assert design.doubts == ("segment 1: it is a toy",)
    assert design.content.result["doubts"] == ["segment 1: it is a toy"]
    notes = Comparison.of(read_design_folder(tmp_path / "out"), Doubtful()).notes
    assert any("'toy'" in note and "segment 1: it is a toy" in note for note in notes)


def test_bad_input_leaves_nothing_behind(helix, tmp_path):
    helix.write_text(helix.read_text() + "oops,0,0\n")
    for target, objective in ((helix, "paired"), (tmp_path / "none.csv", "paired"), (helix, "best")):
        with pytest.raises(InputError):
            run_design(target, tmp_path / "out", ToyLaw(), objective)
        assert not (tmp_path / "out").exists()
