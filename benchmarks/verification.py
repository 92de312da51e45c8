"""The verification ladder: the cases of tests/verification on stated meshes, finer where they show
convergence.

`page` writes docs/verification.md and its pictures from the figures and their details.
"""

import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks import cell, segments
from benchmarks.tables import table

ENERGY_INTERVALS = 16
LAND_MESHES = ((8, 2, 2), (16, 2, 2), (24, 4, 4), (32, 4, 4), (48, 6, 6))
COOK_MESHES = (4, 8, 16, 32)
MANUFACTURED_MESHES = (2, 4, 8, 16)


def verification():
    """The part `verification`: ({key: value}, details)."""
    from pneunet.hifi.verification import cells, cook, energy_balance, exact_cases, land, manufactured, patch

    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        sphere, past, unstable = exact_cases.sphere(folder)
        exact = {
            "sphere_max_rel_error": sphere,
            "sphere_past_limit_rel_error": past,
            "tube_max_rel_error": exact_cases.tube(folder),
            "capped_tube_max_rel_error": exact_cases.capped_tube(folder),
            "torsion_rel_error": exact_cases.torsion(folder)[0] + cells.torsion(folder),
            "flexure_rel_error": exact_cases.flexure() + cells.flexure(),
        }
    strips = {}
    for name in exact_cases.STRIP_LOADS:
        tip, wanted = exact_cases.cantilever(name)
        error = np.linalg.norm(tip - wanted) / np.linalg.norm(wanted - [exact_cases.STRIP[0], 0.0])
        strips[name] = {
            "tip_x_z_mm": tip.tolist(),
            "elastica_x_z_mm": wanted.tolist(),
            "rel_error": float(error),
        }
    beams = [land.beam(bricks) for bricks in LAND_MESHES]
    panels = [cook.rise(bricks) for bricks in COOK_MESHES]
    limit = cook.converged(*(rise for rise, _ in panels[-3:]))
    errors = [manufactured.errors(bricks) for bricks in MANUFACTURED_MESHES]
    order_u, order_p = manufactured.orders(*errors[-2:])
    balance, energy_dofs = energy_balance.balance(ENERGY_INTERVALS)
    figures = {key: max(row.relative_error for row in rows) for key, rows in exact.items()}
    figures |= {
        "land1_z_mm": beams[-1][0],
        "cook_rel_error": abs(panels[-1][0] / limit - 1),
        "mms_order_u": order_u,
        "mms_order_p": order_p,
        "energy_balance_rel": abs(balance[-1][1]),
    }
    details = {
        "exact": {key: [asdict(row) for row in rows] for key, rows in exact.items()},
        "sphere_unstable_past": unstable,
        "strips": strips,
        "land": [{"cells": bricks, "dofs": dofs, "z_mm": z} for bricks, (z, dofs) in zip(LAND_MESHES, beams)],
        "cook": {
            "meshes": [
                {"cells": bricks, "dofs": dofs, "rise_mm": rise}
                for bricks, (rise, dofs) in zip(COOK_MESHES, panels)
            ],
            "converged_mm": limit,
            "published_mm": cook.PUBLISHED,
        },
        "manufactured": [
            {"cells": bricks, "dofs": dofs, "u_error": u, "p_error": p}
            for bricks, (u, p, dofs) in zip(MANUFACTURED_MESHES, errors)
        ],
        "patch": {"affine": patch.affine(), "constant pressure": patch.squeezed()},
        "energy": {"dofs": energy_dofs, "rules": [{"intervals": n, "rel": gap} for n, gap in balance]},
    }
    return figures, details


