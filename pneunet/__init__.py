"""pneunet: simulation and inverse design of pneu-net soft robots.

    import pneunet as pn

    target = pn.Target.read("curve.csv")            # points in mm
    design = pn.inverse_design(target)              # what to cast, and at what pressure
    lines = design.predict([10, 20, 30])            # kPa -> a Centreline each
    design.save("out/mine")                         # design.toml, centreline.csv, ...
    solved = design.solve("out/mine", ranks=2)      # finite elements in processes of their own
    pn.report("out/mine")                           # one HTML page

Names are loaded when they are first asked for: importing pneunet costs nothing. Lengths are in mm and
degrees; pressures of this module's functions are in kPa and say so in the argument's name.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pneunet.base.curve import Curve as Curve
    from pneunet.base.errors import ConvergenceError as ConvergenceError
    from pneunet.base.errors import InputError as InputError
    from pneunet.base.files.results import Results as Results
    from pneunet.base.files.results import read_run as read_run
    from pneunet.base.materials.laws import silicone as silicone
    from pneunet.base.strains import RodStrains as RodStrains
    from pneunet.design.chain import run_study as run_study
    from pneunet.design.chain import solve_cell as solve_cell
    from pneunet.design.design import Design as Design
    from pneunet.design.inverse_design import inverse_design as inverse_design
    from pneunet.design.measured.comparison import MeasuredComparison as MeasuredComparison
    from pneunet.design.measured.comparison import compare as compare
    from pneunet.design.report.rundata import Solution as Solution
    from pneunet.design.target.casting import Casting as Casting
    from pneunet.design.target.shapes import TargetShape as TargetShape
    from pneunet.design.target.shapes import TipPoints as TipPoints
    from pneunet.design.target.target import Target as Target
    from pneunet.design.workspace import Workspace as Workspace
    from pneunet.design.workspace import workspace as workspace
    from pneunet.front import fit_material as fit_material
    from pneunet.front import loads as loads
    from pneunet.front import material as material
    from pneunet.front import predict as predict
    from pneunet.front import read_design as read_design
    from pneunet.front import report as report
    from pneunet.front import rod as rod
    from pneunet.front import segment as segment
    from pneunet.front import view as view
    from pneunet.geometry.loading import DeadLoads as DeadLoads
    from pneunet.geometry.moulds.parameters import Moulds as Moulds
    from pneunet.geometry.parameters import Manipulator as Manipulator
    from pneunet.geometry.parameters import Segment as Segment
    from pneunet.reduced.rod.centreline import Centreline as Centreline
    from pneunet.reduced.rod.rod import Rod as Rod
    from pneunet.reduced.rod.rod import RodPiece as RodPiece

#: public name -> module that has it
_PLACES = {
    "Casting": "design.target.casting",
    "Centreline": "reduced.rod.centreline",
    "ConvergenceError": "base.errors",
    "Curve": "base.curve",
    "DeadLoads": "geometry.loading",
    "Design": "design.design",
    "InputError": "base.errors",
    "Manipulator": "geometry.parameters",
    "MeasuredComparison": "design.measured.comparison",
    "Moulds": "geometry.moulds.parameters",
    "Results": "base.files.results",
    "Rod": "reduced.rod.rod",
    "RodPiece": "reduced.rod.rod",
    "RodStrains": "base.strains",
    "Segment": "geometry.parameters",
    "Solution": "design.report.rundata",
    "Target": "design.target.target",
    "TargetShape": "design.target.shapes",
    "TipPoints": "design.target.shapes",
    "Workspace": "design.workspace",
    "compare": "design.measured.comparison",
    "fit_material": "front",
    "inverse_design": "design.inverse_design",
    "loads": "front",
    "material": "front",
    "predict": "front",
    "read_design": "front",
    "read_run": "base.files.results",
    "report": "front",
    "rod": "front",
    "run_study": "design.chain",
    "segment": "front",
    "silicone": "base.materials.laws",
    "solve_cell": "design.chain",
    "view": "front",
    "workspace": "design.workspace",
}
__all__ = [*_PLACES, "__version__"]


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("pneunet")
    if name not in _PLACES:
        raise AttributeError(f"module 'pneunet' has no attribute '{name}'")
    value = getattr(import_module(f"pneunet.{_PLACES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
