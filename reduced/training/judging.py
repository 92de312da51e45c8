"""How far a trained law is from finite elements of designs that it has not seen.

Judged are states on the coarsest mesh, which most designs have, with the law for that mesh. All figures are
over the states of all designs together.
"""

from dataclasses import replace

import numpy as np

from pneunet.base.se3 import exp_pose
from pneunet.base.strains import RodStrains
from pneunet.reduced.trained.enthalpy import anharmonic_gradient, whitening
from pneunet.reduced.trained.law import KindLaw
from pneunet.reduced.training.states import Sample, States

Figures = dict[str, float]
#: name -> of each state
Misses = dict[str, np.ndarray]

#: mm; of the free segment whose tip is compared
TIP_LENGTH = 100.0
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
    free = law.free_strains(f.shape, f.pressure)
    closed = law.closed(f.shape, f.pressure, free)
    K = law.stiffness_at(f.shape, free, closed)
    M, D1 = whitening(law.kind, K)
    v = np.einsum("nij,nj->ni", M, f.strains + sample.change - free)
    by_v = D1[:, None] * (v + anharmonic_gradient(v, law.anharmonic_at(f.shape, free, closed)))
    forces = np.einsum("nij,ni->nj", M, by_v)
    own, _ = whitening(law.kind, symmetric(f.matrices))
    both = np.stack([forces - sample.forces, sample.forces], axis=2)
    error, size = np.linalg.norm(np.linalg.solve(np.swapaxes(own, 1, 2), both), axis=1).T
    return error / size


def symmetric(K: np.ndarray) -> np.ndarray:
    """The symmetric parts of matrices (n, 6, 6)."""
    return (K + np.swapaxes(K, 1, 2)) / 2


def within(law: KindLaw, states: States) -> np.ndarray:
    """(n, p) bool: whether strains that are not zero by symmetry lie within their 90 % intervals."""
    half = law.half_width(states.shape, states.pressure, exact=True)
    inside = np.abs(law.free_strains(states.shape, states.pressure) - states.strains) <= half
    return inside[:, law.quantile > 0]


def misses(law: KindLaw, sample: Sample) -> Misses:
    """{name: array} of a law's errors on a Sample that it has not seen."""
    law, sample = replace(law, level=0), sample.on(0)
    loaded = sample.free.loaded
    q = law.free_strains(loaded.shape, loaded.pressure)
    K = law.free_stiffness(sample.free.shape, sample.free.pressure)
    force = force_error(law, sample) if len(sample.forces) else np.zeros(0)
    return {
        "strain": strain_error(loaded, q),
        "tip": tip_error(loaded, q),
        "stiffness": stiffness_error(sample.free, K),
        "force": force[sample.doubled],
        "force in other directions": force[~sample.doubled],
        "inside": within(law, loaded),
    }


def figures(found: list[Misses]) -> Figures:
    """{figure: number} of a list of `misses`; nan where no state says."""
    m = {name: np.concatenate([one[name] for one in found]) for name in found[0]}

    def high(name):
        return float(np.percentile(m[name], 95)) if len(m[name]) else float("nan")

    return {
        "law_strain_median_rel": float(np.median(m["strain"])),
        "law_strain_p95_rel": high("strain"),
        "law_tip100_p95_rel": high("tip"),
        "law_stiffness_p95_rel": high("stiffness"),
        "law_force_p95_rel": high("force"),
        "force_in_other_directions_p95_rel": high("force in other directions"),
        "law_interval_coverage_90": float(m["inside"].mean()),
    }


def finest_mesh(law: KindLaw, held_out: Sample) -> Figures:
    """{figure: number} of the free strains on the finest of several meshes with the law as it is, which is
    for that mesh."""
    fine = held_out.free.of(held_out.free.level == law.level).loaded
    if not law.level or not len(fine.size):
        return {}
    error = strain_error(fine, law.free_strains(fine.shape, fine.pressure))
    return {
        "finest_mesh_held_out_designs": len(np.unique(fine.design)),
        "finest_mesh_strain_median_rel": float(np.median(error)),
        "finest_mesh_strain_p95_rel": float(np.percentile(error, 95)),
    }


def further_angles(found: list[tuple[np.ndarray, Misses]]) -> Figures:
    """{figure: number} of the free states of designs more slanted than the held-out ones; found: [(their
    numbers, `misses`)]."""
    if not found:
        return {}
    of_all = figures([missed for _, missed in found])
    kept = ("law_strain_median_rel", "law_strain_p95_rel", "law_tip100_p95_rel", "law_stiffness_p95_rel")
    told = {key.replace("law_", "further_angles_"): of_all[key] for key in kept}
    return {"further_angles_designs": sum(len(numbers) for numbers, _ in found)} | told
