"""`pneunet campaign`: cells of both kinds over a space-filling sample of designs, gathered into the data set
of the rod law."""

import json
import logging
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from pneunet.base.files.atomic import room_in, write_text
from pneunet.base.files.dataset import DIRECTIONS, UPPER, CellData, columns, write_dataset
from pneunet.base.files.datasheet import datasheet
from pneunet.base.files.record import revision, write_record
from pneunet.base.system.interrupts import Interrupted
from pneunet.geometry.shape_numbers import SHAPE, STIFFENING, direction_matrix, normal_pitch, numbers_of
from pneunet.hifi.fem.agreement import folder_of_all, on_rank_0
from pneunet.hifi.runs.campaign.case import STATES
from pneunet.hifi.runs.campaign.extension import Known, taken_over
from pneunet.hifi.runs.campaign.file import Campaign, read_campaign
from pneunet.hifi.runs.campaign.sample import MU
from pneunet.hifi.runs.cases import STATUSES, Case, run_cases

log = logging.getLogger(__name__)

DATA, SHEET = "cells.npz", "cells.md"
#: s between two writings of the data set while it grows
PAUSE = 60.0
#: strains that the body's half turns forbid over all, above which a case is not accepted: its mesh is too
#: coarse
LARGEST_SYMMETRY_DEFECT = 0.02


def run_campaign(
    path: str | Path,
    directory: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    retry: bool = False,
    extend: str | Path | None = None,
) -> CellData:
    """Compute the cases of CAMPAIGN.toml that are not finished in `directory`; collective. Returns the
    CellData.

    extend: a data set whose cases are taken over as they are. directory gets cells.npz and its data sheet
    cells.md, rewritten while it grows, run.json and cases/NAME.
    """
    directory, started = Path(directory), time.perf_counter()
    campaign = on_rank_0(comm, lambda: read_campaign(path))
    known = on_rank_0(comm, lambda: taken_over(campaign, extend)) if extend else Known()
    counts = Counter((d.kind, d.mesh.name) for d in campaign.designs)
    for (kind, mesh), number in counts.items():
        log.info(f"campaign: {number} {kind} designs on mesh '{mesh}'")
    gathering = Gathering(campaign, directory, known)
    if extend:
        log.info(f"{len(known.cases)} of them are taken over from {extend}")
    cases = [d.case for d in campaign.designs if d.case.name not in known.cases]
    with folder_of_all(comm, directory):
        try:
            run_cases(cases, directory / "cases", campaign.limits, comm, gathering.add, retry)
        except Interrupted:
            on_rank_0(comm, lambda: gathering.write() and None)
            raise
        return on_rank_0(comm, lambda: gathering.finish(comm.size, time.perf_counter() - started))


