"""Pictures of where walls touch: a translucent deformed body, its facing walls coloured by their signed
distance."""

from pathlib import Path
from typing import Any

import numpy as np

from pneunet.base.pictures.rendering import View, coloured, render, view_of, write_picture

FIELD = "wall_distance_mm"
COLOURS = "RdYlBu"
#: of the gap: walls nearer than this touch, where a contact model holds them apart
TOUCHING = 0.02
BODY = {"color": "#868e96", "opacity": 0.13}
EDGES = {"color": "#868e96", "line_width": 1.0, "lighting": False}
#: so that colours stay those of the bar
EVENLY_LIT = {"ambient": 0.75, "diffuse": 0.3}
RIM = {"color": "black", "line_width": 4.0, "lighting": False}
LABEL = "distance of facing walls (mm); below zero: overlap"


def draw_walls(
    path: str | Path,
    body: Any,
    edges: Any,
    walls: Any,
    gap: float,
    title: str,
    touching: float = 0.0,
    view: View | None = None,
) -> None:
    """Write the picture; pyvista meshes in mm, `walls` with point data FIELD.

    The colours are centred on touching walls and reach as far as the gap at rest (mm), or as the deepest
    overlap. A black line surrounds where the distance is below `touching` (mm). view:
    base.pictures.rendering.View, by default one that holds the body.
    """
    distances = np.asarray(walls.point_data[FIELD])
    reach = max(gap, -float(distances.min()))
    view = view or view_of(body.points)
    surface, look = coloured(walls, FIELD, (-reach, reach), COLOURS)
    things = [(edges, EDGES), (surface, look | EVENLY_LIT), (body, BODY)]
    if distances.min() < touching < distances.max():
        rim = walls.contour([touching], scalars=FIELD)
        rim.clear_data()
        things.append((rim, RIM))
    extend = "max" if distances.max() > reach else "neither"
    write_picture(path, view, render(view, things), title, (LABEL, (-reach, reach), COLOURS), extend)
