"""docs/paper-models.md and its picture, from the details of the part `paper` (benchmarks/paper.py)."""

import textwrap
import tomllib
from pathlib import Path

import numpy as np

from benchmarks.paper import (
    ANGLES,
    CHECKED,
    CHECKED_ANGLES,
    FINER,
    ONE_SIDED,
    PAPER_ANGLE,
    PAPER_TAU,
    PAPER_TAU_10KPA,
    PRESSURES,
    SIZE,
    TWISTING,
    best,
)
from benchmarks.tables import table

PICTURE = "paper-models.png"
WIDTH = 110
SHOWN = "twist_w15"
KPA = [round(p * 1e3) for p in PRESSURES]

#: name -> paragraph
TEXT = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())


def _prose(text, **facts):
    """Lines of paragraphs."""
    paragraphs = (text.format(**facts) if facts else text).strip().split("\n\n")
    wrapped = [textwrap.wrap(" ".join(p.split()), WIDTH, break_on_hyphens=False) for p in paragraphs]
    return [line for lines in wrapped for line in ["", *lines]][1:]


def _case(name):
    return name.replace("_", "-")


def _array(values):
    return np.array(values, float)


def _listed(values):
    return ", ".join(f"{v:g}" for v in values)


def _tau(cells):
    from benchmarks.paper import curves

    strains = _array(cells)
    return 1e3 * curves(strains, ANGLES).tau


def highest(angles, tau):
    """(angle of the largest of tau (angles,), tau there), by a cubic spline through those that are known."""
    from scipy.interpolate import CubicSpline

    known = np.isfinite(tau)
    fine = np.linspace(np.min(angles[known]), np.max(angles[known]), 1101)
    values = CubicSpline(angles[known], tau[known])(fine)
    return fine[values.argmax()], values.max()


def _highest_text(tau):
    if np.isfinite(tau).sum() < 4:
        return "-"
    angle, value = highest(np.array(ANGLES), tau)
    return f"{angle:.0f} ({value:.1f})"


def _number(value, form="{:.1f}"):
    return "-" if not np.isfinite(value) else form.format(value)


def _helix(strains, height):
    """P_t kappa_h / (2 pi cot(theta)) on the line at z = height (mm), of strains (angles, pressures, 6); 90
    degrees left out."""
    from pneunet.base.strains import RodStrains

    strains = strains[:-1]
    e, k = strains[..., :3], strains[..., 3:]
    rod = RodStrains(e + np.cross(k, [0.0, 0.0, height]), k)
    return rod.helix_pitch * rod.helix_cylinder_curvature / (2 * np.pi) * np.tan(np.radians(ANGLES))[:, None]


def _cells_section(d):
    touch = "; ".join(
        f"{_case(name)} at {_listed(cells['touch']) if cells['touch'] else 'no angle'}"
        for name, cells in d["cells"].items()
    )
    failures = [text for cells in d["cells"].values() for text in cells["failures"]]
    coarse = _tau(d["cells"][CHECKED]["none"])[[ANGLES.index(a) for a in CHECKED_ANGLES], -1]
    ratios = 1e3 * _array(d["finer"])[:, -1] / coarse
    facts = dict(
        size=SIZE,
        finer=FINER,
        cases=", ".join(map(_case, TWISTING)),
        angles=_listed(ANGLES),
        touch=touch,
        failures=(
            ("Paths that ended short: " + "; ".join(failures) + ".")
            if failures
            else "Every path reached 50 kPa."
        ),
        checked=_case(CHECKED),
        ratios=" and ".join(f"{r:.3f}" for r in ratios),
        checked_angles=" and ".join(f"{a:g}" for a in CHECKED_ANGLES),
    )
    return ["## The cells", "", *_prose(TEXT["cells"], **facts)]


