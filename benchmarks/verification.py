"""The verification ladder: the cases of tests/verification on stated meshes, finer where they show
convergence.

`page` writes docs/verification.md and its pictures from the figures and their details.
"""

import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks import cell, cell_grids, segments
from benchmarks.tables import table

ENERGY_INTERVALS = 16
LAND_MESHES = ((8, 2, 2), (16, 2, 2), (24, 4, 4), (32, 4, 4), (48, 6, 6))
COOK_MESHES = (4, 8, 16, 32, 64)
MANUFACTURED_MESHES = (2, 4, 8, 16)
#: coarser meshes than those of the table, by half, for the order of what is exact
HALVED = {"tube": 0.5, "flexure": (2, 8)}
ELEMENTS = ("tetrahedra", "hexahedra")


def verification():
    """The part `verification`: ({key: value}, details)."""
    from dolfinx.mesh import CellType

    from pneunet.hifi.verification import energy_balance

    kinds = dict(zip(ELEMENTS, (CellType.tetrahedron, CellType.hexahedron)))
    found = {name: ladder(element) for name, element in kinds.items()}
    balance, energy_dofs = energy_balance.balance(ENERGY_INTERVALS)

    def worst(of):
        return max(of(ladder) for ladder in found.values())

    figures = {
        key: worst(lambda each, key=key: max(row["relative_error"] for row in each["exact"][key]))
        for key in found[ELEMENTS[0]]["exact"]
    }
    figures |= {
        "land1_z_mm": found["tetrahedra"]["land"][-1]["z_mm"],
        "land1_hexahedra_z_mm": found["hexahedra"]["land"][-1]["z_mm"],
        "cook_rel_error": worst(
            lambda each: abs(each["cook"][-1]["rise_mm"] / each["cook_converged_mm"] - 1)
        ),
        "mms_order_u": -worst(lambda each: -each["orders"]["manufactured solution: u in L2"]),
        "mms_order_p": -worst(lambda each: -each["orders"]["manufactured solution: p in L2"]),
        "energy_balance_rel": abs(balance[-1][1]),
    }
    return figures, {
        "elements": found,
        "energy": {"dofs": energy_dofs, "rules": [{"intervals": n, "rel": gap} for n, gap in balance]},
    }


def ladder(element):
    """What all cases give on meshes of a dolfinx.mesh.CellType."""
    from pneunet.hifi.verification import cells, cook, exact_cases, land, manufactured, patch

    with tempfile.TemporaryDirectory() as name:
        folder, on = Path(name), {"element": element}
        sphere, past, unstable = exact_cases.sphere(folder, **on)
        exact = {
            "sphere_max_rel_error": sphere,
            "sphere_past_limit_rel_error": past,
            "tube_max_rel_error": exact_cases.tube(folder, **on),
            "capped_tube_max_rel_error": exact_cases.capped_tube(folder, **on),
            "torsion_rel_error": exact_cases.torsion(folder, **on)[0] + cells.torsion(folder, **on),
            "flexure_rel_error": exact_cases.flexure(**on) + cells.flexure(**on),
        }
        coarse = {
            "tube_max_rel_error": exact_cases.tube(folder, HALVED["tube"], **on),
            "flexure_rel_error": exact_cases.flexure(HALVED["flexure"], **on),
        }
    strips = {}
    for name in exact_cases.STRIP_LOADS:
        tip, wanted = exact_cases.cantilever(name, **on)
        error = np.linalg.norm(tip - wanted) / np.linalg.norm(wanted - [exact_cases.STRIP[0], 0.0])
        strips[name] = {
            "tip_x_z_mm": tip.tolist(),
            "elastica_x_z_mm": wanted.tolist(),
            "rel_error": float(error),
        }
    beams = [land.beam(bricks, **on) for bricks in LAND_MESHES]
    panels = [cook.rise(bricks, **on) for bricks in COOK_MESHES]
    rises = [rise for rise, _ in panels[-3:]]
    errors = [manufactured.errors(bricks, **on) for bricks in MANUFACTURED_MESHES]
    orders = dict(
        zip(
            ("manufactured solution: u in L2", "manufactured solution: p in L2"),
            manufactured.orders(*errors[-2:]),
        )
    )
    orders["Cook's membrane: rise"] = float(np.log2(abs(np.divide(*np.diff(rises)))))
    for key, rows in coarse.items():
        for before, after in zip(rows, exact[key]):
            orders[f"{after.case}: {after.quantity}"] = float(
                np.log2(before.relative_error / after.relative_error)
            )
    return {
        "exact": {
            key: [asdict(row) | {"relative_error": row.relative_error} for row in rows]
            for key, rows in exact.items()
        },
        "orders": orders,
        "sphere_unstable_past": unstable,
        "strips": strips,
        "land": [{"cells": bricks, "dofs": dofs, "z_mm": z} for bricks, (z, dofs) in zip(LAND_MESHES, beams)],
        "cook": [
            {"cells": bricks, "dofs": dofs, "rise_mm": rise}
            for bricks, (rise, dofs) in zip(COOK_MESHES, panels)
        ],
        "cook_converged_mm": cook.converged(*rises),
        "manufactured": [
            {"cells": bricks, "dofs": dofs, "u_error": u, "p_error": p}
            for bricks, (u, p, dofs) in zip(MANUFACTURED_MESHES, errors)
        ],
        "patch": {"affine": patch.affine(**on), "constant pressure": patch.squeezed(**on)},
    }


