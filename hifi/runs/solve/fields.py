"""ParaView files: one .vtu per accepted step and a .pvd that lists those that are complete."""

from pathlib import Path

import numpy as np

from pneunet.base.files.atomic import write_text
from pneunet.hifi.fem import compat
from pneunet.hifi.fem.agreement import on_rank_0
from pneunet.hifi.fem.surface import EDGES

QUADRATIC_TETRA = 24
#: dolfinx's P2 node order -> VTK's
TO_VTK = [0, 1, 2, 3, 9, 6, 8, 7, 5, 4]


class FieldWriter:
    """Gathers fields on rank 0 and writes them with VTK, so that files are the same for any number of ranks.

    At points: displacement (mm), pressure (the multiplier, MPa), stretch (largest principal) and
    wall_distance_mm, on facing walls the signed distance from the wall opposite and nan elsewhere; as field
    data the marks of hifi.contact.touch. Each .vtu appears by rename when it is whole, and only then in
    solution.pvd: a killed run leaves valid files.
    """

    def __init__(self, directory, problem, stretch, walls):
        self.directory, self.problem, self.stretch, self.walls = Path(directory), problem, stretch, walls
        self.comm = problem.mesh.comm
        index_map = problem.displacement_space.dofmap.index_map
        self._owned = index_map.size_local
        cells = compat.cell_dofs(problem.displacement_space)[: problem.mesh.topology.index_map(3).size_local]
        local_to_global = index_map.local_to_global(
            np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        )
        self._cells = self._gather(local_to_global[cells])
        self._points = self._gather(problem.nodes[: self._owned])
        self._wall_nodes = walls.node_numbers(local_to_global)
        self._listed = []

    def keep(self, steps):
        """List the files of an earlier run's `steps`, (number, pressure in kPa) each; rank 0's other files of
        steps go."""
        names = [(pressure, f"step_{number:04d}.vtu") for number, pressure in steps]
        self._listed = [(pressure, name) for pressure, name in names if (self.directory / name).exists()]
        if self.comm.rank == 0:
            self._list()
            for old in set(self.directory.glob("step_*.vtu")) - {self.directory / name for _, name in names}:
                old.unlink()

    def _gather(self, rows):
        parts = self.comm.gather(rows, root=0)
        return np.concatenate(parts) if self.comm.rank == 0 else None

    def _pressure_at_nodes(self):
        """Multiplier at the P2 nodes: corner values, averaged on mid-edges. One value per local displacement
        node."""
        corner = self.problem.pressure_field()
        p2 = compat.cell_dofs(self.problem.displacement_space)
        p1 = compat.cell_dofs(self.problem.pressure_space)
        out = np.zeros(len(self.problem.nodes))
        out[p2[:, :4]] = corner[p1]
        for i, (a, b) in enumerate(EDGES):
            out[p2[:, 4 + i]] = (corner[p1[:, a]] + corner[p1[:, b]]) / 2
        return out

    def _wall_distance(self):
        """wall_distance_mm of all nodes on rank 0, None elsewhere."""
        distances = self.walls.at_nodes()
        if distances is None:
            return None
        out = np.full(len(self._points), np.nan)
        np.fmin.at(out, self._wall_nodes.ravel(), np.where(np.isfinite(distances), distances, np.nan).ravel())
        return out

    def write(self, number, pressure_kPa, marks):
        """Write the current state as step `number` at the given pressure; `marks`: {name: bool} for the
        file's field data."""
        fields = {
            "displacement": self.problem.displacement()[: self._owned],
            "pressure": self._pressure_at_nodes()[: self._owned],
            "stretch": self.stretch.nodal()[: self._owned],
        }
        fields = {name: self._gather(values) for name, values in fields.items()} | {
            "wall_distance_mm": self._wall_distance()
        }
        on_rank_0(self.comm, lambda: self._save(fields, marks, number, pressure_kPa))

    def _save(self, fields, marks, number, pressure_kPa):
        import pyvista
        from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

        cells = np.hstack([np.full((len(self._cells), 1), 10), self._cells[:, TO_VTK]])
        grid = pyvista.UnstructuredGrid(
            cells.ravel(), np.full(len(cells), QUADRATIC_TETRA, np.uint8), self._points
        )
        for name, values in fields.items():
            grid.point_data[name] = values.astype(np.float32)
        for name, value in marks.items():
            grid.field_data[name] = np.array([value], np.int32)
        name = f"step_{number:04d}.vtu"
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()  # VTK itself crashes on a full disk
        writer.Write()
        write_text(self.directory / name, writer.GetOutputString())
        self._listed.append((pressure_kPa, name))
        self._list()

    def _list(self):
        rows = "".join(f'  <DataSet timestep="{p:.9g}" part="0" file="{f}"/>\n' for p, f in self._listed)
        write_text(
            self.directory / "solution.pvd",
            f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n <Collection>\n{rows}'
            " </Collection>\n</VTKFile>\n",
        )
