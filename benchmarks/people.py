"""Files as people bring them (tests/data/people) with the right answer of each: the part `people`."""

import logging
import tempfile
from pathlib import Path

from pneunet.base.errors import InputError

PEOPLE = Path(__file__).resolve().parents[1] / "tests" / "data" / "people"
#: rows of a curve's file, and (roll, length) of the bending pieces that it is made of, where that is known
CURVES = {
    "byte_order_mark_bare": (4, None),
    "semicolon": (5, [(0, 150)]),
    "five_markers_on_an_arc": (5, [(0, 150)]),
    "noisy_arc": (200, [(0, 150)]),
    "s_curve_in_a_plane": (61, [(0, 75), (180, 75)]),
}
#: what a test that is not of tension, or a length without its gauge length, is told
REFUSALS = {"compression": "compress", "simple_shear": "shear", "elongation_in_mm": "--gauge-length-mm"}
TENSILE = ("decimal_comma", "units_in_second_row", "results_table_above", "load_and_unload_cycles")
ITSELF = "runs through itself"


def _tensile(name):
    """mu = 0.1 MPa, and no break where none was seen."""
    from pneunet.base.materials.fitting import TensileData, fit
    from pneunet.base.materials.tensile import read_tensile

    specimens = read_tensile(PEOPLE / f"{name}.csv")
    mu = fit("neo-Hookean", TensileData(specimens, 1.5)).material.mu
    return abs(mu - 0.1) < 2e-3 and not any(s.broke for s in specimens)


def _refused(name, told):
    from pneunet.base.materials.tensile import read_tensile

    try:
        read_tensile(PEOPLE / f"{name}.csv")
    except InputError as error:
        return told in str(error)
    return False


def _curve(name, points, wanted):
    """Read, and split into what it is made of, to 1 mm of length and 1 % of curvature."""
    from pneunet.design.segmentation.segment import segment
    from pneunet.design.target.file import read_target

    target = read_target(PEOPLE / f"{name}.csv")
    right = len(target.points) == points
    if wanted is not None:
        pieces = segment(target).pieces
        right &= [(p.kind, p.roll) for p in pieces] == [("bending", roll) for roll, _ in wanted]
        right &= all(abs(p.length - length) < 1 for p, (_, length) in zip(pieces, wanted))
        right &= all(abs(p.curvature - 1 / 60) < 0.01 / 60 for p in pieces)
    return right


def _flat_circles():
    from pneunet import inverse_design

    return any(ITSELF in text for text in inverse_design(PEOPLE / "one_and_a_half_flat_circles.csv").doubts)


def _coil():
    from pneunet import Design

    return any(ITSELF in text for text in Design.read(PEOPLE / "coil_through_itself.toml").doubts)


def _paper_layer():
    """Curvature near that of a layer with mu = 1000 MPa."""
    from pneunet.hifi.cell.file import read_cell
    from pneunet.hifi.cell.run import solve_cell

    states = []
    with tempfile.TemporaryDirectory() as folder:
        case = read_cell(PEOPLE / "stiff_paper_layer.cell.toml")
        solve_cell(case, Path(folder) / "cell.npz", states.append)
    return abs(abs(states[-1].strains.k[1]) - 0.0164) < 3e-4


def people():
    """The part `people`: the share of files whose answer is right."""
    logging.disable(logging.WARNING)
    checks = {name: (_tensile, name) for name in TENSILE}
    checks |= {name: (_refused, name, told) for name, told in REFUSALS.items()}
    checks |= {name: (_curve, name, *known) for name, known in CURVES.items()}
    checks |= {"one_and_a_half_flat_circles": (_flat_circles,), "coil_through_itself": (_coil,)}
    checks |= {"stiff_paper_layer": (_paper_layer,)}
    right = {}
    for name, (check, *arguments) in checks.items():
        try:
            right[name] = bool(check(*arguments))
        except InputError as error:
            right[name] = False
            print("  ", error, flush=True)
        print("  ", name, right[name], flush=True)
    return {"people_files_right": sum(right.values()) / len(right)}, {"right": right}
