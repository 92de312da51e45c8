"""`pneunet campaign` with real finite elements, as a user starts it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pneunet.base.files.dataset import columns, read_dataset
from pneunet.cli import main
from pneunet.hifi.runs.campaign.file import read_campaign

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGN = """kinds = ["one-sided"]
designs = {designs}
held_out_every = 2
levels = 2
top_pressure_over_mu = 0.1
[[mesh]]
name = "coarse"
mesh_size_mm = 6
prescribed = 2
slopes = true
stiffness_slopes = true
"""


def campaign(ranks, folder, designs, output="out", *options):
    (folder / "campaign.toml").write_text(CAMPAIGN.format(designs=designs))
    command = [
        sys.executable,
        "-m",
        "pneunet",
        "campaign",
        str(folder / "campaign.toml"),
        "-o",
        str(folder / output),
        *options,
    ]
    line = [sys.executable, "-m", "pneunet", "run", "-n", str(ranks), "--", *command]
    done = subprocess.run(line, capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return done.stdout, read_dataset(folder / output / "cells.npz")


def test_a_campaign_grows_and_its_states_are_those_of_one_potential(tmp_path):
    _, first = campaign(2, tmp_path, 1)
    text, data = campaign(1, tmp_path, 2)
    assert "1 of 2 cases are finished" in text
    assert data.accepted.all() and data.held_out.tolist() == [False, True]
    assert (data.strains[data.case == 0] == first.strains).all()
    assert (tmp_path / "out" / "cells.md").read_text().startswith("# Data set of unit cells")
    # derivatives by shape and stiffening, of designs that train a law
    known = np.isfinite(data.strain_slopes[:, :11]).all(axis=(1, 2))
    assert (known == ((data.case == 0) & ~data.prescribed)).all() and np.isnan(
        data.strain_slopes[:, 11]
    ).all()
    assert np.isfinite(data.stiffness_slopes[:, :11]).all(axis=(1, 2)).sum() == 1  # of the state at rest
    # from the data alone it goes on elsewhere
    text, again = campaign(1, tmp_path, 2, "other", "--extend", str(tmp_path / "out" / "cells.npz"))
    assert "2 of them are taken over" in text
    for f in columns():
        assert np.array_equal(
            getattr(again, f.name), getattr(data, f.name), equal_nan=f.metadata["type"] == "f4"
        ), f.name
    for row in (0, 1):
        free = np.flatnonzero((data.case == row) & ~data.prescribed)
        held = np.flatnonzero((data.case == row) & data.prescribed)
        assert data.pressure[free] == pytest.approx([0, 0.05, 0.1]) and len(held) == 2
        assert np.abs(data.forces[free]).max() < 1e-6 < 1e-3 < np.linalg.norm(data.forces[held], axis=1).min()
        # forces are the potential's slope: from the free state they are the mean of the two stiffnesses, to
        # second order
        for i in held:
            start = free[np.argmin(np.abs(data.pressure[free] - data.pressure[i]))]
            change = data.strains[i] - data.strains[start]
            mean = (data.matrices[i] + data.matrices[start]) / 2
            assert data.forces[i] == pytest.approx(
                mean @ change, abs=0.05 * float(np.linalg.norm(data.forces[i]))
            )


def test_designs_that_are_suggested_can_be_further_ones(tmp_path, capsys):
    path = tmp_path / "c.toml"
    path.write_text("designs = 3\nkinds = ['twisting']\n")
    line = ["suggest", str(path), "--kind", "twisting", "--touching", "-n", "2", "--of", "50"]
    assert main(line) == 0
    lines = capsys.readouterr().out
    path.write_text("designs = 3\nkinds = ['twisting']\n" + lines)
    further = [d for d in read_campaign(path).designs if d.index >= 3]
    assert len(further) == 2 and not any(d.held_out for d in further)
    for more, message in (
        (["--law", "analytic"], "--law analytic does not know it"),
        (["--of", "3"], "on offer: offer more"),
    ):
        assert main([*line, *more]) == 2
        assert message in capsys.readouterr().err
