"""The screw-periodic unit cell. Serial by design: cells are spread over ranks, not split."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from base.materials import NeoHookean
from geometry.cell import mesh_cell
from hifi.cell import CellProblem
from hifi.cell_path import CellPath
from hifi.stepping import StepSize, run_steps
from tests.cases import CASES

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="cells are serial")


def solved(segment, path, pressure, cut=0.0, mesh_size=2.5):
    mesh_cell(segment, mesh_size, path, cut)
    cell = CellPath(CellProblem(segment, path))
    run_steps(cell, pressure, StepSize(first=0.005, smallest=1e-4))
    return cell


def held(segment, path, pressure, strains):
    """(force, moment) (6,) per section at prescribed strains (6,)."""
    cell = CellPath(CellProblem(segment, path), fixed_strains=strains)
    run_steps(cell, pressure, StepSize(first=0.005, smallest=1e-4))
    state = cell.state()
    cell.destroy()
    return np.concatenate([state.force, state.moment])


@pytest.fixture
def one_sided():
    return CASES["one_sided_w10"](angle=60.0, chambers=1, material=NeoHookean(0.2068))


def test_free_state_has_the_segment_s_symmetry_and_no_force(one_sided, tmp_path):
    cell = solved(one_sided, tmp_path / "cell.msh", 0.02)
    state = cell.state()
    e, k = state.strains.e, state.strains.k
    size = np.linalg.norm(k)
    assert abs(k[2]) < 0.01 * size and abs(e[2]) < 0.01 * size * one_sided.pitch
    assert k[0] > 0.5 * size and k[1] > 0.5 * size  # twists and bends away from the chambers
    assert state.force == pytest.approx(np.zeros(3), abs=1e-7)
    assert state.moment == pytest.approx(np.zeros(3), abs=1e-6)
    cell.destroy()


def test_stiffness_is_symmetric_positive_and_the_slope_of_forces(one_sided, tmp_path):
    path = tmp_path / "cell.msh"
    cell = solved(one_sided, path, 0.02)
    state = cell.state()
    free = np.concatenate([state.strains.e, state.strains.k])
    K = state.stiffness
    assert abs(K - K.T).max() < 1e-8 * abs(K).max()
    assert np.linalg.eigvalsh(K)[0] > 0
    cell.destroy()
    direction = np.array([0.01, -0.005, 0.004, 0.001, 0.0008, -0.0006])
    h = 0.05
    ahead, behind = (held(one_sided, path, 0.02, free + s * h * direction) for s in (1, -1))
    assert (ahead - behind) / (2 * h) == pytest.approx(K @ direction, rel=1e-4, abs=1e-4 * np.linalg.norm(K @ direction))


def test_a_stiff_bottom_layer_keeps_its_length(one_sided, tmp_path):
    path, z = tmp_path / "cell.msh", one_sided.core_bottom + 0.25
    stretches = []
    for mu in (0.2068, 20.68):
        layered = replace(one_sided, layer_thickness=0.5, layer_material=NeoHookean(mu))
        cell = solved(layered, path, 0.02)
        strains = cell.state().strains
        stretches.append(np.linalg.norm(strains.e + np.cross(strains.k, [0, 0, z])))
        cell.destroy()
    assert stretches[0] < 0.99  # the soft base is compressed by the bending
    assert stretches[1] == pytest.approx(1.0, abs=2e-3)


def test_twisting_cell_only_twists_and_the_cut_s_place_does_not_matter(tmp_path):
    segment = CASES["twist_w12"](angle=60.0, chambers=1, material=NeoHookean(0.317))
    twists = []
    for cut in (0.0, 1.3):
        cell = solved(segment, tmp_path / f"{cut}.msh", 0.02, cut)
        state = cell.state()
        k = state.strains.k
        assert np.abs(k[1:]).max() < 0.01 * abs(k[0])
        twists.append(k[0])
        cell.destroy()
    # two different meshes of the same body
    assert twists[1] == pytest.approx(twists[0], rel=0.03)
