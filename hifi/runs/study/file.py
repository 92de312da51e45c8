"""STUDY.toml: one body and what is varied in it, spread out into the cases of hifi.runs.cases.

A variable is a path into the tables of the body, `segment.2.angle_deg` or `material.mu_MPa`; the parameters
of segments and materials are known by their bare names too. So whatever a CELL.toml or design.toml can say
can be varied.
"""

import copy
import itertools
import json
import logging
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pneunet.base.errors import InputError
from pneunet.base.files.kinds import STUDY, read_tables
from pneunet.base.files.toml import as_table, from_table, read_toml, refuse_unknown
from pneunet.base.materials.laws import LAWS
from pneunet.base.quantities import Checked, quantities, quantity
from pneunet.base.system.processes import Limits
from pneunet.geometry.designfile import design_from_tables, design_tables
from pneunet.geometry.parameters import Segment
from pneunet.hifi.cell.file import cell_from_tables, cell_tables
from pneunet.hifi.runs.cases import Case, case_limits

log = logging.getLogger(__name__)
BODIES = ("cell", "segment", "manipulator")
SEGMENT_KEYS = list(quantities(Segment))
MATERIAL_KEYS = ["silicone", "law"] + sorted(
    {key for law in LAWS.values() for key in quantities(law)} - {"name", "source"}
)
#: keys which say what a material is: the table that stood there before means nothing any more
NAMES_OF_MATERIALS = ("silicone", "law")
#: values at the top of a design.toml and of a CELL.toml, and at that of the latter alone
COMMON_KEYS = ("pressure_kPa", "mesh_size_mm", "contact")
CELL_KEYS = (*COMMON_KEYS, "control", "volume_factor")

#: in one study; so many are read in seconds
MOST_CASES = 10_000
#: takes more than a second
MANY_CASES = 500


@dataclass(frozen=True)
class StudyCase:
    """One row of the list or grid: {variable as the user wrote it: value}, its case, or why there can be
    none."""

    values: dict[str, Any]
    case: Case | None
    refusal: str = ""

    @property
    def label(self) -> str:
        return ", ".join(f"{name} = {value}" for name, value in self.values.items()) or "the body as it is"


@dataclass(frozen=True)
class Study(Checked):
    """levels: pressures at which each case is recorded; limits: of one case; variables: names of what is
    varied; cases: in order."""

    kind: str = quantity(None, choices=BODIES)
    levels: int = quantity(None, 10, low=1, high=1000)
    limits: Limits = Limits()
    variables: tuple[str, ...] = ()
    cases: tuple[StudyCase, ...] = ()


def read_study(path: str | Path) -> Study:
    """The Study in a TOML file; InputError that names key and fix otherwise.

    A combination of the grid that is no valid body is kept with its refusal, a listed case or a whole grid of
    them is an error.
    """
    data, where = read_tables(path, STUDY), str(path)
    for key, fix in (
        ("kind", "write 'cell', 'segment' or 'manipulator'"),
        ("base", 'write the body as [base], or base = "FILE.toml"'),
    ):
        if key not in data:
            raise InputError(f"{where}: key '{key}' is missing: {fix}")
    refuse_unknown(data, ["kind", "base", "levels", "limits", "grid", "case"], where)
    base = _base(data["base"], data["kind"], Path(path))
    own = {key: tables[key] for tables in (base, data) for key in quantities(Study) if key in tables}
    study = from_table(Study, own, where, limits=case_limits(data, where))
    listed, grid = _varied(data, base, where)
    count = len(listed) * math.prod(map(len, grid.values()))
    if count > MOST_CASES:
        raise InputError(
            f"{where}: {count} cases are more than the {MOST_CASES} of one study: vary less, or coarser"
        )
    if count > MANY_CASES:
        log.info(f"{where}: {count} cases are put together")
    cases = []
    for row in listed:
        for combination in itertools.product(*grid.values()):
            cases.append(_study_case(study, base, {**row, **dict(zip(grid, combination))}, where))
    refused = [case.refusal for case in cases if case.case is None]
    if refused and (not grid or len(refused) == len(cases)):
        raise InputError(refused[0])
    variables = tuple(dict.fromkeys([*(name for row in listed for name in row), *grid]))
    return replace(study, variables=variables, cases=tuple(cases))


def _base(base, kind, path):
    """The tables of the body that is varied: written in the study, or in a file beside it."""
    if isinstance(base, str):
        base = read_toml(path.parent / base)
    base = as_table(base, f"{path} [base]")
    if "segment" not in base:
        raise InputError(f"{path} [base]: key 'segment' is missing: write [base.segment]")
    segment = base["segment"]
    single = isinstance(segment, dict)
    if not single and not (isinstance(segment, list) and all(isinstance(row, dict) for row in segment)):
        raise InputError(f"{path} [base]: segments are written [base.segment], or [[base.segment]] in a row")
    if kind == "cell" and not single:
        raise InputError(
            f"{path} [base]: a cell has one segment: write [base.segment], or kind = 'manipulator'"
        )
    if kind == "segment" and not single and len(segment) != 1:
        raise InputError(f"{path} [base]: {len(segment)} segments: write kind = 'manipulator'")
    if kind != "cell" and single:
        base["segment"] = [segment]
    return base


