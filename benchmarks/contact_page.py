"""The tables at the end of docs/contact.md, from the details of the parts `contact` and `contact-segment`."""

from benchmarks.contact import ANGLES, ELEMENT, FINE, FINER, PARAMETERS, SIZE
from benchmarks.tables import below_mark, table


def page(text, results, meta):
    """docs/contact.md, of which `text` is the present one, with the part below its mark made anew."""
    details = meta["contact"]["details"]
    medium = {kPa: limit for kPa, _, limit, _, _ in details["kPa_force_N_and_limit_tau_and_limit"]}
    effort = details["steps_factorisations_CPU_s"]
    lines = [
        "## Measured",
        "",
        (
            f"Cell twist-w15, 60 degrees, mu = 0.317 MPa, {ELEMENT} of {SIZE:g} mm, unless said; tau in rad"
            f" per m of deformed length. First touch at {details['first_touch_kPa']:.2f} kPa."
        ),
    ]
    lines += shown(
        "Twist without and with contact, overlap without it, force between chambers, and the third medium's"
        " in its limit:",
        {
            "kPa": "g",
            "tau without": ".2f",
            "tau with": ".2f",
            "overlap, mm": ".2f",
            "force, N": ".4f",
            "third medium, N": "",
        },
        [
            [
                kPa,
                without,
                with_contact,
                -distance,
                force,
                f"{medium[kPa]:.4f} ({force / medium[kPa] - 1:+.1%})" if kPa in medium else "",
            ]
            for kPa, with_contact, without, force, distance in details[
                "kPa_tau_with_and_without_force_N_overlap_without_mm"
            ][1:]
        ],
    )
    lines += shown(
        "Distance of the solids' surfaces where walls push with more than a tenth of the air's pressure:",
        {
            "degrees": "g",
            "kPa": "g",
            "tau": ".2f",
            "force, N": ".4f",
            "area, mm2": ".1f",
            "deepest, mm": "+.4f",
            "farthest, mm": "+.4f",
        },
        details[ANGLES],
    )
    lines += shown(
        "The penalty's stiffness and onset, one at a time, at 50 kPa:",
        {
            "parameter": "",
            "times": "g",
            "tau": ".3f",
            "force, N": ".4f",
            "largest distance over the gap": ".2%",
        },
        details[PARAMETERS],
    )
    lines += shown(
        f"The mesh refined to {FINER:g} mm:",
        {"kPa": "g", "tau without": ".2f", "tau with": ".2f", "what contact adds": ".3f", "force, N": ".4f"},
        [
            [kPa, without, with_contact, with_contact - without, force]
            for kPa, with_contact, without, force in details[FINE][1:]
        ],
    )
    lines += shown(
        "Force in the third medium: as recorded, one half and one quarter as stiff and thick as far as states"
        " are found, and in the limit:",
        {"kPa": "g", "recorded, N": "", "half, N": "", "quarter, N": "", "limit, N": ".4f"},
        [
            [kPa, *([f"{force:.5f}" for force in found[::2]] + [""])[:3], medium[kPa]]
            for kPa, *found in details["kPa_force_N_tau_of_softer_media"]
        ],
    )
    if "contact-segment" in meta:
        lines += of_segment(meta["contact-segment"]["details"])
    lines += shown(
        "The cell to 50 kPa in five levels, meshing included:",
        {"contact": "", "steps": "g", "factorisations": "g", "processor seconds": ".1f"},
        [["with", *effort[0]], ["without", *effort[1]]],
    )
    keys = [(f"`{key}`", value) for key, value in sorted(results.items()) if key.startswith("contact_")]
    lines += shown("The figures:", {"key": "", "value": ".3g"}, keys)
    lines += [
        "",
        (
            "The recorded third medium's own bias in the twist before touch is"
            f" {details['bias_twist_rel_third_medium']:.2%}."
        ),
    ]
    return below_mark(text, "contact", lines)


def of_segment(segment):
    """Lines on the part `contact-segment`."""
    without, touching = segment["cpu_seconds_without_and_with"]
    return shown(
        f"The middle pitch of {segment['chambers']} pairs of chambers on {segment['ranks']} ranks"
        f" ({segment['dofs']} dofs, same mesh). With contact it takes {touching / without:.2f} times as long"
        " (processor time):",
        {"kPa": "g", "tau of the segment": ".2f", "tau of the cell": ".2f", "difference": "+.2%"},
        [
            [level["pressure_kPa"], twist, cell, twist / cell - 1]
            for level in segment["levels"]
            for twist, cell in [(level["twist_rad_per_m"], level["cell_twist_rad_per_m"])]
        ],
    )


def shown(said, columns, rows):
    """Lines of a sentence and a table; columns: {head: format of its values}."""
    formatted = [[format(value, form) for value, form in zip(row, columns.values())] for row in rows]
    return ["", said, "", *table(columns, formatted)]
