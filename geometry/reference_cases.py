"""The reference cases that documents and issues name, as factories of their segments: angle in degrees,
chambers.

All dimensions in mm; "normal" thicknesses are across the chamber.
"""

from functools import partial
from typing import Any

from pneunet.base.materials.laws import NeoHookean
from pneunet.geometry import Segment

_W10: dict[str, Any] = dict(
    width=10.0,
    channel_width=2.0,
    channel_height=2.0,
    cavity_floor=1.0,
    chamber_height=4.0,
    gap=1.0,
    material=NeoHookean(mu=0.2068),
)
_TWIST_W12: dict[str, Any] = dict(
    width=12.0,
    channel_width=4.0,
    channel_height=2.0,
    cavity_floor=0.5,
    chamber_height=5.5,
    gap=2.0,
    material=NeoHookean(mu=0.317),
)
_TWIST_W15 = _TWIST_W12 | dict(width=15.0, chamber_height=7.5, gap=1.0)
_LONG = _W10 | dict(channel_width=4.0, cavity_floor=-1.0, material=NeoHookean(mu=0.6204 / 2.98))

#: name -> factory(angle, chambers) of a Segment; walls 1, roof 1, base 2, end margin 2 are Segment's defaults
CASES = {
    "one_sided_w10": partial(Segment, "one-sided", **_W10),
    "twist_w10": partial(Segment, "twisting", **_W10),
    "twist_w12": partial(Segment, "twisting", **_TWIST_W12),
    "twist_w15": partial(Segment, "twisting", **_TWIST_W15),
    "one_sided_long": partial(Segment, "one-sided", **_LONG),
}
