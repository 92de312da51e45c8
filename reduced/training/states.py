"""The states of a data set that a law is trained on and judged by, and how designs are kept apart for the
judging."""

from dataclasses import dataclass, fields, replace

import numpy as np

from pneunet.base.files.dataset import CellData, full_matrices
from pneunet.reduced.trained.coordinates import REST, Coordinates

#: held-out designs that suffice to judge a law; with fewer the training designs are judged too, by laws that
#: have not seen them
ENOUGH = 50
#: parts that the training designs fall into for that
PARTS = 10
#: of a pressure: nearer to that of a state, first touch is known to lie before it, not where
NEAR = 1e-4


@dataclass(frozen=True)
class States:
    """Free states of one kind on one grid, rest included: numbers (n, 15), pressure (n,), strains (n, 6),
    matrices (n, 6, 6), design (n,) numbers, size (n,): norm of the free strains, rest taken off, at the
    design's top pressure on the coarsest grid; closing (n,): how far walls have come nearer, as if they could
    go on in the first state after touch, over the load (Coordinates.closing_load) and the normal pitch; nan
    in the states beyond and at rest. touching (n,) bool; stretch (n,): the largest; volume (n,) of air.
    strain_slopes (n, s, 6), matrix_slopes (n, s, 6, 6): derivatives along the `directions` (s, 15) of the
    numbers, nan where not known, while the pressure changes by pressure_slopes (n, s)."""

    kind: str
    numbers: np.ndarray
    pressure: np.ndarray
    strains: np.ndarray
    matrices: np.ndarray
    design: np.ndarray
    size: np.ndarray
    closing: np.ndarray
    touching: np.ndarray
    stretch: np.ndarray
    volume: np.ndarray
    strain_slopes: np.ndarray
    matrix_slopes: np.ndarray
    pressure_slopes: np.ndarray
    directions: np.ndarray

    def of(self, chosen: np.ndarray) -> "States":
        """Those that are chosen, by rows or by (n,) bool."""
        return replace(self, **{f.name: getattr(self, f.name)[chosen] for f in fields(self)[1:-1]})

    @property
    def loaded(self) -> "States":
        """Those with pressure."""
        return self.of(self.pressure > 0)

    @property
    def inputs(self) -> np.ndarray:
        """(n, d) Coordinates.inputs."""
        return Coordinates(self.kind).inputs(self.numbers, self.pressure)

    def measuring(self, others: "States") -> "States":
        """States of the same designs with the `size` that these have: of paths that ended earlier."""
        sizes = dict(zip(self.design, self.size))
        return replace(others, size=np.array([sizes.get(d, s) for d, s in zip(others.design, others.size)]))

    def joined(self, other: "States") -> "States":
        """These, then the others."""
        both = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)[1:-1]}
        return replace(self, **{name: np.concatenate(pair) for name, pair in both.items()})


@dataclass(frozen=True)
class Sample:
    """Cells of one kind on the coarsest grid: free States (where walls touch also the states of other meshes
    of that size, whose paths end there), and of cells at prescribed strains the free state (`around`,
    States), the change (m, 6) of the strains from there, the forces (m, 6), and doubled (m,) bool: whether
    the strains are twice the free ones; the others went in some direction. finer: free States of some of the
    designs on finer grids, the finest last. Designs with a number below `drawn` are the sample's, as held-out
    ones are; others were chosen."""

    free: States
    around: States
    change: np.ndarray
    forces: np.ndarray
    doubled: np.ndarray
    finer: tuple[States, ...] = ()
    drawn: float = np.inf

    def of(self, designs: np.ndarray) -> "Sample":
        """Those of the designs with these numbers."""
        free, *finer = (s.of(np.isin(s.design, designs)) for s in (self.free, *self.finer))
        held = np.isin(self.around.design, designs)
        around = self.around.of(held)
        return Sample(
            free, around, self.change[held], self.forces[held], self.doubled[held], tuple(finer), self.drawn
        )

    @property
    def designs(self) -> np.ndarray:
        """Their numbers, each once."""
        return np.unique(self.free.design)


