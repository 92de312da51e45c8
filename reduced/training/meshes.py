"""How the difference of grids is learned (reduced.trained.mesh), and states on the coarse grid turned into
those on ever finer ones.

A design's states on a finer grid lie between its states on the coarse one. So a process of the coarse grid
says what that would give, and what it misses of the design's own states there, interpolated over the leading
strain, is taken off. On the finest grid layers at singular planes are half as thick as on the fine one, and
errors fall as h^ORDER: both together tell which share of the difference the fine grid still lacks. It is the
same for all designs, as few have the finest grid.
"""

import logging
from dataclasses import dataclass, replace

import numpy as np

from pneunet.reduced.trained.coordinates import Coordinates, cosine, odd
from pneunet.reduced.trained.enthalpy import symmetric, whitening
from pneunet.reduced.trained.free_path import FreePath
from pneunet.reduced.trained.free_stiffness import FreeStiffness
from pneunet.reduced.trained.mesh import MeshDifference
from pneunet.reduced.trained.side_by_side import SideBySide
from pneunet.reduced.training.regression import FitSettings, Slopes, fit_side_by_side
from pneunet.reduced.training.slopes import along, along_all, known_slopes, slopes_of, told_by_angle
from pneunet.reduced.training.states import Sample, States, folds

log = logging.getLogger(__name__)

#: of errors at re-entrant edges of 270 degrees: twice the singularity's exponent
ORDER = 1.1
#: the finest grid's differences from the fine one over what the fine one lacks
SEEN = 1 - 2**-ORDER
#: part of what the fine grid lacks that its extrapolation may be wrong by: orders of 0.9 to 1.5
ORDER_UNKNOWN = 0.2
#: designs on both grids that suffice to learn the difference; parts of its cross-validation
TELLING, PARTS = 8, 10
#: bounds of its processes' noises, over its own variance; states that their metrics are found on, and as many
#: slopes; their inducing points
NOISES = tuple((np.log(1e-6), np.log(most)) for most in (0.1, 0.1, 10.0))
MOST, INDUCING = 250, 400
#: of d log P/d log(leading strain) of states whose errors are told
FLATTEST = 0.2
#: of the intervals that uncertainties are
INTERVAL = 0.9


@dataclass(frozen=True)
class Differences:
    """Of n states on a finer grid from the coarse one: states, inputs (n, d): their lead_inputs, values (n,
    p), trust (n, p) and Slopes."""

    states: States
    inputs: np.ndarray
    values: np.ndarray
    trust: np.ndarray
    slopes: Slopes

    def fitted(self, some: np.ndarray, share: float, like: SideBySide | None = None) -> SideBySide:
        """The processes of the whole difference, `share` times these, from the states that are `some`
        (n,); like: other ones, whose metrics and noises are taken."""
        place = np.cumsum(some) - 1
        told = self.slopes.of(some[self.slopes.at])
        steep = Slopes(place[told.at], told.ways, share * told.values)
        data = self.inputs[some], share * self.values[some], self.states.design[some], self.trust[some]
        widths = (1, self.values.shape[1] - 1)
        settings = FitSettings(most=MOST, inducing=INDUCING, noises=NOISES)
        return fit_side_by_side(*data, widths, steep, like, settings)


def fit_meshes(
    sample: Sample, path: FreePath, stiffness: FreeStiffness, like: MeshDifference | None = None
) -> MeshDifference:
    """The MeshDifference of a Sample, of which `path` and `stiffness` are those of the coarse grid; like: one
    of more designs, whose metrics, noises and uncertainty are taken."""
    kind, co = sample.free.kind, Coordinates(sample.free.kind)
    both = np.intersect1d(sample.designs, sample.finer[0].design) if sample.finer else []
    if len(both) < TELLING:
        log.info(f"{kind}: {len(both)} designs on finer grids are too few: the law is one of the coarse grid")
        return MeshDifference.none(kind)

    def lead(s: States) -> np.ndarray:
        return co.leading(s.strains)

    def path_inputs(s: States) -> np.ndarray:
        return co.path_inputs(s.numbers, lead(s), path.closing.overlap(s.numbers, s.pressure, lead(s)))

    def stiffness_inputs(s: States) -> np.ndarray:
        return co.stiffness_inputs(s.numbers, s.strains)

    def strains(s: States) -> np.ndarray:
        return co.learned_strains(s.numbers, s.pressure, s.strains)

    def matrices(s: States) -> np.ndarray:
        return co.learned_stiffness(s.numbers, s.matrices)

    # where walls touch, grids differ by the load at which they do, which is no smooth function
    apart = sample.free.of(~sample.free.touching)
    known = [s.of(np.isin(s.design, apart.design) & ~s.touching) for s in sample.finer]
    of_strains = [
        _differences(path.learned, path_inputs, strains, sample.free.loaded, s.loaded, "strain_slopes")
        for s in known
    ]
    of_stiffness = [
        _differences(stiffness.smooth, stiffness_inputs, matrices, apart, s, "matrix_slopes") for s in known
    ]
    lacking, doubt = _lacking(of_strains, co.leading)
    stiffness_lacking, _ = _lacking(of_stiffness, co.leading)
    taken = (like.strains, like.stiffness) if like else (None, None)
    every = [np.ones(len(found[0].inputs), bool) for found in (of_strains, of_stiffness)]
    processes = of_strains[0].fitted(every[0], 1 + lacking, taken[0])
    if like and like.strains:
        uncertain = like.uncertainty, like.uncertainty_at_lead
    else:
        missed = _cross_validated(of_strains[0], 1 + lacking, processes)
        uncertain = np.hypot(missed, doubt).tolist()
    return MeshDifference(
        kind,
        processes,
        of_stiffness[0].fitted(every[1], 1 + stiffness_lacking, taken[1]),
        lacking / (1 + lacking),
        stiffness_lacking / (1 + stiffness_lacking),
        *uncertain,
    )


