"""The paper's twisting and helical models beside unit cells: distances as they are and calibrated, and what
they predict.

`fe` solves the cells; `twisting` and `one_sided` compare and fit; the page is written by
benchmarks/paper_page.py.
"""

import tempfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

SIZE, FINER = 2.0, 1.5
ANGLES = (30.0, 40.0, 45.0, 53.0, 60.0, 75.0, 85.0)
PRESSURES = (0.01, 0.02, 0.03, 0.04, 0.05)
#: case -> mu in MPa, as the reference cases have them
TWISTING = {"twist_w10": 0.2068, "twist_w12": 0.317, "twist_w15": 0.317}
ONE_SIDED, ONE_SIDED_MU = "one_sided_w10", 0.2068
#: where the twist is checked on a finer mesh
CHECKED, CHECKED_ANGLES = "twist_w12", (30.0, 53.0)
#: tubes that are given the paper's largest twist: fibre moduli over mu, Ri/Ro, and the paper's numbers
#: (rad/mm, Sec. III and IV)
TUBES = ((1.0, 0.3), (1.0, 0.5), (3.0, 0.3), (3.0, 0.5), (10.0, 0.3), (10.0, 0.5))
PAPER_TAU, PAPER_ANGLE, PAPER_TAU_10KPA = 0.033, 53.0, 0.0063


def segment(case, angle, mu):
    from pneunet.base.materials.laws import NeoHookean
    from pneunet.geometry.reference_cases import CASES

    return CASES[case](angle=angle, chambers=1, material=NeoHookean(mu))


def sweep(body, contact, size=SIZE):
    """((pressures, 6) of e and k, nan where the path ended short; whether walls overlap; why it ended or
    None)."""
    from pneunet.base.errors import ConvergenceError, InputError
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.run import solve_cell

    strains, states, reason = np.full((len(PRESSURES), 6), np.nan), [], None
    case = CellCase(body, PRESSURES[-1], size, len(PRESSURES), contact=contact, element="tetrahedra")
    with tempfile.TemporaryDirectory() as folder:
        try:
            solve_cell(case, Path(folder) / "cell.npz", states.append)
        except (ConvergenceError, InputError) as error:
            reason = str(error)
    for j, state in enumerate(states[1:]):
        strains[j] = state.strains.vector
    return strains, any(state.walls_overlap for state in states), reason


def fe(case, mu, angles):
    """{"none" and "auto": strains (angles, pressures, 6), "touch": angles at which walls meet, "failures":
    [text]}.

    Where no walls meet there is nothing for contact to do, and the cell is solved once.
    """
    free, held, touch, failures = [], [], [], []
    for angle in angles:
        body = segment(case, angle, mu)
        strains, overlap, reason = sweep(body, "none")
        reasons = {"none": reason}
        free.append(strains)
        if overlap or reason:
            touch.append(angle)
            strains, _, reasons["auto"] = sweep(body, "auto")
        held.append(strains)
        failures += [
            f"{case}, {angle:g} deg, contact {name}: {text}" for name, text in reasons.items() if text
        ]
    return {"none": np.array(free), "auto": np.array(held), "touch": touch, "failures": failures}


def curves(strains, angles):
    """TwistCurves of strains (angles, pressures, 6)."""
    from pneunet.base.strains import RodStrains
    from pneunet.reduced.analytic.calibration import TwistCurves

    rod = RodStrains.of_vector(strains)
    return TwistCurves(np.array(angles), np.array(PRESSURES), rod.twist_per_deformed_length, rod.stretch)


def distance(model, wanted):
    """(model/wanted - 1) in absolute terms, 1 where the model has no state, where `wanted` is known."""
    return np.abs(np.nan_to_num(model) / wanted - 1)[np.isfinite(wanted)]


def twisting(cells, angles):
    """{case: tube as it is, fits, and their curves} from {case: strains with contact}."""
    from pneunet.reduced.analytic.calibration import calibrate_tube, tube_curves
    from pneunet.reduced.analytic.law import segment_tube
    from pneunet.reduced.analytic.twisting import PAPER_FIBRE_MODULUS

    found = {}
    for case, strains in cells.items():
        wanted = curves(strains, angles)
        known = np.isfinite(wanted.tau).all(axis=1)
        kept = replace(
            wanted, angles=wanted.angles[known], tau=wanted.tau[known], stretch=wanted.stretch[known]
        )
        tube = segment_tube(segment(case, 60.0, TWISTING[case]))
        printed = replace(tube, fibre_modulus=PAPER_FIBRE_MODULUS)
        rows = [
            ("as it is", replace(tube, fibre_convention=convention), None) for convention in ("axial", "hoop")
        ]
        rows.append(("printed E_t", printed, None))
        for radii, name in ((False, "E_t"), (True, "E_t, Ri, Ro")):
            for convention in ("axial", "hoop"):
                fit = calibrate_tube(kept, replace(tube, fibre_convention=convention), radii)
                rows.append((name, fit.tube, (fit.tau_error, fit.stretch_error)))
        found[case] = []
        for name, tube, errors in rows:
            curve = tube_curves(tube, angles, PRESSURES)
            found[case].append(
                {
                    "fitted": name,
                    "tube": asdict(tube),
                    "errors": errors,
                    "distance": distance(curve.tau, wanted.tau),
                    "tau": curve.tau,
                    "stretch": curve.stretch,
                }
            )
    return found


