"""Tensile tests are read in their units, columns only by what their names say, first loading up to break."""

from pathlib import Path

import pytest

from pneunet.base.errors import InputError
from pneunet.base.materials.fitting import TensileData, fit
from pneunet.base.materials.tensile import STRESS_UNITS, read_tensile

PEOPLE = Path(__file__).parents[1] / "data" / "people"


POINTS = [(0.1, 0.02), (0.2, 0.04), (0.4, 0.07), (0.6, 0.09), (0.8, 0.12), (1.0, 0.15)]


def write(path, text):
    path.write_text(text)
    return path


def mu(specimens):
    return fit("neo-Hookean", TensileData(specimens)).material.mu


@pytest.mark.parametrize(
    "name", ["decimal_comma", "units_in_second_row", "results_table_above", "load_and_unload_cycles"]
)
def test_files_of_people(name):
    """Made with mu = 0.1 MPa, to 200 % strain, where none of them broke."""
    [specimen] = read_tensile(PEOPLE / f"{name}.csv")
    assert mu([specimen]) == pytest.approx(0.1, rel=1e-3)
    assert specimen.stretch[-1] == pytest.approx(3.0) and not specimen.broke


def test_a_length_is_no_strain(tmp_path):
    path = PEOPLE / "elongation_in_mm.csv"
    with pytest.raises(InputError, match=r"'Elongation \(mm\)' is a length, not a strain: give --gauge"):
        read_tensile(path)
    assert mu(read_tensile(path, gauge_length=33.0)) == pytest.approx(0.1, rel=1e-3)
    strain = PEOPLE / "decimal_comma.csv"
    with pytest.raises(InputError, match="a gauge length is given, but no column of lengths"):
        read_tensile(strain, gauge_length=33.0)
    both = PEOPLE / "results_table_above.csv"
    assert mu(read_tensile(both, gauge_length=66.0)) > 0.15  # lengths count where a gauge length is given


@pytest.mark.parametrize(("name", "test"), [("compression", "compression"), ("simple_shear", "shear")])
def test_other_tests_are_refused(name, test):
    with pytest.raises(InputError, match=f"is of a test in {test}: only uniaxial tension is fitted"):
        read_tensile(PEOPLE / f"{name}.csv")


@pytest.mark.parametrize(
    "text",
    [
        "stretch,nominal_stress_MPa\n" + "".join(f"{1 + e},{s}\n" for e, s in POINTS),
        "strain_percent,stress_kPa\n" + "".join(f"{100 * e},{1e3 * s}\n" for e, s in POINTS),
        "a;b\nMaterial;x\n\nTime (s);True Strain;True Stress (MPa);Engineering Strain;Engineering Stress"
        " (MPa)\n" + "".join(f"{i};9;9;{e};{s}\n".replace(".", ",") for i, (e, s) in enumerate(POINTS)),
        "Strain (%)\tStress (N/mm2)\n"
        + "".join(f"{100 * e}\t{s}\n" for e, s in [*POINTS, (1.02, 0.03), (1.5, 0.0)]),
    ],
    ids=["stretch", "percent and kPa", "columns of a testing machine", "breaks"],
)
def test_files_are_read_in_their_units(tmp_path, text):
    [specimen] = read_tensile(write(tmp_path / "test.csv", text))
    assert specimen.stretch == pytest.approx([1 + e for e, _ in POINTS])
    assert specimen.stress == pytest.approx([s for _, s in POINTS])
    assert specimen.broke == text.endswith("\t0.0\n")


