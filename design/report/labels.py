"""Colours, names and number formats shared by every picture: the same thing looks the same everywhere."""

import math
from collections import Counter

from pneunet.base.materials.laws import Hyperelastic
from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.parameters import PASSIVE, TWISTING, Manipulator, Segment

TARGET, REDUCED, FINITE_ELEMENTS = "#30363d", "#1f6fb2", "#d9480f"
STYLES: dict[str, dict] = {
    "target": {"color": TARGET, "linestyle": (0, (4, 2)), "linewidth": 1.8, "zorder": 4},
    "reduced": {"color": REDUCED, "linestyle": "-", "linewidth": 2.0},
    "finite elements": {"color": FINITE_ELEMENTS, "linestyle": "-", "linewidth": 2.0},
}
SEGMENT_COLOURS = ("#8fc1a4", "#ecc46a", "#bda0d0", "#e2a0ae", "#a5b8c9")


def segment_colour(index: int) -> str:
    return SEGMENT_COLOURS[index % len(SEGMENT_COLOURS)]


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue from 0 to 255 of '#rrggbb'."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def plain(value: float, decimals: int = 2) -> str:
    """A number without trailing zeros: 2 -> '2', 5.7735 -> '5.77'."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text


def kPa(pressure: float | tuple[float, ...]) -> str:
    """A pressure in MPa, or one for each group of segments: 0.035 -> '35 kPa', (0.03, 0) -> '30 / 0 kPa'."""
    each = pressure if isinstance(pressure, tuple) else (pressure,)
    return f"{' / '.join(plain(p * KPA_PER_MPA) for p in each)} kPa"


def significant(value: float, digits: int = 4) -> str:
    """A number of `digits` significant digits, never with an exponent: 193812.3 -> '193800', 0.01234 ->
    '0.01234'."""
    if value == 0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return plain(round(value, decimals), max(decimals, 0))


def signed(value: float, digits: int = 4) -> str:
    """`significant` with a plus before what is positive."""
    return "+" * (value > 0) + significant(value, digits)


def material_names(manipulator: Manipulator) -> dict[Hyperelastic, str]:
    """{material of a body: what it is called}: its name, which is the same for all that were given none; then
    with the shear modulus, which tells them apart."""
    shared = Counter(m.name for m in manipulator.materials)
    return {
        m: f"{m.name}, mu = {significant(m.mu)} MPa" if shared[m.name] > 1 else m.name
        for m in manipulator.materials
    }


def segment_mode(segment: Segment) -> str:
    """What a segment does: twisting or nothing (passive); bending at exactly 90 degrees; else helical."""
    if segment.kind in (TWISTING, PASSIVE):
        return segment.kind
    return "bending" if segment.cot == 0 else "helical"


def segment_name(segment: Segment) -> str:
    """'twisting 60° × 8', 'bending 90° × 8, rolled 180°' or 'passive 20 mm'"""
    if segment.kind == PASSIVE:
        return f"{PASSIVE} {plain(segment.length)} mm"
    rolled = f", rolled {segment.roll}°" if segment.roll else ""
    return f"{segment_mode(segment)} {plain(segment.angle, 1)}° × {segment.chambers}{rolled}"
