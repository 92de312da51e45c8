"""The sample of a campaign and its prescribed strains; the command itself is in
tests/pneunet/test_campaign.py."""

import json
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.dataset import write_dataset
from pneunet.base.materials.laws import NeoHookean, material_to_table
from pneunet.geometry.designfile import segment_table
from pneunet.geometry.parameters import ONE_SIDED, TWISTING
from pneunet.geometry.reference_cases import CASES
from pneunet.geometry.shape_numbers import SHAPE, shape_numbers
from pneunet.hifi.path.equilibrium import PathState
from pneunet.hifi.path.newton import NewtonOptions
from pneunet.hifi.runs.campaign import case
from pneunet.hifi.runs.campaign.case import first_touch, prescribed_change, solve_campaign_case
from pneunet.hifi.runs.campaign.extension import taken_over
from pneunet.hifi.runs.campaign.file import EDGES, on_offer, read_campaign
from pneunet.hifi.runs.campaign.sample import RANGES, prescribed_states, segments
from tests.reduced.made_up_cells import made_up_data

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="nothing parallel in it")


def campaign(tmp_path, text):
    (tmp_path / "c.toml").write_text(text)
    return read_campaign(tmp_path / "c.toml")


def test_more_designs_keep_the_first_ones(tmp_path):
    few, many = (campaign(tmp_path, f"designs = {n}\nheld_out_every = 3") for n in (5, 20))
    names = {d.case.name for d in many.designs}
    assert len(few.designs) == 10 and {d.case.name for d in few.designs} < names and len(names) == 40
    assert {d.index for d in many.designs if d.held_out} == {2, 5, 8, 11, 14, 17}
    # ended half way it is a smaller one
    assert [d.index for d in many.designs] == sorted(d.index for d in many.designs)


def test_edge_designs_are_further_ones_that_lie_further_out_and_train_the_law(tmp_path):
    plain, fine = (
        "designs = 6\nkinds = ['twisting']\nheld_out_every = 3\n",
        "[[mesh]]\nname = 'fine'\nmesh_size_mm = 1\nevery = 5\n",
    )
    meshes = (
        "[[mesh]]\nname = 'coarse'\nmesh_size_mm = 2\n"
        + fine
        + "[edge_ranges.twisting]\nangle_deg = [30, 90]"
    )
    few, many = (campaign(tmp_path, plain + f"edge_designs = {n}\n" + meshes) for n in (3, 64))
    ordinary = campaign(tmp_path, plain + meshes).designs
    # fine meshes are for every fifth of the first six
    assert many.designs[:8] == ordinary and [d.index for d in many.designs[8:]] == [*range(EDGES, EDGES + 64)]
    assert {d.case.name for d in few.designs} < {d.case.name for d in many.designs}
    edges = many.designs[8:]
    assert not any(d.held_out for d in edges)
    for name, low, high in (("width", 8.0, 16.0), ("angle", 30.0, 90.0)):
        places = np.array([(getattr(d.segment, name) - low) / (high - low) for d in edges])
        # of Chebyshev's nodes a third lies in the middle half
        assert ((places > 0.25) & (places < 0.75)).sum() == pytest.approx(64 / 3, abs=2)


def test_further_designs_are_those_of_a_larger_sample_and_on_offer_is_what_they_may_be(tmp_path):
    plain = "kinds = ['twisting']\nheld_out_every = 3\n"
    meshes = (
        "[[mesh]]\nname = 'coarse'\nmesh_size_mm = 2\n[[mesh]]\nname = 'fine'\nmesh_size_mm = 1\nevery = 7\n"
    )
    few = campaign(tmp_path, "designs = 2\n" + plain + meshes + "[further]\ntwisting = [9, 7]")
    many = {(d.index, d.mesh.name): d for d in campaign(tmp_path, "designs = 12\n" + plain + meshes).designs}
    # fine meshes are for every seventh of the first two
    assert [(d.index, d.mesh.name) for d in few.designs] == [
        (0, "coarse"),
        (0, "fine"),
        (1, "coarse"),
        (7, "coarse"),
        (9, "coarse"),
    ]
    assert all(d.case == many[d.index, d.mesh.name].case for d in few.designs)
    offered = on_offer(few, "twisting", 10)
    assert [index for index, _ in offered] == [3, 4, 6, 10]
    assert offered[-1][1] == many[10, "coarse"].segment


def test_prescribed_states_and_fine_meshes_are_for_some_designs(tmp_path):
    text = """designs = 13
kinds = ["twisting"]
[[mesh]]
name = "coarse"
mesh_size_mm = 2
prescribed = 2
prescribed_every = 3
[[mesh]]
name = "fine"
mesh_size_mm = 1
every = 6
"""
    designs = campaign(tmp_path, text).designs
    coarse, fine = ([d for d in designs if d.mesh.name == name] for name in ("coarse", "fine"))
    assert [d.index for d in fine] == [0, 6, 12] and [d.index for d in coarse] == list(range(13))
    assert [len(d.case.inputs["prescribed"]) for d in coarse] == [2, 0, 0] * 4 + [2]
    assert not any(d.case.inputs["prescribed"] for d in fine)


