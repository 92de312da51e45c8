"""Functions of the front door that name units where the rooms behind it have one consistent system (mm,
MPa)."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pneunet.base import se3
from pneunet.base.errors import InputError
from pneunet.base.files.toml import from_table
from pneunet.base.materials.fit_run import run_fit
from pneunet.base.materials.fitting import Fit
from pneunet.base.materials.laws import Hyperelastic, material_from_table
from pneunet.base.quantities import shown
from pneunet.base.units import each_in_MPa
from pneunet.design.design import Design, chosen_law
from pneunet.design.report.report import write_report
from pneunet.design.report.viewing import run_view
from pneunet.design.search.doubts import WARN, tell_doubts
from pneunet.geometry.designfile import segment_from_table
from pneunet.geometry.loading import DeadLoads
from pneunet.geometry.parameters import Manipulator, Segment
from pneunet.reduced.rod import prediction
from pneunet.reduced.rod.centreline import Centreline
from pneunet.reduced.rod.laws import SegmentLaw
from pneunet.reduced.rod.rod import Rod


def segment(
    material: Hyperelastic | None = None, layer_material: Hyperelastic | None = None, **keys: object
) -> Segment:
    """A Segment from a design.toml's keys: segment(kind="one-sided", angle_deg=60, chambers=8, width_mm=12).

    material: by default the paper's; layer_material: of a bottom layer. InputError that names key and fix
    where a key is unknown, missing or wrong.
    """
    return segment_from_table(keys, "segment", material or Segment.material, layer_material)


def material(**keys: object) -> Hyperelastic:
    """A material from a design.toml's keys: material(law="Yeoh", c10_MPa=0.1, c20_MPa=0.01) or
    material(silicone="Ecoflex 00-30"). InputError that names key and fix otherwise."""
    return material_from_table(keys, "material")


def fit_material(
    path: str | Path,
    law: str = "all",
    *,
    directory: str | Path | None = None,
    stress_unit: str | None = None,
    to_strain_percent: float | None = None,
    gauge_length_mm: float | None = None,
) -> Fit:
    """Fit a material law to a table of tensile tests (docs/materials.md): its material, error and warnings.

    directory: gets material.toml and fit.png, by default out/fit-NAME. to_strain_percent: fit no further, by
    default 150. gauge_length_mm: of elongations in mm. InputError where the table or the law is none.
    """
    strain = None if to_strain_percent is None else to_strain_percent / 100
    return run_fit(path, law, directory, stress_unit, strain, gauge_length_mm)


def loads(**keys: object) -> DeadLoads:
    """Dead loads from a design.toml's keys: loads(gravity_m_per_s2=[0, 0, -9.81], tip_force_N=[0, 0,
    -0.1]). InputError that names key and fix otherwise."""
    return from_table(DeadLoads, keys, "loads")


def read_design(path: str | Path, law: str | SegmentLaw | None = None) -> Design:
    """The Design in a design.toml or in its folder; law: by default the one that it was designed with.
    InputError where there is none."""
    return Design.read(path, law)


def predict(
    manipulator: Manipulator,
    *,
    pressure_kPa: float | Iterable[float],
    law: str | SegmentLaw = "trained",
    base_pose: np.ndarray | None = None,
) -> Centreline:
    """The Centreline (mm) of a free Manipulator at a pressure; base_pose (4, 4): frame of its base.

    pressure_kPa: one for all, or one for each group of segments. law: 'trained', 'analytic', a law's file
    (.npz) or a SegmentLaw. InputError where a pressure or their number is wrong, ConvergenceError where the
    law has no equilibrium. What makes the law doubt its answer is logged.
    """
    law, pressure, manipulator = chosen_law(law), each_in_MPa(pressure_kPa), _body(manipulator)
    line = prediction.predict(manipulator, pressure, law, base_pose=_pose(base_pose))
    tell_doubts(prediction.doubts(manipulator, [pressure], law), law, WARN)
    return line


def rod(
    manipulator: Manipulator,
    *,
    pressure_kPa: float | Iterable[float],
    law: str | SegmentLaw = "trained",
    base_pose: np.ndarray | None = None,
) -> Rod:
    """The Rod of a Manipulator, which carries loads: rod(...).equilibrium(pn.loads(tip_force_N=[0, 0,
    -0.1])).

    pressure_kPa: one for all, or one for each group of segments. InputError where a pressure or their number
    is wrong.
    """
    return Rod.of(_body(manipulator), chosen_law(law), each_in_MPa(pressure_kPa), _pose(base_pose))


def _body(given):
    """A Manipulator, or InputError."""
    if not isinstance(given, Manipulator):
        raise InputError(f"manipulator: write pn.Manipulator((segment, ...)), not {shown(given)}")
    return given


def _pose(given):
    """A base's frame (4, 4), or None; InputError for anything else."""
    return None if given is None else se3.checked_pose(given, "base_pose")


def report(directory: str | Path, law: str | SegmentLaw | None = None) -> Path:
    """Write one HTML page of what a design's folder holds; its path. law: by default that of the design.
    InputError where the folder holds no design."""
    return write_report(directory, None if law is None else chosen_law(law))


def view(directory: str | Path, film: str | None = None, window: bool = False) -> Path:
    """Write view.html of a design's folder: the body to turn in any browser, with a slider over load steps;
    its path. film: 'gif' or 'mp4' of the inflation as well; window: open one, where there is a display.
    InputError where the folder holds no design, or for another film."""
    return run_view(directory, film=film and f".{film}", in_window=window)
