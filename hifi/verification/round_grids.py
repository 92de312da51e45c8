"""Round bodies of triquadratic hexahedra: tensor grids, bent into place block by block (mm).

A block is a map of its lattice, places (n, 3) in the unit cube, to space. Blocks whose faces meet have the
same nodes there, so that nodes at one place are one.
"""

from collections.abc import Callable

import numpy as np
from basix import CellType as BasixCell
from basix import ElementFamily, LagrangeVariant, create_element

Map = Callable[[np.ndarray], np.ndarray]
#: half a side of the square in the middle of a cylinder's section, over its radius
_CORE = 0.45


def _lattice(counts):
    """(places (n, 3) of the nodes in the unit cube, cells (m, 27) in dolfinx's order of a cell's nodes)."""
    shape = 2 * np.array(counts) + 1
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    reference = create_element(ElementFamily.P, BasixCell.hexahedron, 2, LagrangeVariant.equispaced).points
    first = 2 * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    nodes = first + np.rint(2 * reference).astype(int)
    return index / (shape - 1), np.ravel_multi_index(tuple(np.moveaxis(nodes, -1, 0)), shape)


def joined(blocks: list[tuple[Map, tuple[int, int, int]]]) -> tuple[np.ndarray, np.ndarray]:
    """(points (n, 3), cells (m, 27)) of blocks (map, counts) whose nodes meet."""
    points, cells = [], []
    for place, counts in blocks:
        lattice, block = _lattice(counts)
        cells.append(block + sum(map(len, points)))
        points.append(place(lattice))
    stacked = np.concatenate(points)
    _, first, number = np.unique(stacked.round(9), axis=0, return_index=True, return_inverse=True)
    return stacked[first], number.ravel()[np.concatenate(cells)]


def _count(length, size):
    return int(np.ceil(length / size - 1e-9))


def _shell(size):
    """Elements from radius 1 to 2 whose edges are at most `size` times the radius."""
    return _count(np.log(2), size)


def sphere(size: float) -> tuple[np.ndarray, np.ndarray]:
    """An eighth of a sphere with radii 1 and 2: a block for each of the three faces of an eighth of a
    cube."""
    around, through = _count(np.pi / 4, size), _shell(size)

    def block(axis):
        def place(q):
            across = np.tan(np.pi / 4 * q[:, 1:])
            way = np.roll(np.column_stack([np.ones(len(q)), across]), axis, axis=1)
            return 2 ** q[:, :1] * way / np.linalg.norm(way, axis=1)[:, None]

        return place, (through, around, around)

    return joined([block(axis) for axis in range(3)])


def tube(size: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """A quarter of a slice of a tube along x with radii 1 and 2."""

    def place(q):
        radius, angle = 2 ** q[:, 1], np.pi / 2 * q[:, 2]
        return np.column_stack([length * q[:, 0], radius * np.cos(angle), radius * np.sin(angle)])

    return joined([(place, (1, _shell(size), _count(np.pi / 2, size)))])


def cylinder(size: float) -> tuple[np.ndarray, np.ndarray]:
    """Solid cylinder of radius and length 1 along x: a square core and four blocks around it."""
    along, around = _count(1.0, size), _count(np.pi / 2, size)
    through = _count(1 - _CORE, size)

    def core(q):
        return np.column_stack([q[:, 0], _CORE * (2 * q[:, 1:] - 1)])

    def side(turns):
        def place(q):
            at = 2 * q[:, 2] - 1
            inner = _CORE * np.column_stack([np.ones(len(q)), at])
            outer = np.column_stack([np.cos(np.pi / 4 * at), np.sin(np.pi / 4 * at)])
            section = inner + q[:, 1:2] * (outer - inner)
            turn = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), turns)
            return np.column_stack([q[:, 0], section @ turn])

        return place, (along, through, around)

    return joined([(core, (along, around, around)), *(side(turns) for turns in range(4))])
