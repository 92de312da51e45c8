"""What a trained law learns instead of strains and stiffness: smooth numbers of order one that keep the
body's symmetries.

All without dimension (base.files.dataset): pressure P/mu, strains q = (e, k l). With c = cos(angle), mirror
images have opposite c, and every quantity is even or odd in c: e2, k1 and k3 change sign in the mirror. Odd
ones are c times an even function, which is learned as a function of c^2 and the logarithms of the lengths:
what makes a design soft is a product of powers. How the silicone stiffens is
an input as it is. The free strains are led by the one that never vanishes, the
curvature k2 of a one-sided, the stretch of a twisting segment; the others are divided by it. The stiffness is
L D L^T by the blocks that the half turns of the body leave: unit lower triangular L and log D.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.base.strains import MIRROR, RodStrains
from pneunet.geometry.parameters import ONE_SIDED, TWISTING
from pneunet.geometry.shape_numbers import NUMBERS, SHAPE, STIFFENING

REST = RodStrains.unstrained().vector
#: P/mu below which the response is linear anyway: the logarithm is taken of their sum
SMALL_PRESSURE = 0.01
#: the same of the leading strain
SMALL_STRAIN = 0.1
#: what loads a cell and what holds it: kind -> name -> sum of Segment's lengths; as many as the sample varies
#: on their own. (Measured: a tenth off the error of the free strains against the lengths themselves.)
_OF_BOTH: dict[str, dict[str, float]] = {
    "width": {"width": 1},
    "cavity's rise over the core": {
        "cavity_floor": 1,
        "chamber_height": 1,
        "channel_height": -0.5,
        "roof": -1,
    },
    "cavity_thickness": {"cavity_thickness": 1},
    "wall": {"wall": 1},
    "top_wall": {"top_wall": 1},
    "channel_width": {"channel_width": 1},
    "channel_height": {"channel_height": 1},
}
LENGTHS = {
    ONE_SIDED: _OF_BOTH | {"core's height": {"base_thickness": 1, "channel_height": 1, "roof": 1}},
    TWISTING: _OF_BOTH
    | {"core's half height": {"channel_height": 0.5, "roof": 1}, "cavity_floor": {"cavity_floor": 1}},
}
#: kind -> lengths that the sample varies and that LENGTHS knows only in sums
IN_SUMS = {
    ONE_SIDED: ("chamber_height", "gap", "base_thickness"),
    TWISTING: ("chamber_height", "gap", "roof"),
}
#: of a normal pitch; lengths that are smaller, or negative, count as this
SMALLEST = 1e-3
#: of a ratio whose logarithm is taken; and part of the gap over which walls come to touch
TINY, TOUCH_WIDTH = 1e-6, 0.01
#: of a normal pitch, by which walls would overlap
SMALL_OVERLAP = 0.01
#: the gap's place among the numbers
GAP = SHAPE.index("gap")
#: places of the leading strain and the overlap among the path_inputs
LEAD, OVERLAP = -2, -1
#: kind -> (index of the leading strain, of the others that are not zero)
LEADING = {ONE_SIDED: (4, (0, 1, 3)), TWISTING: (0, (3,))}
#: kind -> blocks of the stiffness
BLOCKS = {ONE_SIDED: ((0, 1, 3, 4), (2, 5)), TWISTING: ((0, 3), (1, 4), (2, 5))}


@dataclass(frozen=True)
class Coordinates:
    """The transformations for one kind of segment. numbers (n, 15): geometry.shape_numbers.NUMBERS, without
    dimension."""

    kind: str

    @cached_property
    def of_cell(self) -> int:
        """How many of the inputs come first that say what the cell is like, whatever its load."""
        return 1 + len(LENGTHS[self.kind]) + len(STIFFENING)

    @cached_property
    def stiffening(self) -> slice:
        """Places of the silicone's stiffening among the inputs."""
        return slice(1 + len(LENGTHS[self.kind]), self.of_cell)

    def _with(self, numbers, load):
        x = np.empty((len(numbers), self.of_cell + 1))
        x[:, 0], x[:, self.stiffening], x[:, -1] = cosine(numbers) ** 2, numbers[:, len(SHAPE) :], load
        # not out=: numpy's logarithm into strided memory differs in the last bit with where that memory
        # happens to lie
        x[:, 1 : self.stiffening.start] = np.log(self._lengths(numbers))
        return x

    def inputs(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, d) regression inputs of numbers (n, 15) and P/mu (n,)."""
        return self._with(numbers, np.log(pressure + SMALL_PRESSURE))

    def lead_inputs(self, numbers: np.ndarray, lead: np.ndarray) -> np.ndarray:
        """(n, d) the same with the leading strain (n,) in the place of the pressure."""
        return self._with(numbers, np.log(lead + SMALL_STRAIN))

    def ranged(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, r) what the training designs' ranges are told of: the inputs, and the logarithms of the lengths
        that those know only in sums."""
        apart = np.log(np.maximum(numbers[:, [SHAPE.index(name) for name in IN_SUMS[self.kind]]], SMALLEST))
        return np.hstack([self.inputs(numbers, pressure), apart])

    def ranged_slopes(self, numbers: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """(n, r, 14) derivatives of `ranged` by the 13 shape numbers and P/mu."""
        d, apart = self.of_cell + 1, [SHAPE.index(name) for name in IN_SUMS[self.kind]]
        by = np.zeros((len(numbers), d + len(apart), len(SHAPE) + 1))
        by[:, :d] = self.by_shape(numbers, np.broadcast_to(np.eye(d), (len(numbers), d, d)))
        by[:, d - 1, -1] = 1 / (pressure + SMALL_PRESSURE)
        by[:, d + np.arange(len(apart)), apart] = 1 / np.maximum(numbers[:, apart], SMALLEST)
        return by

    def path_inputs(self, numbers: np.ndarray, lead: np.ndarray, overlap: np.ndarray) -> np.ndarray:
        """(n, d + 1) `lead_inputs` and `overlap_input` (n,)."""
        return np.column_stack([self.lead_inputs(numbers, lead), self.overlap_input(overlap)])

    @staticmethod
    def overlap_input(overlap: np.ndarray) -> np.ndarray:
        """(n,) regression input of by how much walls would overlap (n,), in normal pitches: the same for all
        that are apart."""
        return np.log(np.maximum(overlap, 0) + SMALL_OVERLAP)

    @staticmethod
    def overlap_input_slope(overlap: np.ndarray) -> np.ndarray:
        """(n,) its derivative."""
        return (overlap > 0) / (np.maximum(overlap, 0) + SMALL_OVERLAP)

    def leading(self, strains: np.ndarray) -> np.ndarray:
        """(n,) the leading one of the strains (n, 6), 0 at rest."""
        lead = LEADING[self.kind][0]
        return strains[:, lead] - REST[lead]

    def closing_load(self, pressure: np.ndarray, lead: np.ndarray) -> np.ndarray:
        """(n,) what walls close in proportion to, almost: the leading strain of a one-sided, the pressure of
        a twisting segment, whose stretch opens the gaps while its walls bulge. (Measured: the other way round
        first touch is missed by twice as much.)"""
        return lead if self.kind == ONE_SIDED else pressure

    def closing_inputs(self, numbers: np.ndarray, load: np.ndarray) -> np.ndarray:
        """(n, d) regression inputs of how far walls close over the load (n,)."""
        return self._with(numbers, load)

    def with_load(self, inputs: np.ndarray, load: np.ndarray) -> np.ndarray:
        """(n, d) the same with what `inputs` (n, .) say of the cell."""
        return np.concatenate([inputs[:, : self.of_cell], load[:, None]], axis=1)

    def stiffness_inputs(self, numbers: np.ndarray, strains: np.ndarray) -> np.ndarray:
        """(n, d) regression inputs of the stiffness: the leading one of the free strains (n, 6) in the place
        of the pressure. (What softens a cell is how far it has gone; measured: a fifth off the error.)"""
        return self._with(numbers, self.leading(strains))

    def contact_inputs(self, numbers: np.ndarray, strains: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """(n, d + 1) those of what contact adds to it: by how much walls would overlap, too, having `closed`
        (n,) so much of their gap."""
        overlap = self.overlap_input((closed - 1) * numbers[:, GAP])
        return np.column_stack([self.stiffness_inputs(numbers, strains), overlap])

    @staticmethod
    def touch(closed: np.ndarray) -> np.ndarray:
        """(n,) from 0 to 1, whether walls touch that have closed so much (n,) of their gap, as if they could
        go on."""
        return 1 / (1 + np.exp(-np.clip(np.log(np.maximum(closed, TINY)) / TOUCH_WIDTH, -30, 30)))

    def around_inputs(self, numbers: np.ndarray, strains: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """(n, d + 2) what the enthalpy around free states depends on: the same, and whether walls touch."""
        return np.column_stack([self.contact_inputs(numbers, strains, closed), self.touch(closed)])

    @cached_property
    def _sums(self):
        """(15, d) from NUMBERS to LENGTHS."""
        out = np.zeros((len(NUMBERS), len(LENGTHS[self.kind])))
        for i, parts in enumerate(LENGTHS[self.kind].values()):
            for name, factor in parts.items():
                out[SHAPE.index(name), i] = factor
        return out

    def _lengths(self, numbers):
        return np.maximum(numbers.dot(self._sums), SMALLEST)

    @property
    def names(self) -> list[str]:
        """What `told` gives."""
        both = LENGTHS[self.kind], IN_SUMS[self.kind]
        lengths, apart = ([f"{name} / normal pitch" for name in names] for names in both)
        stiffening = [f"{name} of Yeoh's law" for name in STIFFENING]
        return ["angle_deg (or 180 - that)", *lengths, *stiffening, "pressure / mu", *apart]

    def told(self, ranged: np.ndarray) -> np.ndarray:
        """(r,) `ranged` (r,) as a user knows it: degrees, ratios."""
        ends = [1, 1 + len(LENGTHS[self.kind]), self.of_cell, self.of_cell + 1]
        squared_cosine, lengths, stiffening, load, apart = np.split(ranged, ends)
        angle, pressure = np.degrees(np.arccos(np.sqrt(squared_cosine))), np.exp(load) - SMALL_PRESSURE
        return np.concatenate([angle, np.exp(lengths), stiffening, np.maximum(pressure, 0), np.exp(apart)])

    # ---- free strains
    @cached_property
    def strain_parity(self) -> np.ndarray:
        """(p,) of the learned strains: 1 even, -1 odd."""
        lead, others = LEADING[self.kind]
        return MIRROR[[lead, *others]]

    def learned_strains(self, numbers: np.ndarray, pressure: np.ndarray, strains: np.ndarray) -> np.ndarray:
        """(n, p) from strains (n, 6) at P > 0: the logarithm of the pressure over the leading one, and the
        others over that."""
        lead, others = LEADING[self.kind]
        q = strains - REST
        ratios = q[:, others] / q[:, [lead]] / odd(self.strain_parity[1:], cosine(numbers))
        return np.column_stack([np.log(pressure / q[:, lead]), ratios])

    def strains(self, numbers: np.ndarray, lead: np.ndarray, ratios: np.ndarray) -> np.ndarray:
        """(n, 6) of the leading strain (n,) and the others' learned ratios (n, p - 1)."""
        (of_lead, of_others), lead = self._places, lead[:, None]
        others = lead * ratios * odd(self.strain_parity[1:], cosine(numbers))
        return REST + lead * of_lead + others @ of_others

    @cached_property
    def _places(self):
        """(6,) and (p - 1, 6): where the leading strain and the others stand among all."""
        first, others = LEADING[self.kind]
        return np.eye(6)[first], np.eye(6)[list(others)]

    def by_shape(self, numbers: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """(n, p, 14) derivatives by the 13 shape numbers of what has the derivatives (n, p, .) by inputs,
        those by others than the shape left out; one more, 0, for the pressure."""
        by = np.zeros((*slopes.shape[:2], len(SHAPE) + 1))
        by_lengths = slopes[:, :, 1 : len(LENGTHS[self.kind]) + 1]
        by[:, :, :-1] = (by_lengths / self._lengths(numbers)[:, None]) @ self._sums[: len(SHAPE)].T
        by[:, :, 0] = slopes[:, :, 0] * (2 * cosine(numbers) * _by_angle(numbers))[:, None]
        return by

    def strain_slopes(
        self,
        numbers: np.ndarray,
        lead: np.ndarray,
        ratios: np.ndarray,
        by_ratios: np.ndarray,
        by_lead: np.ndarray,
    ) -> np.ndarray:
        """(n, 6, 14) derivatives of `strains` by the shape numbers and P/mu, of those (n, p - 1, 14) of the
        ratios and (n, 14) of the leading strain."""
        first, others = LEADING[self.kind]
        out, c = np.zeros((len(lead), 6, len(SHAPE) + 1)), cosine(numbers)
        out[:, first] = by_lead
        for j, (i, parity) in enumerate(zip(others, self.strain_parity[1:])):
            factor = c if parity < 0 else np.ones(len(lead))
            out[:, i] = (factor * lead)[:, None] * by_ratios[:, j]
            out[:, i] += (factor * ratios[:, j])[:, None] * by_lead
            if parity < 0:
                out[:, i, 0] += _by_angle(numbers) * ratios[:, j] * lead
        return out

    # ---- stiffness
    @property
    def stiffness_parity(self) -> np.ndarray:
        """(p,) the same of what is learned of the stiffness."""
        return np.concatenate([self._parity(block) for block in BLOCKS[self.kind]])

    @staticmethod
    def _parity(block):
        i, j = np.tril_indices(len(block), -1)
        s = MIRROR[list(block)]
        return np.concatenate([np.ones(len(block)), s[i] * s[j]])

    @property
    def bending(self) -> int:
        """Place of the bending stiffness, that of k2, among what is learned: what contact adds most to."""
        blocks = BLOCKS[self.kind]
        at = next(i for i, block in enumerate(blocks) if 4 in block)
        return sum(len(block) * (len(block) + 1) // 2 for block in blocks[:at]) + blocks[at].index(4)

    def learned_stiffness(self, numbers: np.ndarray, matrices: np.ndarray) -> np.ndarray:
        """(n, p) from stiffness (n, 6, 6), of which what the symmetries forbid is left out. Not positive
        definite: nan."""
        c, out = cosine(numbers), []
        for block in BLOCKS[self.kind]:
            K = matrices[:, block][:, :, block]
            good = np.linalg.eigvalsh(K)[:, 0] > 0
            factor = np.full(K.shape, np.nan)
            factor[good] = np.linalg.cholesky(K[good])
            diagonal = np.diagonal(factor, axis1=1, axis2=2)
            i, j = np.tril_indices(len(block), -1)
            parity = self._parity(block)[len(block) :]
            out += [2 * np.log(diagonal), (factor / diagonal[:, None, :])[:, i, j] / odd(parity, c)]
        return np.hstack(out)

    def stiffness(self, numbers: np.ndarray, learned: np.ndarray) -> np.ndarray:
        """(n, 6, 6), symmetric and positive definite, back from (n, p)."""
        c, K, start = cosine(numbers), np.zeros((len(learned), 6, 6)), 0
        for block in BLOCKS[self.kind]:
            b = len(block)
            i, j = np.tril_indices(b, -1)
            parity = self._parity(block)[b:]
            L = np.tile(np.eye(b), (len(learned), 1, 1))
            L[:, i, j] = learned[:, start + b : start + b + len(i)] * odd(parity, c)
            D = np.exp(learned[:, start : start + b])
            K[np.ix_(range(len(K)), block, block)] = (L * D[:, None, :]) @ np.swapaxes(L, 1, 2)
            start += b + len(i)
        return K


def _by_angle(numbers):
    """(n,) derivative of the cosine by the angle in degrees."""
    return -np.radians(1.0) * np.sin(np.radians(numbers[:, 0]))


def cosine(numbers: np.ndarray) -> np.ndarray:
    """(n,) cos(angle) of numbers (n, 15)."""
    return np.cos(np.radians(numbers[:, 0]))


def odd(parity: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(n, p): c where parity (p,) is -1, 1 where it is 1."""
    return np.where(parity < 0, c[:, None], 1.0)