def sample_of(data: CellData, kind: str, held_out: bool) -> Sample:
    """The Sample of a kind's accepted cases in CellData, of the held-out designs or of all others."""
    k = data.about["kinds"].index(kind)
    cases = data.accepted & (data.kind == k) & (data.held_out == held_out)
    sizes = np.array([min(v for key, v in m.items() if key.endswith("_mm")) for m in data.about["meshes"]])
    coarse = sizes == sizes.max()
    coarsest, finer = np.argmax(coarse), [m for m in np.argsort(-sizes) if not coarse[m]]
    usable = cases[data.case] & ~data.overlapping
    mesh = data.mesh[data.case]
    states, row = _free_states(data, kind, np.flatnonzero(usable & (mesh == coarsest)))
    held = np.array([i for i in np.flatnonzero(usable & data.prescribed) if _state(data, i) in row], int)
    where = np.array([row[_state(data, i)] for i in held], int)
    around = states.of(where)
    change = data.strains[held].astype(float) - around.strains
    free = around.strains - REST
    doubled = np.linalg.norm(change - free, axis=1) < 1e-3 * np.linalg.norm(free, axis=1)
    others = (_free_states(data, kind, np.flatnonzero(usable & (mesh == m)))[0] for m in finer)
    known = tuple(states.measuring(s) for s in others if len(s.design))
    again = (
        coarse[mesh] & (mesh != coarsest) & np.isin(data.design[data.case], states.design[states.touching])
    )
    if (usable & again).any():
        before, _ = _free_states(data, kind, np.flatnonzero(usable & again))
        states = states.joined(states.measuring(before.loaded))
    drawn = data.about["campaign"].get("designs", np.inf)
    return Sample(states, around, change, data.forces[held].astype(float), doubled, known, drawn)


def _state(data, i):
    """What a free state and those prescribed at its pressure have in common."""
    return data.case[i], round(float(data.pressure[i]), 6)


def _free_states(data, kind, rows):
    """(States of those of the data set's rows that are free, {_state: place among them})."""
    free = rows[~data.prescribed[rows]]
    case, directions = data.case[free], np.array(data.about["directions"][kind], float)
    top = {data.case[i]: np.linalg.norm(data.strains[i] - REST) for i in free}  # pressures increase
    closing = {
        i: rate for number in top for i, rate in _closing(data, free[case == number], Coordinates(kind))
    }
    states = States(
        kind,
        np.hstack([data.shape[case], data.stiffening[case]]).astype(float),
        data.pressure[free].astype(float),
        data.strains[free].astype(float),
        data.matrices[free].astype(float),
        data.design[case],
        np.array([top[number] for number in case]),
        np.array([closing.get(i, np.nan) for i in free]),
        data.pressure[free] >= (1 - NEAR) * _met(data.first_touch[case]),
        data.largest_stretch[free].astype(float),
        data.volume[free].astype(float),
        data.strain_slopes[free, : len(directions)].astype(float),
        full_matrices(data.stiffness_slopes[free, : len(directions)].astype(float)),
        np.zeros((len(free), len(directions))),
        directions,
    )
    return states, {_state(data, i): place for place, i in enumerate(free)}


def _met(first_touch):
    """Pressures of first touch, infinite where there was none."""
    return np.where(np.isfinite(first_touch), first_touch.astype(float), np.inf)


def _closing(data, rows, coordinates):
    """Pairs (row, States.closing) of a case's free states, which have these rows, at rest first: those that
    say something."""
    distance, pressure = (a[rows].astype(float) for a in (data.wall_distance, data.pressure))
    lead = coordinates.leading(data.strains[rows].astype(float))
    load, first = coordinates.closing_load(pressure, lead), _met(data.first_touch[data.case[rows[0]]])
    for n in range(1, len(rows)):
        if load[n] <= 0:
            continue
        if pressure[n] < (1 - NEAR) * first:
            yield rows[n], (distance[0] - distance[n]) / load[n]
        else:
            if pressure[n] > (1 + NEAR) * first > 0:
                yield rows[n], distance[0] / np.interp(first, pressure, load)
            return


def folds(designs: np.ndarray, parts: int) -> list[np.ndarray]:
    """[numbers of one part] of designs, dealt out at random, the same for the same designs; as many parts as
    there are designs, where these are fewer."""
    part = np.random.default_rng(0).permutation(len(designs)) % parts
    return [designs[part == f] for f in range(min(parts, len(designs)))]


def splits(training: Sample, held_out: Sample) -> list[tuple[Sample, Sample]]:
    """[(what a law learns from, what it is judged on)] of two Samples: as they are, and where the held-out
    designs are too few also by PARTS of those training designs that were drawn as they were."""
    pairs = [(training, held_out)]
    if len(held_out.designs) < ENOUGH:
        every, drawn = training.designs, training.designs[training.designs < training.drawn]
        pairs += [
            (training.of(np.setdiff1d(every, judged)), training.of(judged)) for judged in folds(drawn, PARTS)
        ]
    return pairs
