"""The command line's grammar: sub-commands, their arguments and what may stand for them."""

import argparse
import math
import shutil
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NoReturn

from pneunet.base.errors import InputError
from pneunet.base.units import LARGEST_PRESSURE_KPA
from pneunet.manual import EXIT_CODES, PAGES, TOP
from pneunet.start import KINDS

#: shells that `pneunet completion` knows
SHELLS = ("bash", "zsh", "fish")
#: a design's file in its folder
DESIGN = "design.toml"
A_DESIGN = "a design.toml, or the folder that holds it"
A_CAMPAIGN = "the campaign; pneunet init campaign writes one"


class Parser(argparse.ArgumentParser):
    """Errors are InputErrors; --pressure is not taken for --pressure-kPa: the unit is part of the name."""

    def __init__(self, **options):
        as_written = argparse.RawDescriptionHelpFormatter
        super().__init__(**options, allow_abbrev=False, formatter_class=as_written)

    def format_help(self) -> str:
        self.description = _in_columns(self.description or "")
        return super().format_help()

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} ({self.prog} --help tells more)")


def _in_columns(text):
    """Paragraphs as wide as the terminal, as argparse counts it, and no wider than is read with ease."""
    width = min(shutil.get_terminal_size().columns - 2, 100)
    return "\n\n".join(textwrap.fill(paragraph, width) for paragraph in text.split("\n\n"))


class _Version(argparse.Action):
    """Name, version and revision, looked for when they are wanted."""

    def __call__(self, parser, *_):
        from importlib.metadata import version

        from pneunet.base.files.record import revision

        number, built = version("pneunet"), revision()
        print(f"pneunet {number}" + (f" ({built})" if built != number else ""))
        parser.exit()


def real(text: str) -> float:
    """A number in ASCII digits, nan for any other text."""
    try:
        return float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        return math.nan


def path(text: str) -> Path:
    """A name that a file can have."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty: a variable that is not set?")
    if not text.isprintable() or max(len(part.encode()) for part in Path(text).parts or ("",)) > 255:
        raise argparse.ArgumentTypeError("no file is called so: control characters, or over 255 in a name")
    if len(text) > 3000:
        raise argparse.ArgumentTypeError("over 3000 characters are too long a path")
    return Path(text)


def design_file(text: str) -> Path:
    """A design.toml, given by its own name or by its folder's."""
    given = path(text)
    return given / DESIGN if (given / DESIGN).is_file() else given


def run_folder(text: str) -> Path:
    """A design's folder, given by its own name or by its design.toml's."""
    given = path(text)
    return given.parent if given.name == DESIGN and given.is_file() else given


def pressures(text: str, least: float = math.ulp(0.0)) -> list[float]:
    """kPa of a comma-separated list."""
    values = []
    for word in text.split(","):
        value = real(word)
        if math.isnan(value):
            raise argparse.ArgumentTypeError(f"'{word}' is not a number; write for instance 10,20,30")
        if not least <= value <= LARGEST_PRESSURE_KPA:
            allowed = f"0..{LARGEST_PRESSURE_KPA:g} kPa" + ", 0 left out" * bool(least)
            raise argparse.ArgumentTypeError(f"{value:g} must lie in {allowed}")
        values.append(value)
    return values


def one_pressure(text: str) -> float:
    """kPa; 0 is for loads alone."""
    values = pressures(text, 0.0)
    if len(values) != 1:
        raise argparse.ArgumentTypeError("one number is wanted here")
    return values[0]


def _number(text: str, low: float, high: float, said: str) -> float:
    value = real(text)
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"'{text}' must be a number {said}")
    return value


def mesh_size(text: str) -> float:
    """mm"""
    return _number(text, 0.1, 20, "in 0.1..20")


def strain_percent(text: str) -> float:
    """Larger than 0."""
    return _number(text, math.ulp(0.0), math.inf, "larger than 0")


def gauge_length(text: str) -> float:
    """mm"""
    return _number(text, 0.1, 1e4, "in 0.1..1e4")


def whole(text: str) -> int:
    """1 to 20000"""
    if not (text.isascii() and text.isdecimal() and len(text) < 10) or not 0 < int(text) <= 20_000:
        raise argparse.ArgumentTypeError(f"'{text}' must be a whole number in 1..20000")
    return int(text)


#: types of arguments that are names of files, and of folders
FILES, FOLDERS = (path, design_file), (run_folder,)


