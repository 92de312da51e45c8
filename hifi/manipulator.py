"""Solve a whole manipulator, clamped at its base, under one growing cavity pressure."""

import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from base import se3
from base.errors import ConvergenceError
from base.files import output_directory, write_csv
from base.record import write_record
from geometry import cad
from geometry.designfile import body_tables
from hifi import compat
from hifi.body import BodySystem
from hifi.control import LoadControl
from hifi.loads import Pressure
from hifi.output import FieldWriter
from hifi.path import EquilibriumPath
from hifi.problem import MixedProblem, Support
from hifi.rod_coordinates import RodCoordinates
from hifi.sections import SectionFrames
from hifi.stepping import StepSize, run_steps
from hifi.stretch import PrincipalStretch
from hifi.walls import WallDistances

KPA = 1e3  # kPa per MPa
#: rad; Newton on slender bodies is limited by how far they turn in a step, not by how far they strain
TURN_PER_STEP = 0.3


@dataclass(frozen=True)
class Measured:
    """One accepted state, the same on all ranks but for `walls` (rank 0 only). Pressure in MPa, lengths in mm.

    unstable: unstable directions at fixed pressure of the tangent factorised last, in this step or before.
    """

    step: int
    pressure: float
    iterations: int
    factorisations: int
    seconds: float
    volume: float
    largest_stretch: float
    stations: np.ndarray
    frames: np.ndarray
    strains: object
    walls: np.ndarray | None
    unstable: int


class ManipulatorSolve:
    """The boundary value problem of a meshed manipulator with everything that is measured on it."""

    def __init__(self, manipulator, mesh_path, comm=MPI.COMM_WORLD, newton_options=None, flip_y=False):
        """flip_y mirrors the mesh at the plane y = 0: for a mirrored manipulator on the original's mesh."""
        self.manipulator, self.comm = manipulator, comm
        mesh, cell_tags, facet_tags = compat.read_mesh(mesh_path, comm)
        if flip_y:
            mesh.geometry.x[:, 1] *= -1
        materials = {cad.BODY + i: s.material for i, s in enumerate(manipulator.segments)}
        materials |= {cad.LAYER + i: s.layer_material for i, s in enumerate(manipulator.segments) if s.layer_thickness}
        self.pressure = Pressure((cad.CAVITY, cad.CHANNEL))
        self.problem = MixedProblem(mesh, cell_tags, facet_tags, materials, [Support(cad.BASE)], [self.pressure])
        spacing = float(np.mean([s.pitch for s in manipulator.segments]))
        coordinates = RodCoordinates(self.problem.nodes, self.problem.owned_nodes, comm, spacing)
        self.system = BodySystem(self.problem, coordinates, self._apply)
        self.path = EquilibriumPath(self.system, LoadControl(), newton_options)
        self.sections = SectionFrames(self.problem, manipulator)
        self.walls = WallDistances(self.problem, manipulator)
        self.stretch = PrincipalStretch(self.problem)

    def _apply(self, load):
        self.pressure.value.value = load

    def measure(self, step=None):
        """Measured of the current state; collective."""
        frames = self.sections.frames()
        return Measured(
            step=step.number if step else 0,
            pressure=self.path.parameter,
            iterations=step.iterations if step else 0,
            factorisations=step.factorisations if step else 0,
            seconds=step.seconds if step else 0.0,
            volume=self.problem.cavity_volume(),
            largest_stretch=self.stretch.largest(),
            stations=self.sections.stations,
            frames=frames,
            strains=self.sections.segment_strains(frames),
            walls=self.walls.distances(),
            unstable=self.system.unstable,
        )

    def run(self, pressure, on_measured=lambda measured: None, milestones=(), first_step=None):
        """Step to `pressure` (MPa); `on_measured` sees every accepted state. ConvergenceError when it stops short."""
        softest = min(s.material.mu for s in self.manipulator.segments)
        size = StepSize(
            first=min(first_step or 0.01 * softest, pressure),
            smallest=1e-5 * softest,
            largest=0.05 * softest,
            milestones=tuple(milestones),
        )
        before = [self.path.parameter, self._relative_rotations(self.sections.frames())]

        def keep(step):
            measured = self.measure(step)
            now = self._relative_rotations(measured.frames)
            turn = np.linalg.norm(se3.log_rotation(np.swapaxes(before[1], -1, -2) @ now), axis=-1).sum()
            size.largest = min(0.05 * softest, TURN_PER_STEP * (step.load - before[0]) / max(turn, 1e-12))
            before[:] = [step.load, now]
            on_measured(measured)

        return run_steps(self.path, pressure, size, keep)

    @staticmethod
    def _relative_rotations(frames):
        """(stations - 1, 3, 3) rotation of each section frame with respect to the one before."""
        return np.swapaxes(frames[:-1, :3, :3], -1, -2) @ frames[1:, :3, :3]

    def destroy(self):
        self.system.destroy()