#: what of the page's text cannot be computed
ABOUT = """\
Every number is from the mixed elements of `hifi`, mu = 1 MPa, mm and MPa: P2/P1 tetrahedra and Q2/Q1
hexahedra with 27 Gauss points, through the same code. Meshes are stated; dofs count u and p. Boxes are of the
same bricks for both: a hexahedron, or six tetrahedra with the same nodes. `make bench ONLY=verification` runs
all of it, `python -m pytest tests/verification` the same cases on the cheapest meshes that meet the
bars.""".splitlines()
ORDERS = """\
From one mesh to the next, of half the size: the order at which the error falls, in the cases that are small
enough to be solved on both; Cook's from the last three meshes. An exact value that is met to rounding has no
order.""".splitlines()
EXACT = """\
Sphere, tube and cylinder have second-order geometry, radii 1 and 2 (the solid cylinder's 1). *h* is the
edge length, *r* the distance from the centre or axis. Tetrahedra are gmsh's; hexahedra are blocks of tensor
grids bent into place, three in an eighth of a sphere and five in a cylinder.

- *Sphere*: an octant. Pressure control to P = 0.8, from there volume control through the limit point.
- *Tube*: a quarter of a slice between two planes. For the capped tube the far plane is put where its force
  is the thrust P pi a^2.
- *Torsion*: both end sections are held as the exact solution has them; force and moment are reactions.
- *Flexure*: rollers in the middle, the end section turned. At k = 1.5 the inner face is shortened to 0.55,
  where a half-space wrinkles. So each state is found from the interpolant of the exact one (Newton's
  method does not mind that the factorised tangent has unstable directions there).
- *cell*: torsion and flexure as unit cells of the screw-periodic formulation at prescribed strains; force
  and moment are its section force and moment.""".splitlines()
LAND = """\
Land et al. 2015, problem 1: a law of its own (exponential, fibres along x) and a follower pressure on an
open face (unsymmetric tangent, LU). The table has the deformed z of the point (10, 0.5, 1). The codes of
that paper lie within 4.15 to 4.19 mm.""".splitlines()
COOK = """\
Plane strain, G = 80.1938 and K = 400942 MPa, 100 N per mm of thickness. Bricks are graded to the clamped
end and the edges. The converged value is extrapolated from the last three meshes at the order that they
show. On hexahedra the rise first grows with the mesh, then falls, of order 1.4 at the clamped corners: that
two coarse meshes agree is chance.""".splitlines()
MANUFACTURED = """\
Unit cube, isochoric finite shears, body force and the traction on one face derived by hand. The table has
L2 errors, and orders from one mesh to the next (bars: 2.8 for u, 1.8 for p).""".splitlines()
ENERGY = """\
The shipped two-segment body to 20 kPa: work of the pressure by Simpson's rule against the stored energy.
The rule's own error falls 16 times when its step is halved. Bar: 1e-5 on the finest one.""".splitlines()
PICTURES = {
    "verification-inflation.png": "Pressure over inner radius: exact curves, computed states",
    "verification-convergence.png": "Manufactured solution, Land's beam, Cook's membrane on both elements",
}


def _exact_table(details):
    rows = []
    for pair in zip(*(each["exact"].values() for each in details["elements"].values())):
        for element, compared in zip(details["elements"], pair):
            for r in compared:
                numbers = [f"{r[name]:.7f}" for name in ("reference", "computed")]
                where = [r["case"], r["quantity"], element, r["mesh"], r["dofs"]]
                rows.append([*where, *numbers, f"{r['relative_error']:.1e}", "1e-3"])
    head = ["case", "quantity", "element", "mesh", "dofs", "exact", "computed", "relative error", "bar"]
    return table(head, rows)


