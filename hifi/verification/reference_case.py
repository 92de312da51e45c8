"""One FE case on a shipped mesh, `python -m pneunet.hifi.verification.reference_case OUT.json [OTHER.json]`,
on any number of ranks; with another result it says how far they differ, and fails where that is too far.

Its numbers must be the same on one and two ranks, on Debian 12 and 13, natively and in the container.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np

#: of `largest_difference`, whatever computed the two
SAME = 1e-6
DATA = Path(__file__).resolve().parent / "data"


def numbers() -> dict[str, float]:
    """{name: number} of the converged state at 20 kPa; the same on all ranks."""
    from pneunet.geometry.designfile import read_design_file
    from pneunet.hifi.body.manipulator import ManipulatorSolve
    from pneunet.hifi.path.newton import NewtonOptions

    design = read_design_file(DATA / "reference.toml")
    # two decades below what is compared
    options = NewtonOptions(relative_tolerance=1e-11)
    solve = ManipulatorSolve(design.manipulator, DATA / "reference.npz", newton_options=options)
    solve.run(design.pressure)
    measured = solve.measure()
    out = {"volume_mm3": measured.volume, "largest_stretch": measured.largest_stretch}
    out |= {f"tip_{axis}_mm": value for axis, value in zip("xyz", measured.frames[-1, :3, 3])}
    for i, (e, k) in enumerate(zip(measured.strains.e, measured.strains.k), start=1):
        out |= {f"segment_{i}_e{j}": v for j, v in enumerate(e, start=1)}
        out |= {f"segment_{i}_k{j}_per_mm": v for j, v in enumerate(k, start=1)}
    out |= {
        "smallest_wall_distance_mm": measured.touch.wall_distance,
        "body_distance_mm": measured.touch.body_distance,
    }
    solve.destroy()
    return out


def on_ranks(ranks: int, path: Path) -> dict[str, float]:
    """`numbers()` of a run on so many ranks, started as a user would; `path` is where it leaves them."""
    python = sys.executable
    command = [
        python,
        "-m",
        "pneunet",
        "run",
        "-n",
        str(ranks),
        "--",
        python,
        "-m",
        "pneunet.hifi.verification.reference_case",
        str(path),
    ]
    subprocess.run(command, check=True, cwd=DATA.parent.parent, timeout=300)
    return json.loads(Path(path).read_text())


def largest_difference(one: dict[str, float], two: dict[str, float]) -> float:
    """Largest difference of two results, relative to the larger of a value and 1 (0.01 for curvatures,
    1/mm); infinite where one has a number that the other has not."""
    if one.keys() != two.keys():
        return math.inf
    scale = {name: 0.01 if "per_mm" in name else 1.0 for name in one}
    differences = [abs(two[name] - value) / max(abs(value), scale[name]) for name, value in one.items()]
    return float(np.max(differences))  # nan if one is


def main(path: str, other: str = "") -> None:
    from mpi4py import MPI

    result = numbers()
    if MPI.COMM_WORLD.rank:
        return
    Path(path).write_text(json.dumps(result, indent=1) + "\n")
    if other:
        difference = largest_difference(result, json.loads(Path(other).read_text()))
        print(f"largest relative difference from {other}: {difference:.1e} (may be {SAME:.0e})")
        if not difference <= SAME:
            sys.exit(1)


if __name__ == "__main__":
    main(*sys.argv[1:])
