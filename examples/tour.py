# %% [markdown]
# A tour of pneunet from Python, cell by cell, as in a notebook. It needs numpy and scipy alone and takes some
# seconds; finite elements are one line more, at the end.

# %% A finger made by hand: eight chambers across it, so that it bends.
import numpy as np

import pneunet as pn

finger = pn.Manipulator((pn.segment(kind="one-sided", angle_deg=90, chambers=8, width_mm=12),))
design = pn.Design.of(finger, pressure_kPa=30, name="finger")
print(design)

# %% Its shape under several pressures: section frames, points in mm, arc length.
lines = design.predict([10, 20, 30])
for pressure_kPa, line in zip([10, 20, 30], lines):
    print(f"{pressure_kPa} kPa: {line.length:.1f} mm long, tip at {line.points[-1].round(1)} mm")
assert lines[2].points[-1, 2] < lines[0].points[-1, 2] < 0  # chambers on top: it bends down

# %% Slanted chambers make a helix; 120 degrees is the mirror image of 60.
left, right = (
    pn.predict(pn.Manipulator((pn.segment(kind="one-sided", angle_deg=angle, chambers=12),)), pressure_kPa=30)
    for angle in (60, 120)
)
assert np.allclose(left.points * [1, -1, 1], right.points, atol=1e-6)

# %% How far does its tip give under a tenth of a newton?
rod = pn.rod(finger, pressure_kPa=30)
state = rod.equilibrium(pn.loads(tip_force_N=[0, 0, -0.1]))
print(f"the tip moves by {np.linalg.norm(state.tip[:3, 3] - rod.free().points[-1]):.1f} mm")

# %% What the law doubts, it says.
print("doubts:", design.doubts or "none")

# %% Everything in a folder, as the command line leaves it, and read back.
design.save("out/finger")
print(pn.read_run("out/finger"))

# %% Finite elements of the whole body, on two MPI ranks (some minutes; needs dolfinx):
# solved = design.solve("out/finger", ranks=2)
# print(solved.tip, solved.strains.k)
