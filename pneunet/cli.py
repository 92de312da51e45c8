"""The command line: each command is one call of a function that Python has too.

Exit codes: 0 done; 3 done, but a design does not follow its target; 2 bad input, a load that could not be
reached or too little memory; 130 interrupted (each with one line on standard error, under MPI from one rank);
anything else is a bug and shows its traceback.
"""

import errno
import logging
import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from pneunet.arguments import parser
from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.system.interrupts import interruptible, leave
from pneunet.base.system.launch import rank_map
from pneunet.base.system.libraries import told_what_to_install
from pneunet.base.system.log import complain, show_on_screen
from pneunet.base.units import MPA_PER_KPA
from pneunet.start import write_start

#: exit code of a design that is written, but does not follow its target
NOT_FOLLOWED = 3
log = logging.getLogger(__name__)


def init(a: Namespace) -> None:
    write_start(a.kind, a.file)


def design(a: Namespace) -> int:
    from pneunet.design.inverse_design import run_design
    from pneunet.reduced.choice import choose_law

    folder = a.output or Path("out") / a.target.stem
    with rank_map() as mapping:
        if not mapping:  # the work for rank 0 is done
            return 0
        found = run_design(a.target, folder, choose_law(a.law), outside=a.outside, mapping=mapping)
    return 0 if found.followed else NOT_FOLLOWED


def shape(a: Namespace) -> None:
    from pneunet.design.shape import run_shape
    from pneunet.reduced.choice import choose_law

    run_shape(a.design, a.pressures, a.output or a.design.parent, choose_law(a.law), a.outside)


def mesh(a: Namespace) -> None:
    from pneunet.geometry.cad.mesh import mesh_design

    mesh_design(a.design, a.output or a.design.parent, a.mesh_size_mm)


def export(a: Namespace) -> None:
    from pneunet.front import read_design

    read_design(a.design).export(a.output or a.design.parent, a.moulds)


def _load_finite_elements(command):
    import petsc4py  # noqa: F401  # where it is missing, one line says what to install, and nothing else is said

    log.info(f"{command}; finite elements are being loaded")


def solve(a: Namespace) -> None:
    from pneunet.geometry.designfile import read_design_file

    content = read_design_file(a.design)  # before finite elements are loaded, which takes a while
    _load_finite_elements(f"solve: {content.name}")
    from pneunet.hifi.runs.solve.solve import solve_design

    pressure = None if a.pressure is None else a.pressure * MPA_PER_KPA
    folder = a.output or a.design.parent
    solve_design(content, folder, a.mesh_size_mm, pressure, not a.no_fields, resume=a.resume)


def cell(a: Namespace) -> None:
    _load_finite_elements(f"cell: {a.cell}")
    from pneunet.hifi.runs.cell import run_cell

    run_cell(a.cell, a.output or a.cell.parent)


def study(a: Namespace) -> None:
    _load_finite_elements(f"study: {a.study}")
    from pneunet.hifi.runs.study.study import run_study

    run_study(a.study, a.output or Path("out") / a.study.stem, retry=a.retry)


def campaign(a: Namespace) -> None:
    _load_finite_elements(f"campaign: {a.campaign}")
    from pneunet.hifi.runs.campaign.campaign import run_campaign

    run_campaign(a.campaign, a.output or Path("out") / a.campaign.stem, retry=a.retry, extend=a.extend)


def suggest(a: Namespace) -> None:
    from pneunet.design.chain import suggest as suggestion

    found = suggestion(a.campaign, a.kind, a.number, a.of, a.touching, a.law)
    print(f"[further]\n{a.kind} = {found}")


def train(a: Namespace) -> None:
    from pneunet.reduced.training.train import run_training

    with rank_map() as mapping:
        if mapping:  # other ranks have worked for this one
            out = a.output or a.data.with_name("law.npz")
            run_training(a.data, out, not a.no_comparison, mapping, a.like)


def workspace(a: Namespace) -> None:
    from pneunet.design.workspace import run_workspace
    from pneunet.reduced.choice import choose_law

    with rank_map() as mapping:
        if mapping:  # other ranks have worked for this one
            name = a.workspace.stem if a.workspace else "workspace"
            run_workspace(a.workspace, a.output or Path("out") / name, choose_law(a.law), mapping)


def report(a: Namespace) -> None:
    from pneunet.front import report as write

    write(a.directory, a.law)


def view(a: Namespace) -> None:
    from pneunet.design.report.viewing import run_view

    run_view(a.run, a.output, a.law, a.film and f".{a.film}", a.window)


def compare(a: Namespace) -> None:
    from pneunet.design.measured.comparison import run_compare

    run_compare(a.run, a.measured, a.output, a.markers, a.fit_wall, a.as_is, a.law)


def fit_material(a: Namespace) -> None:
    from pneunet.base.materials.fit_run import run_fit

    run_fit(a.test, a.law, a.output, a.stress_unit, a.to_strain_percent / 100, a.gauge_length_mm)


def run(a: Namespace) -> int:
    from pneunet.base.system import launch

    return launch.run(a.ranks, a.rest)


def doctor(a: Namespace) -> int:
    from pneunet import doctor as check

    return check.main()


def completion(a: Namespace) -> None:
    from pneunet.completion import script

    print(script(parser(COMMANDS), a.shell))


COMMANDS = {
    "init": init,
    "design": design,
    "shape": shape,
    "workspace": workspace,
    "mesh": mesh,
    "export": export,
    "solve": solve,
    "cell": cell,
    "study": study,
    "campaign": campaign,
    "suggest": suggest,
    "train": train,
    "report": report,
    "view": view,
    "compare": compare,
    "fit-material": fit_material,
    "run": run,
    "doctor": doctor,
    "completion": completion,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    show_on_screen()
    grammar = parser(COMMANDS)
    try:
        with interruptible() as told, told_what_to_install():
            a = grammar.parse_args(arguments)
            return a.function(a) or 0
    except (InputError, ConvergenceError, MemoryError) as error:
        complain(error)
        return 2
    except BrokenPipeError:  # `pneunet ... | head`: nobody reads on
        _close_output()
        return 141
    except OSError as error:  # of what is printed: files tell by themselves
        if error.errno not in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO):
            raise
        _close_output()
        complain(f"output cannot be written ({error.strerror}): make room where it goes")
        return 2
    except BaseException as error:
        if not told and not isinstance(error, KeyboardInterrupt):
            raise
        return leave(error)


def _close_output():
    """Python shall not try again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