def _beside(details, of, same, texts):
    """Rows of a table over meshes, both elements next to each other: what `same` says of the first's row, and
    `texts` of each."""
    both = [each[of] for each in details["elements"].values()]
    return [[*same(rows[0]), *(text(r) for r in rows for text in texts)] for rows in zip(*both)]


def _heads(*texts):
    return [f"{text}, {element}" for element in ELEMENTS for text in texts]


def page(meta, folder):
    """Lines of verification.md; its pictures go to `folder`."""
    d = meta["verification"]["details"]
    d = d | {"elements": {name: d["elements"][name] for name in ELEMENTS}}  # which JSON has sorted
    _inflation_picture(d, folder / "verification-inflation.png")
    _convergence_picture(d, folder / "verification-convergence.png")
    made = "Made by `make bench ONLY=verification` and `python -m benchmarks --snapshot`"
    lines = ["# Verification", "", f"{made} (benchmarks/verification.py); do not edit.", ""]
    lines += [*ABOUT, "", "## Orders of convergence", "", *ORDERS, ""]
    orders = [each["orders"] for each in d["elements"].values()]
    lines += table(
        ["what", *ELEMENTS], [[name, *(f"{each[name]:.2f}" for each in orders)] for name in orders[0]]
    )
    lines += ["", f"![{PICTURES['verification-convergence.png']}](verification-convergence.png)"]
    lines += ["", "## Exact solutions", "", *EXACT, "", *_exact_table(d), ""]
    for element, each in d["elements"].items():
        counts = ", ".join(map(str, each["sphere_unstable_past"]))
        lines += [
            "Unstable directions of the sphere at fixed pressure, at the radii under volume control,"
            f" {element}: {counts}.",
            "",
        ]
    lines += [f"![{PICTURES['verification-inflation.png']}](verification-inflation.png)", ""]
    lines += [
        "Strips 90 x 2 x 2 mm against the elastica (which has neither shear nor a clamped section's"
        " stiffness), bar 1e-2:",
        "",
    ]
    pair = "({0[0]:.3f}, {0[1]:.3f})".format
    lines += table(
        ["load", "element", "tip (x, z), mm", "elastica", "relative error"],
        [
            [name, element, pair(s["tip_x_z_mm"]), pair(s["elastica_x_z_mm"]), f"{s['rel_error']:.1e}"]
            for element, each in d["elements"].items()
            for name, s in each["strips"].items()
        ],
    )
    lines += ["", "## Land's beam", "", *LAND, ""]
    lines += table(
        ["bricks", "dofs", *_heads("z in mm")],
        _beside(
            d, "land", lambda r: ["x".join(map(str, r["cells"])), r["dofs"]], [lambda r: f"{r['z_mm']:.4f}"]
        ),
    )
    lines += ["", "## Cook's membrane", "", *COOK, "", *_cook(d)]
    lines += ["", "## Manufactured solution", "", *MANUFACTURED, ""]
    texts = [lambda r, name=name: f"{r[name]:.3e}" for name in ("u_error", "p_error")]
    lines += table(
        ["bricks", "dofs", *_heads("error of u", "error of p")],
        _beside(d, "manufactured", lambda r: [f"{r['cells']}^3", r["dofs"]], texts),
    )
    lines += ["", "## Patch tests and energy", ""]
    lines += ["On a distorted mesh of a cube, largest errors over all nodes:", ""]
    lines += table(
        ["solution", "element", "u, mm", "p, MPa"],
        [
            [name, element, f"{u:.1e}", f"{p:.1e}"]
            for element, each in d["elements"].items()
            for name, (u, p) in each["patch"].items()
        ],
    )
    lines += ["", *ENERGY, ""]
    lines += table(
        ["intervals", "work / energy - 1"],
        [[r["intervals"], f"{r['rel']:.2e}"] for r in d["energy"]["rules"]],
    )
    for part, section in SECTIONS.items():
        if part in meta:
            lines += ["", *section(meta[part]["details"])]
    return "\n".join(lines) + "\n"


#: part -> lines that it adds to the page from its details
SECTIONS = {
    "cell": cell.section,
    "cell-grids": cell_grids.section,
    "contact-grids": cell_grids.contact_section,
    "segments": segments.section,
}


