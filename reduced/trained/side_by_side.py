"""Gaussian processes of several outputs side by side, each with metric and noise of its own."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.reduced.trained import gaussian


@dataclass(frozen=True)
class SideBySide:
    """Gaussian processes of consecutive outputs, each with metric and noise of its own, as one."""

    processes: tuple

    def __call__(self, x, derivative=False):
        if len(self.processes) == 1:  # a copy would cost a sixth of a call
            return self.processes[0](x, derivative)
        found = [process(x, derivative) for process in self.processes]
        if not derivative:
            return np.concatenate(found, axis=1)
        return tuple(np.concatenate(part, axis=1) for part in zip(*found))

    @cached_property
    def rest(self):
        """SideBySide of all but the first process."""
        return SideBySide(self.processes[1:])

    def deviation(self, x):
        """(n, p) standard deviations at inputs (n, d), without noise."""
        return np.concatenate([process.deviation(x) for process in self.processes], axis=1)


def fit_side_by_side(x, y, group, trust, widths, slopes=None, like=None, **settings):
    """SideBySide processes of `widths` outputs each; the rest as for gaussian.fit."""
    ends = np.cumsum([0, *widths])
    likes = like.processes if like else [None] * len(widths)
    slopes = slopes or gaussian.no_slopes(x.shape[1], y.shape[1])
    parts = [slice(*both) for both in zip(ends, ends[1:])]
    found = [
        gaussian.fit(x, y[:, c], group, trust[:, c], slopes.columns(c), like=known, **settings)
        for c, known in zip(parts, likes)
    ]
    return SideBySide(tuple(found))
