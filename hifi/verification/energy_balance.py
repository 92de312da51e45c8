"""The work that the pressure does on a pneu-net is the energy stored in it.

Int P dV = P V - int V dP, the last by Simpson's rule over states at equal steps of pressure: the rule on
every state, on every second and on every fourth shows its own error, a sixteenth each time the step is
halved.
"""

import numpy as np
from scipy.integrate import simpson

from pneunet.geometry.designfile import read_design_file
from pneunet.hifi.body.manipulator import ManipulatorSolve
from pneunet.hifi.verification import reference_case

PRESSURE = 0.02


def balance(intervals: int = 8) -> tuple[list[tuple[int, float]], int]:
    """([(intervals, work of the pressure / stored energy - 1), coarsest rule first], dofs) of the shipped
    two-segment body."""
    design = read_design_file(reference_case.DATA / "reference.toml")
    solve = ManipulatorSolve(design.manipulator, reference_case.DATA / "reference.npz")
    pressures = np.linspace(0.0, PRESSURE, intervals + 1)
    volume = {0.0: solve.problem.cavity_volume()}
    solve.run(
        PRESSURE,
        lambda measured: volume.update({measured.pressure: measured.volume}),
        milestones=pressures[1:],
    )
    stored, dofs = solve.problem.stored_energy(), solve.problem.dofs
    solve.destroy()
    V = np.array([volume[P] for P in pressures])
    found = []
    for stride in (4, 2, 1):
        work = PRESSURE * V[-1] - simpson(V[::stride], x=pressures[::stride])
        found.append((intervals // stride, float(work / stored - 1)))
    return found, dofs
