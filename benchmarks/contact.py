"""Figures of self-contact in the unit cell twist-w15: distances, bias, sensitivity, an independent method, an
exact solution, cost."""

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

SIZE, FINER, ELEMENT = 2.0, 1.5, "hexahedra"
TOP = 0.05
#: pressures (MPa) at which the third medium is asked for the force between chambers
CHECKED = (0.01, 0.03, 0.05)
#: of the default medium's stiffness, thickness when squeezed (J0) and regularisation: what the extrapolation
#: starts from
SOFTNESSES = (1.0, 0.5, 0.25)
#: keys of the details that the page is made of
ANGLES = "angle_kPa_tau_force_N_area_mm2_nearest_mm_farthest_mm"
PARAMETERS = "parameter_factor_tau_50kPa_force_N_distance_rel_gap"
FINE = "kPa_tau_finer_with_and_without_force_N"
#: of the pressure of first touch: where the bias before contact is measured
JUST_BEFORE = 0.985


def segment(name="twist_w15", angle=60.0, mu=0.317):
    from pneunet.base.materials.laws import NeoHookean
    from pneunet.geometry.reference_cases import CASES

    return CASES[name](angle=angle, chambers=1, material=NeoHookean(mu))


def run(folder, body, contact, pressure=TOP, levels=5, size=SIZE, **case):
    """(states, CPU seconds, pressure of first touch or None)."""
    from pneunet.hifi.cell.file import CellCase
    from pneunet.hifi.cell.run import solve_cell

    path, states, touches = Path(folder) / f"{time.monotonic_ns()}.npz", [], []
    started = time.process_time()
    solve_cell(
        CellCase(body, pressure, size, levels, contact=contact, element=ELEMENT, **case),
        path,
        states.append,
        on_touch=touches.append,
    )
    return states, time.process_time() - started, touches[0] if touches else None


def twist(state):
    """tau in rad/m of deformed length."""
    return state.strains.k[0] / state.strains.e[0] * 1e3


def curvature(state):
    return np.linalg.norm(state.strains.k)


def farthest(states, gap):
    """Largest distance of walls where they push at each other, either side of zero, over the gap."""
    return max(
        max(abs(s.contact.nearest), abs(s.contact.farthest)) / gap
        for s in states
        if s.contact and s.contact.area
    )


@dataclass(frozen=True)
class Reference:
    """The cell twist-w15, 60 degrees, with and without contact at SIZE; `folder` for meshes."""

    folder: Path
    body: object
    states: list
    loose: list
    touch: float

    @property
    def increment(self):
        """What contact adds to the twist at the top pressure, rad/m."""
        return twist(self.states[-1]) - twist(self.loose[-1])


def angles(reference):
    """Distances of walls that push, at three angles of the chambers."""
    found = {60: reference.states}
    for angle in (45, 75):
        found[angle] = run(reference.folder, segment(angle=float(angle)), "auto")[0]
    figures = {
        f"contact_distance_rel_gap_{angle}": farthest(states, reference.body.gap)
        for angle, states in found.items()
    }
    rows = [
        [
            angle,
            s.pressure * 1e3,
            twist(s),
            s.contact.force,
            s.contact.area,
            s.contact.nearest,
            s.contact.farthest,
        ]
        for angle, states in found.items()
        for s in states[1:]
    ]
    return figures, {ANGLES: rows}


def bias(reference):
    """Before first touch, and where nothing touches at all: what a contact model does that ought to do
    nothing."""
    one_sided, folder, before = (
        segment("one_sided_w10", mu=0.2068),
        reference.folder,
        JUST_BEFORE * reference.touch,
    )

    def last(body, contact, pressure):
        return run(folder, body, contact, pressure, 1)[0][-1]

    loose = last(reference.body, "none", before)
    relative = {
        c: abs(twist(last(reference.body, c, before)) / twist(loose) - 1) for c in ("auto", "third-medium")
    }
    bent = [curvature(last(one_sided, c, TOP)) for c in ("auto", "none")]
    figures = {
        "contact_bias_twist_rel": relative["auto"],
        "contact_bias_curvature_rel": abs(bent[0] / bent[1] - 1),
    }
    return figures, {"bias_twist_rel_third_medium": relative["third-medium"]}


def parameters(reference):
    """The penalty's stiffness and onset halved and doubled, one at a time."""
    from pneunet.hifi.contact.penalty import WallPenalty

    rows, standard = [], WallPenalty()
    for name in ("stiffness", "onset"):
        for factor in (0.5, 2.0):
            penalty = replace(standard, **{name: factor * getattr(standard, name)})
            last = run(reference.folder, reference.body, "auto", levels=1, penalty=penalty)[0][-1]
            rows.append([name, factor, twist(last), last.contact.force, farthest([last], reference.body.gap)])
    change = max(abs(row[2] - twist(reference.states[-1])) for row in rows)
    figures = {"contact_parameter_sensitivity_rel": change / reference.increment}
    details = {
        PARAMETERS: rows,
        "parameter_sensitivity_of_twist_rel": change / twist(reference.states[-1]),
    }
    return figures, details


def finer_mesh(reference):
    """The mesh refined once, with and without contact."""
    fine, loose = (run(reference.folder, reference.body, c, size=FINER)[0] for c in ("auto", "none"))
    increment = twist(fine[-1]) - twist(loose[-1])
    details = {
        FINE: [[s.pressure * 1e3, twist(s), twist(t), s.contact.force] for s, t in zip(fine, loose)],
        "mesh_sensitivity_of_twist_rel": abs(twist(fine[-1]) / twist(reference.states[-1]) - 1),
    }
    return {"contact_mesh_sensitivity_rel": abs(increment / reference.increment - 1)}, details


