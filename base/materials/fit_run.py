"""`pneunet fit-material`: from a tensile test to a [material] table, a picture and a word on how far to trust
it."""

import logging
from math import inf, isfinite
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.atomic import write_text
from pneunet.base.files.folder import output_folder
from pneunet.base.files.toml import toml_text
from pneunet.base.materials.fitting import Fit, TensileData, biaxial_spread, fit
from pneunet.base.materials.hyperelastic import nominal_stress
from pneunet.base.materials.laws import LAWS, Hyperelastic, material_to_table
from pneunet.base.materials.tensile import Specimen, read_tensile
from pneunet.base.pictures.rendering import figure, save
from pneunet.base.progress import progress
from pneunet.base.units import KPA_PER_MPA

log = logging.getLogger(__name__)

#: engineering strain that walls of pneu-nets seldom pass
USUAL_STRAIN = 1.5
#: no test tells fits with smaller errors (relative) apart
RESOLVED = 1e-3
#: laws that fit worse than this (relative) have no say in how uncertain the equibiaxial response is
CREDIBLE = 0.1


def run_fit(
    path: str | Path,
    law: str = "all",
    directory: str | Path | None = None,
    stress_unit: str | None = None,
    largest_strain: float | None = None,
    gauge_length: float | None = None,
) -> Fit:
    """Fit `law` (a name of base.materials.laws.LAWS, any case, or "all") to the tests in `path`; returns the
    chosen Fit.

    Writes material.toml and fit.png to `directory` (default out/fit-STEM). largest_strain: fit no further
    than this engineering strain; None or inf: USUAL_STRAIN. gauge_length: mm, for elongations in mm. With
    "all" the least error without instability is chosen.
    """
    path = Path(path)
    with output_folder(directory or Path("out") / f"fit-{path.stem}") as folder:
        return _fit(path, law, folder, stress_unit, largest_strain, gauge_length)


def _fit(path, law, directory, stress_unit, largest_strain, gauge_length):
    """The chosen Fit of `run_fit`."""
    names = {name.lower(): name for name in LAWS}
    if law.lower() not in (*names, "all"):
        raise InputError(f"--law {law}: known laws are {', '.join(LAWS)}, or all")
    choice = ""
    if largest_strain is None or not isfinite(largest_strain):
        largest_strain = USUAL_STRAIN
        choice = ", what pneu-nets see (--to-strain-percent for another range)"
    specimens = read_tensile(path, stress_unit, gauge_length)
    with located(path):
        tests = TensileData(specimens, largest_strain)
    elongation = min((float(s.stretch[-1]) - 1 for s in specimens if s.broke), default=inf)
    reached = max(float(s.stretch[-1]) for s in specimens) - 1
    common = {
        "elongation_at_break": elongation,
        "name": path.stem,
        "source": f"pneunet fit-material {path.name}: uniaxial to stretch {tests.largest:.3g}",
    }
    fits, refused = {}, {}
    log.info(f"{path.name}: fitting {', '.join(LAWS)}")
    for name in progress(LAWS, "laws"):
        try:
            fits[name] = fit(name, tests, **common)
        except InputError as error:
            refused[name] = error
    wanted = list(LAWS) if law.lower() == "all" else [names[law.lower()]]
    shown = [fits[name] for name in wanted if name in fits]
    if not shown:
        raise InputError(f"{path}: no usable law comes out ({refused[wanted[0]]})")
    chosen = best(shown)
    write_text(directory / "material.toml", toml_text({"material": material_to_table(chosen.material)}))
    credible = [f for f in fits.values() if f is chosen or f.error < CREDIBLE]
    stretch = min(2.0, tests.largest)
    low, high = biaxial_spread(credible, stretch)
    draw(directory / "fit.png", path.stem, specimens, tests, shown, chosen, credible)
    count = f"{len(specimens)} specimen{'s' * (len(specimens) > 1)}"
    seen = "at" if isfinite(elongation) else "not seen, at least"
    log.info(
        f"{path.name}: {count}, fitted to {100 * (tests.largest - 1):.0f} % strain{choice};"
        f" break {seen} {100 * min(elongation, reached):.0f} %"
    )
    for f in shown:
        log.info(
            f"{'-> ' if f is chosen else '   '}{f.material.law:14s} error {100 * f.error:5.1f} %  "
            f" {parameters(f.material)}"
        )
    for warning in chosen.warnings:
        log.warning("warning: %s", warning)
    log.warning(
        f"warning: uniaxial data alone: at equibiaxial stretch {stretch:.2g} the {len(credible)} laws that"
        f" fit predict {low:.4g}..{high:.4g} MPa"
    )
    log.info(f"written: {directory / 'material.toml'}, fit.png")
    return chosen


