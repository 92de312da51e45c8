"""One consistent system: mm, N, MPa, tonne, s."""

from pneunet.base import units


def test_factors_make_one_system():
    assert units.TO_INTERNAL["kPa"] * 1e3 == units.TO_INTERNAL["MPa"] == 1.0
    # 1000 kg/m3 under gravity over 1 m of depth is 9.81 kPa
    weight = 1000 * units.TO_INTERNAL["kg_per_m3"] * units.GRAVITY * 1000
    assert abs(weight / (9.81 * units.TO_INTERNAL["kPa"]) - 1) < 1e-12
    assert units.TO_INTERNAL["per_m"] * 1000 == 1.0
