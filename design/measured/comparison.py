"""`pneunet compare`: a measurement beside its prediction, and what it says of the casting."""

import logging
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.errors import InputError, located
from pneunet.base.files.atomic import write_csv
from pneunet.base.files.folder import output_folder
from pneunet.base.files.record import write_record
from pneunet.base.materials.laws import of_modulus
from pneunet.base.pictures import rendering
from pneunet.base.units import KPA_PER_MPA, LARGEST_PRESSURE_KPA, MPA_PER_KPA
from pneunet.design.design import Design, chosen_law
from pneunet.design.measured.fit import CastingFit, fit_casting
from pneunet.design.measured.prediction import Aligned, Predicted, align, one_marker
from pneunet.design.measured.table import (
    BASE,
    CENTRELINE,
    DISPLACEMENT,
    MARKERS,
    TIP,
    Measurement,
    read_measured,
    read_places,
)
from pneunet.design.report.rundata import read_design_folder
from pneunet.design.target.metrics import compare as compare_curves
from pneunet.geometry.designfile import DesignFile, write_design_file
from pneunet.geometry.parameters import Manipulator
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.prediction import doubts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

log = logging.getLogger(__name__)
COLUMNS = ("pressure_kPa", "point", "rows", "spread", "error", "error_percent", "half_width_90_percent")
#: standard deviations of a 90 % interval
NORMAL_90 = 1.645


