"""What a trained law learns instead of strains and stiffness: smooth numbers of order one that keep the body's symmetries.

All without dimension (base.dataset): pressure P/mu, strains q = (e, k l). With c = cos(angle), mirror images have opposite c, and
every quantity is even or odd in c: e2, k1 and k3 change sign in the mirror. Odd ones are c times an even function, which is
learned as a function of c^2 and the logarithms of the lengths. The free strains are led by the one that never vanishes, the
curvature k2 of a one-sided, the stretch of a twisting segment, as log(strain / P); the others are divided by it. Pressures too
enter by their logarithm, as the lengths do: what makes a design soft is a product of powers. The stiffness is L D L^T by the
blocks that the half turns of the body leave: unit lower triangular L and log D.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.parameters import ONE_SIDED, TWISTING
from geometry.shape_numbers import SHAPE

#: of (e1, e2, e3, k1, k2, k3) in the mirror y -> -y
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
REST = np.eye(6)[0]
#: P/mu below which the response is linear anyway: the logarithm is taken of their sum
SMALL_PRESSURE = 0.01
#: what loads a cell and what holds it: kind -> name -> sum of Segment's lengths; as many as the sample varies on their own.
#: (Measured: a tenth off the error of the free strains against the lengths themselves.)
_OF_BOTH = {
    "width": {"width": 1},
    "cavity's rise over the core": {"cavity_floor": 1, "chamber_height": 1, "channel_height": -0.5, "roof": -1},
    "cavity_thickness": {"cavity_thickness": 1},
    "wall": {"wall": 1},
    "top_wall": {"top_wall": 1},
    "channel_width": {"channel_width": 1},
    "channel_height": {"channel_height": 1},
}
LENGTHS = {
    ONE_SIDED: _OF_BOTH | {"core's height": {"base_thickness": 1, "channel_height": 1, "roof": 1}},
    TWISTING: _OF_BOTH | {"core's half height": {"channel_height": 0.5, "roof": 1}, "cavity_floor": {"cavity_floor": 1}},
}
#: of a normal pitch; lengths that are smaller, or negative, count as this
SMALLEST = 1e-3
#: of a strain, whose logarithm is taken; and part of the strain at which walls touch over which they come to do so
TINY, TOUCH_WIDTH = 1e-6, 0.05
#: kind -> (index of the leading strain, of the others that are not zero)
LEADING = {ONE_SIDED: (4, (0, 1, 3)), TWISTING: (0, (3,))}
#: kind -> blocks of the stiffness
BLOCKS = {ONE_SIDED: ((0, 1, 3, 4), (2, 5)), TWISTING: ((0, 3), (1, 4), (2, 5))}


@dataclass(frozen=True)
class Coordinates:
    """The transformations for one kind of segment."""

    kind: str

    def inputs(self, shape, pressure, level):
        """(n, d) regression inputs of shape numbers (n, 13), P/mu (n,) and the mesh's level (n,) or a number."""
        x = np.empty((len(shape), len(LENGTHS[self.kind]) + 3))
        x[:, 0], x[:, -2], x[:, -1] = cosine(shape) ** 2, np.log(pressure + SMALL_PRESSURE), level
        np.log(self._lengths(shape), out=x[:, 1:-2])
        return x

    def shape_inputs(self, shape):
        """(n, d - 2) those of `inputs` that the shape alone gives."""
        return self.inputs(shape, np.zeros(len(shape)), 0)[:, :-2]

    def leading(self, strains):
        """(n,) the leading one of the strains (n, 6), 0 at rest."""
        lead = LEADING[self.kind][0]
        return strains[:, lead] - REST[lead]

    def stiffness_inputs(self, shape, strains, touch, level):
        """(n, d + 1) regression inputs of the stiffness: the leading one of the free strains (n, 6) in the place of the pressure, and
        how much walls touch, from 0 to 1, when they do so from the leading strain exp(touch) (n,) on. (What softens a cell is how far
        it has gone; measured: a fifth off the error. Where walls meet, the stiffness jumps; measured: half off the error in twisting
        segments.)"""
        x, lead = self.inputs(shape, np.zeros(len(shape)), level), self.leading(strains)
        x[:, -2] = lead
        beyond = (np.log(np.maximum(lead, TINY)) - touch) / TOUCH_WIDTH
        return np.insert(x, -1, 1 / (1 + np.exp(-np.clip(beyond, -30, 30))), axis=1)

    def around_inputs(self, shape, strains, touch):
        """(n, d) what the enthalpy around free states depends on: the same, whatever the mesh."""
        return self.stiffness_inputs(shape, strains, touch, 0)[:, :-1]

    @cached_property
    def _sums(self):
        """(13, d) from shape numbers to LENGTHS."""
        out = np.zeros((len(SHAPE), len(LENGTHS[self.kind])))
        for i, parts in enumerate(LENGTHS[self.kind].values()):
            for name, factor in parts.items():
                out[SHAPE.index(name), i] = factor
        return out

    def _lengths(self, shape):
        return np.maximum(shape @ self._sums, SMALLEST)

    @property
    def names(self):
        """What `told` gives."""
        lengths = [f"{name} / normal pitch" for name in LENGTHS[self.kind]]
        return ["angle_deg (or 180 - that)", *lengths, "pressure / mu", "mesh"]

    def told(self, inputs):
        """(d,) inputs (d,) as a user knows them: degrees, ratios."""
        angle = np.degrees(np.arccos(np.sqrt(inputs[0])))
        return np.array([angle, *np.exp(inputs[1:-2]), max(np.exp(inputs[-2]) - SMALL_PRESSURE, 0.0), inputs[-1]])

    # ---- free strains
    @property
    def strain_parity(self):
        """(p,) of the learned strains: 1 even, -1 odd."""
        lead, others = LEADING[self.kind]
        return MIRROR[[lead, *others]]

    def learned_strains(self, shape, pressure, strains):
        """(n, p) from strains (n, 6) at P > 0."""
        lead, others = LEADING[self.kind]
        q = strains - REST
        ratios = q[:, others] / q[:, [lead]] / odd(self.strain_parity[1:], cosine(shape))
        return np.column_stack([np.log(q[:, lead] / pressure), ratios])

    def strains(self, shape, pressure, learned):
        """(n, 6) back from (n, p)."""
        lead, others = LEADING[self.kind]
        size = np.exp(learned[:, 0]) * pressure
        q = np.zeros((len(learned), 6))
        q[:, lead] = size
        q[:, others] = learned[:, 1:] * odd(self.strain_parity[1:], cosine(shape)) * size[:, None]
        return q + REST

    def spread(self, shape, pressure, learned, deviation):
        """(n, 6) standard deviation of the strains from that of the learned numbers (n, p), taken as independent."""
        lead, others = LEADING[self.kind]
        size, out = np.exp(learned[:, 0]) * pressure, np.zeros((len(learned), 6))
        out[:, lead] = size * deviation[:, 0]
        c = np.abs(odd(self.strain_parity[1:], cosine(shape)))
        out[:, others] = size[:, None] * c * np.hypot(deviation[:, 1:], learned[:, 1:] * deviation[:, :1])
        return out

    def strains_and_slopes(self, shape, pressure, learned, slopes):
        """(strains (n, 6), their derivatives (n, 6, 14) by the shape numbers and P/mu) from those (n, p, d) of the learned."""
        lead, others = LEADING[self.kind]
        n, c = len(learned), cosine(shape)
        by_angle = -np.radians(1.0) * np.sin(np.radians(shape[:, 0]))  # dc/d(degree)
        by = np.zeros((n, learned.shape[1], len(SHAPE) + 1))
        by[:, :, :-1] = (slopes[:, :, 1:-2] / self._lengths(shape)[:, None]) @ self._sums.T
        by[:, :, 0] = slopes[:, :, 0] * (2 * c * by_angle)[:, None]
        by[:, :, -1] = slopes[:, :, -2] / (pressure + SMALL_PRESSURE)[:, None]
        size = np.exp(learned[:, 0]) * pressure
        by_size = size[:, None] * by[:, 0]
        by_size[:, -1] += size / pressure
        q, out = self.strains(shape, pressure, learned), np.zeros((n, 6, len(SHAPE) + 1))
        out[:, lead] = by_size
        for j, (i, parity) in enumerate(zip(others, self.strain_parity[1:]), start=1):
            factor = c if parity < 0 else np.ones(n)
            out[:, i] = (factor * size)[:, None] * by[:, j] + (factor * learned[:, j])[:, None] * by_size
            if parity < 0:
                out[:, i, 0] += by_angle * learned[:, j] * size
        return q, out

    # ---- stiffness
    @property
    def stiffness_parity(self):
        return np.concatenate([self._parity(block) for block in BLOCKS[self.kind]])

    @staticmethod
    def _parity(block):
        i, j = np.tril_indices(len(block), -1)
        s = MIRROR[list(block)]
        return np.concatenate([np.ones(len(block)), s[i] * s[j]])

    def learned_stiffness(self, shape, matrices):
        """(n, p) from stiffness (n, 6, 6), of which what the symmetries forbid is left out. Not positive definite: nan."""
        c, out = cosine(shape), []
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

    def stiffness(self, shape, learned):
        """(n, 6, 6), symmetric and positive definite, back from (n, p)."""
        c, K, start = cosine(shape), np.zeros((len(learned), 6, 6)), 0
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


def cosine(shape):
    """(n,) cos(angle) of shape numbers (n, 13)."""
    return np.cos(np.radians(shape[:, 0]))


def odd(parity, c):
    """(n, p): c where parity (p,) is -1, 1 where it is 1."""
    return np.where(parity < 0, c[:, None], 1.0)
