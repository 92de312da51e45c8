"""The states of a data set that a law is trained on and judged by, and how designs are kept apart for the
judging."""

from dataclasses import dataclass, fields, replace

import numpy as np

from pneunet.base.files.dataset import CellData, full_matrices
from pneunet.reduced.trained.coordinates import REST, Coordinates

#: held-out designs that suffice to judge a law; with fewer the training designs are judged too, by laws that
#: have not seen them
ENOUGH = 100
#: parts that the training designs fall into for that
PARTS = 10
#: designs on a finer mesh that suffice to learn what it changes (measured: from two of them the law's guess
#: was three times off)
COMMON = 10
#: of a pressure: nearer to that of a state, first touch is known to lie before it, not where
NEAR = 1e-4


@dataclass(frozen=True)
class States:
    """Free states of one kind, rest included: shape (n, 13), pressure (n,), strains (n, 6), matrices (n, 6,
    6), design (n,) numbers, level (n,) of the mesh, the finest last, size (n,): norm of the free strains,
    rest taken off, at the case's top pressure; closing (n,): how far walls have come nearer, as if they could
    go on in the first state after touch, over the load (Coordinates.closing_load) and the normal pitch; nan
    in the states beyond and at rest. touching (n,) bool. strain_slopes (n, s, 6), matrix_slopes (n, s, 6, 6):
    derivatives along the `directions` (s, 13) of shape, nan where not known."""

    kind: str
    shape: np.ndarray
    pressure: np.ndarray
    strains: np.ndarray
    matrices: np.ndarray
    design: np.ndarray
    level: np.ndarray
    size: np.ndarray
    closing: np.ndarray
    touching: np.ndarray
    strain_slopes: np.ndarray
    matrix_slopes: np.ndarray
    directions: np.ndarray

    def of(self, chosen: np.ndarray) -> "States":
        """Those that are chosen, by rows or by (n,) bool."""
        return replace(self, **{f.name: getattr(self, f.name)[chosen] for f in fields(self)[1:-1]})

    @property
    def loaded(self) -> "States":
        """Those with pressure."""
        return self.of(self.pressure > 0)

    @property
    def case(self) -> np.ndarray:
        """(n,) equal for the states of one design on one mesh."""
        return self.design * (1 + self.level.max(initial=0)) + self.level

    @property
    def inputs(self) -> np.ndarray:
        """(n, d) Coordinates.inputs."""
        return Coordinates(self.kind).inputs(self.shape, self.pressure, self.level)


@dataclass(frozen=True)
class Sample:
    """Cells of one kind: free States, and of those at prescribed strains the free state (`around`, States),
    the change (m, 6) of the strains from there and the forces (m, 6). Designs with a number below `drawn` are
    the sample's, as held-out ones are; others were chosen."""

    free: States
    around: States
    change: np.ndarray
    forces: np.ndarray
    drawn: float = np.inf

    def of(self, designs: np.ndarray) -> "Sample":
        """Those of the designs with these numbers."""
        held = np.isin(self.around.design, designs)
        return self._with(self.free.of(np.isin(self.free.design, designs)), held)

    def on(self, level: int) -> "Sample":
        """Those on one mesh."""
        held = self.around.level == level
        return self._with(self.free.of(self.free.level == level), held)

    def on_common_meshes(self) -> "Sample":
        """Those on the coarsest mesh and on others that at least COMMON designs are computed on."""
        free, held = self.free, self.around
        rare = [
            level
            for level in np.unique(free.level)
            if level and len(np.unique(free.design[free.level == level])) < COMMON
        ]
        kept = ~np.isin(held.level, rare)
        return self._with(free.of(~np.isin(free.level, rare)), kept)

    def _with(self, free, held):
        return Sample(free, self.around.of(held), self.change[held], self.forces[held], self.drawn)

    @property
    def doubled(self) -> np.ndarray:
        """(m,) bool: prescribed are twice the free strains, others than those went in some direction."""
        free = self.around.strains - REST
        return np.linalg.norm(self.change - free, axis=1) < 1e-3 * np.linalg.norm(free, axis=1)

    @property
    def designs(self) -> np.ndarray:
        """Their numbers, each once."""
        return np.unique(self.free.design)


def sample_of(data: CellData, kind: str, held_out: bool) -> Sample:
    """The Sample of a kind's accepted cases in CellData, of the held-out designs or of all others."""
    k = data.about["kinds"].index(kind)
    cases = data.accepted & (data.kind == k) & (data.held_out == held_out)
    sizes = [min(size for key, size in mesh.items() if key != "name") for mesh in data.about["meshes"]]
    level = np.argsort(np.argsort(-np.array(sizes)))
    rows = np.flatnonzero(cases[data.case] & ~data.overlapping)
    free, held = rows[~data.prescribed[rows]], rows[data.prescribed[rows]]
    directions = np.array(data.about["directions"][kind])
    top = {}
    for i in free:  # pressures increase
        top[data.case[i]] = np.linalg.norm(data.strains[i] - REST)
    closing = {
        i: rate
        for case in top
        for i, rate in _closing(data, free[data.case[free] == case], Coordinates(kind))
    }
    at = {(data.case[i], round(float(data.pressure[i]), 6)): n for n, i in enumerate(free)}
    states = States(
        kind,
        data.shape[data.case[free]].astype(float),
        data.pressure[free].astype(float),
        data.strains[free].astype(float),
        data.matrices[free].astype(float),
        data.design[data.case[free]],
        level[data.mesh[data.case[free]]],
        np.array([top[data.case[i]] for i in free]),
        np.array([closing.get(i, np.nan) for i in free]),
        data.pressure[free] >= (1 - NEAR) * _met(data.first_touch[data.case[free]]),
        data.strain_slopes[free, : len(directions)].astype(float),
        full_matrices(data.stiffness_slopes[free, : len(directions)].astype(float)),
        directions,
    )
    held = np.array([i for i in held if (data.case[i], round(float(data.pressure[i]), 6)) in at], int)
    where = np.array([at[data.case[i], round(float(data.pressure[i]), 6)] for i in held], int)
    change = data.strains[held].astype(float) - states.strains[where]
    drawn = data.about.get("campaign", {}).get("designs", np.inf)
    return Sample(states, states.of(where), change, data.forces[held].astype(float), drawn)


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
    """[numbers of one part] of designs, dealt out at random, the same for the same designs."""
    part = np.random.default_rng(0).permutation(len(designs)) % parts
    return [designs[part == f] for f in range(parts)]


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