@dataclass(frozen=True, eq=False)
class MeasuredComparison:
    """A measurement beside what a design's law predicts. Values are in the target's coordinates.

    measured: as it was read; predicted: as the design is; aligned: the measurement, registered; fit: the
    casting that the measurement speaks for, None where it says nothing (why: `no_fit`). solved: of finite
    elements in the folder, where the tip was measured: (pressures (m,) in kPa, how far the tip has gone
    (m,) in mm).
    """

    design: Design
    measured: Measurement
    predicted: Predicted
    aligned: Aligned
    fit: CastingFit | None
    no_fit: str = ""
    as_is: bool = False
    solved: tuple[np.ndarray, np.ndarray] | None = None

    def __repr__(self) -> str:
        rms = f"RMS {self.rms:.3g} {self.measured.unit} ({self.percent(self.rms):.2g} %)"
        told = "" if self.fit is None else f", modulus times {self.fit.change.modulus:.3f}"
        return f"<MeasuredComparison: {len(self.pressures_kPa)} pressures, {rms}{told}>"

    @property
    def pressures_kPa(self) -> np.ndarray:
        """(n,) of the levels."""
        return self.measured.pressures * KPA_PER_MPA

    @property
    def errors(self) -> np.ndarray:
        """(n, k) distance of measured from predicted, mm or degrees; nan where nothing was seen."""
        return np.linalg.norm(self.aligned.values - self.predicted.plain, axis=2)

    @property
    def loaded(self) -> slice:
        """The levels above rest, where registration makes errors small."""
        return slice(int(self.measured.at_rest), None)

    @property
    def rms(self) -> float:
        """Of the errors above rest."""
        return float(np.sqrt(np.nanmean(self.errors[self.loaded] ** 2)))

    @property
    def whole(self) -> float:
        """What percents are of: the body's length at rest for points, the largest measured value else."""
        points = self.aligned.values.shape[2] == 3
        return self.design.manipulator.length if points else float(np.nanmax(np.abs(self.aligned.values)))

    def percent(self, error: float | np.ndarray) -> float | np.ndarray:
        return 100 * error / self.whole

    @property
    def bars(self) -> np.ndarray | None:
        """(n, k) half of the 90 % interval of predicted and measured together; None where the law knows no
        error of its own."""
        half = self.predicted.half_width
        if half is None:
            return None
        mean = self.measured.spread / np.sqrt(self.measured.rows)[:, None]
        return np.hypot(half, NORMAL_90 * np.nan_to_num(mean))

    @property
    def inside(self) -> float | None:
        """Share of the observations above rest that lie within the bars; None without bars."""
        if self.bars is None:
            return None
        seen = np.isfinite(self.errors[self.loaded])
        return float(np.mean((self.errors <= self.bars)[self.loaded][seen]))

    @property
    def told(self) -> int:
        """The point whose way is told and drawn: the tip, or the marker that should go farthest."""
        names, predicted = self.measured.names, self.predicted.plain
        if TIP in names:
            return names.index(TIP)
        return int(np.argmax(np.linalg.norm(predicted[-1] - predicted[0], axis=1))) if names else -1

    def way(self, values: np.ndarray) -> np.ndarray:
        """(n,) of values (n, k, d), measured or predicted: how far the point `told` has gone from where it
        was at the first level, mm, or the value itself."""
        values = values[:, self.told]
        return np.linalg.norm(values - values[0], axis=1) if values.shape[1] == 3 else values[:, 0]

    @property
    def solved_rms(self) -> float | None:
        """RMS of the tip's way, measured less that of the finite elements, as far as those went, mm."""
        if self.solved is None:
            return None
        kPa, way = self.solved
        measured = self.way(self.aligned.values)
        within = (self.pressures_kPa <= 1.001 * kPa[-1]) & (np.arange(len(measured)) >= self.loaded.start)
        off = (measured - np.interp(self.pressures_kPa, kPa, way))[within]
        return float(np.sqrt(np.nanmean(off**2))) if len(off) else None

    @cached_property
    def fitted(self) -> np.ndarray | None:
        """(n, k, d) what the fitted casting does, as Predicted.plain."""
        return None if self.fit is None else self.predicted.observed(self.predicted.lines(self.fit.change))

    @cached_property
    def consequences(self) -> dict:
        """What the fit would change in the design, by file key: its pressure for the shape that was designed,
        how far the tip is off at the old one, and with a target the RMS distances from it; None for what the
        law finds no equilibrium of. Under dead loads no pressure gives that shape back."""
        if self.fit is None:
            return {}
        change, P = self.fit.change, self.design.content.largest_pressure
        kPa, line = P * KPA_PER_MPA, self.predicted.line
        wanted, shapes = line(P), {"design": line(P, change)}
        out: dict = {"design_pressure_kPa": kPa}
        if not self.design.content.loads:
            shapes["that"] = line(change.modulus * P, change)
            out["pressure_for_the_shape_kPa"] = change.modulus * kPa
        for key, found in shapes.items():
            tips = None if found is None or wanted is None else found.points[-1] - wanted.points[-1]
            out[f"tip_off_at_{key}_pressure_mm"] = None if tips is None else float(np.linalg.norm(tips))
        if self.design.target is not None:
            cast = {"design": "cast", "that": "cast_at_that_pressure"}
            of_target = {"designed": wanted} | {cast[key]: found for key, found in shapes.items()}
            for key, found in of_target.items():
                errors = None if found is None else compare_curves(found.points, self.design.target.curve)
                out[f"target_rms_{key}_mm"] = None if errors is None else errors.rms
        return out

    def corrected(self) -> DesignFile:
        """The design with the fitted modulus and walls, at the pressure for the shape that was designed,
        under dead loads at its own. InputError without a fit, or where there is no such body."""
        if self.fit is None:
            raise InputError(f"{self.measured.path}: no fit, so nothing to correct: {self.no_fit}")
        change, content = self.fit.change, self.design.content
        body = change.of_body(content.manipulator)
        segments = [
            replace(
                s,
                material=of_modulus(s.material, change.modulus * s.material.mu),
                layer_material=s.layer_material
                and of_modulus(s.layer_material, change.modulus * s.layer_material.mu),
            )
            for s in body.segments
        ]
        factor = 1.0 if content.loads else change.modulus
        largest = min(factor * content.largest_pressure, LARGEST_PRESSURE_KPA * MPA_PER_KPA)
        return replace(
            content, manipulator=Manipulator(tuple(segments)), pressure=content.scaled(largest), result={}
        )

    def table(self) -> dict:
        """By file key, for run.json."""
        errors = self.errors[self.loaded]
        unit = self.measured.unit
        out = {
            "measured": self.measured.path,
            "what": self.measured.what,
            "points": list(self.measured.names),
            "unit": unit,
            "levels": len(self.pressures_kPa),
            "rows": int(self.measured.rows.sum()),
            "rms": self.rms,
            "rms_percent": self.percent(self.rms),
            "largest": float(np.nanmax(errors)),
            "percent_of": self.whole,
            "off_at_rest": self.aligned.off,
            "turn_from_loaded_shapes": self.aligned.turned,
            "registration": None if self.aligned.pose is None else self.aligned.pose.tolist(),
            "inside_90_percent_bars": self.inside,
            "finite_elements_way_of_tip_rms_mm": self.solved_rms,
        }
        if self.fit is None:
            return out | {"fit": None, "no_fit": self.no_fit}
        return out | {"fit": self.fit.table() | {"unit": unit}, "consequences": self.consequences}

    def lines(self) -> list[str]:
        """The same for people, a line each."""
        unit, m = self.measured.unit, self.measured
        of = "length" if self.aligned.values.shape[2] == 3 else "the largest measured"
        out = [
            f"{m.what} at {len(m.pressures)} pressures, {self.pressures_kPa[0]:.4g} to"
            f" {self.pressures_kPa[-1]:.4g} kPa, from {int(m.rows.sum())} rows",
            f"registered at rest to {self.aligned.off:.3g} {unit}"
            + "; the turn about the markers' line is that of the loaded shapes" * self.aligned.turned,
            f"measured - predicted: RMS {self.rms:.3g} {unit} ({self.percent(self.rms):.2g} % of {of}),"
            f" largest {np.nanmax(self.errors[self.loaded]):.3g} {unit}",
        ]
        if self.inside is not None:
            out.append(f"within the prediction's own 90 % bars: {100 * self.inside:.0f} % of the points")
        else:
            out.append(f"no bars: the law '{self.predicted.law.name}' does not know how wrong it is")
        if self.solved is not None and self.solved_rms is not None:
            out.append(
                f"finite elements in this folder: the tip's way differs by {self.solved_rms:.3g} mm RMS,"
                f" up to {self.solved[0][-1]:.4g} kPa"
            )
        if self.fit is None:
            return [*out, f"no fit: {self.no_fit}"]
        f, c = self.fit, self.consequences
        told = f"modulus times {f.change.modulus:.3f}"
        if f.interval and f.interval_of_measurement:
            low, high = f.interval_of_measurement
            told += f" (90 %: {f.interval[0]:.3f} to {f.interval[1]:.3f}"
            told += f"; were the law exact, {low:.3f} to {high:.3f})"
        if f.change.wall:
            told += f", walls {f.change.wall:+.3f} mm"
        if f.wall_interval:
            told += f" (90 %: {f.wall_interval[0]:+.3f} to {f.wall_interval[1]:+.3f})"
        out.append(f"best fit: {told}; RMS {f.rms:.3g} {unit}")
        if f.at_the_edge:
            return [*out, "no modulus in reach fits: is it this body, in these units?"]
        off = c["tip_off_at_design_pressure_mm"]
        needs = (
            "so no pressure gives the designed shape back, since the loads stay"
            if self.design.content.loads
            else f"so the shape designed for {c['design_pressure_kPa']:.4g} kPa needs"
            f" {c['pressure_for_the_shape_kPa']:.4g} kPa"
        )
        told = " the law finds no equilibrium" if off is None else f" the tip is {off:.3g} mm off"
        out.append(f"{needs}; at {c['design_pressure_kPa']:.4g} kPa{told}")
        return out

    def rows(self) -> list[list]:
        """Of compare.csv: COLUMNS, then measured, predicted and fitted coordinates or values."""
        m, bars = self.measured, self.bars
        names = m.names or [str(i + 1) for i in range(m.values.shape[1])]
        out: list[list] = []
        for i, pressure in enumerate(self.pressures_kPa):
            for k, name in enumerate(names):
                error = self.errors[i, k]
                row = [pressure, name, int(m.rows[i]), m.spread[i, k], error, self.percent(error)]
                row += [np.nan if bars is None else bars[i, k]]
                for values in (self.aligned.values, self.predicted.plain, self.fitted):
                    row += [*([np.nan] * m.values.shape[2] if values is None else values[i, k])]
                out.append(["" if isinstance(v, float) and np.isnan(v) else v for v in row])
        return out

    def header(self) -> list[str]:
        """Names of the columns of `rows`, with their units."""
        unit, points = self.measured.unit, self.measured.values.shape[2] == 3
        of_unit = ("spread", "error", "half_width_90_percent")
        out = [f"{name}_{unit}" if name in of_unit else name for name in COLUMNS]
        for who in ("measured", "predicted", "fitted"):
            out += [f"{who}_{axis}_mm" for axis in "xyz"] if points else [f"{who}_{unit}"]
        return out

    def plot(self) -> "Figure":
        """A matplotlib figure: measured and predicted over pressure, errors with the bars, shapes."""
        from pneunet.design.measured.picture import comparison_figure

        return comparison_figure(self)

    def save(self, directory: str | Path) -> Path:
        """Write compare.csv, run.json, with a fit fitted.toml and with matplotlib compare.png; the folder."""
        with output_folder(directory) as folder:
            write_csv(folder / "compare.csv", self.header(), self.rows())
            if self.fit is not None:
                write_design_file(folder / "fitted.toml", self.corrected())
            inputs = {"design": self.design.content.name, "law": self.predicted.law.name, "as_is": self.as_is}
            body = self.design.manipulator
            levels = [self.design.content.scaled(P) for P in self.measured.pressures.tolist()]
            doubted = doubts(body, levels, self.predicted.law)
            write_record(folder, inputs=inputs, doubts=list(doubted), **self.table())
            for text in doubted:
                log.warning(f"warning: {text}")
            try:
                rendering.save(self.plot(), folder / "compare.png")
            except ImportError:
                log.info("no picture: install it with: pip install 'pneunet[pictures]'")
        return folder


