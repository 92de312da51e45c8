"""The sheet for the workshop: what to print, mix and do, how far to inflate, what to keep exact."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pneunet.base.materials.laws import PAPER_TWISTING
from pneunet.base.units import KPA_PER_MPA
from pneunet.design.report.labels import kPa, material_names, plain, segment_name
from pneunet.design.search.tolerances import Effect
from pneunet.design.workshop.limits import Limit
from pneunet.geometry.designfile import DesignFile
from pneunet.geometry.moulds.layers import LOWER, MIDDLE, UPPER, Layer, Run
from pneunet.geometry.moulds.parameters import Moulds
from pneunet.geometry.moulds.part import Part

ML_PER_MM3 = 1e-3
GRAM_PER_TONNE = 1e6


@dataclass(frozen=True)
class SheetTable:
    """header (n,), rows of n texts."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Steps:
    """What to do, in order."""

    texts: Sequence[str]


@dataclass(frozen=True)
class Picture:
    """A PNG of the pack's folder."""

    file: str
    caption: str


Block = str | SheetTable | Steps | Picture


@dataclass(frozen=True)
class Pack:
    """What the sheet tells of: parts without the body; runs as large as the moulds."""

    design: DesignFile
    moulds: Moulds
    parts: Sequence[Part]
    runs: Sequence[Run]
    limits: Sequence[Limit]
    effects: Sequence[Effect]


def sections(pack: Pack) -> Iterator[tuple[str, list[Block]]]:
    """(title, blocks) from the top of the sheet down."""
    yield "Drawing", [Picture("drawing.png", "All dimensions in mm.")]
    yield "Print", _print(pack)
    yield "Mix", _mix(pack)
    yield "Cast", _cast(pack)
    yield "Bond", _bond(pack)
    yield "Inflate", _inflate(pack)
    yield "Keep exact", _keep(pack)


def _print(pack):
    m = pack.moulds
    rows = [[p.name, str(p.count), " x ".join(plain(v, 1) for v in p.size), p.does] for p in pack.parts]
    told = [f"Bed {plain(m.bed_length)} x {plain(m.bed_width)} x {plain(m.bed_height)} mm."]
    told.append("Every part lies as it is printed, without support: nothing that forms silicone overhangs.")
    if m.shrinkage:
        told.append(
            f"The moulds are {plain(100 * m.shrinkage, 3)} % larger than the body, which shrinks as it cures."
        )
    if m.draft:
        told.append(f"Cores, ridges and fins have {plain(m.draft)} degrees of draft.")
    thin = min((s.gap for s in pack.design.manipulator.segments if s.chambers), default=0.0)
    told.append(f"The thinnest fin is {plain(thin)} mm: print it with at least two lines, or in resin.")
    return [
        " ".join(told),
        SheetTable(["part", "count", "size, mm", "what for"], rows),
        Picture("moulds.png", "The moulds as they lie on the bed."),
    ]


def amounts(pack: Pack) -> list[tuple[str, str, float, float, int]]:
    """(layer, silicone, mL, g, casts) of every pour, what is wasted included."""
    names, out = material_names(pack.design.manipulator), []
    for number, run in enumerate(pack.runs, start=1):
        for layer in run.layers:
            if layer.name == LOWER and run.same_turned:
                continue
            casts = 2 if layer.name == UPPER and run.same_turned else 1
            for silicone, volume in layer.volumes.items():
                mm3 = volume * (1 + pack.moulds.waste)
                of, gram = called(layer, number, len(pack.runs)), mm3 * silicone.density * GRAM_PER_TONNE
                out.append((of, names[silicone], mm3 * ML_PER_MM3, gram, casts))
    return out


def called(layer: Layer, number: int, count: int) -> str:
    """Name of a layer of the run `number` of `count`."""
    return f"run {number}, {layer.name}" if count > 1 else layer.name


def _mix(pack):
    found = amounts(pack)
    rows = [[layer, name, plain(ml, 1), plain(gram, 1), str(casts)] for layer, name, ml, gram, casts in found]
    totals: dict[str, float] = {}
    for _, name, _, gram, casts in found:
        totals[name] = totals.get(name, 0.0) + gram * casts
    told = "; ".join(f"{plain(gram, 1)} g of {name}" for name, gram in totals.items())
    assumed = [m.name for m in pack.design.manipulator.materials if m.name == PAPER_TWISTING.name]
    notes = [f"ASSUMED silicone, where nobody gave another: {name}." for name in assumed]
    return [
        *notes,
        f"In all: {told}; of which {plain(100 * pack.moulds.waste)} % stays in cup and vents. Of a silicone"
        " in two parts these are both together, in the maker's ratio.",
        SheetTable(["layer", "silicone", "mL a cast", "g a cast", "casts"], rows),
    ]


