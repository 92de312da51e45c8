"""The trained law on made-up cells: a smooth law that obeys the symmetries, in the schema of the data set."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.dataset import UPPER, CellData, columns, write_dataset
from pneunet.base.materials.laws import NeoHookean, Yeoh
from pneunet.geometry.parameters import KINDS, ONE_SIDED, TWISTING
from pneunet.geometry.shape_numbers import SHAPE, direction_matrix, segment_of, shape_numbers
from pneunet.reduced.trained.coordinates import BLOCKS, MIRROR, REST, Coordinates
from pneunet.reduced.trained.enthalpy import monomials, whitening
from pneunet.reduced.trained.law import RodLaw, read_law
from pneunet.reduced.training.fit import fit_closing, fit_path, fit_stiffness
from pneunet.reduced.training.judging import further_angles, stiffness_error, strain_error
from pneunet.reduced.training.states import sample_of
from pneunet.reduced.training.suggestion import most_telling
from pneunet.reduced.training.train import (
    FURTHER_BY,
    designs_at_further_angles,
    judge_free_states_again,
    run_training,
    samples_of,
)

SLOPES = {f.name: f.metadata["shape"] for f in columns() if f.name.endswith("_slopes")}
DESIGNS, PRESSURES = 60, np.linspace(0, 0.3, 5)


def true_free(kind, shape, P):
    """(6,) free strains."""
    c, width, wall = np.cos(np.radians(shape[0])), shape[SHAPE.index("width")], shape[SHAPE.index("wall")]
    size = P * np.exp(0.4 * np.log(width) - np.log(wall) + 0.8 * c**2 + 0.5 * P)
    if kind == ONE_SIDED:
        return REST + size * np.array([0.2 + 0.1 * c**2, -0.2 * c, 0, c * (1 + P), 1, 0])
    return REST + size * np.array([1, 0, 0, 2 * c / width, 0, 0])


def true_stiffness(kind, shape, P):
    """(6, 6) of the free state."""
    c, K = np.cos(np.radians(shape[0])), np.zeros((6, 6))
    for block in BLOCKS[kind]:
        L = np.eye(len(block))
        for i in range(len(block)):
            for j in range(i):
                odd = MIRROR[block[i]] * MIRROR[block[j]] < 0
                L[i, j] = (0.3 * c if odd else 0.2) * (1 + P) / (1 + i)
        D = np.exp(0.5 * np.log(shape[SHAPE.index("wall")]) + P) / (1.0 + np.array(block))
        K[np.ix_(block, block)] = L @ np.diag(D) @ L.T
    return K


def made_up_data():
    rng = np.random.default_rng(4)
    rows = {f.name: [] for f in columns()}
    for number, kind in enumerate(KINDS):
        for design in range(DESIGNS):
            v = rng.uniform(
                [45, 1.5, 0.6, 0.25, 0.15, 0.12, 0.3, 0.3, 0.25],
                [90, 2.5, 1.2, 0.4, 0.25, 0.25, 0.6, 0.6, 0.35],
            )
            shape = dict(zip(("angle", "width", "chamber_height", "cavity_thickness", "wall", "top_wall"), v))
            shape |= {"base_thickness": v[6], "channel_width": v[7], "channel_height": v[8]}
            shape["gap"] = 1 - shape["cavity_thickness"] - 2 * shape["wall"]
            shape["side_wall"] = shape["roof"] = shape["top_wall"]
            shape["cavity_floor"] = (
                shape["channel_height"] / 2 * (1 if kind == ONE_SIDED else rng.uniform(0.3, 1))
            )
            s = np.array([shape[name] for name in SHAPE])
            case = {
                "kind": number,
                "design": design,
                "held_out": design % 5 == 4,
                "shape": s,
                "limit_pressure": np.nan,
            }
            case["first_touch"] = np.nan
            for f in columns():
                if f.metadata["of"] == "cases":
                    rows[f.name].append(case.get(f.name, 0))
            row = len(rows["kind"]) - 1
            for P in PRESSURES:
                add_state(rows, row, P, true_free(kind, s, P), np.zeros(6), true_stiffness(kind, s, P), False)
            for P, doubled in zip(PRESSURES[[1, 2, 4]], (True, False, False)):
                K, free = true_stiffness(kind, s, P), true_free(kind, s, P)
                change = free - REST if doubled else rng.normal(size=6) * 0.1
                M, D1 = whitening(kind, K[None])
                v = M[0] @ change
                force = D1[0] * M[0].T @ (v + 4 * 0.7 * (v @ v) * v)  # 0.7 |v|^4: a sum of allowed monomials
                add_state(rows, row, P, free + change, force, K, True)
    about = {
        "kinds": list(KINDS),
        "meshes": [{"name": "a", "mesh_size_mm": 1}],
        "shape": list(SHAPE),
        "statuses": ["done"],
    }
    about["directions"] = {kind: direction_matrix(kind).tolist() for kind in KINDS}
    about |= {"largest_symmetry_defect": 0.01, "revisions": ["made up"], "reasons": {}}
    return CellData(about, **{f.name: np.array(rows[f.name], f.metadata["type"]) for f in columns()})


def add_state(rows, row, P, strains, forces, K, prescribed):
    state = {
        "case": row,
        "prescribed": prescribed,
        "pressure": P,
        "strains": strains,
        "forces": forces,
        "stiffness": K[UPPER],
    }
    state |= {name: np.full(SLOPES[name], np.nan) for name in SLOPES}
    state["wall_distance"] = rows["shape"][row][SHAPE.index("gap")] * (1 - P)
    for f in columns():
        if f.metadata["of"] == "states":
            rows[f.name].append(state.get(f.name, 0))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("law")
    write_dataset(folder / "cells.npz", made_up_data())
    law = run_training(folder / "cells.npz", folder / "law.npz", say=lambda text: None, compare=False)
    return law, folder


def design(kind, angle=63.0, material=None, pitch=4.0):
    shape = np.array([angle, 2.0, 0.9, 0.33, 0.2, 0.27, 0.18, 0.18, 0.45, 0.18, 0.45, 0.3, 0.15])
    return segment_of(kind, shape, pitch, material or NeoHookean(mu=0.25))


def test_a_kind_of_few_designs_is_left_out_and_said():
    data, said = made_up_data(), []
    few = replace(data, status=((data.kind == 1) & (data.design > 5)).astype("i1"))
    assert list(samples_of(few, said.append)) == [ONE_SIDED]
    assert any(line.startswith("twisting: ") and "will not know this kind" in line for line in said)
    with pytest.raises(InputError, match="too few accepted designs of any kind"):
        samples_of(replace(data, status=np.ones_like(data.status)))


@pytest.mark.parametrize("kind", KINDS)
def test_a_design_it_has_not_seen(trained, kind):
    law, segment = trained[0].of(design(kind)), design(kind)
    P = 0.05  # MPa
    scale = np.array([1, 1, 1, 4, 4, 4])
    expected = true_free(kind, shape_numbers(segment), P / 0.25) / scale
    assert law.free_strains(P) == pytest.approx(expected, abs=3e-3 * np.linalg.norm(expected - REST))
    K = true_stiffness(kind, shape_numbers(segment), P / 0.25) * np.outer(scale, scale) * 0.25 * 4.0**2
    assert law.stiffness(law.free_strains(P), P) == pytest.approx(K, rel=0.02, abs=0.02 * abs(K).max())
    assert law.doubts(P) == ()


@pytest.mark.parametrize("kind", KINDS)
def test_force_and_stiffness_are_slopes_of_psi_and_vanish_at_the_free_state(trained, kind):
    law, P, h = trained[0].of(design(kind)), np.array([0.03, 0.06]), 1e-5
    free = law.free_strains(P)
    assert law.force(free, P) == pytest.approx(np.zeros((2, 6)), abs=1e-9)
    q = free + np.array([0.02, -0.01, 0.015, 0.004, -0.01, 0.006])
    for i in range(6):
        step = h * np.eye(6)[i]
        assert (law.psi(q + step, P) - law.psi(q - step, P)) / (2 * h) == pytest.approx(
            law.force(q, P)[:, i], rel=1e-5, abs=1e-7
        )
        slope = (law.force(q + step, P) - law.force(q - step, P)) / (2 * h)
        assert slope == pytest.approx(law.stiffness(q, P)[:, i], rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_mirror_images_and_sizes(trained, kind):
    law = trained[0]
    one, other = law.of(design(kind)), law.of(design(kind).mirrored)
    q = one.free_strains(0.05) + [0.02, 0.01, 0.01, 0.003, 0.002, 0.001]
    assert other.free_strains(0.05) == pytest.approx(one.free_strains(0.05) * MIRROR, abs=1e-12)
    assert other.force(q * MIRROR, 0.05) == pytest.approx(one.force(q, 0.05) * MIRROR, abs=1e-9)
    large = law.of(design(kind, pitch=8.0))
    assert large.free_strains(0.05)[3:] == pytest.approx(one.free_strains(0.05)[3:] / 2)


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_of_the_free_strains(trained, kind):
    law, shape, P = trained[0].kinds[kind], np.array([shape_numbers(design(kind))]), np.array([0.2])
    q, slopes = law.free_strains_and_slopes(shape, P)
    assert q == pytest.approx(law.free_strains(shape, P))
    for i in range(14):
        h = 1e-5 * (shape[0, i] if i < 13 else P[0])
        ends = []
        for sign in (1, -1):
            s, p = shape.copy(), P.copy()
            if i < 13:
                s[0, i] += sign * h
            else:
                p[0] += sign * h
            ends.append(law.free_strains(s, p)[0])
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(slopes[0, :, i], rel=1e-4, abs=1e-7)


def test_held_out_figures_of_an_easy_law_are_small_and_its_intervals_honest(trained):
    for figures in trained[0].about["figures"].values():
        assert figures["law_strain_median_rel"] < 2e-3 and figures["law_strain_p95_rel"] < 0.02
        assert figures["law_stiffness_p95_rel"] < 0.02 and figures["law_force_p95_rel"] < 0.05
        assert figures["force_in_other_directions_p95_rel"] < 0.05
        assert figures["law_interval_coverage_90"] > 0.7


def test_designs_more_slanted_than_the_held_out_ones_are_judged_by_laws_that_have_not_seen_them(trained):
    data = made_up_data()
    training, held_out = samples_of(replace(data, held_out=data.held_out & (data.shape[:, 0] > 60)))[
        ONE_SIDED
    ]
    pairs = designs_at_further_angles(training, held_out)
    further = training.free.design[training.free.shape[:, 0] < held_out.free.shape[:, 0].min() - FURTHER_BY]
    assert (
        np.array_equal(np.sort(np.concatenate([judged.designs for _, judged in pairs])), np.unique(further))
        and len(pairs) == 5
    )
    for learned, judged in pairs:
        assert np.array_equal(np.union1d(learned.designs, judged.designs), training.designs)
        assert len(learned.designs) + len(judged.designs) == len(training.designs)
    learned, judged = pairs[0]
    told = further_angles(
        [(judged.designs, judge_free_states_again(trained[0].kinds[ONE_SIDED], learned, judged))]
    )
    assert (
        told["further_angles_designs"] == len(judged.designs)
        and 0 < told["further_angles_strain_p95_rel"] < 0.02
    )
    assert designs_at_further_angles(*samples_of(data)[ONE_SIDED]) == [] and further_angles([]) == {}


def test_it_says_when_it_is_asked_outside_and_by_how_much(trained):
    law, segment = trained[0], design(ONE_SIDED)
    for kind in KINDS:
        assert law.doubts(design(kind), [0.01, 0.05]) == () and (law.excess(design(kind), 0.05) == 0).all()
    assert any("pressure / mu = 0.5 is outside" in text for text in law.doubts(segment, [0.01, 0.25 * 0.5]))
    assert law.excess(segment, 0.2).max() > law.excess(segment, 0.15).max() > 0
    wide = replace(segment, width=40.0)
    assert any("width / normal pitch = 10 is outside" in text for text in law.doubts(wide, 0.01))
    # the core is as high as before
    thin = replace(segment, base_thickness=0.4, channel_height=2.6, cavity_floor=1.3)
    assert any("base_thickness / normal pitch = 0.1 is outside" in text for text in law.doubts(thin, 0.01))
    other = design(ONE_SIDED, material=Yeoh(c10=0.125, c20=0.01))
    assert any("neo-Hookean" in text for text in law.doubts(other, 0.05))
    with pytest.raises(InputError, match="knows one-sided segments only: take --law analytic"):
        RodLaw({ONE_SIDED: law.kinds[ONE_SIDED]}, {}).strains(design(TWISTING), 0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_the_design_that_teaches_most_is_the_one_it_knows_least_of(trained, kind):
    """Without a limit load on the way; the other is one that it was trained on."""
    data = made_up_data()
    known = data.shape[(data.kind == data.about["kinds"].index(kind)) & ~data.held_out][0].astype(float)
    far = known + 0.6 * (known - data.shape.mean(axis=0))
    law = trained[0].kinds[kind]
    assert (law.path.at(np.array([known, far]), np.full(2, 0.1), 0)[1] == 0).all()
    assert most_telling(law, np.array([known, far]), 1, 0.1, 0.9).tolist() == [1]


def test_a_table_of_designs_holds_what_single_calls_give(trained):
    law, P = trained[0], [0.0, 0.03, 0.06]
    segments = [design(ONE_SIDED, 50.0), design(TWISTING, 120.0), design(ONE_SIDED, 90.0, pitch=7.0)]
    found = law.table(segments, P)
    for i, segment in enumerate(segments):
        one = law.strains(segment, P)
        assert found.e[i] == pytest.approx(one.e) and found.k[i] == pytest.approx(one.k)


@pytest.mark.parametrize("kind", KINDS)
def test_many_states_at_once_are_those_one_by_one(trained, kind):
    law = trained[0].kinds[kind]
    shape = np.repeat([shape_numbers(design(kind))], 300, axis=0)
    P = np.linspace(0.0, 0.3, 300)
    q = law.free_strains(shape, P)
    assert law.path.strains(shape[1:], P[1:], np.zeros(299, int)) == pytest.approx(q[1:], abs=1e-12)
    for i in (0, 1, 140, 299):
        assert law.free_strains(shape[i : i + 1], P[i : i + 1])[0] == pytest.approx(q[i], abs=1e-7)


def test_a_file_gives_the_same_law(trained):
    law, folder = trained
    again = read_law(folder / "law.npz")
    for kind in KINDS:
        segment = design(kind)
        q = law.of(segment).free_strains(0.05) + 0.01
        assert (again.of(segment).force(q, 0.05) == law.of(segment).force(q, 0.05)).all()
        assert again.of(segment).half_width(0.05) == pytest.approx(
            law.of(segment).half_width(0.05), rel=0.05, abs=1e-5
        )
    with pytest.raises(InputError, match="not a trained law"):
        (folder / "bad.npz").write_text("")
        read_law(folder / "bad.npz")
    assert "law_strain_p95_rel" in (folder / "law.md").read_text()


def test_on_the_same_data_the_metrics_of_a_law_give_it_again(trained):
    law, folder = trained
    settings = {"say": lambda text: None, "compare": False, "like": folder / "law.npz"}
    again = run_training(folder / "cells.npz", folder / "again.npz", **settings)
    for kind in KINDS:
        segment = design(kind)
        assert again.of(segment).free_strains(0.05) == pytest.approx(
            law.of(segment).free_strains(0.05), rel=1e-9, abs=1e-12
        )
        assert again.kinds[kind].quantile == pytest.approx(law.kinds[kind].quantile, rel=1e-6)
    assert "like_sha256" in again.about and "like_sha256" not in law.about


def test_how_far_walls_close_is_known_up_to_the_first_state_in_touch():
    data = made_up_data()
    first = np.full(len(data.kind), np.nan)
    first[:2] = 0.1, PRESSURES[2]  # between levels, where it is known; at one, before which it was
    free = sample_of(replace(data, first_touch=first), ONE_SIDED, False).free
    met, at_level, never = (free.of(free.design == design) for design in range(3))
    gap, lead = met.shape[0, SHAPE.index("gap")], Coordinates(ONE_SIDED).leading(met.strains)
    touched = gap / np.interp(0.1, PRESSURES, lead)
    assert met.closing == pytest.approx(
        [np.nan, gap * PRESSURES[1] / lead[1], touched, np.nan, np.nan], nan_ok=True
    )
    assert met.touching.tolist() == at_level.touching.tolist() == [False, False, True, True, True]
    assert np.isfinite(at_level.closing).tolist() == [False, True, False, False, False]
    assert np.isfinite(never.closing).sum() == 4 and not never.touching.any()


def test_stiffness_jumps_where_walls_touch():
    """Walls of twisting cells close in proportion to the pressure; in touch, bending is stiffer by a factor
    and by how far they overlap."""
    data = made_up_data()
    wall, gap = (data.shape[:, SHAPE.index(name)].astype(float) for name in ("wall", "gap"))
    first = 0.16 * np.exp(wall - 0.2)
    closed = data.pressure / first[data.case]
    added = np.where(closed > 1, 0.4 + wall[data.case] + (closed - 1) * gap[data.case], 0.0)
    K = data.matrices.copy()
    # the last pivot of its block alone
    K[:, 4, 4] += (np.exp(added) - 1) * (K[:, 4, 4] - K[:, 4, 1] ** 2 / K[:, 1, 1])
    touched = replace(
        data,
        first_touch=first.astype("f4"),
        stiffness=K[(slice(None), *UPPER)].astype("f4"),
        wall_distance=(np.maximum(1 - closed, 0) * gap[data.case]).astype("f4"),
    )
    learned, seen = (sample_of(touched, TWISTING, held_out).free for held_out in (False, True))
    closing = fit_closing(learned)
    stiffness, closed = (
        fit_stiffness(learned, closing),
        closing.closed(seen.shape, seen.pressure, seen.strains),
    )
    assert (closed > 1).tolist() == seen.touching.tolist() and 0.2 < seen.touching.mean() < 0.8
    assert stiffness_error(seen, stiffness.at(seen.shape, seen.strains, closed, 0)).max() < 0.05
    few = learned.of(np.isin(learned.design, np.unique(learned.design)[:8]))
    assert fit_closing(few).process is None and fit_stiffness(few, fit_closing(few)).contact is None


@pytest.mark.parametrize("kind", KINDS)
def test_paths_of_free_states_have_a_kink_where_walls_touch(kind):
    """Walls close in proportion to the leading strain (one-sided) or the pressure; the more they overlap, the
    more the cell strains."""
    data, rest = made_up_data(), np.zeros(6)
    rest[0] = 1.0
    wall, gap = (data.shape[:, SHAPE.index(name)].astype(float) for name in ("wall", "gap"))
    first, strains, distance = (
        0.15 * np.exp(10 * (wall - 0.2)),
        data.strains.astype(float),
        np.zeros(len(data.strains)),
    )
    place = {ONE_SIDED: 4, TWISTING: 0}[kind]
    for i, case in enumerate(data.case):
        at_touch = true_free(kind, data.shape[case], first[case])[place] - rest[place]
        change, lead, factor = strains[i] - rest, strains[i, place] - rest[place], 1.0
        for _ in range(60):
            closed = factor * lead / at_touch if kind == ONE_SIDED else data.pressure[i] / first[case]
            factor = 1 + 0.1 * np.log1p(max(closed - 1, 0) * gap[case] / 0.05)
        strains[i], distance[i] = rest + factor * change, max(1 - closed, 0) * gap[case]
    touched = replace(
        data, first_touch=first.astype("f4"), strains=strains, wall_distance=distance.astype("f4")
    )
    learned, seen = (sample_of(touched, kind, held_out).free.loaded for held_out in (False, True))
    told = fit_path(learned, slopes=False)
    untold = fit_path(replace(learned, touching=np.zeros(len(learned.design), bool)), slopes=False)
    errors = [strain_error(seen, path.strains(seen.shape, seen.pressure, 0)) for path in (told, untold)]
    assert (
        errors[0].max() < 0.03 and errors[0].mean() < errors[1].mean() / 2 and untold.closing.process is None
    )
    shape, P, h = seen.shape[:1], np.array([0.25]), 1e-5
    assert told.closing.overlap(shape, P, told.at(shape, P, 0)[0]) > 0
    _, slopes = told.strains_and_slopes(shape, P, 0)
    for name, step in (("gap", h), ("wall", h), ("angle", 100 * h), ("pressure", h)):
        i = -1 if name == "pressure" else SHAPE.index(name)
        by_shape, by_pressure = (step * np.eye(13)[i], 0.0) if i >= 0 else (np.zeros(13), step)
        ends = [told.strains(shape + sign * by_shape, P + sign * by_pressure, 0)[0] for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(slopes[0, :, i], rel=2e-3, abs=2e-5)


def test_beyond_a_limit_load_strains_stay_and_it_says_so():
    """Cells whose pressure over the leading strain falls, P = a q (1 - q), up to 0.996 of the limit load
    a/4."""
    data = made_up_data()
    rows = np.flatnonzero(~data.prescribed & (data.pressure > 0))
    strains, pressure, lead = data.strains.copy(), data.pressure.copy(), {ONE_SIDED: 4, TWISTING: 0}

    def stiff(case):
        return 0.5 * np.exp(data.shape[case, SHAPE.index("wall")])

    for i in rows:
        case = data.case[i]
        place = lead[KINDS[data.kind[case]]]
        q = 0.47 * data.pressure[i] / 0.3
        strains[i] = REST + (data.strains[i] - REST) * q / (data.strains[i] - REST)[place]
        pressure[i] = stiff(case) * q * (1 - q)
    train = sample_of(replace(data, strains=strains, pressure=pressure), ONE_SIDED, False).free
    path, shape = fit_path(train), data.shape[:1].astype(float)
    limit = stiff(0) / 4
    at = path.at(np.repeat(shape, 4, axis=0), limit * np.array([0.5, 0.9, 1.1, 1.5]), 0)
    assert at[0][:2] == pytest.approx([(1 - np.sqrt(0.5)) / 2, (1 - np.sqrt(0.1)) / 2], rel=1e-2)
    assert at[1] == pytest.approx([0, 0, np.log(1.1), np.log(1.5)], abs=0.02)
    assert at[0][2:] == pytest.approx([0.5, 0.5], abs=0.06)
    q, slopes = path.strains_and_slopes(shape, np.array([1.5 * limit]), 0)
    assert np.isfinite(q).all() and np.isfinite(slopes).all()


@pytest.mark.parametrize("kind", KINDS)
def test_learned_numbers_give_strains_and_stiffness_back(kind):
    rng, co = np.random.default_rng(2), Coordinates(kind)
    shape = np.array([shape_numbers(design(kind, angle)) for angle in (50.0, 80.0)])
    P = np.array([0.1, 0.2])
    q = np.array([true_free(kind, s, p) for s, p in zip(shape, P)])
    learned = co.learned_strains(shape, P, q)
    assert co.strains(shape, P * np.exp(-learned[:, 0]), learned[:, 1:]) == pytest.approx(q)
    K = np.array([true_stiffness(kind, s, p) for s, p in zip(shape, P)])
    assert co.stiffness(shape, co.learned_stiffness(shape, K)) == pytest.approx(K)
    anything = co.stiffness(shape, rng.normal(size=(2, len(co.stiffness_parity))))
    assert (np.linalg.eigvalsh(anything) > 0).all()


def test_monomials_are_those_that_half_turns_leave():
    # cubic and quartic, even in (e3, k3); for the twisting kind also in (e2, k2)
    assert len(monomials(ONE_SIDED)) == 20 + 4 * 3 + 35 + 10 * 3 + 5
    assert len(monomials(TWISTING)) == 4 + 2 * 3 * 2 + 5 + 3 * 3 * 2 + 5 * 2 + 3 * 3
