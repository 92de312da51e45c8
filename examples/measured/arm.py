"""One-segment pressurised arm: measured, not predicted, for its length is not published.

Source: the public repository srl-ethz/diffPD_sim2real, `python/1segment_arm` (motion capture). A cylinder of
Dragon Skin 10, radius 22.22 mm, with four chambers around an inner rounded square, outer walls of 2.03 mm,
inner ones of 2.27 mm, one end section of 6.93 mm; it hangs clamped at one end, and one chamber is inflated.
Tip: mean of the last 30 frames less that of the first 3.

Its length stands in none of the files that could be read, nor whether its chambers are wound with fibre. So
the body cannot be built, and no prediction of it is shown. What the numbers say by themselves: the length of
an arc of constant curvature, and of no stretch, that has both the tip's displacement and its tilt.
"""

import numpy as np

MBAR = np.arange(50, 401, 25)
DISPLACEMENT_MM = np.array(
    [1.04, 1.75, 2.74, 3.90, 5.17, 6.09, 7.41, 8.75, 10.48, 12.68, 15.05, 18.20, 21.74, 26.94, 32.99]
)
TILT_DEG = np.array(
    [1.07, 1.92, 2.91, 4.20, 5.51, 6.60, 8.01, 9.52, 11.33, 13.93, 16.62, 20.05, 24.90, 30.28, 37.59]
)


def arc_lengths() -> np.ndarray:
    """(n,) mm, of arcs of constant curvature with these displacements and tilts."""
    t = np.radians(TILT_DEG)
    return DISPLACEMENT_MM / np.hypot(1 - np.sin(t) / t, (1 - np.cos(t)) / t)


def lines() -> list[str]:
    """For people."""
    length = arc_lengths()
    return [
        f"{mbar} mbar: displacement {d:.2f} mm, tilt {t:.2f} deg: an arc of {a:.0f} mm"
        for mbar, d, t, a in zip(MBAR, DISPLACEMENT_MM, TILT_DEG, length)
    ] + [
        f"one arc does not hold all of it: its length would be {length.min():.0f} to {length.max():.0f} mm;"
        " cannot be compared with a prediction: the body's length is not published"
    ]
