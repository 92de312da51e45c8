"""The command line: each link of the chain is a sub-command, and an importable function behind it.

Exit codes: 0 done; 2 bad input, a load that could not be reached or too little memory (one line on standard
error, under MPI from one rank); anything else is a bug and shows its traceback.
"""

import argparse
import math
import os
import sys
import time
from pathlib import Path

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.system.libraries import told_what_to_install
from pneunet.base.system.log import is_rank_0, show_on_screen
from pneunet.launch import rank_map


class Parser(argparse.ArgumentParser):
    def __init__(self, **options):
        # --pressure is not taken for --pressure-kPa: the unit is part of the name
        super().__init__(**options, allow_abbrev=False)

    def error(self, message):
        raise InputError(f"{message} ({self.prog} --help tells more)")


def pressures(text):
    """MPa values of a comma-separated list of kPa."""
    values = []
    for word in text.split(","):
        try:
            value = float(word)
        except ValueError:
            raise argparse.ArgumentTypeError(
                f"'{word}' is not a number; write for instance 10,20,30"
            ) from None
        if not 0 < value <= 2000:
            raise argparse.ArgumentTypeError(f"{value:g} must lie in 0..2000 kPa")
        values.append(value * 1e-3)
    return values


def one_pressure(text):
    if text.strip() == "0":  # for loads alone
        return 0.0
    values = pressures(text)
    if len(values) != 1:
        raise argparse.ArgumentTypeError("one number is wanted here")
    return values[0]


def mesh_size(text):
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.1 <= value <= 20:
        raise argparse.ArgumentTypeError(f"'{text}' must be a number in 0.1..20")
    return value


def whole(text):
    if not text.isdecimal() or not 0 < int(text) <= 20_000:
        raise argparse.ArgumentTypeError(f"'{text}' must be a whole number in 1..20000")
    return int(text)


def strain_percent(text):
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not value > 0:
        raise argparse.ArgumentTypeError(f"'{text}' must be a number larger than 0")
    return value


class Version(argparse.Action):
    """`--version`: name, version and revision, asked for when they are wanted."""

    def __call__(self, parser, *_):
        from importlib.metadata import version

        from pneunet.base.files.record import revision

        number, built = version("pneunet"), revision()
        print(f"pneunet {number}" + (f" ({built})" if built != number else ""))
        parser.exit()