class Gathering:
    """The records that are known, and what is taken over (`known`), turned into the data set."""

    def __init__(self, campaign: Campaign, directory: str | Path, known: Known) -> None:
        self.campaign, self.directory, self.known = campaign, Path(directory), known
        self.records, self.written = {}, time.monotonic()
        self._states = {}

    def add(self, case: Case, record: dict[str, Any]) -> None:
        """Take the record of a case with the states in its folder."""
        self.records[case.name] = record
        path = self.directory / "cases" / case.name / STATES
        self._states[case.name] = json.loads(path.read_text()) if path.exists() else []
        if time.monotonic() - self.written > PAUSE:
            self.write()

    def write(self) -> CellData:
        """Write data set and data sheet of what is known; returns the CellData. InputError when that cannot
        be written."""
        data = self.data()
        with room_in(self.directory):
            write_dataset(self.directory / DATA, data)
            write_text(self.directory / SHEET, datasheet(data))
        self.written = time.monotonic()
        return data

    def finish(self, ranks: int, seconds: float) -> CellData:
        """Write what is known with run.json."""
        data = self.write()
        counts = Counter(record["status"] for record in self.records.values())
        write_record(
            self.directory, campaign=self.campaign.table, cases=counts, ranks=ranks, wall_seconds=seconds
        )
        log.info(", ".join(f"{number} {status}" for status, number in counts.items()))
        log.info(
            f"{len(data.kind)} cases, {data.accepted.mean():.1%} accepted, {len(data.case)} states in"
            f" {self.directory / DATA}; {SHEET}"
        )
        return data

    def data(self) -> CellData:
        """The CellData of what is known so far, in order of the sample."""
        c = self.campaign
        known = [d for d in c.designs if d.case.name in self.records or d.case.name in self.known.cases]
        rows = {f.name: [] for f in columns()}
        reasons = {}
        for i, design in enumerate(known):
            if design.case.name in self.known.cases:
                case, states, reason = self.known.cases[design.case.name]
            else:
                record = self.records[design.case.name]
                case, reason = _case_row(c, design, record), record["reason"]
                states = [_state_row(design.segment, s) for s in self._states[design.case.name]]
            if reason:
                reasons[str(i)] = reason
            states = [{**state, "case": i} for state in states]
            for name, value in case.items():
                rows[name].append(value)
            for state in states:
                for name, value in state.items():
                    rows[name].append(value)
        about = {
            "kinds": list(c.kinds),
            "meshes": [{"name": m.name, **m.settings} for m in c.meshes],
            "shape": list(SHAPE),
            "stiffening": list(STIFFENING),
            "directions": {kind: direction_matrix(kind).tolist() for kind in c.kinds},
            "statuses": list(STATUSES),
            "reasons": reasons,
            "campaign": c.table,
            "ranges": c.ranges,
            "largest_symmetry_defect": LARGEST_SYMMETRY_DEFECT,
            "revisions": sorted(
                {r["revision"] for r in self.records.values() if "revision" in r} | self.known.revisions
                or {revision()}
            ),
        }
        arrays = {
            f.name: np.asarray(rows[f.name], f.metadata["type"]).reshape(-1, *f.metadata["shape"])
            for f in columns()
        }
        return CellData(about, **arrays)


def _case_row(campaign, design, record):
    result = record["result"] or {}
    mesh = result.get("mesh", {})
    (numbers,), (pitch,) = numbers_of([design.segment])
    over_mu = {
        name: result[name] / MU if result.get(name) is not None else np.nan
        for name in ("limit_pressure", "first_touch")
    }
    return {
        "kind": campaign.kinds.index(design.kind),
        "design": design.index,
        "held_out": design.held_out,
        "mesh": campaign.meshes.index(design.mesh),
        "shape": numbers[: len(SHAPE)],
        "stiffening": numbers[len(SHAPE) :],
        "normal_pitch_mm": pitch,
        "status": STATUSES.index(record["status"]),
        **over_mu,
        "cells": mesh.get("cells", 0),
        "unknowns": mesh.get("unknowns", 0),
        "seconds": result.get("cpu_seconds", record["seconds"]),
        "missing": len(result.get("missing", [])),
    }


def _state_row(segment, state):
    """A state of states.json (mm, MPa) without dimension: see base.files.dataset."""
    length = normal_pitch(segment)
    scale = np.array([1, 1, 1, length, length, length])
    force = MU * length**2
    wall = state["wall_distance"]
    return {
        "prescribed": state["kind"] != "free",
        "pressure": state["pressure"] / MU,
        "strains": np.array(state["strains"]) * scale,
        "forces": np.array(state["forces"]) / scale / force,
        "stiffness": (np.array(state["stiffness"]) / np.outer(scale, scale) / force)[UPPER],
        "volume": state["volume"] / segment.pitch / length**2,
        "energy": state["energy"] / segment.pitch / force,
        "unstable": state["unstable"],
        "largest_stretch": state["largest_stretch"],
        "residual": state["residual"],
        "wall_distance": np.nan if wall is None else wall / length,
        "contact": state["contact"],
        "strain_slopes": _slopes(state.get("strain_slopes"), lambda a: a * scale, 6),
        "stiffness_slopes": _slopes(
            state.get("stiffness_slopes"), lambda a: (a / np.outer(scale, scale) / force)[:, *UPPER], 21
        ),
    }


def _slopes(values, without_dimension, width):
    out = np.full((DIRECTIONS, width), np.nan)
    if values is not None:
        out[: len(values)] = without_dimension(np.array(values))
    return out
