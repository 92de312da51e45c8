"""Numbers that no move of code may change: `python -m tests.reference_outputs OUT.json` writes them.

tests/data/reference_outputs.json was written before the packages were moved under one name.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Manipulator, Segment
from pneunet.geometry.reference_cases import CASES
from pneunet.reduced import choose_law, predict
from pneunet.reduced.choice import DATA_SET

STORED = Path(__file__).resolve().parent / "data" / "reference_outputs.json"
CELL_MESH = STORED.with_name("reference_cell.npz")
#: (case, angle in degrees) of the free strains, and pressures in kPa
STATES = (
    (("one_sided_w10", 60.0), ("twist_w12", 60.0)),
    (2.0, 5.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0, 40.0, 50.0),
)
_SOFT = NeoHookean(mu=0.2068)
#: three designs and their pressures in kPa
DESIGNS = {
    "tentacle": (
        Manipulator(
            (CASES["twist_w12"](60.0, 6), Segment("one-sided", 90.0, 6), Segment("one-sided", 60.0, 8))
        ),
        40.0,
    ),
    "finger": (
        Manipulator((Segment("one-sided", 90.0, 10, width=10.0, channel_width=2.0, material=_SOFT),)),
        30.0,
    ),
    "coil": (Manipulator((CASES["one_sided_w10"](120.0, 12), CASES["one_sided_w10"](70.0, 5))), 25.0),
}


def free_strains():
    """{case: {law: (10, 6)}} strains (e, k) over the pressure, 1/mm for k."""
    cases, pressures = STATES
    out = {}
    for name, angle in cases:
        segment = CASES[name](angle, 5)
        found = {
            law: choose_law(law).strains(segment, np.array(pressures) * 1e-3)
            for law in ("trained", "analytic")
        }
        out[name] = {law: q.vector.tolist() for law, q in found.items()}
    return out


def centrelines():
    """{design: points (n, 3) in mm, every 5 mm or nearer}."""
    law = choose_law()
    return {
        name: predict(body, 1e-3 * kPa, law, 5.0).points.tolist() for name, (body, kPa) in DESIGNS.items()
    }


def held_out_figures():
    """{kind: {figure: number}} of the shipped law on the held-out designs, of those that there are."""
    from pneunet.base.files.dataset import read_dataset
    from pneunet.reduced.training.train import held_out_figures, samples_of

    found = held_out_figures(choose_law().kinds, samples_of(read_dataset(DATA_SET)))
    return {kind: {key: v for key, v in one.items() if np.isfinite(v)} for kind, one in found.items()}


def cell():
    """A unit cell at 20 kPa on a mesh of 3 mm that is kept (gmsh's differs from processor to processor):
    strains, volume (mm3) and stiffness (N, N mm, N mm2)."""
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.run import follow_path

    case = CellCase(CASES["one_sided_w10"](60.0, 1), 0.02, 3.0, levels=1, element="tetrahedra")
    state = follow_path(case, CellProblem(case.segment, CELL_MESH, contact=case.penalty))
    strains = state.strains.vector.tolist()
    return {"strains": strains, "volume_mm3": state.volume, "stiffness": state.stiffness.tolist()}


def body():
    """pneunet.hifi.verification.reference_case on two ranks."""
    from pneunet.hifi.verification import reference_case

    with tempfile.TemporaryDirectory() as folder:
        return reference_case.on_ranks(2, Path(folder) / "body.json")


def reduced_outputs():
    """What numpy and scipy alone compute."""
    return {
        "free strains": free_strains(),
        "centrelines": centrelines(),
        "held-out figures": held_out_figures(),
    }


def finite_element_outputs():
    """What finite elements compute."""
    return {"cell": cell(), "body on two ranks": body()}


def largest_difference(one, two):
    """Largest difference of two trees of numbers, relative to the largest number of each list."""
    if isinstance(one, dict):
        assert one.keys() == two.keys(), (sorted(one), sorted(two))
        return max(largest_difference(one[key], two[key]) for key in one)
    a, b = np.asarray(one, float), np.asarray(two, float)
    assert a.shape == b.shape, (a.shape, b.shape)
    return float(abs(a - b).max() / abs(a).max())


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(
        json.dumps(reduced_outputs() | finite_element_outputs(), default=float) + "\n"
    )
