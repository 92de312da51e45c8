"""The paper's errors, in both readings of what it printed.

Eq. 27 is a *sum* of squared distances from N points of the target to the curve. The paper gives its value in
m^2 under the name "mean squared error". N is not printed. As a sum over 201 points and as a mean it means
very different distances; both are told."""

import numpy as np

#: m^2, as printed in the captions of Figs 7 and 9
PRINTED = {"octopus": 3.86e-4, "tentacle2": 1.83e-3, "vase": 2.15e-4, "pear": 1.91e-4}
POINTS = 201


def root_mean_square(name: str) -> tuple[float, float]:
    """(RMS distance in mm if the printed number is a sum over POINTS points, if it is their mean)."""
    value = 1e6 * PRINTED[name]
    return float(np.sqrt(value / POINTS)), float(np.sqrt(value))


def readings(name: str, length: float) -> str:
    """Both readings of a target's printed number in words; length: of the target, mm."""
    summed, mean = root_mean_square(name)
    return (
        f"printed: {PRINTED[name]:.3g} m^2; read as Eq. 27 has it, a sum over {POINTS} points, that is an"
        " RMS of"
        f" {summed:.2f} mm ({100 * summed / length:.2f} % of length), read as a mean {mean:.1f} mm"
        f" ({100 * mean / length:.1f} %)"
    )