def parser(functions: Mapping[str, Callable]) -> Parser:
    """The parser; functions: {command: what is called with its arguments}."""
    top = Parser(
        prog="pneunet",
        description=TOP.about,
        epilog=f"pneunet COMMAND --help tells more.\n\n{TOP.epilog()}\n\n{EXIT_CODES}",
    )
    top.add_argument("--version", action=_Version, nargs=0, help="name, version and revision")
    commands = top.add_subparsers(
        title="commands", dest="command", metavar="COMMAND", required=True, parser_class=Parser
    )

    def add(name, text):
        page = PAGES[name]
        description = f"{text}\n\n{page.about}"
        command = commands.add_parser(name, help=text, description=description, epilog=page.epilog())
        command.set_defaults(function=functions[name])
        return command.add_argument

    def add_law(argument, default):
        text = "trained (the rod law that comes along), analytic, or the .npz of pneunet train"
        text += f"; default: {default or 'as designed'}"
        argument("--law", default=default, metavar="LAW", help=text)

    def add_outside(argument):
        text = "where the law doubts the design; default: warn"
        argument("--outside", choices=("warn", "refuse"), default="warn", help=text)

    def add_output(argument, default, metavar="DIR"):
        argument("-o", "--output", type=path, metavar=metavar, help=f"default: {default}")

    def add_retry(argument):
        text = "compute again what crashed, ran out of time or memory"
        argument("--retry", action="store_true", help=text)

    finished = "; finished cases there are kept"

    a = add("init", "a file with comments to start from: a target, a design, a cell, a study, a campaign")
    a("kind", choices=tuple(KINDS), help="what it is of")
    a("file", type=path, nargs="?", metavar="FILE.toml", help="default: KIND.toml, here")

    a = add("design", "inverse design: target curve (CSV or TOML) -> design.toml, centreline.csv, design.png")
    a("target", type=path, help="a file, or the name of a shipped target: octopus, tentacle2, vase, pear")
    add_law(a, "trained")
    add_outside(a)
    add_output(a, "out/NAME of the target")

    a = add("shape", "reduced model only: centrelines, 3D body, picture and animation")
    a("design", type=design_file, help=A_DESIGN)
    text = "default: five steps to the design's"
    a("--pressure-kPa", type=pressures, dest="pressures", metavar="10,20,...", help=text)
    add_law(a, "trained")
    add_outside(a)
    add_output(a, "the design's folder")

    a = add("workspace", "what segments reach over angle and pressure, and where tips of one to three go")
    text = "what is varied; default: the paper's silicone and a design's start dimensions"
    a("workspace", type=path, nargs="?", metavar="WORKSPACE.toml", help=text)
    add_law(a, "trained")
    add_output(a, "out/NAME of the file, out/workspace without one")

    a = add("mesh", "CAD (STEP) and tagged mesh, with volumes and checks")
    a("design", type=design_file, help=A_DESIGN)
    a("--mesh-size-mm", type=mesh_size, help="largest edge of the elements; default: the design's")
    add_output(a, "the design's folder")

    a = add("export", "everything to cast it: STEP and STL of body and moulds, a sheet for the workshop")
    a("design", type=design_file, help=A_DESIGN)
    text = "printer, draft, clearances, ...; default: a bed of 220 mm and straight walls"
    a("--moulds", type=path, metavar="MOULDS.toml", help=text)
    add_output(a, "the design's folder; the pack is in its folder workshop")

    text = "finite elements of the whole manipulator; under MPI: pneunet run -n 2 solve DESIGN.toml"
    a = add("solve", text)
    a("design", type=design_file, help=A_DESIGN)
    text = "default: the design's; 0: its [loads] alone"
    a("--pressure-kPa", type=one_pressure, dest="pressure", help=text)
    a("--mesh-size-mm", type=mesh_size, help="largest edge of the elements; default: the design's")
    a("--no-fields", action="store_true", help="write no ParaView files")
    text = "go on from the last accepted step of a run that was ended, on any ranks"
    a("--resume", action="store_true", help=text)
    add_output(a, "the design's folder")

    text = "one pitch of a long segment: strains, volume and rod stiffness over pressure, or at given strains"
    a = add("cell", text)
    a("cell", type=path, metavar="CELL.toml", help="the cell; pneunet init cell writes one")
    add_output(a, "the file's folder")

    text = "cells, segments or manipulators over a grid or a list"
    text += "; on MPI ranks: pneunet run -n 3 study STUDY.toml"
    a = add("study", text)
    a("study", type=path, metavar="STUDY.toml", help="the study; pneunet init study writes one")
    add_retry(a)
    add_output(a, f"out/NAME of the study{finished}")

    text = (
        "cells over a space-filling sample of designs, for the rod law: pneunet run -n 3 campaign FILE.toml"
    )
    a = add("campaign", text)
    a("campaign", type=path, metavar="CAMPAIGN.toml", help=A_CAMPAIGN)
    text = "a data set whose cases are taken over, not computed again"
    a("--extend", type=path, metavar="DATA.npz", help=text)
    add_retry(a)
    add_output(a, f"out/NAME of the campaign{finished}")

    a = add("suggest", "further designs for a campaign: those that would teach the rod law most")
    a("campaign", type=path, metavar="CAMPAIGN.toml", help=A_CAMPAIGN)
    a("--kind", choices=("one-sided", "twisting"), required=True, help="of the segments")
    a("-n", "--number", type=whole, default=100, metavar="100", help="how many; default: 100")
    text = "of how many designs that follow in the sample; default: 2000"
    a("--of", type=whole, default=2000, metavar="2000", help=text)
    text = "by the bending stiffness of cells whose walls touch, not by the free strains"
    a("--touching", action="store_true", help=text)
    text = "of pneunet train; default: the one that comes along"
    a("--law", default="trained", metavar="LAW.npz", help=text)

    a = add("train", "the rod law from a data set of cells, with its errors on held-out designs")
    a("data", type=path, metavar="DATA.npz", help="cells.npz of pneunet campaign")
    text = "keep the metrics and noises of this law: for data that have grown"
    a("--like", type=path, metavar="LAW.npz", help=text)
    a("--no-comparison", action="store_true", help="leave out the other laws and the learning curve")
    add_output(a, "law.npz beside the data; tables get the same name with .md", "LAW.npz")

    a = add("report", "one HTML page: target, reduced prediction and finite elements side by side")
    a("directory", type=run_folder, help=A_DESIGN)
    add_law(a, None)

    a = add("view", "a page to turn the body in any browser, with a slider over load steps; a window, a film")
    a("run", type=run_folder, metavar="RUN", help=A_DESIGN)
    a("--film", choices=("gif", "mp4"), help="of the inflation, as well")
    a("--window", action="store_true", help="open a window as well, where there is a display")
    add_law(a, None)
    add_output(a, "the design's folder")

    a = add(
        "compare", "a measurement over pressure beside its prediction, and the modulus that it speaks for"
    )
    a("run", type=run_folder, metavar="RUN", help=A_DESIGN)
    text = "markers, tip, centreline, angle or displacement over pressure (docs/use-compare.md)"
    a("measured", type=path, metavar="MEASURED.csv", help=text)
    text = "where markers sit on the body at rest: marker, x_mm, y_mm, z_mm"
    a("--markers", type=path, metavar="MARKERS.csv", help=text)
    a("--fit-wall", action="store_true", help="fit the thickness of the walls beside the modulus")
    text = "the coordinates are the target's already: register nothing"
    a("--as-is", action="store_true", help=text)
    add_law(a, None)
    add_output(a, "compare/ in the design's folder")

    a = add("fit-material", "fit a material law to a tensile test (CSV) -> material.toml, fit.png")
    a("test", type=path, metavar="TENSILE.csv", help="strain and stress, with their units")
    text = "neo-Hookean, Mooney-Rivlin, Yeoh, Gent, Ogden, or all (default): the best of them"
    a("--law", default="all", help=text)
    a("--stress-unit", help="where the file names none: MPa, kPa, Pa, psi, ...")
    text = "fit no further than this (default 150, what pneu-nets see)"
    a("--to-strain-percent", type=strain_percent, default=math.inf, metavar="200", help=text)
    text = "length that elongations in mm are of: strain is elongation over it"
    a("--gauge-length-mm", type=gauge_length, metavar="33", help=text)
    add_output(a, "out/fit-NAME of the test")

    a = add("run", "start a pneunet command (or, after --, any program) on N MPI ranks")
    a("-n", "--ranks", type=int, required=True, help="how many; commands with cases compute on all but one")
    a("rest", nargs=argparse.REMAINDER, metavar="COMMAND ...", help="as it is written without run -n N")

    add("doctor", "check this installation and say what to fix")

    a = add("completion", "what makes a shell complete pneunet's commands, options and files")
    a("shell", choices=SHELLS, help="which it is for")
    return top
