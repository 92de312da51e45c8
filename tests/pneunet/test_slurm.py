"""examples/slurm/job.sh on a real SLURM that is started for the test; `make bench ONLY=slurm` does it with
finite elements."""

import sys

import pytest

from tests import slurm


@pytest.mark.skipif(bool(slurm.missing()), reason=slurm.missing())
def test_a_job_whose_time_is_over_goes_back_into_the_queue_and_on(tmp_path):
    """Toy cases on two ranks, told so after the first one; what is on disk then is not computed again."""
    cases, program = tmp_path / "cases", tmp_path / "a pneunet"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m tests.toy_cases "$@"\n')
    program.chmod(0o755)
    with slurm.private_slurm() as env:
        env["PNEUNET"] = str(program)
        job = slurm.Job.submit(env, tmp_path, [cases, "naps"])
        job.wait_for(lambda: list(cases.glob("*/record.json")))
        job.time_is_over()
        kept = {path: path.stat().st_mtime_ns for path in cases.glob("*/record.json")}
        job.wait_for(lambda: job.state() == "COMPLETED")
    said = job.log.read_text()
    assert f"interrupted: {len(kept)} of 8" in said and f"{len(kept)} of 8 cases are finished in" in said
    assert 1 <= len(kept) < 8 and len(list(cases.glob("*/record.json"))) == 8
    assert all(path.stat().st_mtime_ns == written for path, written in kept.items())
