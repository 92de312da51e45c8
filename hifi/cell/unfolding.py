"""A state of a part of a cell as one of the whole cell: what breaks the symmetry starts from there."""

from collections.abc import Callable

import numpy as np

from pneunet.hifi.cell.problem import CellProblem
from pneunet.hifi.cell.symmetry import periodic_tree

#: mm
_TOLERANCE = 1e-5


def unfolding(part: CellProblem, whole: CellProblem) -> Callable[[np.ndarray], np.ndarray]:
    """What makes states (unknowns + multipliers + 6,) of the whole cell's system of those of the part's, in
    its first class of symmetry; both on the same grid."""
    node, turn = _images(part, part.nodes, whole.nodes)
    corner, _ = _images(part, _corners(part), _corners(whole))
    own = whole.classes[0]
    there = own.reduced >= 0

    def unfolded(state: np.ndarray) -> np.ndarray:
        values, array = part.expand(state[: part.unknowns]), np.zeros(len(whole.array))
        array[whole.displacement_dofs] = turn * values[part.displacement_dofs[node]]
        array[whole.pressure_dofs] = values[part.pressure_dofs[corner]]
        unknowns = np.zeros(own.unknowns)
        unknowns[own.reduced[there]] = (own.signs * array)[there]
        # in equilibrium the gauge carries nothing
        return np.concatenate([unknowns, np.zeros(own.gauge.shape[1]), state[-6:]])

    return unfolded


def _images(part, places, points):
    """(number of the part's node that a half turn takes to each of `points` (n, 3), that half turn's diagonal
    (n, 3)); places: of the part's nodes."""
    tree, wrapped = periodic_tree(places, part.segment.pitch)
    distance, nearest = zip(*(tree.query(wrapped(points * turn)) for turn in part.turns))
    best = np.argmin(distance, axis=0)
    rows = np.arange(len(points))
    if np.array(distance)[best, rows].max() > _TOLERANCE:
        raise ValueError("the part and the whole cell lie on different grids")
    return np.array(nearest)[best, rows], part.turns[best]


def _corners(problem):
    return problem.pressure_space.tabulate_dof_coordinates()[: len(problem.pressure_dofs)]