def _twist_section(d):
    with_contact, without = (_tau(d["cells"][SHOWN][contact]) for contact in ("auto", "none"))
    lines = ["", "## tau(P, theta)", "", *_prose(TEXT["twist"], case=_case(SHOWN)), ""]
    rows = [
        [f"{angle:g}", *(f"{_number(a)} ({_number(b)})" for a, b in zip(held, free))]
        for angle, held, free in zip(ANGLES, with_contact, without)
    ]
    lines += table(["theta, deg", *(f"{p} kPa" for p in KPA)], rows)
    lines += ["", f"![tau over theta and P, and the helix]({PICTURE})", "", "## Where tau is largest", ""]
    lines += [*_prose(TEXT["highest"], paper_angle=PAPER_ANGLE, paper_tau=PAPER_TAU), ""]
    rows = []
    for name in TWISTING:
        kinds = [("FE, with contact", _tau(d["cells"][name]["auto"]))]
        if d["cells"][name]["touch"]:
            kinds.append(("FE, without", _tau(d["cells"][name]["none"])))
        fitted = [row for row in d["tubes"][name] if row["fitted"] in ("as it is", "E_t, Ri, Ro")]
        kinds += [
            (f"tube, {row['tube']['fibre_convention']}, {_fit_name(row)}", 1e3 * _array(row["tau"]))
            for row in fitted
        ]
        rows += [[_case(name), kind, *(_highest_text(tau[:, j]) for j in (0, 2, 4))] for kind, tau in kinds]
    return lines + table(["case", "", *(f"{KPA[j]} kPa: deg (rad/m)" for j in (0, 2, 4))], rows)


def _fit_name(row):
    return row["fitted"] if row["errors"] is None else f"{row['fitted']} fitted"


def _tube_section(d):
    lines = ["", "## The tube's constants", "", *_prose(TEXT["tube"]), ""]
    rows = []
    for name in TWISTING:
        for row in d["tubes"][name]:
            tube, distance = row["tube"], row["distance"]
            errors = ["", ""] if row["errors"] is None else [f"{e:.2f}" for e in row["errors"]]
            constants = [
                f"{tube['fibre_modulus'] / tube['mu']:.2g}",
                f"{tube['inner_radius']:.2f}",
                f"{tube['outer_radius']:.2f}",
            ]
            share = f"{100 * np.median(distance):.0f} %; {100 * np.max(distance):.0f} %"
            rows.append([_case(name), tube["fibre_convention"], row["fitted"], *constants, *errors, share])
    head = [
        "case",
        "convention",
        "fitted",
        "E_t/mu",
        "Ri, mm",
        "Ro, mm",
        "error of tau",
        "of stretch",
        "tau's distance: median; worst",
    ]
    lines += table(head, rows)
    lines += ["", *_prose(TEXT["convention"] + " " + _verdict(d)), ""]
    at = ANGLES.index(60.0)
    ratio = {
        name: (
            _tau(d["cells"][name]["auto"])[at, -1] / _tau(d["cells"][name]["auto"])[at, 0] / 5,
            best(d["tubes"][name])["tau"][at],
        )
        for name in TWISTING
    }
    text = ", ".join(
        f"{tau[-1] / tau[0] / 5:.2f} against {fe:.2f} in the cells ({_case(n)})"
        for n, (fe, tau) in ratio.items()
        if tau[-1]
    )
    return lines + _prose(
        f"{TEXT['slope']} {text}. No fit changes that, and it is most of what is left of the error."
    )


def _verdict(d):
    """What the fits say about the convention."""
    squares = {}
    for name, rows in d["tubes"].items():
        for row in rows:
            if row["errors"]:
                squares[name, row["fitted"], row["tube"]["fibre_convention"]] = np.square(row["errors"]).sum()
    texts = []
    for fitted in ("E_t", "E_t, Ri, Ro"):
        ratios = ", ".join(
            f"{squares[name, fitted, 'hoop'] / squares[name, fitted, 'axial']:.2f}" for name in TWISTING
        )
        texts.append(f"{ratios} with {fitted} fitted")
    moduli, hoop = [], []
    for rows in d["tubes"].values():
        for row in rows:
            if row["fitted"] == "E_t, Ri, Ro":
                tube = row["tube"]
                moduli += [tube["fibre_modulus"] / tube["mu"]] if tube["fibre_convention"] == "axial" else []
                hoop += [tube["outer_radius"]] if tube["fibre_convention"] == "hoop" else []
    return TEXT["verdict"].format(
        names=", ".join(map(_case, TWISTING)), ratios="; ".join(texts), hoop=_span(hoop), moduli=_span(moduli)
    )


def _span(values):
    return f"{min(values):.2g} to {max(values):.2g}"


