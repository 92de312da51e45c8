"""What acts on a manipulator beside its pressure, how the pressure is walked up, and what is measured at the
end."""

from dataclasses import dataclass, fields

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.toml import from_table, to_table
from pneunet.base.quantities import Checked, quantities, quantity

CONTROLS = ("pressure", "volume", "arc length")
#: of the walls of neighbouring chambers: held apart where they touch, or not
CONTACTS = ("auto", "none")


@dataclass(frozen=True)
class DeadLoads(Checked):
    """Loads that keep their direction in space while the body moves, in the target's coordinates (where the
    base stands).

    gravity: acceleration (3,) in mm/s2, each material has its density; tip_force (3,) in N and tip_moment
    (3,) in N mm, spread over the tip's face. They are put on together, in a ramp of their own, before the
    pressure.
    """

    gravity: tuple = quantity("m_per_s2", (0.0, 0.0, 0.0), low=0, high=1e4)
    tip_force: tuple = quantity("N", (0.0, 0.0, 0.0), low=0, high=1e4)
    tip_moment: tuple = quantity("N_mm", (0.0, 0.0, 0.0), low=0, high=1e6)

    def __bool__(self) -> bool:
        return any(any(getattr(self, f.name)) for f in fields(self))

    def in_body(self, base_pose: np.ndarray) -> "DeadLoads":
        """The same loads in the body's axes, for a base that stands at `base_pose` (4, 4)."""
        turn = np.asarray(base_pose)[:3, :3].T
        return DeadLoads(*(tuple(map(float, turn @ getattr(self, f.name))) for f in fields(self)))

    def text(self) -> str:
        """The loads that act, in words; '' without any."""
        names = {"gravity_m_per_s2": "gravity ({}) m/s2", "tip_force_N": "tip force ({}) N"}
        names["tip_moment_N_mm"] = "tip moment ({}) N mm"
        acting = self.table().items()
        return ", ".join(names[key].format(", ".join(f"{v:g}" for v in value)) for key, value in acting)

    def table(self) -> dict:
        """The loads that act, as in [loads]; empty without any."""
        return {key: value for key, value in to_table(self).items() if any(value)}


@dataclass(frozen=True)
class Control(Checked):
    """What is prescribed along the path: 'pressure' up to the design's; 'volume' of the cavity up to
    `volume_factor` times the one at rest, which walks through limit points of the pressure; or 'arc length',
    root mean square displacement of the nodes summed along the path, up to `arc_length` mm, which walks
    through any limit point."""

    name: str = quantity(None, "pressure", key="control", choices=CONTROLS)
    volume_factor: float = quantity(None, 2.0, low=1.001, high=100)
    arc_length: float = quantity("mm", 10.0, low=1e-3, high=1e4)

    def table(self) -> dict:
        """The keys that say so in a file; empty for pressure control."""
        own = ("control", *(key for key, name in CONTROL_OF.items() if name == self.name))
        return {key: value for key, value in to_table(self).items() if key in own} if len(own) > 1 else {}


CONTROL_KEYS = tuple(quantities(Control))
#: key -> the control that it goes with
CONTROL_OF = {"volume_factor": "volume", "arc_length_mm": "arc length"}


def read_control(table: dict, where: str) -> Control:
    """The Control among the keys of a file's top table; InputError otherwise."""
    control = from_table(Control, {key: table[key] for key in CONTROL_KEYS if key in table}, where)
    for key, name in CONTROL_OF.items():
        if key in table and name != control.name:
            raise InputError(f'{where}: {key} goes with control = "{name}": write that too, or leave it out')
    return control


@dataclass(frozen=True)
class Extras:
    """What is computed at the end beside the shape; see hifi.body.tip."""

    tip_stiffness: bool = quantity(None, False)
    blocked_force: bool = quantity(None, False)
