"""`Moulds`: what the moulds of a body are like, apart from the body."""

from dataclasses import dataclass, replace

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.quantities import Checked, quantities, quantity
from pneunet.geometry.grids.planes import snapped
from pneunet.geometry.parameters import OF_CHAMBERS, Manipulator, Segment

#: mm: what a printer still prints as a fin
THINNEST_FIN = 0.4


@dataclass(frozen=True)
class Moulds(Checked):
    """The printer's bed, and what the printed moulds have beside the body's own shape."""

    bed_length: float = quantity("mm", 220.0, "of the printer; longer moulds are cut", low=60, high=2000)
    bed_width: float = quantity("mm", 220.0, "of the printer", low=20, high=2000)
    bed_height: float = quantity("mm", 200.0, "of the printer", low=10, high=2000)
    draft: float = quantity(
        "deg", 0.0, "of cores, ridges and fins: walls grow thicker towards the tips", low=0, high=5
    )
    draft_outside: float = quantity(
        "deg",
        0.0,
        "of the body's sides: it grows wider towards the planes at which it is split",
        low=0,
        high=5,
    )
    clearance: float = quantity("mm", 0.15, "dowels in holes, body in the jig", low=0, high=1)
    fillet: float = quantity("mm", 0.0, "radius of the upright edges of sharp chambers' cores", low=0, high=5)
    split: float | None = quantity(
        "mm",
        None,
        "height of the split plane above the channel's axis; default: the cavities' floor",
        low=-50,
    )
    shrinkage: float = quantity("percent", 0.001, "of the silicone as it cures, linear", low=-1, high=5)
    flange: float = quantity("mm", 8.0, "walls of the moulds; dowels go through them", low=5, high=50)
    floor: float = quantity("mm", 3.0, "below the body", low=1, high=20)
    plate: float = quantity("mm", 4.0, "that carries the cores", low=2, high=20)
    dowel: float = quantity("mm", 3.0, "diameter", low=1, high=10)
    vent: float = quantity("mm", 1.5, "diameter of the holes in the plates", low=0.5, high=5)
    port: float = quantity("mm", 2.0, "outer diameter of the tube", low=0.5, high=10)
    waste: float = quantity(
        "percent", 0.2, "mixed beyond the body's volume: cup, vents, rim", low=0, high=200
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.flange < self.dowel + 2:
            raise InputError(
                f"flange_mm = {self.flange:g}: a dowel of {self.dowel:g} mm needs at least {self.dowel + 2:g}"
            )

    @property
    def slope(self) -> float:
        """Of drafted walls: mm sideways a mm of height."""
        return float(np.tan(np.radians(self.draft)))

    @property
    def slope_outside(self) -> float:
        """Of the body's sides."""
        return float(np.tan(np.radians(self.draft_outside)))

    @property
    def split_as_printed(self) -> float | None:
        """The split, in moulds as large as `printed`."""
        return None if self.split is None else self.split / (1 - self.shrinkage)


def printed(manipulator: Manipulator, moulds: Moulds) -> Manipulator:
    """The manipulator as large as its moulds must be, so that it is right when the silicone has shrunk.
    InputError where a parameter of the moulds does not go with the body."""
    scale = 1 / (1 - moulds.shrinkage)
    castable = [snapped(s, lowest=0.0) for s in manipulator.segments]
    segments = [replace(s, **{name: scale * getattr(s, name) for name in _lengths(s)}) for s in castable]
    for i, s in enumerate(segments, start=1):
        _check(f"segment {i}", s, moulds)
    return Manipulator(tuple(segments))


def _lengths(s):
    """Fields of a segment that are lengths."""
    return [
        f.name
        for key, f in quantities(Segment).items()
        if f.metadata["unit"] == "mm" and (s.chambers or key not in OF_CHAMBERS)
    ]


def _check(where: str, s: Segment, moulds: Moulds) -> None:
    if not s.chambers:
        return
    if moulds.port > s.channel_height:
        raise InputError(
            f"port_mm = {moulds.port:g}: larger than the channel of {where}, {s.channel_height:g} mm high"
        )
    grown = moulds.slope * (s.chamber_top + s.channel_height / 2)
    fin, tip = (
        s.gap - 2 * grown,
        s.cavity_thickness - 2 * moulds.slope * (s.cavity_top + s.channel_height / 2),
    )
    if moulds.draft and (min(fin, tip) < THINNEST_FIN or grown / s.sin > s.end_margin):
        raise InputError(
            f"draft_deg = {moulds.draft:g}: fins and cores of {where} would be thinner than {THINNEST_FIN:g}"
            " mm at their tips: take less"
        )
    radius = max(moulds.fillet, s.fillet)
    if 2 * radius > tip - 0.01:
        raise InputError(
            f"fillet_mm = {radius:g}: must be less than half of the cores of {where}, {tip:.3g} mm thick"
        )
