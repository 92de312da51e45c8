"""Laws come back from tests made with them, and doubtful fits say so."""

import math

import numpy as np
import pytest

from pneunet.base.errors import InputError
from pneunet.base.files.toml import read_toml
from pneunet.base.materials.fit_run import run_fit
from pneunet.base.materials.fitting import TensileData, fit
from pneunet.base.materials.hyperelastic import nominal_stress
from pneunet.base.materials.laws import LAWS, Gent, MooneyRivlin, NeoHookean, Ogden, Yeoh, material_from_table
from pneunet.base.materials.tensile import Specimen
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


def write(path, specimen):
    lines = "".join(f"{x},{y}\n" for x, y in zip(specimen.stretch, specimen.stress))
    path.write_text("stretch,stress_MPa\n" + lines)
    return path


def test_all_laws_are_compared_and_the_best_can_be_pasted(tmp_path, caplog):
    pytest.importorskip("matplotlib")
    caplog.set_level("INFO", "pneunet")
    path = write(tmp_path / "my test.csv", measured(Gent(0.15, 25.0), 4.0))
    chosen = run_fit(path, directory=tmp_path / "fit", largest_strain=5.0)
    assert chosen.material.law == "Gent"
    [table] = read_toml(tmp_path / "fit" / "material.toml").values()
    assert material_from_table(table, "file") == chosen.material
    assert chosen.material.name == "my test"
    told = "\n".join(caplog.messages)
    assert all(law in told for law in LAWS) and "uniaxial data alone" in told
    assert "fitted to 300 % strain; break not seen, at least 300 %" in told
    assert (tmp_path / "fit" / "fit.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("largest_strain", [None, math.inf])
def test_the_strains_that_pneu_nets_see_are_fitted_unless_others_are_given(tmp_path, caplog, largest_strain):
    pytest.importorskip("matplotlib")
    caplog.set_level("INFO", "pneunet")
    path = write(tmp_path / "test.csv", measured(Gent(0.15, 25.0), 4.0, points=299))
    usual = run_fit(path, "neo-Hookean", tmp_path / "fit", largest_strain=largest_strain)
    assert "fitted to 150 % strain, what pneu-nets see (--to-strain-percent for another range)" in caplog.text
    own = run_fit(path, "neo-Hookean", tmp_path / "fit", largest_strain=0.5)
    assert "fitted to 50 % strain; break" in caplog.text
    assert own.material.mu < usual.material.mu  # less stiffening in it


def test_a_break_is_written_only_where_it_is_seen(tmp_path):
    pytest.importorskip("matplotlib")
    path = write(tmp_path / "test.csv", measured(NeoHookean(0.1), 2.0))
    for line, elongation in (("", math.inf), ("2.01,0.001\n", 1.0)):
        path.write_text(path.read_text() + line)
        material = run_fit(path, "neo-Hookean", tmp_path / "fit").material
        assert material.elongation_at_break == pytest.approx(elongation)
        written = read_toml(tmp_path / "fit" / "material.toml")["material"]
        assert ("elongation_at_break_percent" in written) == bool(line)


def test_a_law_with_more_parameters_is_not_chosen_for_its_fit_of_rounded_numbers(tmp_path):
    pytest.importorskip("matplotlib")
    specimen = measured(NeoHookean(0.1), 2.5, points=12)
    rounded = Specimen(specimen.stretch, specimen.stress.round(4), False)
    material = run_fit(write(tmp_path / "test.csv", rounded), directory=tmp_path / "fit").material
    assert material.law == "neo-Hookean" and material.mu == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize("law", ["all", "Gent"])
def test_no_usable_law_is_said_in_one_line_and_leaves_nothing(tmp_path, law):
    wrong_unit = measured(NeoHookean(100.0), 2.5)
    wrong_unit = Specimen(wrong_unit.stretch, 1e3 * wrong_unit.stress, False)
    with pytest.raises(InputError, match=r"test.csv: no usable law comes out \(.*is it in kPa") as error:
        run_fit(write(tmp_path / "test.csv", wrong_unit), law, tmp_path / "fit")
    assert "\n" not in str(error.value) and not (tmp_path / "fit").exists()


def test_a_law_that_has_locked_is_no_obstacle(tmp_path, caplog):
    pytest.importorskip("matplotlib")
    path = write(tmp_path / "test.csv", measured(Gent(0.1, 3.0), 2.25))
    assert run_fit(path, "Gent", tmp_path / "fit").material.jm == pytest.approx(3.0, rel=0.01)
    assert "predict " in caplog.text
