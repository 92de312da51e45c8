"""Colours, names and number formats shared by every picture: the same thing looks the same everywhere."""

import math

from pneunet.base.units import KPA_PER_MPA
from pneunet.geometry.parameters import TWISTING, Segment

TARGET, REDUCED, FINITE_ELEMENTS = "#30363d", "#1f6fb2", "#d9480f"
STYLES: dict[str, dict] = {
    "target": {"color": TARGET, "linestyle": (0, (4, 2)), "linewidth": 1.8},
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


def kPa(pressure: float) -> str:
    """A pressure in MPa: 0.035 -> '35 kPa'."""
    return f"{plain(pressure * KPA_PER_MPA)} kPa"


def significant(value: float, digits: int = 4) -> str:
    """A number of `digits` significant digits, never with an exponent: 193812.3 -> '193800', 0.01234 ->
    '0.01234'."""
    if value == 0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return plain(round(value, decimals), max(decimals, 0))


def segment_mode(segment: Segment) -> str:
    """What a segment does: twisting; bending at exactly 90 degrees; else helical."""
    if segment.kind == TWISTING:
        return "twisting"
    return "bending" if segment.cot == 0 else "helical"


def segment_name(segment: Segment) -> str:
    """'twisting 60° × 8'"""
    return f"{segment_mode(segment)} {plain(segment.angle, 1)}° × {segment.chambers}"