class ResultFiles:
    """CSV files of a run, rewritten whole after every accepted step so that a kill leaves them valid. Rank 0 only."""

    def __init__(self, directory, gaps):
        self.directory, self.gaps = Path(directory), gaps
        self.steps, self.centrelines, self.segments = [], [], []

    def add(self, m):
        p = m.pressure * KPA
        nearest = float(m.walls.min()) if len(m.walls) else float("inf")
        tip = m.frames[-1, :3, 3]
        row = [m.step, p, m.iterations, m.factorisations, m.volume, *tip, nearest, m.largest_stretch, m.unstable, m.seconds]
        self.steps.append(row)
        self.centrelines += [[m.step, p, s, *g[:3, 3]] for s, g in zip(m.stations, m.frames)]
        for i, (e, k) in enumerate(zip(m.strains.e, m.strains.k), start=1):
            self.segments.append([m.step, p, i, *e, *k])
        write_csv(
            self.directory / "steps.csv",
            "step pressure_kPa iterations factorisations volume_mm3 tip_x_mm tip_y_mm tip_z_mm smallest_wall_distance_mm "
            "largest_stretch unstable_directions seconds".split(),
            self.steps,
        )
        write_csv(self.directory / "centrelines.csv", "step pressure_kPa s_mm x_mm y_mm z_mm".split(), self.centrelines)
        write_csv(
            self.directory / "segments.csv",
            "step pressure_kPa segment e1 e2 e3 k1_rad_per_mm k2_per_mm k3_per_mm".split(),
            self.segments,
        )
        write_csv(
            self.directory / "walls.csv",
            "segment side gap gap_mm distance_mm".split(),
            [[*gap, d] for gap, d in zip(self.gaps, m.walls)],
        )