def parser():
    top = Parser(
        prog="pneunet",
        description="From a 3D target curve to a pneu-net soft manipulator, proven in finite elements.",
    )
    top.add_argument("--version", action=Version, nargs=0, help="name, version and revision")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)

    def add(name, function, text):
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(function=function)
        return command

    def add_law(command, default):
        text = (
            "trained (the rod law that comes along), analytic, or the .npz of pneunet train; default:"
            f" {default or 'as designed'}"
        )
        command.add_argument("--law", default=default, metavar="LAW", help=text)

    def add_outside(command):
        command.add_argument(
            "--outside",
            choices=("warn", "refuse"),
            default="warn",
            help="where the law doubts the design; default: warn",
        )

    c = add(
        "design",
        run_design,
        "inverse design: target curve (CSV or TOML) -> design.toml, centreline.csv, design.png",
    )
    c.add_argument("target", type=Path)
    add_law(c, "trained")
    add_outside(c)
    c.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: out/NAME of the target")

    c = add("shape", run_shape, "reduced model only: centrelines, 3D body, picture and animation")
    c.add_argument("design", type=Path)
    c.add_argument(
        "--pressure-kPa",
        type=pressures,
        dest="pressures",
        metavar="10,20,...",
        help="default: five steps to the design's",
    )
    add_law(c, "trained")
    add_outside(c)
    c.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: the design's folder")

    c = add("mesh", run_mesh, "CAD (STEP) and tagged tetrahedral mesh, with volumes and checks")
    c.add_argument("design", type=Path)
    c.add_argument("--mesh-size-mm", type=mesh_size, help="tetrahedron edge; default: the design's")
    c.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: the design's folder")

    c = add(
        "solve",
        run_solve,
        "finite elements of the whole manipulator; under MPI: pneunet run -n 2 solve DESIGN.toml",
    )
    c.add_argument("design", type=Path)
    c.add_argument(
        "--pressure-kPa",
        type=one_pressure,
        dest="pressure",
        help="default: the design's; 0: its [loads] alone",
    )
    c.add_argument("--mesh-size-mm", type=mesh_size, help="tetrahedron edge; default: the design's")
    c.add_argument("--no-fields", action="store_true", help="write no ParaView files")
    c.add_argument(
        "--resume",
        action="store_true",
        help="go on from the last accepted step of a run that was ended, on any ranks",
    )
    c.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: the design's folder")

    c = add(
        "cell",
        run_cell,
        "one pitch of a long segment: strains, volume and rod stiffness over pressure, or at given strains",
    )
    c.add_argument("cell", type=Path, metavar="CELL.toml")
    c.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: the file's folder")

    c = add(
        "study",
        run_study,
        "cells, segments or manipulators over a grid or a list; on MPI ranks: pneunet run -n 3 study"
        " STUDY.toml",
    )
    c.add_argument("study", type=Path, metavar="STUDY.toml")
    c.add_argument(
        "--retry", action="store_true", help="compute again what crashed, ran out of time or memory"
    )
    c.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="default: out/NAME of the study; finished cases there are kept",
    )

    c = add(
        "campaign",
        run_campaign,
        "cells over a space-filling sample of designs, for the rod law: pneunet run -n 3 campaign FILE.toml",
    )
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml")
    c.add_argument(
        "--extend",
        type=Path,
        metavar="DATA.npz",
        help="a data set whose cases are taken over, not computed again",
    )
    c.add_argument(
        "--retry", action="store_true", help="compute again what crashed, ran out of time or memory"
    )
    c.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="default: out/NAME of the campaign; finished cases there are kept",
    )

    c = add("suggest", run_suggest, "further designs for a campaign: those that would teach the rod law most")
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml")
    c.add_argument("--kind", choices=("one-sided", "twisting"), required=True)
    c.add_argument("-n", "--number", type=whole, default=100, metavar="100", help="how many; default: 100")
    c.add_argument(
        "--of",
        type=whole,
        default=2000,
        metavar="2000",
        help="of how many designs that follow in the sample; default: 2000",
    )
    c.add_argument(
        "--touching",
        action="store_true",
        help="by the bending stiffness of cells whose walls touch, not by the free strains",
    )
    c.add_argument(
        "--law",
        default="trained",
        metavar="LAW.npz",
        help="of pneunet train; default: the one that comes along",
    )

    c = add("train", run_train, "the rod law from a data set of cells, with its errors on held-out designs")
    c.add_argument("data", type=Path, metavar="DATA.npz")
    c.add_argument(
        "--like",
        type=Path,
        metavar="LAW.npz",
        help="keep the metrics and noises of this law: for data that have grown",
    )
    c.add_argument(
        "--no-comparison", action="store_true", help="leave out the other laws and the learning curve"
    )
    c.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="LAW.npz",
        help="default: law.npz beside the data; tables get the same name with .md",
    )

    c = add(
        "report", run_report, "one HTML page: target, reduced prediction and finite elements side by side"
    )
    c.add_argument("directory", type=Path)
    add_law(c, None)

    c = add(
        "fit-material",
        run_fit_material,
        "fit a material law to a tensile test (CSV) -> material.toml, fit.png",
    )
    c.add_argument("test", type=Path, metavar="TENSILE.csv")
    c.add_argument(
        "--law",
        default="all",
        help="neo-Hookean, Mooney-Rivlin, Yeoh, Gent, Ogden, or all (default): the best of them",
    )
    c.add_argument("--stress-unit", help="where the file names none: MPa, kPa, Pa, psi")
    c.add_argument(
        "--to-strain-percent",
        type=strain_percent,
        default=math.inf,
        metavar="200",
        help="fit no further than this",
    )
    c.add_argument("-o", "--output", type=Path, metavar="DIR", help="default: out/fit-NAME of the test")

    c = add("run", run_ranks, "start a pneunet command (or, after --, any program) on N MPI ranks")
    c.add_argument("-n", "--ranks", type=int, required=True)
    c.add_argument("rest", nargs=argparse.REMAINDER, metavar="COMMAND ...")

    add("doctor", run_doctor, "check this installation and say what to fix")
    return top


def say(text):
    print(text, flush=True)


def design_folder(arguments):
    return arguments.output or arguments.design.parent


def run_design(a):
    from pneunet.design.run import run_design as work
    from pneunet.reduced.choice import choose_law

    work(a.target, a.output or Path("out") / a.target.stem, choose_law(a.law), say=say, outside=a.outside)


