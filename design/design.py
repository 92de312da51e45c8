"""`Design`: a manipulator at its pressure, with what the reduced model says of it and the ways on from
there."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, overload

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_csv, write_text
from pneunet.base.files.folder import output_folder
from pneunet.base.files.record import write_record
from pneunet.base.files.schemas import CENTRELINE, POINT
from pneunet.base.quantities import shown
from pneunet.base.strains import RodStrains
from pneunet.base.units import KPA_PER_MPA, each_in_MPa, in_MPa
from pneunet.design.segmentation.segmentation import is_piece_row, piece_tables
from pneunet.design.target.metrics import FOLLOWED, Errors, compare
from pneunet.design.target.target import Target
from pneunet.geometry.designfile import DesignFile, read_design_file, write_design_file
from pneunet.geometry.parameters import Manipulator
from pneunet.reduced.choice import choose_law
from pneunet.reduced.rod.centreline import Centreline
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.overlap import overlap_doubts
from pneunet.reduced.rod.prediction import doubts, predict_design, segment_strains

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneunet.design.report.rundata import Solution
    from pneunet.design.search.inverse import Candidate
    from pneunet.design.search.tolerances import Tolerances
    from pneunet.geometry.moulds.parameters import Moulds

#: how split.toml begins
SPLIT = """# The split that this design follows: edited, a target of its own, or tables for yours.
points = "target.csv"

