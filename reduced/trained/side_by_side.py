"""Gaussian processes of several outputs side by side, each with metric and noise of its own."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneunet.reduced.trained.gaussian import GaussianProcess


@dataclass(frozen=True)
class SideBySide:
    """Gaussian processes of consecutive outputs, each with metric and noise of its own, as one."""

    processes: tuple[GaussianProcess, ...]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """(n, p) at inputs (n, d)."""
        if len(self.processes) == 1:  # a copy would cost a sixth of a call
            return self.processes[0](x)
        return np.concatenate([process(x) for process in self.processes], axis=1)

    def with_slopes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(the same, derivatives by the inputs (n, p, d))."""
        means, slopes = zip(*(process.with_slopes(x) for process in self.processes))
        return np.concatenate(means, axis=1), np.concatenate(slopes, axis=1)

    @cached_property
    def rest(self) -> "SideBySide":
        """SideBySide of all but the first process."""
        return SideBySide(self.processes[1:])

    def deviation(self, x: np.ndarray) -> np.ndarray:
        """(n, p) standard deviations at inputs (n, d), without noise."""
        return np.concatenate([process.deviation(x) for process in self.processes], axis=1)
