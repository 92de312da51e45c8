"""The workspace: shapes are those of `predict`, whoever computes them, and cover what is asked for."""

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.materials.laws import NeoHookean
from pneunet.base.strains import RodStrains
from pneunet.design.target.reach import Reach, reach
from pneunet.design.workspace import WorkspaceCase, _picks, _shares, workspace
from pneunet.geometry.parameters import ONE_SIDED, Manipulator, Segment
from pneunet.reduced.rod.prediction import predict
from tests.design.toy_law import ToyLaw

SMALL = {"angle_step": 15.0, "pressures": (0.0, 0.01, 0.02), "shapes": 700}


def test_tips_are_those_of_predictions():
    law, case = ToyLaw(), WorkspaceCase(**SMALL)
    found = workspace(case, law=law)
    assert [len(c.tips) for c in found.clouds] == [14, 98, 588] and found.lost == 0
    for cloud in found.clouds:
        assert cloud.angles.shape == (len(cloud.tips), len(cloud.chain))
        for i in range(0, len(cloud.tips), 41):
            angles, kinds = cloud.angles[i], cloud.chain
            body = Manipulator(tuple(case.segment(k, float(a)) for k, a in zip(kinds, angles)))
            line = predict(body, float(cloud.pressures[i]), law)
            assert cloud.tips[i] == pytest.approx(line.points[-1], abs=1e-9)
            assert cloud.directions[i] == pytest.approx(line.poses[-1, :3, 0], abs=1e-12)


def test_what_has_no_equilibrium_is_left_out_and_counted():
    found = workspace(WorkspaceCase(**SMALL | {"shapes": 800}), law=ToyLaw(limit=0.015))
    assert found.lost == 399 and all((c.pressures == 0.01).all() for c in found.clouds)


def test_what_the_law_doubts_is_marked_and_told(caplog):
    case = WorkspaceCase(
        **SMALL | {"chains": ((ONE_SIDED,),), "pressures": (0.03, 0.05)}, material=NeoHookean(0.12)
    )
    with caplog.at_level("WARNING"):
        found = workspace(case)
    # the law was taught P/mu up to 0.32: 0.05/0.12 is 0.42
    assert found.doubted[ONE_SIDED][:, 1].all() and not found.doubted[ONE_SIDED][:, 0].all()
    (cloud,) = found.clouds
    assert cloud.doubted[cloud.pressures == 0.05].all()
    assert "pressure / mu = 0.417 is outside the trained law's" in caplog.text
    assert not workspace(WorkspaceCase(**SMALL), law=ToyLaw()).clouds[1].doubted.any()


def test_picks_are_all_combinations_or_spread_evenly():
    every = _picks(2, 3, 2, 18)
    assert len(np.unique(every, axis=0)) == 18 and every.max(axis=0).tolist() == [1, 2, 2]
    some = _picks(2, 50, 12, 6000)
    assert len(np.unique(some, axis=0)) > 5400 and (some >= 0).all() and (some < [12, 50, 50]).all()
    counts, _, _ = np.histogram2d(some[:, 1], some[:, 2], bins=5)
    assert counts.min() > 0.9 * 240 and counts.max() < 1.1 * 240


def test_shares_take_no_more_than_there_is():
    case = WorkspaceCase(shapes=1000)
    assert _shares(case, 7, 2) == [14, 98, 686] and _shares(case, 91, 12) == [333, 333, 334]


def bent(curvature, torsion):
    """Strains (..., 6) of an unstretched helix."""
    return RodStrains(
        *np.moveaxis(np.stack([[[1, 0, 0], [t, c, 0]] for c, t in zip(curvature, torsion)]), 1, 0)
    )


def test_the_share_of_what_a_one_sided_segment_can_do_in_a_direction():
    q = bent([0.01, 0.02, 0.01], [-0.01, 0.0, 0.01])
    found = Reach(
        ONE_SIDED, np.array([60.0, 90, 120]), np.array([0.05]), RodStrains(q.e[:, None], q.k[:, None])
    )
    # straight ahead, at the last angle, halfway between the two (in direction), beyond the last, and at rest
    curvature, torsion = [0.01, 0.02, np.cos(np.pi / 8), 0.001, 0], [0, 0.02, np.sin(np.pi / 8), 0.01, 0]
    halfway = 2 / (0.02 + np.hypot(0.01, 0.01))
    assert found.share(curvature, torsion) == pytest.approx([0.5, 2, halfway, np.inf, 0])
    assert found.ranges()["twist"] == pytest.approx((-0.01, 0.01))


def test_of_a_kind_that_varies_the_strongest_counts():
    law = ToyLaw()
    low, high = (Segment(ONE_SIDED, 90.0, 1, chamber_height=h) for h in (3.0, 5.0))
    varied = reach(low, [0.02], law, [60.0, 90.0], {"chamber_height": (3.0, 5.0), "side_wall": (1.0, 20.0)})
    most = np.maximum(*(reach(s, [0.02], law, [60.0, 90.0]).curvature for s in (low, high)))
    assert varied.curvature == pytest.approx(most)
    with pytest.raises(InputError, match="side_wall_mm"):
        reach(low, [0.02], law, vary={"side_wall": (20.0,)})


@pytest.mark.parametrize(
    "text, words",
    [
        ("angles_deg = [20, 90]", "angles_deg must be [smallest, largest] within 30..150"),
        ("angles_deg = 45", "'angles_deg' must be [smallest, largest]"),
        ("pressures_kPa = [20, 10]", "pressures_kPa must rise"),
        ("pressures_kPa = [0, 90]", "must lie in 0..60"),
        ("shapes = 0", "shapes = 0"),
        ('chains = ["one-sided"]', "'chains' must be lists of kinds"),
        ('chains = [["curly"]]', "must be 1 to 8 of one-sided, twisting"),
        ("chains = []", "give at least one list"),
        ("length_cm = 5", "write 'length_mm'"),
        ("[segment]\nside_wall_mm = 6", "two side walls do not fit"),
        ("[segment]\nangle_deg = 6", "unknown key 'angle_deg'"),
    ],
)
def test_bad_cases(tmp_path, text, words):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(InputError) as error:
        WorkspaceCase.read(tmp_path / "a.toml")
    assert words in str(error.value) and "\n" not in str(error.value)
