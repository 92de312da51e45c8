"""What a law is fitted from: samples of made-up cells, walls that touch, limit loads, learned numbers."""

from dataclasses import replace

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.dataset import UPPER
from pneunet.geometry.parameters import KINDS, ONE_SIDED, TWISTING
from pneunet.geometry.shape_numbers import SHAPE, numbers_of
from pneunet.reduced.trained.coordinates import REST, Coordinates
from pneunet.reduced.trained.enthalpy import monomials
from pneunet.reduced.training.fit import fit_closing, fit_path, fit_stiffness
from pneunet.reduced.training.judging import stiffness_error, strain_error
from pneunet.reduced.training.states import sample_of
from pneunet.reduced.training.train import samples_of
from tests.reduced.made_up_cells import PRESSURES, design, made_up_data, true_free, true_stiffness


def test_a_kind_of_few_designs_is_left_out_and_said(caplog):
    caplog.set_level("INFO", "pneunet")
    data = made_up_data()
    few = replace(data, status=((data.kind == 1) & (data.design > 5)).astype("i1"))
    assert list(samples_of(few)) == [ONE_SIDED]
    assert any(
        line.startswith("twisting: ") and "will not know this kind" in line for line in caplog.messages
    )
    with pytest.raises(InputError, match="too few accepted designs of any kind"):
        samples_of(replace(data, status=np.ones_like(data.status)))
    with pytest.raises(InputError, match="too few accepted designs of any kind .*it holds none"):
        samples_of(replace(data, about=data.about | {"kinds": []}))


def test_how_far_walls_close_is_known_up_to_the_first_state_in_touch():
    data = made_up_data()
    first = np.full(len(data.kind), np.nan)
    first[:2] = 0.1, PRESSURES[2]  # between levels, where it is known; at one, before which it was
    free = sample_of(replace(data, first_touch=first), ONE_SIDED, False).free
    met, at_level, never = (free.of(free.design == design) for design in range(3))
    gap, lead = met.numbers[0, SHAPE.index("gap")], Coordinates(ONE_SIDED).leading(met.strains)
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
        closing.closed(seen.numbers, seen.pressure, seen.strains),
    )
    assert (closed > 1).tolist() == seen.touching.tolist() and 0.2 < seen.touching.mean() < 0.8
    assert stiffness_error(seen, stiffness.at(seen.numbers, seen.strains, closed)).max() < 0.05
    few = learned.of(np.isin(learned.design, np.unique(learned.design)[:8]))
    assert fit_closing(few).process is None and fit_stiffness(few, fit_closing(few)).contact is None


@pytest.mark.parametrize("kind", KINDS)
def test_paths_of_free_states_have_a_kink_where_walls_touch(kind):
    """Walls close in proportion to the leading strain (one-sided) or the pressure; the more they overlap, the
    more the cell strains."""
    data, rest = made_up_data(), np.zeros(6)
    rest[0] = 1.0
    numbers = np.hstack([data.shape, data.stiffening]).astype(float)
    wall, gap = (data.shape[:, SHAPE.index(name)].astype(float) for name in ("wall", "gap"))
    first, strains, distance = (
        0.15 * np.exp(10 * (wall - 0.2)),
        data.strains.astype(float),
        np.zeros(len(data.strains)),
    )
    place = {ONE_SIDED: 4, TWISTING: 0}[kind]
    for i, case in enumerate(data.case):
        at_touch = true_free(kind, numbers[case], first[case])[place] - rest[place]
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
    errors = [strain_error(seen, path.strains(seen.numbers, seen.pressure)) for path in (told, untold)]
    assert (
        errors[0].max() < 0.03 and errors[0].mean() < errors[1].mean() / 2 and untold.closing.process is None
    )
    shape, P, h = seen.numbers[:1], np.array([0.25]), 1e-5
    assert told.closing.overlap(shape, P, told.at(shape, P)[0]) > 0
    _, slopes = told.strains_and_slopes(shape, P)
    for name, step in (("gap", h), ("wall", h), ("angle", 100 * h), ("pressure", h)):
        i = -1 if name == "pressure" else SHAPE.index(name)
        by_shape, by_pressure = (step * np.eye(15)[i], 0.0) if i >= 0 else (np.zeros(15), step)
        ends = [told.strains(shape + sign * by_shape, P + sign * by_pressure)[0] for sign in (1, -1)]
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
    path, shape = fit_path(train), train.numbers[:1]
    limit = stiff(0) / 4
    at = path.at(np.repeat(shape, 4, axis=0), limit * np.array([0.5, 0.9, 1.1, 1.5]))
    assert at[0][:2] == pytest.approx([(1 - np.sqrt(0.5)) / 2, (1 - np.sqrt(0.1)) / 2], rel=1e-2)
    assert at[1] == pytest.approx([0, 0, np.log(1.1), np.log(1.5)], abs=0.02)
    assert at[0][2:] == pytest.approx([0.5, 0.5], abs=0.06)
    q, slopes = path.strains_and_slopes(shape, np.array([1.5 * limit]))
    assert np.isfinite(q).all() and np.isfinite(slopes).all()


@pytest.mark.parametrize("kind", KINDS)
def test_learned_numbers_give_strains_and_stiffness_back(kind):
    rng, co = np.random.default_rng(2), Coordinates(kind)
    shape, _ = numbers_of([design(kind, angle) for angle in (50.0, 80.0)])
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
