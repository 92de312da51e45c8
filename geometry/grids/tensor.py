"""A tensor grid with free places of its nodes, and the mesh of its cells that are not empty."""

from dataclasses import dataclass

import numpy as np

from pneunet.geometry import tags
from pneunet.geometry.hexahedra import CORNERS
from pneunet.geometry.meshfile import VolumeMesh

#: what a cell holds: nothing, the channel's air or that of a chamber, more by AIR_OF_GROUP for each further
#: pressure group; else a tag of geometry.tags
EMPTY, CHANNEL_AIR, CAVITY_AIR, AIR_OF_GROUP = 0, 1, 2, 2
#: corners of the lower face across an axis, seen from above: x, y and z in the order that turns right
_FACES = np.array(
    [
        [[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    ]
)


def _faces_of():
    """(kinds,) the tag of a solid's facet by the kind on its other side: across y and z, and across x, where
    a channel ends and has no wall."""
    beside = np.full(tags.GAP + 1, tags.OUTER)
    across = beside.copy()
    for group in range(1, tags.MOST_GROUPS + 1):
        first = AIR_OF_GROUP * (group - 1)
        chamber, channel = tags.cavity_tags(group)
        beside[first + CHANNEL_AIR], beside[first + CAVITY_AIR] = channel, chamber
        across[first + CHANNEL_AIR] = across[first + CAVITY_AIR] = chamber
    return beside, across


_BESIDE, _ACROSS = _faces_of()


@dataclass(frozen=True)
class TensorGrid:
    """points (nx + 1, ny + 1, nz + 1, 3) in mm; kinds (nx, ny, nz): what is in the cells.

    ends: {(axis, -1 or 1): tag of a solid's facets at that end of the grid, None for none}; OUTER where
    nothing is said.
    """

    points: np.ndarray
    kinds: np.ndarray
    ends: dict[tuple[int, int], int | None]

    def mesh(self, air: bool = False) -> VolumeMesh:
        """The solid and the gaps that are meshed, with its air or without."""
        solid = self.kinds >= tags.BODY
        kept = solid | (air & (self.kinds > EMPTY))
        kinds = np.where(solid, self.kinds, tags.AIR)
        cells = self._numbers(np.argwhere(kept), CORNERS)
        facets, facet_tags = zip(*(self._facets(axis) for axis in range(3)))
        used, cells = np.unique(cells, return_inverse=True)
        return VolumeMesh(
            self.points.reshape(-1, 3)[used],
            cells.reshape(-1, 8),
            kinds[kept],
            np.searchsorted(used, np.concatenate(facets)),
            np.concatenate(facet_tags),
        )

    def _numbers(self, cells, corners):
        """(n, corners) numbers of nodes."""
        shape = self.points.shape[:3]
        index = cells[:, None] + corners
        return np.ravel_multi_index(tuple(np.moveaxis(index, -1, 0)), shape)

    def _facets(self, axis):
        """Facets (n, 4) of the solid across an axis, turning right around what points out of it, and their
        tags (n,)."""
        pad = [(1, 1) if a == axis else (0, 0) for a in range(3)]
        kinds = np.pad(self.kinds, pad, constant_values=EMPTY)
        count = kinds.shape[axis]
        low, high = (np.take(kinds, range(a, b), axis) for a, b in ((0, count - 1), (1, count)))
        solid = [(k >= tags.BODY) & (k != tags.GAP) for k in (low, high)]
        found, told = [], []
        for inside, other, turn in ((solid[0] & ~solid[1], high, 1), (solid[1] & ~solid[0], low, -1)):
            cells = np.argwhere(inside)
            tag = (_BESIDE if axis else _ACROSS)[other[inside]]
            at = cells[:, axis]
            for place, side in ((0, -1), (self.kinds.shape[axis], 1)):
                end = self.ends.get((axis, side), tags.OUTER)
                tag[at == place] = -1 if end is None else end
            kept = tag >= 0
            found.append(self._numbers(cells[kept], _FACES[axis][::turn]))
            told.append(tag[kept])
        return np.concatenate(found), np.concatenate(told)