def run_shape(a):
    from pneunet.design.shape import run_shape as work
    from pneunet.geometry.designfile import read_design
    from pneunet.reduced.choice import choose_law

    top = read_design(a.design).pressure
    work(
        a.design,
        a.pressures or [top * i / 5 for i in range(1, 6)],
        design_folder(a),
        say,
        choose_law(a.law),
        a.outside,
    )


def run_mesh(a):
    from pneunet.base.files.atomic import output_directory
    from pneunet.geometry.cad.mesh import mesh_manipulator
    from pneunet.geometry.designfile import read_design

    design = read_design(a.design)
    folder = output_directory(design_folder(a)) / "mesh"
    mesh_manipulator(design.manipulator, a.mesh_size_mm or design.mesh_size, folder)
    say(f"written: {folder / 'manipulator.msh'}, manipulator.step, mesh.json")


def run_solve(a):
    from pneunet.geometry.designfile import read_design

    design = read_design(a.design)
    from pneunet.hifi.runs.solve.solve import solve_design

    solve_design(design, design_folder(a), a.mesh_size_mm, a.pressure, not a.no_fields, resume=a.resume)


def run_cell(a):
    from pneunet.hifi.runs.cell import run_cell as work

    work(a.cell, a.output or a.cell.parent)


def run_study(a):
    from pneunet.hifi.runs.study.study import run_study as work

    work(a.study, a.output or Path("out") / a.study.stem, retry=a.retry)


def run_campaign(a):
    from pneunet.hifi.runs.campaign.campaign import run_campaign as work

    work(a.campaign, a.output or Path("out") / a.campaign.stem, retry=a.retry, extend=a.extend)


def run_suggest(a):
    import numpy as np

    from pneunet.geometry.shape_numbers import shape_numbers
    from pneunet.hifi.runs.campaign.file import on_offer, read_campaign
    from pneunet.reduced.choice import choose_law
    from pneunet.reduced.training.suggestion import most_telling

    campaign, law = read_campaign(a.campaign), choose_law(a.law)
    known = getattr(law, "kinds", {})
    if a.kind not in known or a.kind not in campaign.kinds:
        raise InputError(
            f"--kind {a.kind}: {a.campaign if a.kind in known else f'--law {a.law}'} does not know it"
        )
    offered = on_offer(campaign, a.kind, a.of)
    shape = np.array([shape_numbers(segment) for _, segment in offered])
    top, share = (campaign.table[key] for key in ("top_pressure", "limit_share"))
    rows = most_telling(known[a.kind], shape, a.number, top, share, a.touching)
    say(f"[further]\n{a.kind} = {sorted(offered[row][0] for row in rows)}")


def run_train(a):
    from pneunet.reduced.training.train import run_training

    with rank_map() as mapping:
        if mapping:  # other ranks have worked for this one
            out = a.output or a.data.with_name("law.npz")
            run_training(a.data, out, not a.no_comparison, mapping, a.like)


def run_report(a):
    from pneunet.design.report.report import write_report
    from pneunet.reduced.choice import choose_law

    write_report(a.directory, say, choose_law(a.law) if a.law else None)


def run_fit_material(a):
    from pneunet.base.materials.fit_run import run_fit

    run_fit(a.test, a.law, a.output, a.stress_unit, a.to_strain_percent / 100)


def run_ranks(a):
    from pneunet import launch

    if a.ranks < 1:
        raise InputError(f"-n {a.ranks}: at least 1 rank is needed")
    if not a.rest:
        raise InputError("run: no command given; write for instance: pneunet run -n 2 solve DESIGN.toml")
    return launch.run(a.ranks, a.rest)


def run_doctor(a):
    from pneunet import doctor

    return doctor.main()


def main(arguments=None):
    """Entry point; returns the exit code."""
    show_on_screen()
    try:
        a = parser().parse_args(arguments)
        with told_what_to_install():
            return a.function(a) or 0
    except (InputError, ConvergenceError, MemoryError) as error:
        # every rank fails alike; one of them says so, and the others leave later: mpirun ends a job, and with
        # it what rank 0 still has to say, at the first failure
        if is_rank_0():
            print(f"pneunet: {error}", file=sys.stderr, flush=True)
        else:
            time.sleep(1.0)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # `pneunet ... | head`: nobody reads on
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
