"""The stepper by itself, on paths that do what the test wants."""

import pytest

from pneunet.base.errors import ConvergenceError
from pneunet.hifi.fem.solver import NotConverged, PredictorTooFar
from pneunet.hifi.path.stepping import StepSize, run_steps


class Wall:
    """Every step fails with `error`."""

    parameter = 0.0

    def __init__(self, error):
        self.error = error

    def advance(self, load):
        raise self.error

    def told(self, load):
        return f"{load:g} N"

    def diagnosis(self):
        return ""


@pytest.mark.parametrize("error", [NotConverged("grew"), PredictorTooFar("off")])
def test_a_path_that_never_advances_ends_with_its_reason(error):
    with pytest.raises(
        ConvergenceError, match=rf"stopped at 0 N: the next step, to 0.0\d+ N, did not converge \({error}\)"
    ):
        run_steps(Wall(error), 1.0, StepSize(0.5, 1e-3))