def _paper_section(d):
    facts = dict(paper_tau=PAPER_TAU, paper_angle=PAPER_ANGLE, paper_10=PAPER_TAU_10KPA)
    lines = ["", "## The paper's numbers", "", *_prose(TEXT["anchors"], **facts), ""]
    rows = [
        [
            f"{r['modulus']:g}",
            f"{r['ratio']:g}",
            f"{r['outer_radius']:.2f}",
            f"{r['angle']:g}",
            f"{r['largest'][0]:.4f}",
        ]
        + [f"{r['stretch']:.3f}"]
        for r in d["paper_tubes"]
    ]
    lines += table(
        [
            "E_t/mu",
            "Ri/Ro",
            "Ro, mm",
            "largest tau at, deg",
            "largest tau at 10 kPa, rad/mm",
            "stretch there at 50 kPa",
        ],
        rows,
    )
    printed, largest = d["printed"], d["printed"]["largest_twist"][0]
    medians = [
        100 * np.median(row["distance"])
        for rows in d["tubes"].values()
        for row in rows
        if row["fitted"] == "printed E_t"
    ]
    states = np.concatenate(
        [_array(row["tau"]) for rows in d["tubes"].values() for row in rows if row["fitted"] == "printed E_t"]
    )
    facts = dict(
        lost=100 * np.isnan(states).mean(),
        largest=largest,
        share=PAPER_TAU / largest,
        printed=f"{min(medians):.0f} to {max(medians):.0f} %",
        **printed["residuals"],
    )
    return lines + ["", *_prose(TEXT["printed"], **facts)]


def _helix_section(d):
    from benchmarks.paper import ONE_SIDED_MU, segment

    strains, model = _array(d["cells"][ONE_SIDED]["auto"]), _array(d["bending"]["model"])
    bottom = segment(ONE_SIDED, 60.0, ONE_SIDED_MU).core_bottom
    axis, below, ours = _helix(strains, 0.0), _helix(strains, bottom), _helix(model, 0.0)
    lines = ["", "## Does P_t kappa_h = 2 pi cot(theta) hold?", "", *_prose(TEXT["helix"]), ""]
    rows = [
        [
            f"{angle:g}",
            *(f"{axis[i, j]:.2f} ({below[i, j]:.2f})" for j in (0, 2, 4)),
            *(f"{ours[i, j]:.2f}" for j in (0, 2, 4)),
        ]
        for i, angle in enumerate(ANGLES)
    ]
    lines += table(
        [
            "theta, deg",
            *(f"FE, {KPA[j]} kPa" for j in (0, 2, 4)),
            *(f"our model, {KPA[j]} kPa" for j in (0, 2, 4)),
        ],
        rows,
    )
    lines += ["", *_prose(TEXT["ratio"], low=np.nanmin(axis), high=np.nanmax(axis))]
    lines += ["", "## Curvature", "", *_prose(TEXT["softness"]), ""]
    rows = []
    for row in d["bending"]["rows"]:
        softness, slant = row["constants"]
        shares = [f"{100 * f(row['distance']):.0f} %" for f in (np.median, np.max)]
        rows.append([row["fitted"], f"{softness:.2f} / sin(theta)^{slant:.2f}", *shares])
    return lines + table(["fitted", "pressure times", "distance of \\|k\\|: median", "worst"], rows)


def _summary_section(d):
    tau = _tau(d["cells"][SHOWN]["auto"])
    slopes = np.diff(np.concatenate([np.zeros((len(tau), 1)), tau], axis=1), axis=1)
    rows = _array(d["cells"][SHOWN]["auto"])
    rises = np.diff(
        np.concatenate([np.ones((len(tau), 1)), np.linalg.norm(rows[..., :3], axis=-1)], axis=1), axis=1
    )
    free = _tau(d["cells"][SHOWN]["none"])
    paper = [ANGLES.index(a) for a in (75.0, 60.0, 45.0)]
    added = ", ".join(f"{100 * (tau[i, -1] / free[i, -1] - 1):.0f} % at {ANGLES[i]:g}" for i in paper)
    falls = [(np.diff(slopes[i]) < 0).all() for i in paper]
    most = max(paper, key=lambda i: tau[i, -1] / free[i, -1])
    grows = [(np.diff(rises[i]) > 0).all() for i in paper]
    at = [_highest_text(_tau(d["cells"][name]["auto"])[:, -1]) for name in TWISTING]
    names = ", ".join(map(_case, TWISTING))
    largest = [np.nanmax(_tau(d["cells"][name]["auto"])) for name in TWISTING]
    facts = dict(
        case=_case(SHOWN),
        names=names,
        added=added,
        falls=sum(falls),
        grows=sum(grows),
        most=ANGLES[most],
        at="; ".join(at),
        low=min(largest),
        high=max(largest),
        paper_angle=PAPER_ANGLE,
        paper_tau=PAPER_TAU,
    )
    lines = ["", "## Fig. 3: what could be reproduced and what not", ""]
    for point in TEXT["summary"]:
        text = f"- {point.format(**facts)}"
        lines += textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    return lines


