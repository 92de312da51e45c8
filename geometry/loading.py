"""What acts on a manipulator beside its pressure, how the pressure is walked up, and what is measured at the
end."""

from dataclasses import dataclass, fields

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.toml import as_table, file_key, number, quantity, refuse_unknown, to_table

CONTROLS = ("pressure", "volume", "arc length")


@dataclass(frozen=True)
class DeadLoads:
    """Loads that keep their direction in space while the body moves, in the target's coordinates (where the
    base stands).

    gravity: acceleration (3,) in mm/s2, each material has its density; tip_force (3,) in N and tip_moment
    (3,) in N mm, spread over the tip's face. They are put on together, in a ramp of their own, before the
    pressure.
    """

    gravity: tuple = quantity("m_per_s2", (0.0, 0.0, 0.0))
    tip_force: tuple = quantity("N", (0.0, 0.0, 0.0))
    tip_moment: tuple = quantity("N_mm", (0.0, 0.0, 0.0))

    def __bool__(self):
        return any(any(getattr(self, f.name)) for f in fields(self))

    def in_body(self, base_pose):
        """The same loads in the body's axes, for a base that stands at `base_pose` (4, 4)."""
        turn = np.asarray(base_pose)[:3, :3].T
        return DeadLoads(*(tuple(map(float, turn @ getattr(self, f.name))) for f in fields(self)))

    def text(self):
        """The loads that act, in words; '' without any."""
        words = []
        for key, value in self.table().items():
            name, unit = (
                ("gravity", "m/s2")
                if "gravity" in key
                else ("tip force", "N")
                if "force" in key
                else ("tip moment", "N mm")
            )
            words.append(f"{name} ({', '.join(f'{v:g}' for v in value)}) {unit}")
        return ", ".join(words)

    def table(self):
        """The loads that act, as in [loads]; empty without any."""
        return {key: value for key, value in to_table(self).items() if any(value)}


@dataclass(frozen=True)
class Control:
    """What is prescribed along the path: 'pressure' up to the design's; 'volume' of the cavity up to
    `volume_factor` times the one at rest, which walks through limit points of the pressure; or 'arc length',
    root mean square displacement of the nodes summed along the path, up to `arc_length` mm, which walks
    through any limit point."""

    name: str = "pressure"
    volume_factor: float = quantity(None, 2.0)
    arc_length: float = quantity("mm", 10.0)

    def table(self):
        """The keys that say so in a file; empty for pressure control."""
        key = {"volume": "volume_factor", "arc length": "arc_length_mm"}.get(self.name)
        return {"control": self.name, key: getattr(self, key.removesuffix("_mm"))} if key else {}


CONTROL_KEYS = ["control", *(file_key(f) for f in fields(Control) if "unit" in f.metadata)]


def read_control(table, where):
    """The Control among the keys of a file's top table; InputError otherwise."""
    name = table.get("control", Control.name)
    if name not in CONTROLS:
        raise InputError(
            f"{where}: control = {name!r} is not known: write 'pressure', 'volume' or 'arc length'"
        )
    values = {}
    for key, owner, low, high in (
        ("volume_factor", "volume", 1.001, 100.0),
        ("arc_length_mm", "arc length", 1e-3, 1e4),
    ):
        if key not in table:
            continue
        value = float(number(table[key], key, where))
        if name != owner:
            raise InputError(f'{where}: {key} goes with control = "{owner}": write that too, or leave it out')
        if not low <= value <= high:
            raise InputError(f"{where}: {key} = {value:g} must lie in {low:g}..{high:g}")
        values[key.removesuffix("_mm")] = value
    return Control(name, **values)


#: of the walls of neighbouring chambers: held apart where they touch, or not
CONTACTS = ("auto", "none")


def read_contact(table, where):
    """The `contact` among the keys of a file's top table; InputError otherwise."""
    name = table.get("contact", CONTACTS[0])
    if name not in CONTACTS:
        raise InputError(f"{where}: contact = {name!r} is not known: write 'auto' or 'none'")
    return name


@dataclass(frozen=True)
class Extras:
    """What is computed at the end beside the shape; see hifi.body.tip."""

    tip_stiffness: bool = False
    blocked_force: bool = False


def read_extras(table, where):
    """The Extras of a [measure] table of true and false."""
    known = [f.name for f in fields(Extras)]
    refuse_unknown(as_table(table, where), known, where)
    for key, value in table.items():
        if not isinstance(value, bool):
            raise InputError(f"{where}: '{key}' must be true or false, not {value!r}")
    return Extras(**table)
