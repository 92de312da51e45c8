"""Figures of grids: that every body has one, and what a body on them is off by."""

import tempfile
import time
from pathlib import Path

import numpy as np

#: MPa: a pressure under which a body's answer is linear
SMALL = 1e-5


def made():
    """The part `grids`: ({key: value}, details)."""
    from pneunet.base.errors import InputError
    from pneunet.geometry.grids.body import body_grid
    from pneunet.geometry.grids.cell import cell_grid
    from pneunet.geometry.grids.sample import random_manipulator, random_segment
    from pneunet.geometry.meshfile import open_edges

    random = np.random.default_rng(22)
    cells, bodies, failed = [], [], []
    for draw, grid, count, seconds in (
        (random_segment, lambda s: cell_grid(s, 2.0), 10_000, cells),
        (random_manipulator, lambda m: body_grid(m, 2.0), 500, bodies),
    ):
        for _ in range(count):
            body, started = draw(random), time.process_time()
            try:
                made = grid(body)
                seconds.append(time.process_time() - started)
                # which is refused unless it, air and all, is positive at all corners and Gauss points
                mesh = made.mesh(air=True)
                if draw is random_manipulator and open_edges(mesh.facets):
                    raise InputError("its surface is open")
            except InputError as error:
                failed.append(f"{body}: {error}")
    return {
        "grids_made_of_10000": 10_000 - sum(text.startswith("Segment") for text in failed),
        "grids_made_of_500_bodies": 500 - sum(text.startswith("Manipulator") for text in failed),
        "grid_of_a_cell_ms": 1e3 * float(np.median(cells)),
        "grid_of_a_body_ms": 1e3 * float(np.median(bodies)),
    }, {"failed": failed}


def bodies(sizes=(1.5, 0.75), tetrahedra=2.0):
    """The part `body-grids`: ({key: value}, details): the tip of one-sided-w10, five chambers, at rest's
    stiffness."""
    from pneunet.geometry.cad.mesh import mesh_manipulator
    from pneunet.geometry.meshfile import MESH
    from pneunet.geometry.parameters import Manipulator
    from pneunet.geometry.reference_cases import CASES
    from pneunet.hifi.body.manipulator import ManipulatorSolve

    body, tips, rows = Manipulator((CASES["one_sided_w10"](60.0, 5),)), [], []
    meshes = [*((size, "hexahedra") for size in sizes), (tetrahedra, "tetrahedra")]
    with tempfile.TemporaryDirectory() as folder:
        for size, element in meshes:
            mesh_manipulator(body, size, folder, element)
            started = time.process_time()
            solve = ManipulatorSolve(body, Path(folder) / MESH)
            solve.run(SMALL, stability=False, first_step=SMALL)
            tips.append((solve.measure().frames[-1, :3, 3] - [body.length, 0, 0]) / SMALL)
            rows.append(
                {
                    "mesh_size_mm": size,
                    "element": element,
                    "dofs": solve.problem.dofs,
                    "cpu_seconds": time.process_time() - started,
                    "tip_mm_per_MPa": tips[-1].tolist(),
                }
            )
            solve.destroy()
    off = [float(np.linalg.norm(tip - tips[1]) / np.linalg.norm(tips[1])) for tip in tips]
    return {"body_grid_tip_rel": off[0], "body_tetrahedra_tip_rel": off[2]}, {"runs": rows}