def test_specimens_beside_and_below_each_other(tmp_path):
    beside = "strain,stress_MPa,strain,stress_MPa\n" + "".join(f"{e},{s},{e},{2 * s}\n" for e, s in POINTS)
    below = "strain,stress_MPa\n" + "".join(f"{e},{f * s}\n" for f in (1, 2) for e, s in [(0, 0), *POINTS])
    for text in (beside, below):
        first, second = read_tensile(write(tmp_path / "test.csv", text))
        assert second.stress == pytest.approx(2 * first.stress) and len(first.stress) == len(POINTS)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file"),
        ("x,y\n1,2\n", "no header with a strain .* and a stress column"),
        ("strain,stress\n0.1,1\n", "'stress' names no unit of stress: .*--stress-unit MPa"),
        ("strain,stress_MPa\n0.1,one\n", "row 2: 'one' is not a finite number under 'stress_MPa'"),
        (
            "strain,stress_MPa\n" + "".join(f"{100 * e},{s}\n" for e, s in POINTS),
            "reaches 100: if these are percent",
        ),
        ("strain,stress_MPa\n0.1,1\n0.2,2\n", "fewer than 5 points"),
        ("strain,stress_MPa\n-0.1,-1\n-0.2,-2\n", "'strain' is nowhere above 0: only tension"),
        (
            "Elongation,stress_MPa\n0.1,1\n",
            "'Elongation' names no unit: write strain_percent, or elongation_mm",
        ),
        ("strain,Load (N)\n0.1,1\n", "no header with a strain"),
        ("Biaxial strain,stress_MPa\n0.1,1\n", "test in biaxial tension"),
        ("strain,stress (bananas)\n0.1,1\n", "names no unit of stress: .* known are MPa, .*kgf/cm2, .*ksi"),
        ("strain,stress_MPa,stress_MPa\n0.1,1,1\n", "two columns 'stress_MPa' for one strain"),
        ("0.1,1\n0.2,2\n", "no header with a strain"),
    ],
)
def test_files_that_are_unclear_are_refused(tmp_path, text, message):
    path = tmp_path / "test.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        read_tensile(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "header",
    [
        "Strain {%},Mean stress {MPa},Std of stress {MPa}",
        "strain {per cent},stress {MPa} mean,stress {MPa} sd",
        "Elongation [%],Stress / MPa,Stress error / MPa",
        "elongation_percent,stress_N_per_mm2,stress_N_per_mm2_max",
        "Strain (%),Stress in N / mm²,Lower limit of stress in MPa",
        "Tensile strain (Displacement) (%),Tensile stress (MPa),Tensile strain at break (%)",
    ],
)
def test_a_column_is_used_only_if_its_name_says_what_it_is(tmp_path, header):
    lines = "".join(f"{100 * e},{s},9\n" for e, s in POINTS)
    for opening, closing in ("()", "[]", (" ", " ")):
        text = header.replace("{", opening).replace("}", closing) + "\n" + lines
        [specimen] = read_tensile(write(tmp_path / "test.csv", text))
        assert specimen.stretch == pytest.approx([1 + e for e, _ in POINTS])
        assert specimen.stress == pytest.approx([s for _, s in POINTS])


@pytest.mark.parametrize(
    ("unit", "newton_per_mm2"),
    [("kgf/cm2", 0.0980665), ("kgf/cm²", 0.0980665), ("N/mm^2", 1), ("ksi", 6.894757), ("PSI", 0.006894757)],
)
def test_units_of_stress(tmp_path, unit, newton_per_mm2):
    lines = "".join(f"{s / newton_per_mm2},{e}\n" for e, s in POINTS)  # and the stress may stand first
    for text, given in (
        (f"stress ({unit}),strain\n", None),
        (f"stress,strain\n[{unit}],[-]\n", None),
        ("stress,strain\n", unit),
    ):
        [specimen] = read_tensile(write(tmp_path / "test.csv", text + lines), given)
        assert specimen.stress == pytest.approx([s for _, s in POINTS], rel=1e-6)
    assert set(STRESS_UNITS) >= {"MPa", "kPa", "Pa", "psi", "ksi", "kgf/cm2", "N/mm2"}


def test_cycles_are_one_strip_of_which_first_loading_is_used(tmp_path):
    """Softer reloading changes nothing; after a break or a jump back comes another strip."""
    up = [(0.1 * i, 0.1 * i) for i in range(11)]
    down = [(e, 0.7 * s) for e, s in up[:-1]][::-1]
    again = [(e, 0.8 * s) for e, s in up] + [(1.5, 1.5), (2.0, 2.0)]
    fall = [(2.0, 0.0), (1.0, 0.0), (0.0, 0.0)]
    for points, strips in (
        (up + down + again, [(12, 2.0, False)]),
        (up + down + again + fall, [(12, 2.0, True)]),
        (up + down + again + fall + up, [(12, 2.0, True), (10, 1.0, False)]),
        (up + up, [(10, 1.0, False)] * 2),
    ):
        text = "strain,stress_MPa\n" + "".join(f"{e},{s}\n" for e, s in points)
        found = read_tensile(write(tmp_path / "test.csv", text))
        assert [(len(s.stress), round(s.stretch[-1] - 1, 9), s.broke) for s in found] == strips
        assert all(s.stress == pytest.approx(s.stretch - 1) for s in found)