def page(meta, folder):
    """Text of paper-models.md; its picture goes to `folder`."""
    d = meta["paper"]["details"]
    _picture(d, folder / PICTURE)
    made = (
        "Made by `make bench ONLY=paper` and `python -m benchmarks --snapshot` (benchmarks/paper.py); do not"
        " edit."
    )
    lines = ["# The paper's models beside finite elements", "", made, "", *_prose(TEXT["about"]), ""]
    for section in (
        _cells_section,
        _twist_section,
        _tube_section,
        _paper_section,
        _helix_section,
        _summary_section,
    ):
        lines += section(d)
    return "\n".join(lines) + "\n"


def _picture(d, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, ((over_angle, over_pressure), (models, helix)) = plt.subplots(2, 2, figsize=(11, 8))
    held, free = (_tau(d["cells"][SHOWN][contact]) for contact in ("auto", "none"))
    for color, j in enumerate((0, 2, 4)):
        over_angle.plot(ANGLES, held[:, j], "o-", color=f"C{color}", label=f"FE, {KPA[j]} kPa")
        over_angle.plot(ANGLES, free[:, j], "--", color=f"C{color}")
    over_angle.plot([PAPER_ANGLE], [1e3 * PAPER_TAU], "k*", markersize=11, label="paper's maximum, 50 kPa")
    over_angle.set(title=f"{_case(SHOWN)}; dashed: no contact", xlabel="theta, deg", ylabel="tau, rad/m")
    fit = best(d["tubes"][SHOWN])
    for color, angle in enumerate((45.0, 60.0, 75.0)):
        i = ANGLES.index(angle)
        over_pressure.plot(KPA, held[i], "o-", color=f"C{color}", label=f"FE, {angle:g} deg")
        over_pressure.plot(KPA, free[i], "--", color=f"C{color}")
        over_pressure.plot(KPA, 1e3 * _array(fit["tau"])[i], ":", color=f"C{color}")
    over_pressure.set(title=f"{_case(SHOWN)}; dotted: tube, all fitted", xlabel="P, kPa", ylabel="tau, rad/m")
    models.plot(ANGLES, _tau(d["cells"][CHECKED]["auto"])[:, 2], "ko-", label="FE")
    for row in d["tubes"][CHECKED]:
        if row["fitted"] != "E_t":
            style = "--" if row["errors"] is None else "-"
            label = f"{row['tube']['fibre_convention']}, {_fit_name(row)}"
            models.plot(ANGLES, 1e3 * _array(row["tau"])[:, 2], style, label=label)
    models.axvline(PAPER_ANGLE, color="0.7", linewidth=1)
    models.set(
        title=f"{_case(CHECKED)}, {KPA[2]} kPa; line: the paper's 53 deg",
        xlabel="theta, deg",
        ylabel="tau, rad/m",
    )
    strains, model = _array(d["cells"][ONE_SIDED]["auto"]), _array(d["bending"]["model"])
    for color, j in enumerate((0, 2, 4)):
        helix.plot(ANGLES, _helix(strains, 0.0)[:, j], "o-", color=f"C{color}", label=f"FE, {KPA[j]} kPa")
        helix.plot(ANGLES, _helix(model, 0.0)[:, j], "--", color=f"C{color}")
    helix.axhline(1.0, color="0.7", linewidth=1)
    helix.set(
        title="one-sided-w10; dashed: our model", xlabel="theta, deg", ylabel="P_t kappa_h / (2 pi cot theta)"
    )
    for axes in (over_angle, over_pressure, models, helix):
        axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    plt.close(figure)
