"""Lengths that a clamp holds of a rectangular section (reduced.rod.clamp) beside finite elements of clamped
bars."""

import numpy as np

from benchmarks.tables import below_mark, table

HEIGHT, RATIOS = 1.0, (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
#: of the end's mean strain or curvature times the section's side: small
STRAIN = 1e-5
NAMES = ("stretching", "twisting", "bending about y", "bending about z")
#: of reduced.rod.clamp's six
AT = (0, 3, 4, 5)


def computed(width, counts=(16, 6, 6)):
    """(4,) held lengths (mm) of NAMES of a bar of HEIGHT in counts of hexahedra, small at clamp and edges,
    along it a multiple of 16.

    Far from both ends a turn or a shift grows with x as that of a rod which yields from the held length on.
    """
    from dolfinx.mesh import CellType

    from pneunet.hifi.body.problem import Support
    from pneunet.hifi.fem.loads import EndLoad
    from pneunet.hifi.verification import bodies
    from pneunet.hifi.verification.following import body_system, follow

    sides = np.array([width, HEIGHT])
    length, graded = 4.0 * sides.max(), 1.7

    def move(X):
        across = 2 * X[:, 1:] / sides - 1
        across = np.sign(across) * (1 - (1 - abs(across)) ** 1.4)
        return np.column_stack([length * (X[:, 0] / length) ** graded, across * sides / 2])

    mesh = bodies.box((length, width, HEIGHT), counts, move, element=CellType.hexahedron)
    stations = length * (np.array([10, 13]) / 16) ** graded
    load = 3 * STRAIN * width * HEIGHT  # of a modulus of 3 MPa
    arms = sides.min() * np.array([1 / 8, HEIGHT / 12, width / 12])
    found = []
    for name, wrench in zip(NAMES, np.diag([load, *(load * arms)])):
        push = EndLoad(bodies.END, force=(wrench[0], 0.0, 0.0), moment=tuple(wrench[1:]))
        system = body_system(mesh, [Support(bodies.PLANE_X)], [push])
        follow(system, [1.0], lambda: None, first=1.0)
        X, u = system.problem.nodes, system.problem.displacement()
        near, far = (_moved(name, X[on], u[on]) for on in (np.isclose(X[:, 0], x) for x in stations))
        system.destroy()
        found.append(stations[0] - near * (stations[1] - stations[0]) / (far - near))
    return np.array(found)


def _moved(name, X, u):
    """Shift (mm) or turn (rad) of one of NAMES of nodes of a plane (n, 3) that move by u (n, 3)."""
    (_, y, z), (along, v, w) = X.T, u.T
    return {
        "stretching": lambda: along.mean(),
        "twisting": lambda: (y @ w - z @ v) / (y @ y + z @ z),
        "bending about y": lambda: z @ along / (z @ z),
        "bending about z": lambda: -(y @ along) / (y @ y),
    }[name]()


def clamp():
    """The part `clamp`: largest difference of the formulas from finite elements, over the shorter side."""
    from pneunet.reduced.rod.clamp import held_lengths

    rows = []
    for ratio in RATIOS:
        width = ratio * HEIGHT
        rows.append((ratio, computed(width).tolist(), held_lengths(width, HEIGHT)[list(AT)].tolist()))
        print("  ", rows[-1], flush=True)
    finer = computed(RATIOS[3] * HEIGHT, (32, 9, 9))
    off = max(np.abs(np.subtract(fe, told)).max() / min(r * HEIGHT, HEIGHT) for r, fe, told in rows)
    return {"clamp_length_off_rel": float(off)}, {"rows": rows, "finer": finer.tolist()}


def page(text, details):
    """docs/theory-reduced.md, of which `text` is the present one, with the table below its mark made anew."""
    rows = [
        (f"{ratio:g}", *(f"{a:.3f}; {b:.3f}" for a, b in zip(fe, told)))
        for ratio, fe, told in details["rows"]
    ]
    rows.append((f"{RATIOS[3]:g}, finer grid", *(f"{a:.3f}" for a in details["finer"])))
    told = "Of rectangles, over the height, by width over height: finite elements; `held_lengths`."
    lines = ["## Lengths that a clamp holds", "", told, "", *table(["width", *NAMES], rows)]
    return below_mark(text, "clamp", lines)
