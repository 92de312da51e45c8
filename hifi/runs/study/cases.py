"""What a study computes: the functions that hifi.runs.cases runs in a process of their own, one for each kind
of body.

Both leave levels.csv in the case's folder, a row for each pressure level as it is reached, so that a case
that is ended half way keeps what it had; and the cell.toml or design.toml with which the single case is run
by hand.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.files.atomic import write_csv, write_text
from pneunet.base.files.schemas import INVARIANTS, MARKS, STRAINS
from pneunet.base.files.toml import toml_text
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.designfile import design_from_tables, write_design_file
from pneunet.geometry.parameters import Manipulator
from pneunet.hifi.cell.file import cell_from_tables
from pneunet.hifi.cell.run import solve_cell
from pneunet.hifi.cell.system import CellState
from pneunet.hifi.runs.solve.progress import break_stretch
from pneunet.hifi.runs.solve.solve import solve_design
from pneunet.hifi.runs.study.study import LEVELS

EFFORT = ["steps", "factorisations", "seconds"]


def solve_cell_case(inputs: dict[str, Any], directory: Path) -> dict[str, Any]:
    """One cell: `inputs` are the tables of a CELL.toml. Returns the facts of its mesh."""
    case = cell_from_tables(inputs, "the case")
    write_text(directory / "cell.toml", toml_text(inputs))
    breaks_at, rows = break_stretch(Manipulator((case.segment,))), []
    touched: list[float] = []

    def keep(state: CellState) -> None:
        rows.append(
            {
                "pressure_kPa": state.pressure * KPA_PER_MPA,
                **_strains(state.strains.e, state.strains.k),
                "smallest_wall_distance_mm": state.wall_distance,
                "first_touch_kPa": touched[0] * KPA_PER_MPA if touched else "",
                "contact_force_N": state.contact.force if state.contact else 0.0,
                **_body(state, breaks_at, {MARKS[0]: state.walls_overlap}),
                **{name: getattr(state, name) for name in EFFORT},
            }
        )
        _write(directory, rows)

    return {"mesh": solve_cell(case, directory / "cell.npz", keep, on_touch=touched.append)[1]}


def solve_design_case(inputs: dict[str, Any], directory: Path) -> dict[str, Any]:
    """One manipulator: `inputs` are {"design": the tables of a design.toml, "levels": number of equal
    pressure steps}."""
    design = design_from_tables(inputs["design"], "the case")
    write_design_file(directory / "design.toml", design)
    levels = _Levels(directory, design, inputs["levels"])
    solve_design(design, directory, fields=False, milestones=levels.marks, observers=[levels])
    return {"mesh": json.loads((directory / "mesh" / "mesh.json").read_text())}


class _Levels:
    """levels.csv of a manipulator. Only its last row may stand between two levels: where a path ended."""

    def __init__(self, directory, design, number):
        self.directory, self.breaks_at = directory, break_stretch(design.manipulator)
        self.marks = tuple(np.linspace(0.0, design.largest_pressure, number + 1)[1:])
        self.rows, self.factorisations = {}, 0

    def accepted(self, m):
        self.factorisations += m.factorisations
        for between in self.rows.keys() - {0.0, *self.marks}:
            del self.rows[between]
        strains = {}
        for i, (e, k) in enumerate(zip(m.strains.e, m.strains.k), start=1):
            prefix = f"segment{i}_" if len(m.strains.e) > 1 else ""
            strains |= {prefix + name: value for name, value in _strains(e, k).items()}
        # by pressure: under further loads the last state there counts
        self.rows[m.pressure] = {
            "pressure_kPa": m.pressure * KPA_PER_MPA,
            **strains,
            **{f"tip_{axis}_mm": value for axis, value in zip("xyz", m.frames[-1, :3, 3])},
            "smallest_wall_distance_mm": _finite(m.touch.wall_distance),
            "contact_force_N": m.touch.contact_force,
            "first_touch_kPa": m.touch.walls_from.pressure * KPA_PER_MPA if m.touch.walls_from else "",
            "body_distance_mm": _finite(m.touch.body_distance),
            **_body(m, self.breaks_at, m.touch.marks),
            **{"steps": m.step, "factorisations": self.factorisations, "seconds": m.seconds},
        }
        _write(self.directory, self.rows.values())


def _strains(e, k):
    return dict(zip([*STRAINS, *INVARIANTS], [*e, *k, np.linalg.norm(k), k @ e]))


def _finite(distance):
    return distance if np.isfinite(distance) else ""


def _body(state, breaks_at, marks):
    """What cells and manipulators tell alike, and a word on what makes the row doubtful; marks: {column of
    MARKS: bool}."""
    warnings = {
        **{name.replace("_", " "): holds for name, holds in marks.items()},
        "stretched beyond break": state.largest_stretch > breaks_at,
        "unstable": state.unstable,
    }
    return {
        "volume_mm3": state.volume,
        "largest_stretch": state.largest_stretch,
        "unstable_directions": state.unstable,
        **{name: int(holds) for name, holds in marks.items()},
        "warnings": ", ".join(word for word, holds in warnings.items() if holds),
    }


def _write(directory, rows):
    rows = list(rows)
    write_csv(directory / LEVELS, list(rows[0]), [row.values() for row in rows])