def compare(
    run: "str | Path | Design",
    measured: str | Path,
    *,
    markers: str | Path | None = None,
    fit_wall: bool = False,
    as_is: bool = False,
    law: str | SegmentLaw | None = None,
) -> MeasuredComparison:
    """A measurement over pressure beside what a design predicts.

    run: a design's folder, its design.toml, or a Design; measured: a table (docs/use-compare.md); markers: a
    table of where markers sit on the body, which those called tip and base do not need; fit_wall: the walls'
    thickness too; as_is: the measured coordinates are the target's, nothing is registered; law: by default
    that of the design. InputError, in one line, for what cannot be compared.
    """
    design = run if isinstance(run, Design) else Design.read(run, law)
    used = design.law if law is None or not isinstance(run, Design) else chosen_law(law)
    found = read_measured(measured)
    places = _places(found, design, markers)
    predicted = Predicted(design.content, used, one_marker(found), places)
    with located(str(measured)):
        aligned = align(predicted.measured, predicted.plain, as_is)
    fit, why = None, ""
    try:
        fit = fit_casting(predicted, fit_wall, as_is)
    except InputError as error:
        if fit_wall:
            raise
        why = str(error)
    solved = None if isinstance(run, Design) else _solved(Path(run), found)
    return MeasuredComparison(design, predicted.measured, predicted, aligned, fit, why, as_is, solved)


