"""How much of the law's error is the chance of a mesh: held-out cells computed once more on another mesh of
nearly the same size, judged against the first as the law is.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.tables import table

ROOT = Path(__file__).resolve().parent.parent
CAMPAIGN, FOLDER = ROOT / "examples" / "campaigns" / "cells-v1.toml", ROOT / "out" / "bench" / "remeshed"
#: mm instead of 2; the held-out designs below this index
MESH_SIZE, BELOW = 1.95, 150
FIGURES = ("strain", "tip", "stiffness", "stiffness where walls touch")


def remeshed():
    """The part `remeshed`. Cases that are in FOLDER are not computed again."""
    from pneunet.base.files.dataset import read_dataset
    from pneunet.hifi.runs.campaign.campaign import Gathering
    from pneunet.hifi.runs.campaign.extension import Known
    from pneunet.hifi.runs.campaign.file import read_campaign
    from pneunet.hifi.runs.cases import run_cases
    from pneunet.reduced import read_law
    from pneunet.reduced.choice import DATA_SET, SHIPPED
    from pneunet.reduced.training.states import sample_of

    campaign = read_campaign(CAMPAIGN)
    coarse = campaign.meshes[0]
    mesh = replace(coarse, mesh_size=MESH_SIZE)
    held_out = [d for d in campaign.designs if d.held_out and d.mesh is coarse and d.index < BELOW]
    other = {"mesh": mesh.settings, "prescribed": []}
    designs = tuple(
        replace(d, mesh=mesh, case=replace(d.case, inputs=d.case.inputs | other)) for d in held_out
    )
    FOLDER.mkdir(parents=True, exist_ok=True)
    gathering = Gathering(replace(campaign, designs=designs, meshes=(mesh,)), FOLDER, Known())
    run_cases([d.case for d in designs], FOLDER / "cases", campaign.limits, on_record=gathering.add)
    data, again, laws, details = read_dataset(DATA_SET), gathering.data(), read_law(SHIPPED).kinds, {}
    for kind in again.about["kinds"]:
        first, second = (sample_of(cells, kind, True).on(0).free for cells in (data, again))
        first = first.of(np.isin(first.design, second.design))
        law = replace(laws[kind], level=0)
        by_law = (
            law.free_strains(first.shape, first.pressure),
            law.free_stiffness(first.shape, first.pressure),
        )
        details[kind] = {
            "designs": len(np.unique(first.design)),
            "another mesh": percentiles(first, *at_pressures_of(first, second)),
            "law": percentiles(first, *by_law),
        }
    worst = {name: max(found["another mesh"][name] for found in details.values()) for name in FIGURES[:3]}
    keys = ("remeshed_strain_p95_rel", "remeshed_tip100_p95_rel", "remeshed_stiffness_p95_rel")
    return dict(zip(keys, worst.values())), details


def at_pressures_of(first, second):
    """(strains (n, 6), stiffness (n, 6, 6)) of the second States at the pressures of the first, which differ
    a little where both are parts of their own limit loads."""
    strains, K = np.empty(first.strains.shape), np.empty(first.matrices.shape)
    for number in np.unique(first.design):
        rows, b = first.design == number, second.of(second.design == number)
        for out, values in ((strains, b.strains), (K, b.matrices)):
            flat = values.reshape(len(values), -1).T
            out[rows] = np.column_stack(
                [np.interp(first.pressure[rows], b.pressure, v) for v in flat]
            ).reshape(out[rows].shape)
    return strains, K


def percentiles(states, strains, K):
    """{figure: 95th percentile} of strains (n, 6) and stiffness (n, 6, 6) against States."""
    from pneunet.reduced.training.judging import stiffness_error, strain_error, symmetric, tip_error

    loaded, stiffness = states.pressure > 0, stiffness_error(states, symmetric(K))
    strain, tip = (error(states, strains)[loaded] for error in (strain_error, tip_error))
    return {
        name: float(np.percentile(e, 95))
        for name, e in zip(FIGURES, (strain, tip, stiffness, stiffness[states.touching]))
    }


def lines(details):
    """Lines of docs/rod-law.md."""
    text = (
        "A mesh is one of many, and another of the same size gives other strains. The table has 95th"
        f" percentiles of differences for the held-out designs below index {BELOW}: cells on two meshes of"
        f" nearly the same size, 2 and {MESH_SIZE:g} mm, and the law against the cells at 2 mm. The errors"
        " are defined as the figures below."
    )
    rows = [
        (f"{kind}, {found['designs']} designs", who, *[f"{found[who][name]:.2%}" for name in FIGURES])
        for kind, found in details.items()
        for who in ("another mesh", "law")
    ]
    return ["## How much is the mesh", "", text, "", *table(["", "", *FIGURES], rows), ""]