def _cook(details):
    from pneunet.hifi.verification.cook import PUBLISHED

    limits = {element: each["cook_converged_mm"] for element, each in details["elements"].items()}

    def texts(element):
        return [lambda r: f"{r['rise_mm']:.4f}", lambda r: f"{r['rise_mm'] / limits[element] - 1:.1e}"]

    columns = [
        [[text(r) for text in texts(element)] for r in each["cook"]]
        for element, each in details["elements"].items()
    ]
    first = details["elements"][ELEMENTS[0]]["cook"]
    rows = [
        [f"{r['cells']}^2", r["dofs"], *(text for column in columns for text in column[i])]
        for i, r in enumerate(first)
    ]
    lines = table(["bricks", "dofs", *_heads("rise in mm", "relative error")], rows)
    converged = ", ".join(
        f"{limit:.4f} mm on {element} ({100 * (limit / PUBLISHED - 1):.1f} % above the published)"
        for element, limit in limits.items()
    )
    return [
        *lines,
        "",
        f"Converged: {converged}; bar 5e-3 on the finest mesh. Published with F-bar elements, 30 a side:"
        f" {PUBLISHED:g} mm.",
    ]


def _save(figure, path):
    import matplotlib.pyplot as plt

    figure.savefig(path, dpi=90, bbox_inches="tight")
    plt.close(figure)


def _inflation_picture(d, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from pneunet.hifi.verification import closed_forms

    figure, axes = plt.subplots(figsize=(7, 4))
    a = np.linspace(1.0, 2.25, 200)
    for name, curve in (
        ("sphere", closed_forms.sphere_pressure),
        ("tube, lambda_z = 1", closed_forms.tube_pressure),
    ):
        axes.plot(a, curve(a), label=f"{name}, exact")

    def numbers(each, key):
        return [(r["computed"], float(r["quantity"].split("=")[1])) for r in each["exact"][key]]

    for (element, each), fill in zip(d["elements"].items(), ("full", "none")):
        past = [(a, P) for P, a in numbers(each, "sphere_past_limit_rel_error")]
        sphere = numbers(each, "sphere_max_rel_error") + past
        axes.plot(*zip(*sphere), "o", color="C0", fillstyle=fill, label=f"sphere, {element}")
        tube = numbers(each, "tube_max_rel_error")
        axes.plot(*zip(*tube), "s", color="C1", fillstyle=fill, label=f"tube, {element}")
    axes.set(xlabel="inner radius a, mm", ylabel="P / mu")
    axes.legend()
    _save(figure, path)


def _convergence_picture(d, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from pneunet.hifi.verification import cook

    figure, (orders, beam, panel) = plt.subplots(1, 3, figsize=(13, 3.8))
    for (element, each), style in zip(d["elements"].items(), ("o-", "s--")):
        h = np.array([1 / r["cells"] for r in each["manufactured"]])
        for name, label, colour in (("u_error", "u", "C0"), ("p_error", "p", "C1")):
            errors = [r[name] for r in each["manufactured"]]
            orders.loglog(h, errors, style, color=colour, label=f"L2 error of {label}, {element}")
        beam.semilogx(
            [r["dofs"] for r in each["land"]], [r["z_mm"] for r in each["land"]], style, label=element
        )
        panel.semilogx(
            [r["dofs"] for r in each["cook"]], [r["rise_mm"] for r in each["cook"]], style, label=element
        )
    for order, name, colour in ((3, "u_error", "C0"), (2, "p_error", "C1")):
        last = d["elements"][ELEMENTS[0]]["manufactured"][-1][name]
        orders.loglog(h, last * (h / h[-1]) ** order, ":", color=colour, label=f"order {order}")
    orders.set(title="manufactured solution", xlabel="h, mm", ylabel="L2 error")
    orders.set_xticks(h, [f"{size:g}" for size in h])
    orders.xaxis.set_minor_locator(plt.NullLocator())
    beam.axhspan(4.15, 4.19, alpha=0.2, label="codes of Land et al.")
    beam.set(title="Land's beam", xlabel="dofs", ylabel="z, mm")
    panel.axhline(cook.PUBLISHED, linestyle=":", color="C2", label="published, F-bar, n = 30")
    panel.set(title="Cook's membrane", xlabel="dofs", ylabel="rise, mm")
    for axes in (orders, beam, panel):
        axes.legend()
    figure.tight_layout()
    _save(figure, path)