def solve_design(design, directory, mesh_size=None, pressure=None, fields=True, comm=MPI.COMM_WORLD, say=print):
    """Mesh (if not there yet) and solve a geometry.designfile.Design; files in directory/mesh and directory/solve.

    mesh_size in mm and pressure in MPa override the design's. Returns the last Measured. Raises InputError on bad
    input and ConvergenceError (with everything accepted on disk) when the pressure cannot be reached.
    """
    directory = Path(directory)
    pressure = pressure or design.pressure
    mesh_size = mesh_size or design.mesh_size
    say = say if comm.rank == 0 else (lambda text: None)
    started = time.perf_counter()
    facts = _on_rank_0(comm, lambda: _prepare(design, directory, mesh_size, say))
    solve = ManipulatorSolve(design.manipulator, directory / "mesh" / "manipulator.msh", comm)
    out = directory / "solve"
    files = ResultFiles(out, solve.walls.gaps)
    writer = FieldWriter(out, solve.problem, solve.stretch) if fields else None
    say(
        f"solve: {facts['cells']} cells, {solve.problem.dofs} dofs (P2/P1), {comm.size} rank{'s' * (comm.size > 1)}, "
        f"0..{pressure * KPA:g} kPa; set up in {time.perf_counter() - started:.1f} s"
    )
    breaks_at = break_stretch(design.manipulator)
    last, history = [], []

    def record(status, failures=()):
        if comm.rank == 0:
            write_record(
                out,
                status=status,
                pressure_kPa=pressure * KPA,
                pressure_reached_kPa=last[0].pressure * KPA,
                body=body_tables(design.manipulator),
                mesh=facts,
                cells=facts["cells"],
                dofs=solve.problem.dofs,
                ranks=comm.size,
                mesh_size_mm=facts["mesh_size_mm"],
                wall_seconds=time.perf_counter() - started,
                largest_stretch=last[0].largest_stretch,
                stretch_at_break=breaks_at if np.isfinite(breaks_at) else None,
                timings=solve.path.newton.timings,
                newton=vars(solve.path.newton.options),
                versions=versions(),
                failed_attempts=[[load * KPA, why] for load, why in failures],
                steps=history,
            )

    def keep(m):
        last[:] = [m]
        if writer:
            writer.write(m.step, m.pressure * KPA)
        history.append(
            {
                "step": m.step,
                "pressure_kPa": m.pressure * KPA,
                "iterations": m.iterations,
                "factorisations": m.factorisations,
            }
        )
        if comm.rank == 0:
            files.add(m)
            if m.step:
                say(_progress(m, pressure, breaks_at))
        record("running, or ended by force")

    keep(solve.measure())
    status, failure, result = "reached the pressure asked for", None, None
    try:
        result = solve.run(pressure, keep)
    except KeyboardInterrupt:
        record("interrupted")
        say(f"interrupted at {last[0].pressure * KPA:.4g} kPa; the result up to there is in {out}")
        raise
    except ConvergenceError as error:
        failure, result = error, error.result
        status = f"stopped at {last[0].pressure * KPA:.4g} kPa of {pressure * KPA:g} kPa: {result.reason}"
    record(status, result.failures)
    solve.destroy()
    if failure:
        raise ConvergenceError(
            f"pressure_kPa = {pressure * KPA:g} was not reached: stopped at {last[0].pressure * KPA:.4g} kPa ({result.reason}), "
            f"usually by ballooning, touching walls or too coarse a mesh; the result up to there is in {out}; "
            "try less pressure, thicker walls or a smaller mesh_size_mm"
        )
    return last[0]


def versions():
    """Versions of what computed the result."""
    import petsc4py

    return {
        "dolfinx": compat.VERSION,
        "petsc4py": petsc4py.__version__,
        "mpi": MPI.Get_library_version().split(",")[0],
        "numpy": np.__version__,
    }


def break_stretch(manipulator):
    """Smallest stretch at which one of the manipulator's materials breaks; inf when none says."""
    return min(material.break_stretch for material in manipulator.materials)


def _progress(m, target, breaks_at):
    done = m.pressure / target
    eta = m.seconds / done * (1 - done)
    nearest = m.walls.min() if len(m.walls) else float("inf")
    warning = "  WALLS OVERLAP" if nearest < 0 else ""
    if m.unstable:
        warning += f"  UNSTABLE in {m.unstable}"
    if m.largest_stretch > breaks_at:
        warning += f"  BEYOND BREAK (stretch {breaks_at:.2f})"
    return (
        f"step {m.step:3d}  {m.pressure * KPA:7.2f} kPa  {m.iterations:2d} iterations  {m.factorisations} factorisations  "
        f"stretch {m.largest_stretch:.2f}  wall distance {nearest:.2f} mm  {m.seconds:6.1f} s  ETA {eta:5.0f} s{warning}"
    )


def _prepare(design, directory, mesh_size, say):
    from geometry.mesh import mesh_manipulator, segment_tables

    out = output_directory(directory / "solve")
    for old in [*out.glob("step_*.vtu"), out / "solution.pvd", out / "run.json"]:
        old.unlink(missing_ok=True)  # of an earlier run, which may have had more steps
    facts_path = directory / "mesh" / "mesh.json"
    if facts_path.exists() and (directory / "mesh" / "manipulator.msh").exists():
        facts = json.loads(facts_path.read_text())
        if facts.get("mesh_size_mm") == mesh_size and facts.get("segments") == segment_tables(design.manipulator):
            return facts
    return mesh_manipulator(design.manipulator, mesh_size, directory / "mesh", say)


def _on_rank_0(comm, work):
    """Run `work` on rank 0; its result, or its error, on all ranks."""
    result, error = None, None
    if comm.rank == 0:
        try:
            result = work()
        except Exception as problem:  # agreed on by all ranks before anybody waits in a collective call
            error = problem
    result, error = comm.bcast((result, error), root=0)
    if error is not None:
        raise error
    return result
