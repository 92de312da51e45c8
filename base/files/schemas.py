"""Columns of the tables that a run writes, for what writes them and what reads them; and a reader of any of
them, known columns or not."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import read_csv

#: of rows in which parts of the body run into each other without a contact model: 0 or 1
MARKS = ("walls_overlap", "body_overlap")
POINT = ("x_mm", "y_mm", "z_mm")
STRAINS = ("e1", "e2", "e3", "k1_rad_per_mm", "k2_per_mm", "k3_per_mm")
#: numbers of the strains that no choice of the section's frame changes
INVARIANTS = ("k_norm_per_mm", "k_dot_e_per_mm")

#: centreline.csv of a design, centrelines.csv of its shapes; target.csv has POINT
CENTRELINE = ("s_mm", *POINT)
SHAPES = ("pressure_kPa", *CENTRELINE)

#: steps.csv, centrelines.csv, segments.csv and walls.csv of a solve
STEPS = (
    *"step pressure_kPa iterations factorisations volume_mm3 tip_x_mm tip_y_mm tip_z_mm".split(),
    *("smallest_wall_distance_mm", MARKS[0], "body_distance_mm", MARKS[1], "contact_force_N"),
    *"largest_stretch unstable_directions dead_load_fraction stability_factorisations seconds".split(),
)
CENTRELINES = ("step", "pressure_kPa", *CENTRELINE, *MARKS)
SEGMENTS = ("step", "pressure_kPa", "segment", *STRAINS, *MARKS)
WALLS = ("segment", "side", "gap", "gap_mm", "distance_mm")

#: of a solve's fields: the files of its steps, and the stretch of the elements around a node
STEP_FILES, MEAN_STRETCH = "step_*.vtu", "mean_stretch"

#: cell.csv
CELL = (
    *("pressure_kPa", "volume_mm3", *STRAINS, *INVARIANTS),
    *"force1_N force2_N force3_N moment1_N_mm moment2_N_mm moment3_N_mm".split(),
    *"unstable_directions largest_stretch wall_distance_mm walls_overlap contact_force_N".split(),
    *"contact_area_mm2 contact_nearest_mm contact_farthest_mm contact_gamma".split(),
    *(f"K{i}{j}" for i in range(1, 7) for j in range(1, 7)),
    *(f"kirchhoff{i}{j}" for i in range(1, 5) for j in range(1, 5)),
)

#: study.csv: the case before, its ending after its variables and levels
CASE = ("case",)
ENDING = ("status", "reason", "case_seconds", "case_memory_MB")
#: columns of words, whatever these look like
WORDS = {"case", "side", "warnings", "status", "reason"}


def step_file(number: int) -> str:
    """The name of a step's file, one of STEP_FILES."""
    return STEP_FILES.replace("*", f"{number:04d}")


def read_table(path: str | Path, numbers: Sequence[str] = ()) -> np.ndarray:
    """A CSV table as a structured array (n,), its fields named as the columns, units included.

    A column with words in it is text, any other one float, with nan where a cell is empty or a row ends
    early. InputError when the file cannot be read, or when one of the columns `numbers` is missing or holds
    words.
    """
    header, rows = read_csv(path)
    if "" in header or len(set(header)) < len(header):
        raise InputError(f"{path}: two columns have the same name, or one has none: make the file again")
    for name in numbers:
        if name not in header:
            raise InputError(f"{path}: column '{name}' is missing")
    columns = {name: [row[i] if i < len(row) else "" for row in rows] for i, name in enumerate(header)}
    fields = {}
    for name, cells in columns.items():
        try:
            fields[name] = np.array(cells if name in WORDS else [float(cell or "nan") for cell in cells])
        except ValueError:
            if name in numbers:
                raise InputError(f"{path}: column '{name}' holds words: make the file again") from None
            fields[name] = np.array(cells)
    table = np.empty(len(rows), [(name, column.dtype) for name, column in fields.items()])
    for name, column in fields.items():
        table[name] = column
    return table
