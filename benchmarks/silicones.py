"""How well the law knows real silicones: unit cells of Yeoh laws fitted to tensile tests, computed on the
coarse grid of the campaign, against the law, which learned from made-up ones.

What finer grids change is added to the cells as the law has learned it, so that both are of the same body.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.tables import table

ROOT = Path(__file__).resolve().parent.parent
CAMPAIGN = ROOT / "examples" / "campaigns" / "cells-v2.toml"
#: of the table: the softest, a middle one, the two that stiffen most, and one with a third constant
SILICONES = ("Ecoflex 00-30", "Mold Star 16 FAST", "Dragon Skin 10 MEDIUM", "WAGNERSIL 20 NF", "RTV615")
DESIGNS = (("one_sided_w10", 60.0), ("one_sided_w10", 90.0), ("twist_w12", 60.0))
LEVELS = (0.05, 0.1, 0.15, 0.2)  # P/mu


def free_strains(segment, grid):
    """(levels, 6) free strains (e, k normal pitch) of FE at LEVELS on a Mesh of hifi.runs.campaign.file."""
    from pneunet.geometry.cad.grid import grid_cell
    from pneunet.geometry.shape_numbers import normal_pitch
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.run import follow_path
    from pneunet.hifi.contact.penalty import WallPenalty
    from pneunet.hifi.runs.campaign.sample import typical

    states, like = [], typical(segment.kind)
    case = CellCase(segment, LEVELS[-1] * segment.material.mu, grid.mesh_size, len(LEVELS))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.npz"
        grid_cell(segment, grid.mesh_size, path, grid.edge_size, like=like)
        follow_path(case, CellProblem(segment, path, contact=WallPenalty()), states.append)
    scale, loaded = normal_pitch(segment), [s for s in states if s.pressure > 0]
    return np.array([[*s.strains.e, *(s.strains.k * scale)] for s in loaded])


def silicones():
    """The part `silicones`."""
    from pneunet.base.materials.laws import silicone
    from pneunet.geometry.reference_cases import CASES
    from pneunet.geometry.shape_numbers import numbers_of
    from pneunet.hifi.runs.campaign.file import read_campaign
    from pneunet.reduced import read_law
    from pneunet.reduced.choice import SHIPPED

    rows, laws, grid = [], read_law(SHIPPED).kinds, read_campaign(CAMPAIGN).meshes[0]
    for name, angle in DESIGNS:
        for material in map(silicone, SILICONES):
            segment = replace(CASES[name](angle, 1), material=material)
            law, numbers = laws[segment.kind], np.repeat(numbers_of([segment])[0], len(LEVELS), axis=0)
            pressure, real = law.mesh.converged(numbers, np.array(LEVELS), free_strains(segment, grid))
            missed = law.free_strains(numbers, pressure) - real
            error = np.linalg.norm(missed, axis=1) / np.linalg.norm(real - np.eye(6)[0], axis=1)
            rows.append(
                {"design": f"{name}, {angle:g} deg", "silicone": material.name, "error": error.tolist()}
            )
            print("  ", rows[-1], flush=True)
    worst = np.max([r["error"] for r in rows], axis=0)
    figures = {
        "law_real_silicone_strain_rel_01": worst[LEVELS.index(0.1)],
        "law_real_silicone_strain_rel_02": worst[LEVELS.index(0.2)],
    }
    return {key: float(value) for key, value in figures.items()}, {"levels": LEVELS, "rows": rows}


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
        "The law knows a silicone by its initial modulus and by how it stiffens. The table has how far it is"
        " off for real ones (Yeoh laws fitted to tensile tests of the Soft Robotics Materials Database,"
        " Marechal et al. 2021, ODbL): the norm of the difference of (e, k l) from that of unit cells over"
        " the norm of the free strains. The cells are computed on the coarse grid of the data set; what"
        " finer grids change is added as the law has learned it."
    )
    return ["## Other materials", "", text, "", *table(head, rows), ""]
