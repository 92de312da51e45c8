"""`python -m benchmarks.silicone_table FOLDER`: the table of silicones from the tensile tests in FOLDER.

FOLDER holds raw tests of the Soft Robotics Materials Database, one CSV a silicone, pulled to failure. Writes
base/materials/data/silicones.toml and the rows in docs/materials.md.
"""

import re
import sys
from pathlib import Path

from benchmarks.tables import table
from pneunet.base.files.atomic import write_text
from pneunet.base.files.toml import toml_text
from pneunet.base.materials.fit_run import USUAL_STRAIN
from pneunet.base.materials.fitting import TensileData, fit
from pneunet.base.materials.laws import material_from_table, material_to_table
from pneunet.base.materials.silicones import TABLE
from pneunet.base.materials.tensile import read_tensile

PAGE = Path(__file__).resolve().parents[1] / "docs" / "materials.md"
#: how much worse the law with one parameter may fit than the one with three
SIMPLER = 1.1
HEAD = """\
# Made by `make silicones DATA=FOLDER` from raw tensile tests; do not edit.
# Contains information from the Soft Robotics Materials Database (L. Marechal et al. 2021,
# https://github.com/LucMarechal/Soft-Robotics-Materials-Database), which is made available under the Open
# Database License (ODbL) 1.0, https://opendatacommons.org/licenses/odbl/1-0/. So is this table.

"""


def fitted(path):
    """The [material] table of the silicone whose test is in a file: laws of I1 alone, as a test in one
    direction tells no more."""
    [specimen] = read_tensile(path)
    tests = TensileData([specimen], USUAL_STRAIN)
    plain, yeoh = (fit(law, tests) for law in ("neo-Hookean", "Yeoh"))
    chosen = plain if plain.error < SIMPLER * yeoh.error else yeoh
    material = material_to_table(chosen.material)
    del material["density_kg_per_m3"]  # not in the source: the default
    return material | {
        "elongation_at_break_percent": round(100 * (float(specimen.stretch[-1]) - 1)),
        "name": path.stem,
        "source": (
            f"{path.name} of the Soft Robotics Materials Database (Marechal et al. 2021, ODbL 1.0), fitted to"
            f" {100 * USUAL_STRAIN:.0f} % strain, off by {100 * chosen.error:.1f} %"
        ),
    }


def rows(materials):
    """Lines of the table in docs/materials.md."""
    found = []
    for name, keys in materials.items():
        material = material_from_table(keys, name)
        own = [f"{key} = {value:.4g}" for key, value in keys.items() if key.startswith(("c", "mu")) and value]
        error = re.search(r"off by ([\d.]+) %", material.source)[1]
        break_percent = keys["elongation_at_break_percent"]
        found.append((name, material.law, ", ".join(own), f"{material.mu:.4g}", error, break_percent))
    return table(("name", "law", "constants, MPa", "initial mu, MPa", "fit off by, %", "break, %"), found)


def main(folder):
    if not list(Path(folder).glob("*.csv")):
        sys.exit(f"{folder or 'DATA'}: no CSV files of tensile tests: make silicones DATA=FOLDER")
    materials = {path.stem: fitted(path) for path in sorted(Path(folder).glob("*.csv"))}
    quoted = {f'"{name}"': keys for name, keys in materials.items()}
    write_text(TABLE, HEAD + toml_text(quoted))
    text = "\n".join(rows(materials))
    write_text(PAGE, re.sub(r"^\| name \| .*?(?=\n\n)", lambda _: text, PAGE.read_text(), flags=re.M | re.S))
    print(text)


if __name__ == "__main__":
    main(sys.argv[1])