def _cast(pack):
    cut = any(p.name.endswith("-2") for p in pack.parts)
    steps = [
        "Try all parts dry: dowels go in by hand, plates lie flat on their trays."
        + " Join the pieces of cut moulds with dowels, and tape over the seams from outside." * cut,
        "Spray release agent and let it dry. Resin prints first need a full cure and a coat: uncured resin"
        " keeps platinum silicone from setting.",
        "Weigh, mix and degas the silicone of one layer.",
    ]
    if any(s.layer_thickness for s in pack.design.manipulator.segments):
        steps.append(
            "The stiff layer comes first: pour it into the lower tray up to its thickness and let it gel."
        )
    steps += [
        "Fill a tray to its rim, slowly, from one end, so that the narrow chambers' walls fill from below."
        " Pierce bubbles between the fins.",
        "Lay the plate on from one end, cores down, until the dowels hold it. Silicone must rise in every"
        " vent: that is how you see that the layer is full. Clamp or weigh it down.",
    ]
    if any(layer.name == MIDDLE for run in pack.runs for layer in run.layers):
        steps.append("Fill the middle frame and draw a straight edge over its rim and ridge.")
    if any(run.same_turned for run in pack.runs):
        steps.append("Where the table says two casts, upper and lower layer are the same: cast it twice.")
    return [
        Steps(
            [
                *steps,
                "Let it cure as the maker says. Cut the risers, slip a blade under a corner and"
                " lift the plate straight off: the cores have"
                " no undercut. Peel the layer out of its tray from one end.",
            ]
        )
    ]


def _bond(pack):
    groups = len(pack.design.manipulator.groups)
    steps = [
        "Wipe both faces with isopropanol. Spread 0.2 mm of fresh silicone on the lower face, and keep 1 mm"
        " away from channel and cavities: what is spread there closes them.",
        "Lay the lower layer into the jig, then the middle one if there is one, then the upper one. The jig"
        " holds them in line. Press lightly, no more than the layers' own height, and let it cure.",
        "Push a sharpened tube through each guide in the jig's wall, along y, until it is in the channel;"
        f" pull it out with the core it has cut. Glue in the air's tube, {plain(pack.moulds.port)} mm"
        " outside.",
    ]
    if len(pack.runs) > 1:
        steps.append(
            "Join the runs end to end in the assembly jig, from base to tip. A greased rod through the"
            " channels keeps them open where they go on; pull it out through the port or a cut at the tip."
        )
        floors = {round(s.cavity_floor, 6) for s in pack.design.manipulator.segments if s.chambers}
        if len(floors) > 1:
            steps.append(
                "For the next design: segments with one cavity_floor_mm and no quarter turn between them are"
                " cast in one piece."
            )
    if groups > 1:
        steps.append(
            f"There are {groups} pressure groups. The bulkheads between them are cast with the layers: test"
            " each group alone, the others must not rise."
        )
    steps.append("Test under water at a fifth of the pressure: no bubbles.")
    return [Steps(steps)]


def _inflate(pack):
    pressure = pack.design.largest_pressure
    if not pack.limits:
        told = "No limit was found within three times the design's pressure."
        return [f"Design pressure {kPa(pack.design.pressure)}. {told} {_unknown(pack)}"]
    lowest = pack.limits[0]
    verdict = "below it" if pressure < lowest.pressure else "NOT below it: expect what the reason says"
    return [
        f"Design pressure {kPa(pack.design.pressure)}; do not exceed"
        f" {plain(lowest.pressure * KPA_PER_MPA, 1)} kPa: {lowest.reason}. The design is {verdict}."
        f" {_unknown(pack)}",
        SheetTable(
            ["limit, kPa", "reason"],
            [[plain(limit.pressure * KPA_PER_MPA, 1), limit.reason] for limit in pack.limits],
        ),
    ]


def _unknown(pack):
    names = material_names(pack.design.manipulator)
    unknown = [name for m, name in names.items() if m.elongation_at_break == float("inf")]
    return f"At what stretch the silicone tears is not known: {'; '.join(unknown)}." if unknown else ""


def _keep(pack):
    if not pack.effects:
        return ["The law has no equilibrium at this pressure: what matters most is not known."]
    rows = [
        [f"{e.segment}: {segment_name(pack.design.manipulator.segments[e.segment - 1])}"]
        + [e.name.rsplit("_", 1)[0].replace("_", " "), e.change, f"{e.rms:.2f}", f"{e.tip:.2f}"]
        for e in pack.effects
        if e.segment is not None
    ]
    return [
        "What moves the inflated shape most when it is off, by the reduced model. Measure these on the moulds"
        " before you cast.",
        SheetTable(["segment", "dimension", "off by", "shape moves, mm RMS", "tip moves, mm"], rows),
    ]