def _varied(data, base, where):
    """(list of {variable: value}, {variable: list of values}) of [[case]] and [grid]."""
    rows = data.get("case", [{}])
    if not isinstance(rows, list):
        raise InputError(f"{where}: cases are written [[case]], with double brackets")
    listed = [_flat(as_table(row, f"{where} [[case]] {i}")) for i, row in enumerate(rows, start=1)]
    grid = _flat(as_table(data.get("grid", {}), f"{where} [grid]"))
    if not grid and "case" not in data:
        raise InputError(f"{where}: nothing is varied: write [grid] with key = [values], or [[case]] tables")
    known = [
        *SEGMENT_KEYS,
        *MATERIAL_KEYS,
        *(COMMON_KEYS if isinstance(base["segment"], list) else CELL_KEYS),
    ]
    for table, name in [(row, f"[[case]] {i}") for i, row in enumerate(listed, start=1)] + [(grid, "[grid]")]:
        bare = {key: value for key, value in table.items() if "." not in key and key not in base}
        refuse_unknown(bare, known, f"{where} {name}")
        spelt: dict = {}
        for key in table:
            other = spelt.setdefault(tuple(_path(key)), key)
            if other != key:
                raise InputError(f"{where} {name}: '{other}' and '{key}' are the same: leave one out")
    for key, values in grid.items():
        if not isinstance(values, list) or not values:
            example = "[1, 2]" if values == [] else f"[{values!r}, ...]"
            raise InputError(
                f"{where} [grid]: {key} = {values!r} must be a list of values: write {key} = {example}"
            )
        if key in listed[0]:
            raise InputError(f"{where} [grid]: '{key}' is in the list of cases too: leave it out of one")
    return listed, grid


def _flat(table, prefix=""):
    """{"a.b": value} of nested tables, which TOML makes of dotted keys."""
    out = {}
    for key, value in table.items():
        out |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
    return out


def _study_case(study, base, values, where):
    try:
        function, inputs = _inputs(study, base, values, where)
    except InputError as error:
        return StudyCase(values, None, str(error))
    # through JSON, so that inputs are what the record on disk will hold
    inputs = json.loads(json.dumps(inputs, default=lambda array: array.tolist()))
    return StudyCase(values, Case(function, inputs, StudyCase(values, None).label))


def _inputs(study, base, values, where):
    """(function, its complete inputs) of the body with these values."""
    tables = copy.deepcopy(base)
    name = ", ".join(f"{key} = {value}" for key, value in values.items())
    where = f"{where} ({name})" if name else where
    # a material's name first: other keys of the case change values in it
    for name in sorted(values, key=lambda name: name.rpartition(".")[2] not in NAMES_OF_MATERIALS):
        try:
            _put(tables, _path(name), values[name])
        except (AttributeError, IndexError, TypeError, ValueError):
            raise InputError(
                f"{where}: '{name}' leads nowhere in the body"
                + "; segments are counted from 1, segment.1.angle_deg" * isinstance(base["segment"], list)
            ) from None
    if study.kind == "cell":
        return "hifi.study_cases:solve_cell_case", cell_tables(
            cell_from_tables({**tables, "levels": study.levels}, where)
        )
    design = design_from_tables(tables, where)
    return "hifi.study_cases:solve_design_case", {"design": design_tables(design), "levels": study.levels}


def _path(name):
    if name in SEGMENT_KEYS:
        return ["segment", name]
    return ["material", name] if name in MATERIAL_KEYS else name.split(".")


def _put(table, path, value):
    """Set what `path` leads to; a list of tables is entered by a number from 1, or in all its tables."""
    if isinstance(table, list):
        chosen, rest = (
            ([table[range(1, len(table) + 1).index(int(path[0]))]], path[1:])
            if path[0].isdigit()
            else (table, path)
        )
        for each in chosen:
            _put(each, rest, value)
    elif path[0].isdigit():
        raise ValueError("a number enters a list only")
    elif len(path) == 1:
        if path[0] in NAMES_OF_MATERIALS:
            table.clear()
        table[path[0]] = value
    else:
        _put(table.setdefault(path[0], {}), path[1:], value)


def value_of(name: str, study_case: StudyCase, default: object = "") -> Any:
    """What the column of variable `name` shows: the case's value, or the body's where other cases vary it."""
    if name in study_case.values or study_case.case is None:
        return study_case.values.get(name, default)
    found = study_case.case.inputs.get("design", study_case.case.inputs)
    for step in _path(name):
        if isinstance(found, list):
            found = found[int(step) - 1] if step.isdigit() else found[0].get(step, default)
        elif isinstance(found, dict):
            found = found.get(step, default)
    return found