#: what of the page's text cannot be computed
ABOUT = """\
Every number is from the P2/P1 mixed elements of `hifi`, mu = 1 MPa, mm and MPa. Meshes are stated; dofs
count u and p. `make bench ONLY=verification` runs all of it, `python -m pytest tests/verification` the same
cases on the cheapest meshes that meet the bars.""".splitlines()
EXACT = """\
Sphere, tube and cylinder have second-order geometry, radii 1 and 2 (the solid cylinder's 1). *h* is the
edge length, *r* the distance from the centre or axis.

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
show.""".splitlines()
MANUFACTURED = """\
Unit cube, isochoric finite shears, body force and the traction on one face derived by hand. The table has
L2 errors, and orders from one mesh to the next (bars: 2.8 for u, 1.8 for p).""".splitlines()
ENERGY = """\
The shipped two-segment body to 20 kPa: work of the pressure by Simpson's rule against the stored energy.
The rule's own error falls 16 times when its step is halved. Bar: 1e-5 on the finest one.""".splitlines()
PICTURES = {
    "verification-inflation.png": "Pressure over inner radius: exact curves, computed states",
    "verification-convergence.png": "Manufactured solution, Land's beam and Cook's membrane over the mesh",
}


def _exact_table(details):
    rows = []
    for compared in details["exact"].values():
        for r in compared:
            error = abs(r["computed"] / r["reference"] - 1)
            numbers = [f"{r['reference']:.7f}", f"{r['computed']:.7f}", f"{error:.1e}"]
            rows.append([r["case"], r["quantity"], r["mesh"], r["dofs"], *numbers, "1e-3"])
    return table(["case", "quantity", "mesh", "dofs", "exact", "computed", "relative error", "bar"], rows)


def _orders_table(rows):
    lines, before = [], None
    for r in rows:
        orders = ["", ""]
        if before:
            ratio = np.log(r["cells"] / before["cells"])
            orders = [f"{np.log(before[name] / r[name]) / ratio:.2f}" for name in ("u_error", "p_error")]
        lines.append(
            [f"{r['cells']}^3", r["dofs"], f"{r['u_error']:.3e}", orders[0], f"{r['p_error']:.3e}", orders[1]]
        )
        before = r
    return table(["bricks", "dofs", "error of u", "order", "error of p", "order"], lines)


