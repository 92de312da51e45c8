"""The way to a rod's equilibrium: Newton's method, load steps where a whole one fails, elements halved until
the answer stands still."""

from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.errors import ConvergenceError
from pneunet.reduced.rod.elements import NodalLoads, RodElements, is_minimum

if TYPE_CHECKING:
    from pneunet.reduced.rod.rod import Rod

ITERATIONS = 12
#: a Newton step turns the rod by at most so much, summed along it (rad), and strains it by at most so much;
#: longer ones are shortened
LARGEST_TURN, LARGEST_STRAIN = 2.0, 0.3
SMALLEST_LOAD_STEP = 1 / 2048
#: the coarsest elements: shares of the rod's length that turn less than this (rad) in the free state; and how
#: often they are halved
FIRST_ELEMENTS, FIRST_TURN, HALVINGS = 16, 0.4, 8
#: rad, an element's turn beyond which finer ones are needed; so often are finer ones tried where no
#: equilibrium is found
LARGEST_ELEMENT_TURN, RETRIES = 3.0, 3


class Grid:
    """A rod cut into elements, counts (pieces,) of them, with its loads at the nodes.

    vectors: gravity (3,) in mm/s2, tip force in N, tip moment in N mm, distributed force in N/mm.
    """

    def __init__(self, rod: "Rod", counts: np.ndarray, vectors: list[np.ndarray]) -> None:
        gravity, tip_force, tip_moment, distributed = vectors
        self.counts, self.iterations, self.load_steps = counts, 0, 0
        owner = np.repeat(np.arange(len(counts)), counts)
        h = (rod.lengths / counts)[owner]
        self.s = np.concatenate([[0.0], np.cumsum(h)])
        self.elements = RodElements(h, [rod.pieces[i] for i in owner], rod.base_pose)
        self.loads = NodalLoads(len(h))
        mass = np.array([p.mass for p in rod.pieces])[owner] * h
        centre = np.array([(0.0, *p.mass_centre) for p in rod.pieces])[owner]
        # half of an element's load at either end; the clamp takes what is at node 0
        for part, elements in ((slice(None), slice(None)), (slice(None, -1), slice(1, None))):
            self.loads.add(part, 0.5 * mass[elements, None] * gravity, centre[elements])
            self.loads.add(part, 0.5 * h[elements, None] * distributed)
        self.loads.add(-1, tip_force, (0.0, *rod.tip_centre))
        self.loads.moments[-1] += tip_moment

    def from_coarser(self, coarse: "Grid", x: np.ndarray) -> np.ndarray:
        """x (n, 6) of the grid `coarse` on this one: linear in between within each piece."""
        first = np.repeat(np.cumsum(coarse.counts) - coarse.counts, coarse.counts)
        last = first + np.repeat(coarse.counts, coarse.counts) - 1
        i = np.arange(len(x))
        left, right = np.maximum(i - 1, first), np.minimum(i + 1, last)
        slope = (x[right] - x[left]) / np.maximum(right - left, 1)[:, None]
        halves = np.repeat(self.counts // coarse.counts, coarse.counts)  # 1 or 2
        parent = np.repeat(i, halves)
        second = np.arange(len(parent)) - (np.cumsum(halves) - halves)[parent]
        return x[parent] + ((halves[parent] - 1) * (second - 0.5) / 2)[:, None] * slope[parent]

    def newton(self, x: np.ndarray, factor: float, small: float) -> np.ndarray | None:
        """The equilibrium near x (n, 6) under `factor` of the loads, or None: not found, or (without moments)
        not stable.

        small: the step (strains, k times the length) after which to stop; the next one would be of the order
        of its square.
        """
        loads, reach, h = self.loads.scaled(factor), self.s[-1], self.elements.lengths
        for _ in range(ITERATIONS):
            self.iterations += 1
            step, tangent = self.elements.newton_step(x, loads)
            if step is None or not np.isfinite(step).all():
                return None
            k, e = np.linalg.norm(step[:, :3], axis=1), abs(step[:, 3:]).max()
            x = x + step / max(1.0, k @ h / LARGEST_TURN, e / LARGEST_STRAIN)
            if (np.linalg.norm(x[:, :3], axis=1) * h).max() > LARGEST_ELEMENT_TURN:
                return None
            if max(k.max() * reach, e) < small:
                return x if not loads.conservative or is_minimum(tangent) else None
        return None

    def follow(self, small: float, step: float = 1.0) -> np.ndarray:
        """The equilibrium reached from the free state, the loads growing, from a first `step` on, as fast as
        Newton's method lets them."""
        x, before, reached = self.elements.free(), None, 0.0
        while reached < 1.0:
            aim = min(1.0, reached + step)
            guess = x if before is None else x + (x - before[0]) * (aim - reached) / (reached - before[1])
            found = self.newton(guess, aim, small)
            if found is None:
                step = (aim - reached) / 2
                if step < SMALLEST_LOAD_STEP:
                    raise ConvergenceError(
                        f"rod: no stable equilibrium follows beyond {100 * reached:.4g} % of the loads: the"
                        " rod buckles or snaps there, or its law knows no further; lower the loads, or"
                        " disturb a perfect symmetry by a small side force"
                    )
                continue
            self.load_steps += 1
            before, x, reached, step = (x, reached), found, aim, 2 * (aim - reached)
        return x


def refine(
    rod: "Rod", vectors: list[np.ndarray], tolerance: float, first_load: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, int, int]:
    """(s (n + 1,), poses (n + 1, 4, 4), wrenches (n, 6), error in mm, iterations, load steps) of a rod's
    equilibrium.

    vectors: see Grid. tolerance: of the length; first_load: share of the loads. The error of constant strains
    is of second order, so an answer is three times nearer to the limit than to that of elements twice as
    long.
    """
    lengths, turn = rod.lengths, np.linalg.norm(rod.free_strains.k, axis=1)
    size = np.minimum(lengths.sum() / FIRST_ELEMENTS, FIRST_TURN / np.maximum(turn, 1e-12))
    before, iterations, load_steps, error = None, 0, 0, np.inf
    for halvings in range(HALVINGS + 1):
        # powers of two, so that every node remains one
        counts = 2 ** np.maximum(np.ceil(np.log2(lengths * 2**halvings / size) - 1e-9), 0).astype(int)
        grid = Grid(rod, counts, vectors)
        x = grid.newton(grid.from_coarser(*before[:2]), 1.0, tolerance) if before else None
        try:
            x = grid.follow(tolerance, first_load) if x is None else x
        except ConvergenceError:
            if halvings == RETRIES:
                raise
            before = None
            continue
        poses = grid.elements.poses(x)
        iterations, load_steps = iterations + grid.iterations, load_steps + grid.load_steps
        if before:
            coarse, _, coarse_poses = before
            kept = np.concatenate([[0], np.cumsum(np.repeat(counts // coarse.counts, coarse.counts))])
            error = float(np.linalg.norm(poses[kept, :3, 3] - coarse_poses[:, :3, 3], axis=1).max() / 3)
            if error <= tolerance * lengths.sum():
                return grid.s, poses, grid.elements.wrenches(x), error, iterations, load_steps
        before = grid, x, poses
    raise ConvergenceError(
        f"rod: {counts.sum()} elements leave an error of {error:.2g} mm: ask for a larger tolerance"
    )
