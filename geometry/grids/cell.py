"""The grid of a unit cell: one pitch of a uniform segment, or the part of it from which half turns make the
rest."""

import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry import tags
from pneunet.geometry.ends import lean
from pneunet.geometry.fillets import NO_CELL, refuse_fillets
from pneunet.geometry.grids.morph import Morph
from pneunet.geometry.grids.planes import SAME, along, sideways, upright
from pneunet.geometry.grids.tensor import CAVITY_AIR, CHANNEL_AIR, EMPTY, TensorGrid
from pneunet.geometry.parameters import ONE_SIDED, TWISTING, Segment
from pneunet.geometry.snapping import snapped

#: kind -> diagonals of the half turns, about axes through a chamber's middle, that take a cell to itself
HALF_TURNS = {ONE_SIDED: ((-1, -1, 1),), TWISTING: ((-1, -1, 1), (1, -1, -1), (-1, 1, -1))}


#: mm; a plane further from all places is missed. Morph's interpolation moves them by rounding alone
MISSED = 1e-6


def cell_grid(
    segment: Segment,
    size: float,
    layer: float | None = None,
    gaps: bool = False,
    part: bool = False,
    like: Segment | None = None,
    cut: int = 1,
) -> TensorGrid:
    """The cell of `segment`, a chamber centred at xi = 0, with elements whose edges along x, y and z are at
    most `size` mm.

    layer (mm): one element of this thickness on each side of every plane in which stresses are singular.
    gaps: the room between the chambers is meshed too. part: only xi >= 0, and of a twisting cell only y >= 0:
    HALF_TURNS make the rest. like: a segment whose elements the grid has, as many between any two planes,
    whatever size they come to here: a response on such grids is smooth in the design. InputError where the
    planes of the two stand in another order. cut: into how many equal parts along each axis elements are cut;
    grids of several are nested.
    """
    refuse_fillets([segment], NO_CELL)
    s = snapped(segment)
    twisting, planes = s.kind == TWISTING, like or s
    xi = along(planes).divided(size, layer)
    y = sideways(planes, middle=twisting).divided(size, layer)
    z = upright(planes, size).divided(size, layer)
    if like:
        to = Morph(like, s)
        xi, y, z = (_apart(a) for a in (to.along(xi), to.sideways(y), to.upright(z)))
        own = along(s), sideways(s), upright(s, np.inf)
        if not all(_has(places, planes) for places, planes in zip((xi, y, z), own)):
            raise InputError(
                "a grid like another cell's has planes in the order of those, which this cell's are not in:"
                " leave out alike"
            )
    xi, y, z = (_cut(places, cut) for places in (xi, y, z))
    if not part:
        xi = np.concatenate([-xi[:0:-1], xi])
    if part and twisting:
        y = y[y > -SAME]
    middles = [(a[1:] + a[:-1]) / 2 for a in (xi, y, z)]
    places = np.meshgrid(*middles, indexing="ij", sparse=True)
    kinds = contents(s, places[0], places[1], places[2], gaps=gaps)
    ends: dict[tuple[int, int], int | None] = {(0, -1): None, (0, 1): None}
    if part and twisting:
        ends[1, -1] = None
    return TensorGrid(sheared(s, xi, y, z), kinds, ends)


def _cut(places, parts):
    """With as many equal parts between each two."""
    return np.interp(np.arange((len(places) - 1) * parts + 1) / parts, np.arange(len(places)), places)


def _apart(places):
    """Those that differ: planes of another cell may be one here."""
    return places[np.append(True, np.diff(places) > SAME)]


def _has(places, planes):
    """Whether the planes are among places (n,), mm."""
    return np.abs(np.subtract.outer(planes.places, places)).min(axis=1).max() < MISSED


def sheared(segment: Segment, xi: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """(nx, ny, nz, 3) places of the planes' crossings."""
    X, Y, Z = np.meshgrid(xi, y, z, indexing="ij")
    return np.stack([X + lean(segment, Y, Z), Y, Z], axis=-1)


def contents(
    segment: Segment, xi: np.ndarray, y: np.ndarray, z: np.ndarray, body: int = tags.BODY,
    layer: int = tags.LAYER, gaps: bool = False,
) -> np.ndarray:  # fmt: skip
    """What is at places in the segment's own axes, arrays that broadcast: kinds of TensorGrid. xi from the
    nearest chamber's middle; infinite where there is none."""
    s = segment
    side = np.where(z < 0, -1, 1) if s.kind == TWISTING else 1
    height = side * z
    within = np.abs(y) < s.width / 2
    in_core = within & (s.core_bottom < z) & (z < s.core_top)
    channel = (np.abs(y) < s.channel_width / 2) & (np.abs(z) < s.channel_height / 2)
    kinds = np.where(in_core, np.where(z < s.layer_top, layer, body), EMPTY) + 0 * np.zeros_like(xi, int)
    if s.sides:
        above = within & (s.core_top < height) & (height < s.chamber_top)
        wall = np.abs(xi) < s.chamber_thickness / 2 / s.sin
        kinds = np.where(above & wall, body, np.where(above & ~wall & gaps, tags.GAP, kinds))
        cavity = (np.abs(xi) < s.cavity_thickness / 2 / s.sin) & (np.abs(y) < s.cavity_width / 2)
        cavity = cavity & (s.cavity_floor < height) & (height < s.cavity_top)
        kinds = np.where(cavity, CAVITY_AIR, kinds)
    return np.where(channel, CHANNEL_AIR, kinds)
