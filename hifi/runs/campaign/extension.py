"""A campaign that goes on from a data set: its cases are taken over as they are, whatever became of the
folders that they came from."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.dataset import columns, read_dataset
from pneunet.hifi.runs.campaign.file import Campaign
from pneunet.hifi.runs.cases import STATUSES


@dataclass(frozen=True)
class Known:
    """cases: {name of the case: (row of the case, rows of its states (dicts), reason)}; revisions: of the
    code that computed them."""

    cases: dict = field(default_factory=dict)
    revisions: frozenset = frozenset()


def taken_over(campaign: Campaign, path: str | Path) -> Known:
    """What the data set at `path` knows of a Campaign's cases, found by kind, index and mesh. InputError when
    its sample is another."""
    data = read_dataset(path)
    about = data.about
    theirs = {**about["campaign"], "ranges": about["ranges"]}
    asked = {**campaign.table, "ranges": campaign.ranges}
    del asked["designs"], asked["edge_designs"], asked["further"]  # may grow
    if not theirs.get("edge_designs"):
        del asked["edge_ranges"]
    for key, value in json.loads(json.dumps(asked)).items():
        if theirs.get(key) != value:
            raise InputError(
                f"{path}: its sample has {key} = {theirs.get(key)}, the campaign's {value}: extend it with"
                " the same"
            )
    meshes, cases = {mesh["name"]: mesh for mesh in about["meshes"]}, {}
    places = zip(data.kind.tolist(), data.design.tolist(), data.mesh.tolist())
    rows = {(about["kinds"][k], d, about["meshes"][m]["name"]): row for row, (k, d, m) in enumerate(places)}
    for d in campaign.designs:
        row = rows.get((d.kind, d.index, d.mesh.name))
        if row is None:
            continue
        if meshes[d.mesh.name] != {"name": d.mesh.name, **d.mesh.settings}:
            raise InputError(
                f"{path}: its mesh is {meshes[d.mesh.name]}, the campaign's {d.mesh.settings}: extend it with"
                " the same"
            )
        status = about["statuses"][data.status[row]]
        if status not in STATUSES:
            raise InputError(f"{path}: the status '{status}' of a case is not known to this version")
        case = _row(data, "cases", row) | {
            "kind": campaign.kinds.index(d.kind),
            "mesh": campaign.meshes.index(d.mesh),
            "status": STATUSES.index(status),
        }
        states = [_row(data, "states", i) for i in np.flatnonzero(data.case == row)]
        cases[d.case.name] = case, states, about["reasons"].get(str(row), "")
    return Known(cases, frozenset(about["revisions"]))


def _row(data, of, row):
    return {f.name: getattr(data, f.name)[row] for f in columns() if f.metadata["of"] == of}
