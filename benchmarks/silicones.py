"""What real silicones change: unit cells of Yeoh laws fitted to tensile tests against neo-Hookean ones of the
same initial modulus.

The trained law knows the neo-Hookean material alone; for any other it takes the initial modulus. Both sides
are finite elements on one mesh, so that the material is all that differs.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.tables import table

#: of the table: the softest, a middle one, and the one that stiffens most of five tried
SILICONES = ("Ecoflex 00-30", "Mold Star 16 FAST", "Dragon Skin 10 MEDIUM")
DESIGNS = (("one_sided_w10", 60.0), ("one_sided_w10", 90.0), ("twist_w12", 60.0))
MESH_SIZE = 2.0
LEVELS = (0.05, 0.1, 0.15, 0.2)  # P/mu


def free_strains(segment):
    """(levels, 6) free strains (e, k normal pitch) of FE at LEVELS."""
    from pneunet.geometry.shape_numbers import normal_pitch
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.run import solve_cell

    states = []
    with tempfile.TemporaryDirectory() as folder:
        solve_cell(
            CellCase(segment, LEVELS[-1] * segment.material.mu, MESH_SIZE, len(LEVELS)),
            Path(folder) / "cell.npz",
            states.append,
        )
    scale, loaded = normal_pitch(segment), [s for s in states if s.pressure > 0]
    return np.array([[*s.strains.e, *(s.strains.k * scale)] for s in loaded])


def silicones():
    """The part `silicones`."""
    from pneunet.base.materials.laws import NeoHookean, silicone
    from pneunet.geometry.reference_cases import CASES

    rows = []
    for name, angle in DESIGNS:
        segment = CASES[name](angle, 1)
        plain = free_strains(replace(segment, material=NeoHookean(mu=0.1)))
        for material in map(silicone, SILICONES):
            real = free_strains(replace(segment, material=material))
            error = np.linalg.norm(real - plain, axis=1) / np.linalg.norm(plain - np.eye(6)[0], axis=1)
            rows.append(
                {"design": f"{name}, {angle:g} deg", "silicone": material.name, "error": error.tolist()}
            )
            print("  ", rows[-1], flush=True)
    worst = np.max([r["error"] for r in rows], axis=0)
    figures = {
        "law_real_silicone_strain_rel_01": worst[LEVELS.index(0.1)],
        "law_real_silicone_strain_rel_02": worst[LEVELS.index(0.2)],
    }
    return {key: float(value) for key, value in figures.items()}, {
        "mesh_size_mm": MESH_SIZE,
        "levels": LEVELS,
        "rows": rows,
    }


def table_of_silicones():
    """The part `silicone-table`: how many rows have the file of a test as their source."""
    from pneunet.base.materials.silicones import measured_silicones

    named = [".csv of the Soft Robotics" in keys["source"] for keys in measured_silicones().values()]
    return {"silicones_from_tests": sum(named)}


def lines(details):
    """Lines of docs/rod-law.md."""
    head = ["design", "silicone", *[f"P/mu = {p:g}" for p in details["levels"]]]
    rows = [(r["design"], r["silicone"], *[f"{e:.1%}" for e in r["error"]]) for r in details["rows"]]
    text = (
        "The law takes the initial modulus of a material. The table has what that costs: free strains of unit"
        " cells of real silicones (Yeoh laws fitted to tensile tests of the Soft Robotics Materials Database,"
        " Marechal et al. 2021, ODbL) against neo-Hookean cells of the same initial modulus. It is the norm"
        " of the difference of (e, k l) over the norm of the free strains, finite elements on both sides,"
        f" h = {details['mesh_size_mm']:g} mm."
    )
    return ["## Other materials", "", text, "", *table(head, rows), ""]
