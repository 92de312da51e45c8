"""The laws that --law names, and the trained one that comes along."""

import pytest

from pneunet.base.errors import InputError
from pneunet.geometry import Segment
from pneunet.geometry.parameters import KINDS, ONE_SIDED
from pneunet.reduced.choice import SHIPPED, choose_law, shipped_law


def test_a_law_s_name_chooses_it_again():
    for name in ("trained", "analytic", str(SHIPPED)):
        assert choose_law(name).name == name
    assert choose_law() is shipped_law()
    with pytest.raises(InputError, match="--law best: write 'trained', 'analytic' or the .npz file"):
        choose_law("best")
    with pytest.raises(InputError, match="none.npz: no such file"):
        choose_law("none.npz")


def test_the_shipped_law_knows_the_start_dimensions_of_both_kinds():
    law = shipped_law()
    assert set(law.kinds) == set(KINDS)
    for kind, size in (
        (ONE_SIDED, {}),
        ("twisting", {"chamber_height": 5.5, "cavity_floor": 0.5, "gap": 2.0}),
    ):
        assert law.doubts(Segment(kind, 60.0, 5, **size), [0.01, 0.03]) == ()
