"""What is known of free states besides strains and stiffness: how far the silicone is stretched, and the
volume of the air."""

from dataclasses import dataclass

import numpy as np

from pneunet.reduced.trained.side_by_side import SideBySide
from pneunet.reduced.trained.state_on_path import StateOnPath


@dataclass(frozen=True)
class Recorded:
    """process: at path_inputs, of the logarithms of (largest stretch - 1) over the leading strain and of the
    air's volume (base.files.dataset). The stretch is the mean over the most stretched hundredth of the
    silicone."""

    process: SideBySide

    def at(self, inputs: np.ndarray, lead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(largest stretch (n,), volume of air per length over the squared normal pitch (n,)) at path_inputs
        (n, d) and leading strains (n,)."""
        learned = np.exp(self.process(inputs))
        return 1 + lead * learned[:, 0], learned[:, 1]

    def stretch_and_slopes(self, state: StateOnPath) -> tuple[np.ndarray, np.ndarray]:
        """(largest stretch (n,), its derivatives (n, 14) by the shape numbers and P/mu)."""
        learned, slopes = self.process.with_slopes(state.inputs)
        over_lead, lead = np.exp(learned[:, 0]), state.chain.lead
        by = over_lead[:, None] * (state.lead_by + lead[:, None] * state.of_inputs(slopes[:, 0]))
        return 1 + lead * over_lead, by