def limit(values):
    """Where values at the first of SOFTNESSES go as the medium vanishes: by the polynomial through them
    (Richardson)."""
    from pneunet.hifi.path.stepping import lagrange_coefficients

    return float(np.dot(lagrange_coefficients(SOFTNESSES[: len(values)], 0.0), values))


def medium_forces(body, path, size=SIZE, pressures=CHECKED, softnesses=SOFTNESSES):
    """[[kPa, force (N) and twist (rad/m) at each of the softnesses, as far as states are found]] of the third
    medium; ConvergenceError where there are fewer than two."""
    from pneunet.base.errors import ConvergenceError
    from pneunet.geometry.cad.grid import grid_cell
    from pneunet.hifi.cell.problem import CellProblem
    from pneunet.hifi.cell.run import CONTACT_PATIENCE
    from pneunet.hifi.cell.system import RELATIVE_TOLERANCE, CellSystem
    from pneunet.hifi.contact.medium import Softening, ThirdMedium
    from pneunet.hifi.path.control import LoadControl
    from pneunet.hifi.path.equilibrium import EquilibriumPath
    from pneunet.hifi.path.newton import NewtonOptions
    from pneunet.hifi.path.stepping import StepSize, run_steps

    grid_cell(body, size, path, gaps=True, part=True)
    followed = ThirdMedium()
    problem = CellProblem(body, path, medium=followed)
    system, energy = CellSystem(problem), problem.medium
    options = NewtonOptions(relative_tolerance=RELATIVE_TOLERANCE, patience=CONTACT_PATIENCE)
    path, rows = EquilibriumPath(system, LoadControl(), options), []
    for pressure in pressures:
        run_steps(path, pressure, StepSize(0.02 * body.material.mu, 1e-5))
        kept, row, medium = system.state.copy(), [pressure * 1e3], followed
        for softness in softnesses:
            energy.between(medium)
            softened = EquilibriumPath(Softening(system, energy), LoadControl(), options)
            try:
                run_steps(softened, 1.0, StepSize(0.5, 1e-3))
            except ConvergenceError:
                if len(row) < 5:  # two softnesses
                    raise
                break
            e, k = np.split(system.state[-6:], 2)
            row += [problem.measure_contact().force, k[0] / e[0] * 1e3]
            medium = followed.softer(softness, softness / 2)
        rows.append(row)
        energy.between(followed)
        system.state, path.newton.current = kept, False
    system.destroy()
    return rows


def force_check(reference):
    """The force between chambers against the third medium's in the limit of no medium."""
    from pneunet.base.errors import ConvergenceError

    try:
        rows = medium_forces(reference.body, reference.folder / "medium.npz")
    except ConvergenceError as error:
        return {}, {"force_check": str(error)}
    compared = []
    for kPa, *found in rows:
        [state] = [s for s in reference.states if abs(s.pressure * 1e3 - kPa) < 1e-6]
        compared.append([kPa, state.contact.force, limit(found[::2]), twist(state), limit(found[1::2])])
    details = {"kPa_force_N_tau_of_softer_media": rows, "kPa_force_N_and_limit_tau_and_limit": compared}
    return {"contact_force_check_rel": max(abs(a / b - 1) for _, a, b, _, _ in compared)}, details


def exact(reference):
    """Cylinders pressed together: their force is known."""
    from pneunet.hifi.verification.pressed import pressed

    force, torque, _ = pressed(reference.folder)
    return {"contact_pressed_force_rel": force.relative_error}, {
        "pressed_dofs": force.dofs,
        "pressed_torque_N_mm": torque,
    }


#: each takes the Reference and returns ({key: number}, details)
PIECES = (angles, bias, parameters, finer_mesh, force_check, exact)


def contact(pieces=PIECES):
    """The part `contact`: ({key: value}, details)."""
    with tempfile.TemporaryDirectory() as folder:
        body, folder = segment(), Path(folder)
        for method in ("auto", "none"):  # compiles the forms
            run(folder, body, method, 0.001, 1, 3.0)
        states, seconds, touch = run(folder, body, "auto")
        loose, loose_seconds, _ = run(folder, body, "none")
        figures = {
            "contact_tau_50kPa_rad_per_m": twist(states[-1]),
            "contact_cost_factor": seconds / loose_seconds,
        }
        details = {
            "first_touch_kPa": touch * 1e3,
            "kPa_tau_with_and_without_force_N_overlap_without_mm": [
                [s.pressure * 1e3, twist(s), twist(t), s.contact.force, t.wall_distance]
                for s, t in zip(states, loose)
            ],
            "steps_factorisations_CPU_s": [
                [s[-1].steps, s[-1].factorisations, t] for s, t in ((states, seconds), (loose, loose_seconds))
            ],
        }
        reference = Reference(folder, body, states, loose, touch)
        for piece in pieces:
            found, more = piece(reference)
            figures |= found
            details |= more
    return figures, details


def in_a_segment():
    """The part `contact-segment`: ({key: value}, details), of a finite segment's middle against the cell."""
    from benchmarks.contact_segment import beside_cell

    with tempfile.TemporaryDirectory() as folder:
        states = run(folder, segment(), "auto")[0]
        return beside_cell({s.pressure: twist(s) for s in states}, Path(folder))
