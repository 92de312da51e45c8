"""ParaView files: one .vtu per accepted step and a .pvd that lists those that are complete."""

from pathlib import Path

import numpy as np

from pneunet.base.files.atomic import write_text
from pneunet.base.files.schemas import MEAN_STRETCH, STEP_FILES, step_file
from pneunet.base.pictures.rendering import save_vtk
from pneunet.base.units import KPA_PER_MPA
from pneunet.hifi.body.manipulator import ManipulatorSolve, Measured
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.agreement import gathered, on_rank_0
from pneunet.hifi.fem.surface import VERTICES
from pneunet.hifi.runs.solve.goal import Goal
from pneunet.hifi.runs.solve.tables import Tables

#: cell -> VTK's number of it, and dolfinx's node order -> VTK's: quadratic tetrahedra, triquadratic hexahedra
VTK = {
    "tetrahedron": (24, [0, 1, 2, 3, 9, 6, 8, 7, 5, 4]),
    "hexahedron": (
        29,
        [0, 1, 3, 2, 4, 5, 7, 6]
        + [8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 15, 14]
        + [22, 23, 21, 24, 20, 25, 26],
    ),
}


class FieldWriter:
    """Gathers fields on rank 0 and writes them with VTK, so that files are the same for any number of ranks.

    At points: displacement (mm), pressure (the multiplier, MPa), mean_stretch (largest principal, mean of the
    cells around a node) and wall_distance_mm, on facing walls the signed distance from the wall opposite and
    nan elsewhere; as field data the marks of hifi.contact.touch. Each .vtu appears by rename when it is
    whole, and only then in solution.pvd: a killed run leaves valid files.
    """

    def __init__(self, directory: Path, solve: ManipulatorSolve, goal: Goal) -> None:
        self.directory, self.goal, self.comm = directory, goal, solve.comm
        self.problem, self.stretch, self.walls = solve.problem, solve.stretch, solve.walls
        problem = solve.problem
        index_map = problem.displacement_space.dofmap.index_map
        self._owned = index_map.size_local
        cells = compat.cell_dofs(problem.displacement_space)[: problem.mesh.topology.index_map(3).size_local]
        local_to_global = index_map.local_to_global(
            np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        )
        self._cells = gathered(self.comm, local_to_global[cells])
        self._points = gathered(self.comm, problem.nodes[: self._owned])
        self._wall_nodes = self.walls.node_numbers(local_to_global)
        self._listed = []

    def resume(self, tables: Tables) -> None:
        """List the files of an earlier run's steps, those of the tables; other files of steps go."""
        on_rank_0(self.comm, lambda: self._keep(tables.history()))

    def _keep(self, steps):
        names = {step_file(row["step"]): self.goal.time(row["step"], row["pressure_kPa"]) for row in steps}
        self._listed = [(time, name) for name, time in names.items() if (self.directory / name).exists()]
        self._list()
        for old in self.directory.glob(STEP_FILES):
            if old.name not in names:
                old.unlink()

    def _pressure_at_nodes(self):
        """Multiplier at the displacement nodes: corner values, elsewhere the mean of the corners around. One
        value per local displacement node."""
        corner = self.problem.pressure_field()
        p2 = compat.cell_dofs(self.problem.displacement_space)
        p1 = compat.cell_dofs(self.problem.pressure_space)
        out = np.zeros(len(self.problem.nodes))
        for node, around in enumerate(VERTICES[self.problem.cell_name]):
            out[p2[:, node]] = corner[p1[:, list(around)]].mean(axis=1)
        return out

    def _wall_distance(self):
        """wall_distance_mm of all nodes on rank 0, None elsewhere."""
        distances = self.walls.at_nodes()
        if distances is None:
            return None
        out = np.full(len(self._points), np.nan)
        np.fmin.at(out, self._wall_nodes.ravel(), np.where(np.isfinite(distances), distances, np.nan).ravel())
        return out

    def accepted(self, m: Measured) -> None:
        fields = {
            "displacement": self.problem.displacement()[: self._owned],
            "pressure": self._pressure_at_nodes()[: self._owned],
            MEAN_STRETCH: self.stretch.nodal()[: self._owned],
        }
        fields = {name: gathered(self.comm, values) for name, values in fields.items()} | {
            "wall_distance_mm": self._wall_distance()
        }
        on_rank_0(self.comm, lambda: self._save(fields, m))

    def _save(self, fields, m):
        import pyvista

        kind, order = VTK[self.problem.cell_name]
        cells = np.hstack([np.full((len(self._cells), 1), len(order)), self._cells[:, order]])
        grid = pyvista.UnstructuredGrid(cells.ravel(), np.full(len(cells), kind, np.uint8), self._points)
        for name, values in fields.items():
            grid.point_data[name] = values.astype(np.float32)
        for name, value in m.touch.marks.items():
            grid.field_data[name] = np.array([value], np.int32)
        name = step_file(m.step)
        save_vtk(grid, self.directory / name)
        self._listed.append((self.goal.time(m.step, m.pressure * KPA_PER_MPA), name))
        self._list()

    def _list(self):
        rows = "".join(f'  <DataSet timestep="{p:.9g}" part="0" file="{f}"/>\n' for p, f in self._listed)
        write_text(
            self.directory / "solution.pvd",
            f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n <Collection>\n{rows}'
            " </Collection>\n</VTKFile>\n",
        )