@pytest.mark.parametrize("kind", (ONE_SIDED, TWISTING))
def test_designs_fill_their_ranges_evenly_and_all_can_be_built(kind):
    bodies = segments(kind, RANGES[kind], 64, 3)
    for name, attribute in (("angle_deg", "angle"), ("width_mm", "width"), ("gap_mm", "gap")):
        low, high = RANGES[kind][name]
        values = np.array([getattr(s, attribute) for s in bodies])
        # a scrambled Sobol sequence of 64 puts one point into each 64th
        assert sorted(((values - low) / (high - low) * 64).astype(int).clip(0, 63)) == pytest.approx(
            np.arange(64), abs=1
        )
    assert all(s.side_wall == s.top_wall for s in bodies)


def test_shape_numbers_do_not_change_with_size():
    a, b = (
        segments(
            TWISTING,
            {k: tuple(f * v for v in r) if k.endswith("mm") else r for k, r in RANGES[TWISTING].items()},
            1,
            1,
        )[0]
        for f in (1, 2)
    )
    assert b.width == pytest.approx(2 * a.width, abs=1e-3)
    assert shape_numbers(b) == pytest.approx(shape_numbers(a), rel=1e-3)
    assert shape_numbers(a)[[SHAPE.index("cavity_thickness"), SHAPE.index("gap")]].sum() + 2 * shape_numbers(
        a
    )[SHAPE.index("wall")] == pytest.approx(1)


@pytest.mark.parametrize(
    ("gap", "apart", "touch"), [(1.0, False, False), (0.1, False, True), (0.1, True, False)]
)
def test_a_case_on_a_grid_takes_half_a_cell_and_may_end_where_walls_touch(gap, apart, touch, tmp_path):
    segment = replace(CASES["one_sided_w10"](60.0, 1), gap=gap, material=NeoHookean(1.0))
    inputs = {
        "segment": segment_table(segment),
        "material": material_to_table(segment.material),
        "mesh": {"mesh_size_mm": 6.0, "element": "hexahedra", "alike": True},
        **{"levels": 2, "top_pressure": 0.05, "limit_share": 0.8, "prescribed": [], "slopes": False},
        **{"stiffness_slopes": False, "apart": apart},
    }
    facts = solve_campaign_case(inputs, tmp_path)
    last = json.loads((tmp_path / "states.json").read_text())[-1]
    assert facts["mesh"]["part"] and (facts["first_touch"] is not None) == touch
    assert last["pressure"] == pytest.approx(facts["top_pressure"]) and last["unstable"] == 0
    assert (facts["top_pressure"] < 0.05) == apart and facts["limit_pressure"] is None
    assert (last["contact_force"] > 0) == touch and last["wall_distance"] > 0


@pytest.mark.parametrize(("apart", "why"), [(False, "no step at all"), (True, "nearly touch")])
def test_a_path_that_reaches_nothing_is_no_case_with_a_limit_load_of_0(apart, why, monkeypatch):
    def nowhere(path, target, size, keep):
        if apart:
            keep(None)
        raise ConvergenceError("no step at all")

    rest = SimpleNamespace(parameter=1.0, accepted=[PathState(1.0, 0.0, np.zeros(1), 1.0)], limit_points=[])
    monkeypatch.setattr(case, "EquilibriumPath", lambda *arguments: rest)
    monkeypatch.setattr(case, "run_steps", nowhere)
    sampler = case.Sampler.__new__(case.Sampler)
    sampler.apart, sampler.options, sampler.steps = apart, NewtonOptions(), case.STEPS
    walls = SimpleNamespace(distance=lambda: 0.0)
    sampler.system = SimpleNamespace(volume=lambda: 1.0, walls=walls)
    sampler.problem = SimpleNamespace(segment=CASES["one_sided_w10"](60.0, 1))
    with pytest.raises(ConvergenceError, match=why):
        sampler.scout(0.3, 0.9)


def test_prescribed_states_are_of_the_whole_cell_and_start_from_the_part_s(tmp_path):
    segment = replace(CASES["one_sided_w10"](60.0, 1), material=NeoHookean(1.0))
    prescribed = [asdict(p) for p in prescribed_states(ONE_SIDED, 1, 2, 1)[0]]
    inputs = {
        "segment": segment_table(segment),
        "material": material_to_table(segment.material),
        "mesh": {"mesh_size_mm": 6.0, "element": "hexahedra"},
        **{"levels": 2, "top_pressure": 0.05, "limit_share": 0.8, "prescribed": prescribed},
        **{"slopes": False, "stiffness_slopes": False, "apart": False},
    }
    assert solve_campaign_case(inputs, tmp_path)["missing"] == []
    *states, twofold, other = json.loads((tmp_path / "states.json").read_text())
    free = next(s for s in states if s["pressure"] == other["pressure"])
    assert twofold["strains"][2] == 0 and np.abs(twofold["forces"]).max() > 0.01
    K, change = np.array(free["stiffness"]), np.array(other["strains"]) - free["strains"]
    assert other["strains"][2]
    # not far from the free state the forces are those of its stiffness
    assert np.linalg.norm(K @ change - other["forces"]) < 0.3 * np.linalg.norm(other["forces"])