def best(fits: list[Fit]) -> Fit:
    """Least error among fits that are stable and likely in equibiaxial tension, among all if there is none;
    the first of those that a test cannot tell apart."""
    stable = [f for f in fits if not any(w.startswith(("unstable", "unlikely")) for w in f.warnings)]
    return min(stable or fits, key=lambda f: max(f.error, RESOLVED))


def parameters(material: Hyperelastic) -> str:
    """The law's own parameters in file units, in one line."""
    table = material_to_table(material)
    own = list(table.items())[1 : 1 + len(material.parameters)]
    return ", ".join(f"{key} = {value:.4g}" for key, value in own if value)


def draw(
    path: Path,
    title: str,
    specimens: list[Specimen],
    tests: TensileData,
    shown: list[Fit],
    chosen: Fit,
    credible: list[Fit],
) -> None:
    """Data and fits, residuals, and what the laws say of equibiaxial tension; nominal stress against
    stretch."""
    sheet = figure(11, 5.2, "constrained")
    grid = sheet.add_gridspec(2, 2, height_ratios=(3, 1))
    fitted, residual, biaxial = (
        sheet.add_subplot(grid[0, 0]),
        sheet.add_subplot(grid[1, 0]),
        sheet.add_subplot(grid[:, 1]),
    )
    for s in specimens:
        near = s.stretch <= 1 + 1.15 * (tests.largest - 1)
        fitted.plot(s.stretch[near], s.stress[near], ".", color="0.6", markersize=3)
    fitted.plot([], [], ".", color="0.6", label="test")

    def style(f):
        i = list(LAWS).index(f.material.law)
        # dashed in turn: a law may hide another that it contains
        return {
            "color": f"C{i}",
            "linewidth": 2.2 if f is chosen else 1.3,
            "linestyle": "-" if i % 2 == 0 else (i, (4, 3)),
        }

    l = np.linspace(1.0, tests.largest, 300)
    for f in shown:
        label = f"{f.material.law}, {100 * f.error:.1f} %"
        fitted.plot(l, nominal_stress(f.material, "uniaxial", l), label=label, **style(f))
    for f in (f for f in shown if f in credible):
        for s in specimens:
            use = s.stretch <= tests.largest
            off = nominal_stress(f.material, "uniaxial", s.stretch[use]) - s.stress[use]
            residual.plot(s.stretch[use], KPA_PER_MPA * off, **style(f))
    residual.axhline(0, color="0.3", linewidth=0.6)
    l = np.linspace(1.0, min(tests.largest, 3.0), 200)
    for f in credible:
        biaxial.plot(l, nominal_stress(f.material, "equibiaxial", l), label=f.material.law, **style(f))
    biaxial.set_ylim(0, 2 * np.nanmax(nominal_stress(chosen.material, "equibiaxial", l[: int(0.9 * len(l))])))
    fitted.set(title=f"{title}: uniaxial test and fit", ylabel="nominal stress, MPa", ylim=(0, None))
    residual.set(xlabel="stretch", ylabel="law - test, kPa", xlim=fitted.get_xlim())
    biaxial.set(
        title="equibiaxial tension, not tested: what the laws say",
        xlabel="stretch",
        ylabel="nominal stress, MPa",
    )
    fitted.legend(title="law, relative RMS error")
    biaxial.legend()
    save(sheet, path, 130)