def page(meta, folder):
    """Lines of verification.md; its pictures go to `folder`."""
    d = meta["verification"]["details"]
    _inflation_picture(d, folder / "verification-inflation.png")
    _convergence_picture(d, folder / "verification-convergence.png")
    lines = ["# Verification", ""]
    lines += [
        (
            "Made by `make bench ONLY=verification` and `python -m benchmarks --snapshot`"
            " (benchmarks/verification.py); do not edit."
        ),
        "",
    ]
    lines += [*ABOUT, "", "## Exact solutions", "", *EXACT, "", *_exact_table(d), ""]
    counts = ", ".join(map(str, d["sphere_unstable_past"]))
    lines += [
        f"Unstable directions of the sphere at fixed pressure, at the radii under volume control: {counts}.",
        "",
    ]
    lines += [f"![{PICTURES['verification-inflation.png']}](verification-inflation.png)", ""]
    lines += [
        (
            "Strips 90 x 2 x 2 mm against the elastica (which has neither shear nor a clamped section's"
            " stiffness), bar 1e-2:"
        ),
        "",
    ]
    pair = "({0[0]:.3f}, {0[1]:.3f})".format
    lines += table(
        ["load", "tip (x, z), mm", "elastica", "relative error"],
        [
            [n, pair(s["tip_x_z_mm"]), pair(s["elastica_x_z_mm"]), f"{s['rel_error']:.1e}"]
            for n, s in d["strips"].items()
        ],
    )
    lines += ["", "## Land's beam", "", *LAND, ""]
    lines += table(
        ["bricks", "dofs", "z, mm"],
        [["x".join(map(str, r["cells"])), r["dofs"], f"{r['z_mm']:.4f}"] for r in d["land"]],
    )
    cook = d["cook"]
    lines += ["", "## Cook's membrane", "", *COOK, ""]
    lines += table(
        ["bricks", "dofs", "rise of the corner, mm", "relative error"],
        [
            [
                f"{r['cells']}^2",
                r["dofs"],
                f"{r['rise_mm']:.4f}",
                f"{r['rise_mm'] / cook['converged_mm'] - 1:.1e}",
            ]
            for r in cook["meshes"]
        ],
    )
    away = cook["converged_mm"] / cook["published_mm"] - 1
    lines += [
        "",
        (
            f"Converged: {cook['converged_mm']:.4f} mm, bar 5e-3 on the finest mesh. Published with F-bar"
            " elements, 30 a side: "
        ),
    ]
    lines[-1] += f"{cook['published_mm']:g} mm; the converged value is {100 * away:.1f} % above it."
    lines += ["", "## Manufactured solution", "", *MANUFACTURED, "", *_orders_table(d["manufactured"]), ""]
    lines += [f"![{PICTURES['verification-convergence.png']}](verification-convergence.png)", ""]
    lines += [
        "## Patch tests and energy",
        "",
        "On a distorted mesh of a cube, largest errors over all nodes:",
        "",
    ]
    lines += table(
        ["solution", "u, mm", "p, MPa"],
        [[name, f"{u:.1e}", f"{p:.1e}"] for name, (u, p) in d["patch"].items()],
    )
    lines += ["", *ENERGY, ""]
    lines += table(
        ["intervals", "work / energy - 1"],
        [[r["intervals"], f"{r['rel']:.2e}"] for r in d["energy"]["rules"]],
    )
    for part, section in (("cell", cell.section), ("segments", segments.section)):
        if part in meta:
            lines += ["", *section(meta[part]["details"])]
    return "\n".join(lines) + "\n"


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
    found = [(r["computed"], float(r["quantity"].split("=")[1])) for r in d["exact"]["sphere_max_rel_error"]]
    found += [
        (float(r["quantity"].split("=")[1]), r["computed"]) for r in d["exact"]["sphere_past_limit_rel_error"]
    ]
    axes.plot(*zip(*found), "o", color="C0", label="sphere, computed")
    found = [(r["computed"], float(r["quantity"].split("=")[1])) for r in d["exact"]["tube_max_rel_error"]]
    axes.plot(*zip(*found), "s", color="C1", label="tube, computed")
    axes.set(xlabel="inner radius a, mm", ylabel="P / mu")
    axes.legend()
    _save(figure, path)


def _convergence_picture(d, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (orders, beam, panel) = plt.subplots(1, 3, figsize=(13, 3.8))
    h = np.array([1 / r["cells"] for r in d["manufactured"]])
    for name, label, order in (("u_error", "u", 3), ("p_error", "p", 2)):
        errors = np.array([r[name] for r in d["manufactured"]])
        (line,) = orders.loglog(h, errors, "o-", label=f"L2 error of {label}")
        orders.loglog(
            h, errors[-1] * (h / h[-1]) ** order, "--", color=line.get_color(), label=f"order {order}"
        )
    orders.set(title="manufactured solution", xlabel="h, mm", ylabel="L2 error")
    orders.set_xticks(h, [f"{size:g}" for size in h])
    orders.xaxis.set_minor_locator(plt.NullLocator())
    beam.semilogx([r["dofs"] for r in d["land"]], [r["z_mm"] for r in d["land"]], "o-")
    beam.axhspan(4.15, 4.19, alpha=0.2, label="codes of Land et al.")
    beam.set(title="Land's beam", xlabel="dofs", ylabel="z, mm")
    cook = d["cook"]
    panel.semilogx([r["dofs"] for r in cook["meshes"]], [r["rise_mm"] for r in cook["meshes"]], "o-")
    panel.axhline(cook["converged_mm"], linestyle="--", label="extrapolated")
    panel.axhline(cook["published_mm"], linestyle=":", color="C1", label="published, F-bar, n = 30")
    panel.set(title="Cook's membrane", xlabel="dofs", ylabel="rise, mm")
    for axes in (orders, beam, panel):
        axes.legend()
    figure.tight_layout()
    _save(figure, path)