def test_prescribed_strains_take_the_energy_they_are_told():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6))
    K, q = root @ root.T + np.eye(6), np.array([1.1, 0.02, 0, 0.03, 0.2, 0])
    free = q[3:] @ K[3:, 3:] @ q[3:]
    for p in prescribed_states(ONE_SIDED, 3, 3, 5)[2][1:]:
        change = prescribed_change(q, K, p.amplitude, p.direction)
        assert change @ K @ change == pytest.approx(p.amplitude**2 * free, rel=1e-5)
        assert 0.4 <= p.amplitude <= 1.5
    twofold = prescribed_states(ONE_SIDED, 1, 1, 5)[0][0]
    assert q + prescribed_change(q, K, twofold.amplitude, twofold.direction) == pytest.approx(
        [1.2, 0.04, 0, 0.06, 0.4, 0]
    )


def test_first_touch_lies_where_the_wall_distance_would_pass_zero_and_before_walls_push():
    def free(pressure, distance, force=0.0):
        return {"kind": "free", "pressure": pressure, "wall_distance": distance, "contact_force": force}

    open_ones = [free(0.0, 0.5), free(0.05, 0.35), free(0.1, 0.2)]
    assert first_touch([*open_ones, free(0.2, 0.001, 0.3)]) == pytest.approx(0.1 + 0.2 / 3)
    assert first_touch([*open_ones, free(0.12, 0.001, 0.3)]) == pytest.approx(0.12)
    assert first_touch([free(0.0, 0.5), free(0.1, 0.001, 0.3)]) == 0.1
    assert first_touch(open_ones) is None and first_touch([]) is None


def test_a_data_set_of_another_sample_cannot_be_extended(tmp_path):
    """(That one of the same sample can is in tests/pneunet/test_campaign.py.)"""
    like = "seed = 1\n[[mesh]]\nname = 'coarse'\nmesh_size_mm = "
    asked = campaign(tmp_path, "designs = 3\n" + like + "2.0")
    data, known = made_up_data(4), tmp_path / "known.npz"
    table = {"campaign": asked.table, "ranges": asked.ranges}
    meshes = [{"name": "coarse", **asked.meshes[0].settings}]
    write_dataset(known, replace(data, about=data.about | table | {"meshes": meshes}))
    assert len(taken_over(asked, known).cases) == 6
    further = campaign(tmp_path, "designs = 2\n" + like + "2.0\n[further]\ntwisting = [3, 20]")
    assert {d.index for d in further.designs if d.case.name in taken_over(further, known).cases} == {0, 1, 3}
    edges = "edge_designs = 2\n" + like + "2.0\n[edge_ranges.twisting]\nangle_deg = [30, 90]"
    # it has none of those, so theirs may lie anywhere
    assert len(taken_over(campaign(tmp_path, edges), known).cases) == 8
    with pytest.raises(InputError, match="its mesh is .*extend it with the same"):
        taken_over(campaign(tmp_path, like + "3.0"), known)
    with pytest.raises(InputError, match="seed = 1, the campaign's 2: extend it with the same"):
        taken_over(campaign(tmp_path, "seed = 2"), known)


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "is empty: write at least designs = 250"),
        ("[ranges.one-sided]\nwall_mm = [1e8, 1e9]", "wall_mm = .* must lie in 0.05..500"),
        ("design = 3", "designs"),
        ("designs = 0", "designs = 0 must lie in"),
        ('kinds = ["both"]', "'one-sided', 'twisting'"),
        ('kinds = ["twisting", "twisting"]', "each once"),
        ('[[mesh]]\nname = "a"', "mesh_size_mm' is missing"),
        ('[[mesh]]\nname = "a"\nmesh_size_mm = 2\nslopes = 1', "'slopes' must be true or false, not 1"),
        (
            '[[mesh]]\nname = "a"\nmesh_size_mm = 2\nelement = "tetrahedra"\nalike = true',
            "alike = true: .*hexahedra",
        ),
        ("[ranges.one-sided]\nwall_mm = [2, 1]", "write the lower value first"),
        ("[ranges.one-sided]\nangle_deg = [10, 20]", "must lie in 30..150"),
        (
            "edge_designs = 2\n[edge_ranges.twisting]\nangle_deg = [10, 20]",
            r"\[edge_ranges.twisting\].*must lie in 30..150",
        ),
        (
            "designs = 9\n[further]\ntwisting = [8, 12]",
            r"\[further\]: twisting must be a list of different whole numbers in 9..",
        ),
        ("[further]\nboth = [300]", r"\[further\].*both"),
        ("[edge_ranges.one-sided]\nwalls_mm = [1, 2]", r"\[edge_ranges\].one-sided.*walls_mm"),
    ],
)
def test_a_slip_in_the_file_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        campaign(tmp_path, text)
