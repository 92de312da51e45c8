"""Do parts of a body run into each other? What a state says about it, and the load at which a path met it
first.

Two kinds: the facing *walls* of neighbouring chambers (hifi.contact.walls), which a run with a contact model
keeps apart, and *the body* itself: coils or segments that are far apart along it
(hifi.contact.body_distance), which no run models. A state beyond first touch is marked for good: what came
out of an overlap is not trusted again when the distance grows.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pneunet.base.files.schemas import MARKS
from pneunet.base.units import KPA_PER_MPA
from pneunet.hifi.path.stepping import lagrange_coefficients


@dataclass(frozen=True)
class Load:
    """Where on its path a body is: pressure in MPa, and the fraction of the dead loads that acts."""

    pressure: float
    dead_loads: float = 0.0

    def __str__(self):
        if self.pressure == 0 and self.dead_loads > 0:
            return f"{100 * self.dead_loads:.3g} % of the dead loads"
        return f"{self.pressure * KPA_PER_MPA:.2f} kPa"


@dataclass(frozen=True)
class Touch:
    """A state: smallest signed distances (mm) of facing walls and of parts far apart along the body, inf
    where there are none.

    walls_from, body_from: the Load at which they were first met on the way here, None while they were not.
    contact: the walls are held apart by a contact model, so that their touching is no overlap; contact_force:
    the largest between two walls, N.
    """

    wall_distance: float = np.inf
    body_distance: float = np.inf
    walls_from: Load | None = None
    body_from: Load | None = None
    contact: bool = False
    contact_force: float = 0.0

    @property
    def walls_overlap(self) -> bool:
        return self.walls_from is not None and not self.contact

    @property
    def body_overlap(self) -> bool:
        return self.body_from is not None

    @property
    def marks(self) -> dict[str, bool]:
        """{column of MARKS: bool}."""
        return {name: getattr(self, name) for name in MARKS}

    @property
    def warnings(self) -> list[str]:
        """Short words on what makes the state doubtful."""
        return [name.replace("_", " ") for name, holds in self.marks.items() if holds]

    @property
    def text(self) -> str:
        """What the last line of a run says, "" where nothing overlaps."""
        told = [f"WALLS OVERLAP from {self.walls_from} on, without contact"] * self.walls_overlap
        told += [
            f"PARTS OF THE BODY OVERLAP from {self.body_from} on, which is not modelled"
        ] * self.body_overlap
        return "; ".join(told)

    def news(self, before: "Touch") -> Iterator[str]:
        """Sentences on what this state has met and the one `before` it had not."""
        if self.walls_from and not before.walls_from:
            then = (
                "held apart by contact"
                if self.contact
                else "contact is not modelled, states from here on are marked 'walls overlap'"
            )
            yield f"walls of neighbouring chambers touch at {self.walls_from}: {then}"
        if self.body_from and not before.body_from:
            yield (
                f"parts of the body that are far apart along it touch at {self.body_from}: this is not"
                " modelled, states from here on are marked 'body overlap'"
            )

    def table(self) -> dict[str, Any]:
        """run.json's part: pressures in kPa, null where nothing has touched."""
        return {
            "contact": self.contact,
            **self.marks,
            "first_touch_kPa": self.walls_from and self.walls_from.pressure * KPA_PER_MPA,
            "first_touch_dead_load_fraction": self.walls_from and self.walls_from.dead_loads,
            "first_body_touch_kPa": self.body_from and self.body_from.pressure * KPA_PER_MPA,
            "first_body_touch_dead_load_fraction": self.body_from and self.body_from.dead_loads,
        }


def marked(row: Mapping[str, str]) -> bool:
    """Whether a row of a table, {column: text}, is marked as one in which parts of the body overlap."""
    return any(row.get(mark) == "1" for mark in MARKS)


class TouchWatch:
    """Follows both distances over the accepted states of a path, in their order."""

    def __init__(self, contact: bool = False):
        self.contact, self._walls, self._body = contact, _Crossing(), _Crossing()

    def see(
        self, load: Load, wall_distance: float, body_distance: float = np.inf, contact_force: float = 0.0
    ) -> Touch:
        """The Touch of the state at a Load; the same state may be seen again. Walls that push at each other
        touch, however close."""
        walls, body = (
            self._walls.see(load, np.nan if contact_force > 0 else wall_distance),
            self._body.see(load, body_distance),
        )
        return Touch(wall_distance, body_distance, walls, body, self.contact, contact_force)


class _Crossing:
    """The Load at which a distance passes zero for the first time; nan: it has, and contact keeps it from
    showing."""

    def __init__(self):
        self._known, self.met = [], None

    def see(self, load, distance):
        if self.met is None and not np.isinf(distance):
            if not self._known or (load, distance) != self._known[-1]:
                self._known = [*self._known[-3:], (load, distance)]
            if not distance > 0:
                loads, distances = zip(*self._known)
                self.met = Load(*first_zero([(p.pressure, p.dead_loads) for p in loads], distances).tolist())
        return self.met


def first_zero(loads: Sequence, distances: Sequence[float]) -> np.ndarray:
    """(k,) loads at which the distance passes zero between the last two of loads (n, k), distances (n,), of
    which the last is <= 0, or nan where walls in contact push at each other.

    Interpolated by the parabola through the last three where that stays between the last two, else by their
    chord. In contact extrapolated from the three before, within the last step; where these are no three that
    close, the last load, which is near: no step is taken across a deep overlap (hifi.path.equilibrium).
    """
    loads, distances = np.asarray(loads, float), np.asarray(distances, float)
    if len(loads) == 1:
        return loads[-1]
    between = np.sort(loads[-2:], axis=0)
    pushing = np.isnan(distances[-1])
    known = slice(-4, -1) if pushing else slice(-3, None)
    three = distances[known]
    if len(three) == 3 and three[0] > three[1] > three[2]:
        curve = np.array(lagrange_coefficients(three, 0.0)) @ loads[known]
        if pushing:
            return np.clip(curve, *between)
        if (between[0] <= curve).all() and (curve <= between[1]).all():
            return curve
    if pushing:
        return loads[-1]
    share = distances[-2] / (distances[-2] - distances[-1])
    return loads[-2] + share * (loads[-1] - loads[-2])
