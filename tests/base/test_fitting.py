"""Laws come back from tests made with them, files are read in their units, and doubtful fits say so."""

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.toml import read_toml
from pneunet.base.materials.fit_run import run_fit
from pneunet.base.materials.fitting import TensileData, fit
from pneunet.base.materials.hyperelastic import nominal_stress
from pneunet.base.materials.laws import LAWS, Gent, MooneyRivlin, NeoHookean, Ogden, Yeoh, material_from_table
from pneunet.base.materials.tensile import Specimen, read_tensile
from tests.toy_law import Demiray


def measured(material, largest=3.0, noise=0.0, points=150):
    l = np.linspace(1.02, largest, points)
    factor = 1 + noise * np.random.default_rng(0).normal(size=points)
    return Specimen(l, nominal_stress(material, "uniaxial", l) * factor, True)


@pytest.mark.parametrize(
    "material",
    [
        NeoHookean(0.2),
        MooneyRivlin(0.08, 0.05),
        Yeoh(0.06, -4e-4, 9e-5),
        Gent(0.15, 25.0),
        Ogden(0.1, 3.2),
        Ogden(0.2, 1.5, 0.003, 6.0),
    ],
    ids=lambda m: m.law,
)
def test_parameters_come_back_through_noise(material):
    exact, noisy = (
        fit(material.law, TensileData([measured(material, noise=n)])).material for n in (0.0, 0.01)
    )
    own = [getattr(material, name) for name in material.parameters]
    assert [getattr(exact, name) for name in material.parameters] == pytest.approx(own, rel=2e-3, abs=1e-6)
    assert noisy.mu == pytest.approx(material.mu, rel=0.03)
    l = np.linspace(1.1, 3, 20)
    assert nominal_stress(noisy, "uniaxial", l) == pytest.approx(
        nominal_stress(material, "uniaxial", l), rel=0.02
    )


def test_a_new_law_is_fitted_too(monkeypatch):
    material = Demiray(0.2, 0.08)
    monkeypatch.setitem(LAWS, material.law, Demiray)
    found = fit(material.law, TensileData([measured(material)])).material
    assert (found.mu, found.b) == pytest.approx((0.2, 0.08), rel=1e-3)


def warnings(law, *specimens, **options):
    return " | ".join(fit(law, TensileData(specimens, **options)).warnings)


def test_doubtful_fits_say_so():
    stiffening = measured(Gent(0.1, 12.0), 3.4)
    assert warnings("Gent", stiffening) == ""
    told = warnings("neo-Hookean", stiffening)
    assert "does not have the curve's shape" in told and "too stiff" in told
    assert "reaches only 15 % strain" in warnings("neo-Hookean", measured(NeoHookean(0.2), 1.15))
    assert "reaches only 14 % strain" in warnings(
        "neo-Hookean", measured(NeoHookean(0.2)), largest_strain=0.15
    )
    assert "c01 came out at its bound 0" in warnings("Mooney-Rivlin", measured(NeoHookean(0.2)))
    assert "jm came out at its bound" in warnings("Gent", measured(NeoHookean(0.2)))
    assert "unlikely in equibiaxial" in warnings("Mooney-Rivlin", measured(MooneyRivlin(0.001, 0.2)))
    l = np.linspace(1.02, 3.0, 100)
    softening = Specimen(l, 0.3 * (l - 1) / (1 + 0.8 * (l - 1) ** 2), True)
    assert "unstable in equibiaxial" in warnings("Yeoh", softening)


def write(path, text):
    path.write_text(text)
    return path


POINTS = [(0.1, 0.02), (0.2, 0.04), (0.4, 0.07), (0.6, 0.09), (0.8, 0.12), (1.0, 0.15)]


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
        ("strain,stress_MPa\n0.1,one\n", "'one' is not a number"),
        (
            "strain,stress_MPa\n" + "".join(f"{100 * e},{s}\n" for e, s in POINTS),
            "reaches 100: if these are percent",
        ),
        ("strain,stress_MPa\n0.1,1\n0.2,2\n", "fewer than 5 points"),
    ],
)
def test_files_that_are_unclear_are_refused(tmp_path, text, message):
    path = tmp_path / "test.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        read_tensile(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_all_laws_are_compared_and_the_best_can_be_pasted(tmp_path, caplog):
    caplog.set_level("INFO", "pneunet")
    pytest.importorskip("matplotlib")
    specimen = measured(Gent(0.15, 25.0), 4.0)
    lines = "".join(f"{x},{y}\n" for x, y in zip(specimen.stretch, specimen.stress))
    path = write(tmp_path / "my test.csv", "stretch,stress_MPa\n" + lines)
    chosen = run_fit(path, directory=tmp_path / "fit")
    assert chosen.material.law == "Gent"
    [table] = read_toml(tmp_path / "fit" / "material.toml").values()
    assert material_from_table(table, "file") == chosen.material
    assert chosen.material.break_stretch == pytest.approx(4.0) and chosen.material.name == "my test"
    told = "\n".join(caplog.messages)
    assert (
        all(law in told for law in LAWS) and "uniaxial data alone" in told and "no fall of the stress" in told
    )
    assert (tmp_path / "fit" / "fit.png").read_bytes().startswith(b"\x89PNG")
