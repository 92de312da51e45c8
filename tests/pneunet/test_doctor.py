"""`pneunet doctor`: right about this machine, and of help where something is missing."""

import sys
from pathlib import Path

import pytest

from pneunet import doctor

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def here():
    return {finding.name: finding for finding in doctor.report()}


def test_all_that_is_needed_is_here(here):
    assert [str(f) for f in here.values() if f.needed and not f.ok] == []


def test_versions_and_libraries_are_named(here):
    assert here["dolfinx"].text.split(".")[0] == "0"
    assert here["MPI library"].text.startswith("Open MPI")
    assert here["numpy"].text.endswith("/usr/lib/python3/dist-packages/numpy")
    assert "blas" in here["BLAS"].text and Path(here["BLAS"].text.split()[0]).exists()


def test_a_python_without_the_libraries_is_told_what_to_type(tmp_path, monkeypatch, capsys):
    bare = tmp_path / "python"  # -S leaves out every installed package
    bare.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{Path(sys.executable).resolve()}" -S "$@"\n')
    bare.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(bare))
    assert doctor.main() == 1
    printed = capsys.readouterr().out
    assert "WRONG   dolfinx        ModuleNotFoundError" in printed and "make setup" in printed


def test_reference_blas_is_advised_against(monkeypatch):
    monkeypatch.setattr(
        doctor, "probe", lambda code: (True, "/usr/lib/x86_64-linux-gnu/blas/libblas.so.3.11.0")
    )
    finding = doctor.check_blas()
    assert not finding.ok and "libopenblas0-serial" in finding.fix


def test_a_crash_is_a_finding_not_the_end():
    assert doctor.probe("import os; os.kill(os.getpid(), 11)") == (False, "crashed with signal 11")


def test_threads_beside_ranks_are_only_advice(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    finding = doctor.check_threads()
    assert not finding.ok and not finding.needed
