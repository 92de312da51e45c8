"""How far a trained law is from finite elements of designs that it has not seen.

The law is for ever finer grids, and so is what it is judged by (reduced.training.meshes.truth): states on the
fine grid, extrapolated, of designs that have them, and those on the coarse grid with the learned difference
of the others. All figures are over the states of all designs together.
"""

import numpy as np

from pneunet.base.se3 import exp_pose
from pneunet.base.strains import RodStrains
from pneunet.reduced.trained.enthalpy import anharmonic_gradient, symmetric, whitening
from pneunet.reduced.trained.kind_law import KindLaw
from pneunet.reduced.training.meshes import truth
from pneunet.reduced.training.states import Sample, States

Figures = dict[str, float]
#: name -> of each state
Misses = dict[str, np.ndarray]

#: mm; of the free segment whose tip is compared
TIP_LENGTH = 100.0
#: degrees from 90, of segments of 30 to 40 degrees or their mirror images
SLANTED = 50.0
#: mm; normal pitch of the segments that stand for shape numbers; and of each strain its unit of length
PITCH = 5.0
UNITS = np.array([1, 1, 1, PITCH, PITCH, PITCH])


def strain_error(states: States, strains: np.ndarray) -> np.ndarray:
    """(n,) norm of the error over the norm of the free strains at top pressure."""
    return np.linalg.norm(strains - states.strains, axis=1) / states.size


def tip_error(states: States, strains: np.ndarray) -> np.ndarray:
    """(n,) distance of the tips of free segments of TIP_LENGTH, at normal pitch PITCH, over that length."""
    twists = (RodStrains.of_vector(q / UNITS).twist_vector for q in (states.strains, strains))
    tips = [exp_pose(TIP_LENGTH * twist)[:, :3, 3] for twist in twists]
    return np.linalg.norm(tips[1] - tips[0], axis=1) / TIP_LENGTH


def stiffness_error(states: States, K: np.ndarray) -> np.ndarray:
    """(n,) largest |1 - eigenvalue| of K_FE^-1 K."""
    values = np.linalg.eigvals(np.linalg.solve(states.matrices, K)).real
    return np.abs(values - 1).max(axis=1)


def force_error(law: KindLaw, sample: Sample) -> np.ndarray:
    """(m,) norm of the force error over that of the force, whitened by the stiffness; law alone, its free
    states included."""
    f = sample.around
    free = law.free_strains(f.numbers, f.pressure)
    closed = law.closed(f.numbers, f.pressure, free)
    K = law.stiffness_at(f.numbers, free, closed)
    M, D1 = whitening(law.kind, K)
    v = np.einsum("nij,nj->ni", M, f.strains + sample.change - free)
    by_v = D1[:, None] * (v + anharmonic_gradient(v, law.anharmonic_at(f.numbers, free, closed)))
    forces = np.einsum("nij,ni->nj", M, by_v)
    own, _ = whitening(law.kind, symmetric(f.matrices))
    both = np.stack([forces - sample.forces, sample.forces], axis=2)
    error, size = np.linalg.norm(np.linalg.solve(np.swapaxes(own, 1, 2), both), axis=1).T
    return error / size


def within(law: KindLaw, states: States) -> np.ndarray:
    """(n, p) bool: whether strains that are not zero by symmetry lie within their 90 % intervals, those of
    the grid left out: what is judged by carries the grid's uncertainty itself."""
    strains, half = law.strains_and_own_half_width(states.numbers, states.pressure, exact=True)
    return (np.abs(strains - states.strains) <= half)[:, law.quantile > 0]


def misses(law: KindLaw, sample: Sample) -> Misses:
    """{name: array} of a law's errors on a Sample that it has not seen."""
    judged = truth(sample, law.mesh)
    loaded = judged.free.loaded
    q = law.free_strains(loaded.numbers, loaded.pressure)
    K = law.free_stiffness(judged.free.numbers, judged.free.pressure)
    force = force_error(law, judged) if len(judged.forces) else np.zeros(0)
    return {
        "strain": strain_error(loaded, q),
        "tip": tip_error(loaded, q),
        "stiffness": stiffness_error(judged.free, K),
        "force": force[judged.doubled],
        "force in other directions": force[~judged.doubled],
        "inside": within(law, loaded),
        "slanted": np.abs(90 - loaded.numbers[:, 0]) >= SLANTED,
        "fine": np.isin(loaded.design, sample.finer[0].design if sample.finer else []),
    }


def figures(found: list[Misses]) -> Figures:
    """{figure: number} of a list of `misses`; nan where no state says."""
    m = {name: np.concatenate([one[name] for one in found]) for name in found[0]}

    def share(errors, percent):
        return float(np.percentile(errors, percent)) if len(errors) else float("nan")

    slanted, fine = m["strain"][m["slanted"]], m["strain"][m["fine"]]
    return {
        "law_strain_median_rel": share(m["strain"], 50),
        "law_strain_p95_rel": share(m["strain"], 95),
        "law_angles_30_40_p95_rel": share(slanted, 95),
        "law_tip100_p95_rel": share(m["tip"], 95),
        "law_stiffness_p95_rel": share(m["stiffness"], 95),
        "law_force_p95_rel": share(m["force"], 95),
        "force_in_other_directions_p95_rel": share(m["force in other directions"], 95),
        "law_interval_coverage_90": float(m["inside"].mean()),
        "fine_grid_states": len(fine),
        "fine_grid_strain_median_rel": share(fine, 50),
        "fine_grid_strain_p95_rel": share(fine, 95),
    }