def _missed(process, inputs, outputs, states, slopes):
    """(values (n, p), slopes (n, s, p), nan where not known) of what `process` misses of States, of which
    `slopes` (n, s, ...) must be known."""
    x, y = inputs(states), outputs(states)
    values, missed = y - process(x), np.full((*slopes.shape[:2], y.shape[1]), np.nan)
    known = known_slopes(slopes) & told_by_angle(states)
    at, way = np.nonzero(known)
    if len(at):
        steep = slopes_of(states, known, inputs, outputs, np.ones(len(x), bool))
        missed[at, way] = steep.values - (process.with_slopes(x[at])[1] @ steep.ways[:, :, None])[:, :, 0]
    return values, missed


def _differences(process, inputs, outputs, coarse, fine, slopes):
    """The Differences of `fine` States from the `coarse` ones of the same designs; slopes: name of those of
    States that it takes."""
    co, fine = Coordinates(fine.kind), fine.of(np.isfinite(outputs(fine)).all(axis=1))
    (here, slopes_here), (there, slopes_there) = (
        _missed(process, inputs, outputs, s, getattr(s, slopes)) for s in (fine, coarse)
    )
    nodes, places = co.leading(coarse.strains), co.leading(fine.strains)
    for number in np.unique(fine.design):
        own, rows = coarse.design == number, fine.design == number
        here[rows] -= _interpolated(places[rows], nodes[own], there[own])
        slopes_here[rows] -= _interpolated(places[rows], nodes[own], slopes_there[own])
    parity = co.strain_parity if here.shape[1] == len(co.strain_parity) else co.stiffness_parity

    def lead_inputs(s: States) -> np.ndarray:
        return co.lead_inputs(s.numbers, co.leading(s.strains))

    known = np.isfinite(slopes_here).all(axis=2)
    at, way = np.nonzero(known)
    slopes = Slopes(at, along(fine.of(at), way, lead_inputs), slopes_here[at, way])
    trust = odd(parity, np.abs(cosine(fine.numbers)))
    return Differences(fine, lead_inputs(fine), here, trust, slopes)


def _interpolated(places, nodes, values):
    """(k, ...) at places (k,) of values (m, ...) at nodes (m,), linear, constant beyond; nan where there are
    none."""
    order = np.argsort(nodes)
    nodes, values = nodes[order], values[order]
    out = np.full((len(places), *values.shape[1:]), np.nan)
    flat, found = values.reshape(len(nodes), -1), out.reshape(len(places), -1)
    for column, given in zip(found.T, flat.T):
        good = np.isfinite(given)
        if good.any():
            column[:] = np.interp(places, nodes[good], given[good])
    return out


def _lacking(differences, leading):
    """(what the fine grid still lacks, over its difference from the coarse one; halves (2,) of 90 % intervals
    of the _errors by that)."""
    fine = differences[0]
    if len(differences) < 2 or not len(np.intersect1d(fine.states.design, differences[-1].states.design)):
        log.info(f"{fine.states.kind}: no design on a finest grid: the law is one of the fine grid")
        return 0.0, np.zeros(2)
    finest = differences[-1]
    before = np.full(finest.values.shape, np.nan)
    for number in np.unique(finest.states.design):
        rows, own = finest.states.design == number, fine.states.design == number
        leads = leading(finest.states.strains[rows]), leading(fine.states.strains[own])
        before[rows] = _interpolated(*leads, fine.values[own])
    known = np.isfinite(before).all(axis=1)
    trust, before, more = finest.trust[known], before[known], (finest.values - before)[known] / SEEN
    share = max((trust**2 * before * more).sum() / max((trust**2 * before**2).sum(), 1e-30), 0.0)
    wrong = np.abs(more - share * before) + ORDER_UNKNOWN * np.abs(share * before)
    states = finest.states.of(known)
    return share, np.quantile(_errors(states, trust * wrong), INTERVAL, axis=1)