def best(rows):
    """The fit of all three constants whose squared errors are least."""
    return min(
        (row for row in rows if row["fitted"] == "E_t, Ri, Ro"),
        key=lambda row: np.square(row["errors"]).sum(),
    )


def one_sided(strains, angles):
    """The one-sided model as it is and softened by one and by two constants, from strains (angles, pressures,
    6)."""
    from pneunet.reduced.analytic.calibration import calibrate_softness, softened_curvature
    from pneunet.reduced.analytic.helical import HelicalCell

    bodies = [segment(ONE_SIDED, angle, ONE_SIDED_MU) for angle in angles]
    wanted = np.linalg.norm(strains[..., 3:], axis=-1)
    known = np.isfinite(wanted).all(axis=1)
    kept = [body for body, use in zip(bodies, known) if use]
    rows = []
    for name, slanted in (("nothing", None), ("softness", False), ("softness, slant", True)):
        constants = (
            (1.0, 0.0) if slanted is None else calibrate_softness(kept, PRESSURES, wanted[known], slanted)
        )
        curvature = np.array([softened_curvature(body, PRESSURES, *constants) for body in bodies])
        rows.append(
            {
                "fitted": name,
                "constants": constants,
                "distance": distance(curvature, wanted),
                "curvature": curvature,
            }
        )
    model = [HelicalCell(body).strains(PRESSURES).vector for body in bodies]
    return {"rows": rows, "model": np.array(model)}


def paper_tubes():
    """Tubes made as large as it takes to twist by the paper's 0.033 rad/mm at 50 kPa: a row each of `TUBES`,
    fibres `axial`."""
    from pneunet.reduced.analytic.calibration import tube_curves
    from pneunet.reduced.analytic.twisting import PAPER_MU, TwistingTube

    rows, angles = [], np.arange(30.0, 86.0, 2.5)
    for modulus, ratio in TUBES:
        found = tube_curves(TwistingTube(ratio, 1.0, PAPER_MU, modulus * PAPER_MU), angles, PRESSURES)
        tau = np.nan_to_num(found.tau)
        at = tau[:, -1].argmax()
        size = tau[at, -1] / PAPER_TAU
        row = {"modulus": modulus, "ratio": ratio, "outer_radius": size, "angle": angles[at]}
        rows.append(
            row
            | {
                "largest": tau.max(axis=0) / size,
                "at_angle": tau[at] / size,
                "stretch": found.stretch[at, -1],
            }
        )
    return rows


def printed():
    """What reduced.analytic.printed finds: the largest twist with the printed constants, and the printed
    equations' least residuals."""
    from pneunet.reduced.analytic.printed import MULTIPLIERS, largest_twist, printed_equations
    from pneunet.reduced.analytic.twisting import PAPER_FIBRE_MODULUS, PAPER_MU, TwistingTube

    tube = TwistingTube(3.0, 7.0, PAPER_MU, PAPER_FIBRE_MODULUS)
    residuals = {
        m: float(np.linalg.norm(printed_equations(tube, 60.0, 0.02, m).residual)) for m in MULTIPLIERS
    }
    return {"largest_twist": largest_twist(tube, range(30, 90, 10), 2e-3), "residuals": residuals}


def compare(cells):
    """({key: value}, details) from {case: what `fe` returns} of all cases."""
    tubes = twisting({case: cells[case]["auto"] for case in TWISTING}, ANGLES)
    bending = one_sided(cells[ONE_SIDED]["auto"], (*ANGLES, 90.0))
    figures = {
        "analytic_vs_fe_twist_rel": float(
            np.median(np.concatenate([rows[0]["distance"] for rows in tubes.values()]))
        ),
        "analytic_vs_fe_twist_rel_calibrated": float(
            np.median(np.concatenate([best(rows)["distance"] for rows in tubes.values()]))
        ),
        "analytic_vs_fe_curvature_rel": float(np.median(bending["rows"][0]["distance"])),
        "analytic_vs_fe_curvature_rel_calibrated": float(np.median(bending["rows"][-1]["distance"])),
    }
    details = {
        "cells": cells,
        "tubes": tubes,
        "bending": bending,
        "paper_tubes": paper_tubes(),
        "printed": printed(),
    }
    return figures, plain(details)


def plain(value):
    """`value` for JSON: arrays as lists of 6 digits, nan as None."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def paper():
    """The part `paper`: ({key: value}, details)."""
    cells = {case: fe(case, mu, ANGLES) for case, mu in TWISTING.items()}
    cells[ONE_SIDED] = fe(ONE_SIDED, ONE_SIDED_MU, (*ANGLES, 90.0))
    finer = [sweep(segment(CHECKED, angle, TWISTING[CHECKED]), "none", FINER)[0] for angle in CHECKED_ANGLES]
    figures, details = compare(cells)
    return figures, details | {"finer": plain(curves(np.array(finer), CHECKED_ANGLES).tau)}