def _solved(run: Path, measured: Measurement) -> tuple[np.ndarray, np.ndarray] | None:
    """MeasuredComparison.solved; None where there are no finite elements, or the tip was not measured."""
    at_tip = measured.what in (CENTRELINE, DISPLACEMENT) or TIP in measured.names
    folder = run if run.is_dir() else run.parent
    if not at_tip or not (folder / "solve").is_dir():
        return None
    solve = read_design_folder(folder).solve
    if solve is None:
        return None
    tips = np.column_stack([solve.steps[f"tip_{axis}_mm"] for axis in "xyz"])
    return solve.steps["pressure_kPa"], np.linalg.norm(tips - tips[0], axis=1)


def _places(measured: Measurement, design: Design, markers) -> np.ndarray:
    """(k, 3) of the markers, of anything else the tip; InputError where one sits nobody knows where."""
    length = design.manipulator.length
    known = {TIP: np.array([length, 0.0, 0.0]), BASE: np.zeros(3)}
    if measured.what != MARKERS:
        return known[TIP][None]
    known |= {} if markers is None else read_places(markers)
    lower = {name.lower(): place for name, place in known.items()}
    for name in measured.names:
        if name.lower() not in lower:
            raise InputError(
                f"{measured.path}: where marker '{name}' sits is not known: give --markers FILE with columns"
                " marker, x_mm, y_mm, z_mm on the body at rest ('tip' and 'base' need none)"
            )
    return np.array([lower[name.lower()] for name in measured.names])


def run_compare(
    run: str | Path,
    measured: str | Path,
    directory: str | Path | None = None,
    markers: str | Path | None = None,
    fit_wall: bool = False,
    as_is: bool = False,
    law: str | None = None,
) -> MeasuredComparison:
    """`compare`, told on the screen and saved: by default to compare/ in the design's folder."""
    log.info(f"compare: {measured} with {run}")
    found = compare(run, measured, markers=markers, fit_wall=fit_wall, as_is=as_is, law=law)
    base = Path(run) if Path(run).is_dir() else Path(run).parent
    folder = found.save(base / "compare" if directory is None else directory)
    for line in found.lines():
        log.info(line)
    log.info(f"written: {folder} with {', '.join(sorted(file.name for file in folder.iterdir()))}")
    return found