def _errors(states, error):
    """(2, n) errors of the strains over the leading strain, at a pressure and at a leading strain, by that
    (n, p) of what is learned at a leading strain, times its trust."""
    lead, steep = Coordinates(states.kind).leading(states.strains), np.ones(len(error))
    for number in np.unique(states.design):
        own = np.flatnonzero(states.design == number)
        own = own[states.pressure[own] > 0]
        if len(own) > 1:
            steep[own] = np.gradient(np.log(states.pressure[own]), np.log(lead[own]))
    # next to a limit load the leading strain grows without bound
    at_pressure = np.hypot(error[:, 0] / np.maximum(steep, FLATTEST), np.linalg.norm(error[:, 1:], axis=1))
    return np.stack([at_pressure, np.linalg.norm(error, axis=1)])


def _cross_validated(differences, share, like):
    """(2,) halves of 90 % intervals of the _errors of processes with the metrics and noises of `like`, for
    designs that they have not learned from."""
    number, missed = differences.states.design, []
    for part in folds(np.unique(number), PARTS):
        out = np.isin(number, part)
        found = differences.fitted(~out, share, like)(differences.inputs[out])
        error = differences.trust[out] * (found - share * differences.values[out])
        missed.append(_errors(differences.states.of(out), error))
    return np.quantile(np.concatenate(missed, axis=1), INTERVAL, axis=1)


def converged(states: States, mesh: MeshDifference, fine: bool = False) -> States:
    """States on the coarse grid, or on the fine one, as a MeshDifference says that they are on ever finer
    ones: at the same leading strains."""

    def moved(s: States) -> np.ndarray:
        pressure, strains = mesh.converged(s.numbers, s.pressure, s.strains, fine)
        return np.column_stack([pressure, strains])

    def stiffened(s: States) -> np.ndarray:
        return mesh.converged_stiffness(s.numbers, s.strains, s.matrices, fine)

    if mesh.strains is None:
        return states
    co, (pressure, *strains) = Coordinates(states.kind), moved(states).T
    slopes = along_all(states, known_slopes(states.strain_slopes), moved)
    both = known_slopes(states.strain_slopes) & known_slopes(states.matrix_slopes)
    # walls are as far apart at the same leading strain
    lead = co.leading(states.strains)
    loads = co.closing_load(states.pressure, lead), co.closing_load(pressure, lead)
    return replace(
        states,
        pressure=pressure,
        strains=np.column_stack(strains),
        matrices=stiffened(states),
        closing=states.closing * np.divide(*loads, out=np.ones(len(lead)), where=loads[1] > 0),
        strain_slopes=slopes[:, :, 1:],
        pressure_slopes=slopes[:, :, 0],
        matrix_slopes=along_all(states, both, stiffened),
    )


def converged_sample(sample: Sample, mesh: MeshDifference) -> Sample:
    """The Sample on ever finer grids. Around free states, whitened by the stiffness, forces stay the same."""
    around = converged(sample.around, mesh)
    (M, D1), (M0, D0) = (whitening(around.kind, symmetric(s.matrices)) for s in (around, sample.around))
    change = np.linalg.solve(M, M0 @ sample.change[:, :, None])[:, :, 0]
    whitened = np.linalg.solve(np.swapaxes(M0, 1, 2), sample.forces[:, :, None])
    forces = (D1 / D0)[:, None] * (np.swapaxes(M, 1, 2) @ whitened)[:, :, 0]
    return replace(sample, free=converged(sample.free, mesh), around=around, change=change, forces=forces)


def truth(sample: Sample, mesh: MeshDifference) -> Sample:
    """What a law is judged by: the Sample on ever finer grids, with the free states on the fine grid, as a
    MeshDifference extrapolates them, where a design has those."""
    found = converged_sample(sample, mesh)
    if mesh.strains is None or not sample.finer:
        return found
    fine = converged(sample.finer[0], mesh, fine=True)
    others = found.free.of(~np.isin(found.free.design, fine.design))
    return replace(found, free=others.joined(fine))