"""
#: of run.json: what belongs to the search
EFFORT = ("inputs", "evaluations", "wall_seconds")
log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """What to cast, and at what pressure.

    content: what design.toml says. law: what predicts. target: what was wanted, if anything was.
    active_bounds: of the search, in words. effort: what run.json says of the search. Of a fresh search alone,
    tolerances: what small changes do to the shape; alternatives: distinct bodies that do nearly as well;
    stopped_by: the bound that costs most, in words.
    """

    content: DesignFile
    law: SegmentLaw = field(default_factory=choose_law)
    target: Target | None = None
    active_bounds: tuple[str, ...] = ()
    effort: dict = field(default_factory=dict)
    tolerances: "Tolerances | None" = None
    alternatives: "tuple[Candidate, ...]" = ()
    stopped_by: str = ""

    @classmethod
    def of(
        cls,
        manipulator: Manipulator,
        *,
        pressure_kPa: float | Iterable[float],
        name: str = "design",
        law: str | SegmentLaw = "trained",
        mesh_size_mm: float = 1.5,
    ) -> "Design":
        """A Manipulator made by hand at a pressure, or at one for each group of its segments. law: 'trained',
        'analytic', a law's file (.npz) or a SegmentLaw. InputError where pressure or mesh size is none."""
        content = DesignFile(manipulator, each_in_MPa(pressure_kPa), name=name, mesh_size=mesh_size_mm)
        return cls(content, chosen_law(law))

    @classmethod
    def read(cls, path: str | Path, law: str | SegmentLaw | None = None) -> "Design":
        """The design in a design.toml, or in the folder that holds one, with what that tells of its search.

        law: by default the one it was designed with. InputError where there is none.
        """
        from pneunet.design.report.rundata import read_design_folder

        path = Path(path)
        if path.name != "design.toml" and not path.is_dir():
            return cls(read_design_file(path), chosen_law("trained" if law is None else law))
        folder = read_design_folder(path if path.is_dir() else path.parent)
        folder.require_whole()
        content, told = folder.design, folder.design.result
        return cls(
            content,
            chosen_law(folder.law if law is None else law),
            None if folder.target is None else Target(folder.target, content.name),
            _active_bounds(told, path),
            {key: folder.record[key] for key in EFFORT if key in folder.record},
        )

    def __repr__(self) -> str:
        m = self.manipulator
        told = f"{len(m.segments)} segments, {m.length:.1f} mm, {self.pressure_kPa:.4g} kPa"
        known = vars(self)  # computes nothing: doubts may take seconds
        if errors := known.get("errors"):
            told += f"; RMS {errors.rms:.2f} mm ({errors.percent(errors.rms):.2f} %)"
        return f"<Design {self.content.name}: {told}{f'; {len(self.doubts)} doubts' * ('doubts' in known)}>"

    @property
    def followed(self) -> bool:
        """Whether the prediction follows all of the target, the points of its tip included; true without
        one. A curve that is but a guide need not be followed."""
        if self.target is None:
            return True
        curves = (None if self.target.guided else self.errors, *self.further_errors)
        missed = any(away > FOLLOWED * self.target.length for away in self.tip_errors)
        return not missed and not any(e.not_followed for e in curves if e)

    @property
    def manipulator(self) -> Manipulator:
        """What is cast."""
        return self.content.manipulator

    @property
    def pressure_kPa(self) -> float:
        """The design's pressure, of several groups of segments the largest."""
        return self.content.largest_pressure * KPA_PER_MPA

    @cached_property
    def prediction(self) -> Centreline:
        """The Centreline at the design's pressure, in the target's coordinates."""
        return self._predicted(self.content.pressure)

    @cached_property
    def further_predictions(self) -> tuple[Centreline, ...]:
        """The Centrelines at the pressures of the target's further shapes, in their order."""
        shapes = () if self.target is None else self.target.shapes
        return tuple(self._predicted(s.pressures if len(s.pressures) > 1 else s.pressures[0]) for s in shapes)

    @cached_property
    def errors(self) -> Errors | None:
        """How far the prediction is from the target; None without one."""
        return None if self.target is None else compare(self.prediction.points, self.target.curve)

    @cached_property
    def further_errors(self) -> tuple[Errors, ...]:
        """How far the predictions are from the target's further shapes."""
        shapes = () if self.target is None else self.target.shapes
        return tuple(compare(line.points, s.curve) for line, s in zip(self.further_predictions, shapes))

    @cached_property
    def tip_errors(self) -> tuple[float, ...]:
        """Distances (mm) of the predicted tip from the target's points of the tip, in their order."""
        tip = None if self.target is None else self.target.tip
        if tip is None:
            return ()
        ends = (self._predicted(P).points[-1] for P in tip.pressures.tolist())
        return tuple(float(np.linalg.norm(end - point)) for end, point in zip(ends, tip.points))

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """Reasons, one a line, not to trust the prediction at the design's pressure."""
        of_the_law = doubts(self.manipulator, [self.content.pressure], self.law)
        return of_the_law + overlap_doubts(self.manipulator, self.prediction)

    @cached_property
    def strains(self) -> RodStrains:
        """RodStrains (segments, 3) of the segments' active parts at the design's pressure, in the body's
        axes."""
        return segment_strains(self.manipulator, self.prediction)

    @overload
    def predict(self, pressures_kPa: float) -> Centreline: ...

    @overload
    def predict(self, pressures_kPa: Iterable[float | Iterable[float]]) -> list[Centreline]: ...

    def predict(
        self, pressures_kPa: float | Iterable[float | Iterable[float]]
    ) -> Centreline | list[Centreline]:
        """The Centreline at a pressure, or a list of them at several, in the target's coordinates.

        Of a body with several groups of segments a number is the largest pressure, the others in the design's
        proportions; in a list there may be tuples of one for each group. InputError for a pressure that is
        none, ConvergenceError where the law has no equilibrium.
        """
        if not isinstance(pressures_kPa, Iterable):
            return self._predicted(self.content.scaled(in_MPa(pressures_kPa)))
        return [
            self._predicted(each_in_MPa(p)) if isinstance(p, Iterable) else self.predict(p)
            for p in pressures_kPa
        ]

    def _predicted(self, pressure):
        return predict_design(self.content, pressure, self.law)

    def save(self, directory: str | Path) -> Path:
        """`write` to a folder, which is made if need be; the folder. InputError where a run is at work in
        it."""
        with output_folder(directory) as folder:
            self.write(folder)
        return folder

    def write(self, directory: Path) -> None:
        """Write design.toml, centreline.csv, run.json, with a target target.csv and split.toml, with
        matplotlib design.png. InputError where it cannot be written to."""
        from pneunet.base.pictures import rendering

        content, line = self.content, self.prediction
        if self.target is not None:
            write_csv(directory / "target.csv", POINT, self.target.points)
            content = replace(content, target="target.csv")
            if content.result.get("piece"):
                write_text(directory / "split.toml", SPLIT + piece_tables(content.result["piece"]))
        write_csv(directory / "centreline.csv", CENTRELINE, np.column_stack([line.s, line.points]))
        write_design_file(directory / "design.toml", content)
        inputs = self.effort.get("inputs", {}) | {"law": self.law.name}
        record = {"inputs": inputs, "doubts": list(self.doubts)}
        write_record(directory, **(self.effort | record))
        try:
            rendering.save(self.plot(), directory / "design.png")
        except ImportError:
            log.info("no picture: matplotlib is missing, install it with: pip install 'pneunet[pictures]'")

    def plot(self) -> "Figure":
        """A matplotlib figure of target and prediction, with errors and segments."""
        from pneunet.design.report.pictures import design_figure

        return design_figure(self.content, self.prediction, self.target, self.errors)

    def export(self, directory: str | Path, moulds: "Moulds | str | Path | None" = None) -> Path:
        """Write what a workshop needs to cast it to directory/workshop, the path of which is returned: STEP
        and STL of the body and its moulds, a sheet as HTML and PDF.

        moulds: printer, draft, clearances, ..., or a TOML file of them. A finite element solution of this
        body in the folder tells the limits of the pressure. InputError where moulds or files are wrong.
        """
        from pneunet.design.report.rundata import read_design_folder
        from pneunet.design.workshop.export import read_moulds, write_pack

        if isinstance(moulds, (str, Path)):
            moulds = read_moulds(moulds)
        solved = None
        if (Path(directory) / "design.toml").exists():
            there = read_design_folder(directory)
            same = there.design.manipulator == self.manipulator and there.design.shares == self.content.shares
            solved = there.solve if same else None
        return write_pack(self.content, directory, self.law, moulds, solved)

    def solve(
        self,
        directory: str | Path,
        *,
        ranks: int = 1,
        pressure_kPa: float | None = None,
        mesh_size_mm: float | None = None,
        fields: bool = True,
        resume: bool = False,
    ) -> "Solution":
        """Finite elements of the whole body in processes of their own; the folder gets what `pneunet solve`
        writes.

        pressure_kPa, mesh_size_mm: instead of the design's. fields: ParaView files too. resume: go on from
        the last accepted step of a run that was ended. Progress is shown line by line. InputError on bad
        input, ConvergenceError (with everything accepted on disk) where the pressure cannot be reached.
        """
        from pneunet.design.chain import run_command
        from pneunet.design.report.rundata import read_design_folder

        arguments = []
        if pressure_kPa is not None:
            in_MPa(pressure_kPa)  # before anything is written
            arguments += ["--pressure-kPa", repr(float(pressure_kPa))]
        if mesh_size_mm is not None:
            arguments += ["--mesh-size-mm", repr(float(mesh_size_mm))]
        arguments += ["--no-fields"] * (not fields) + ["--resume"] * resume
        folder = self.save(directory)
        run_command(["solve", str(folder / "design.toml"), *arguments], ranks)
        found = read_design_folder(folder)
        found.require_whole()
        assert found.solve is not None, "a solve that ends well leaves its tables"
        return found.solve


def chosen_law(law: str | SegmentLaw) -> SegmentLaw:
    """A law by its name or file, or as it is; InputError where there is none of that name."""
    if not isinstance(law, (str, SegmentLaw)):
        raise InputError(f"law must be 'trained', 'analytic', a file or a SegmentLaw, not {shown(law)}")
    return choose_law(law) if isinstance(law, str) else law


def _active_bounds(result, where):
    """Those that [result] lists; InputError where what is read back of it was edited into something else."""
    bounds, rows = result.get("active_bounds", []), result.get("piece", [])
    if not isinstance(bounds, list) or not all(isinstance(text, str) for text in bounds):
        raise InputError(f"{where} [result]: 'active_bounds' must be a list of texts: leave it out")
    if not isinstance(rows, list) or not all(is_piece_row(row) for row in rows):
        raise InputError(f"{where} [result]: 'piece' is not as pneunet design writes it: leave it out")
    return tuple(bounds)
