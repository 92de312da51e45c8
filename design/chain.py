"""The way on from a design to finite elements: commands in processes of their own, and what they leave, read
back.

This is the one module of design that knows of hifi, and only inside functions.
"""

import logging
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.atomic import write_text
from pneunet.base.files.folder import output_folder
from pneunet.base.files.results import Results, read_run
from pneunet.base.files.toml import toml_text
from pneunet.base.units import in_MPa
from pneunet.geometry.parameters import Segment
from pneunet.reduced.choice import choose_law

DONE, BAD_INPUT = 0, 2
log = logging.getLogger(__name__)


def run_command(arguments: Sequence[str], ranks: int = 1) -> None:
    """Run a pneunet command to its end, on MPI ranks where there are several, its lines shown as they come.

    InputError or ConvergenceError with what the command said where it ends with exit code 2, RuntimeError
    where it ends otherwise. An interrupt is passed on, and the command ends as it does from a terminal.
    """
    if not isinstance(ranks, int) or ranks < 1:
        raise InputError(f"ranks = {ranks!r} must be a whole number, at least 1")
    program = [sys.executable, "-P", "-m", "pneunet", *arguments]
    if ranks > 1:
        program[4:4] = ["run", "-n", str(ranks)]
    with (
        tempfile.TemporaryFile("w+") as told,
        # a group of its own: a terminal's interrupt is handed on, not told twice
        subprocess.Popen(program, stdout=subprocess.PIPE, stderr=told, text=True, process_group=0) as process,
    ):
        assert process.stdout is not None
        try:
            for line in process.stdout:
                print(line, end="", flush=True)
        except KeyboardInterrupt:
            process.send_signal(signal.SIGINT)
            process.wait()
            raise
        code = process.wait()
        told.seek(0)
        why = told.read().strip()
    if code == BAD_INPUT:
        text = why.rpartition("pneunet: ")[2] or why
        raise ConvergenceError(text) if "stopped at" in text else InputError(text)
    if code != DONE:
        raise RuntimeError(f"pneunet {' '.join(arguments)} ended with exit code {code}: {why[-2000:]}")


def solve_cell(
    segment: Segment,
    directory: str | Path,
    *,
    pressure_kPa: float,
    mesh_size_mm: float = 1.5,
    levels: int = 10,
    contact: str = "auto",
) -> Results:
    """Finite elements of one pitch of a long segment from rest to a pressure, in a process of their own.

    levels: pressures at which the state is recorded. contact: 'auto', 'none' or 'third-medium'. The folder
    gets what `pneunet cell` writes; the table `cell` of the answer has strains, forces and stiffness over
    pressure. InputError on bad input, ConvergenceError where no level can be reached.
    """
    from pneunet.hifi.cell.file import CellCase, cell_tables

    case = CellCase(segment, in_MPa(pressure_kPa), mesh_size_mm, levels, contact=contact)
    with output_folder(directory) as folder:
        write_text(folder / "cell.toml", toml_text(cell_tables(case)))
    run_command(["cell", str(folder / "cell.toml")])
    return read_run(folder)


def run_study(path: str | Path, directory: str | Path, *, ranks: int = 1) -> Results:
    """Bodies over a grid or a list (docs/studies.md), as `pneunet study`; the table `study` of the answer has
    a row a case and pressure level. InputError on bad input."""
    run_command(["study", str(path), "-o", str(directory)], ranks)
    return read_run(directory)


def suggest(
    campaign_path: str | Path,
    kind: str,
    number: int = 100,
    of: int = 2000,
    touching: bool = False,
    law: str = "trained",
) -> list[int]:
    """Indices of further designs for a campaign: those of the next `of` of its sample that would teach a
    trained law most (docs/rod-law.md). touching: by the bending stiffness of cells whose walls touch.

    InputError where the campaign or the law does not know the kind.
    """
    from pneunet.geometry.shape_numbers import numbers_of
    from pneunet.hifi.runs.campaign.file import on_offer, read_campaign
    from pneunet.reduced.training.suggestion import most_telling

    campaign, known = read_campaign(campaign_path), getattr(choose_law(law), "kinds", {})
    if kind not in known or kind not in campaign.kinds:
        who = campaign_path if kind in known else f"--law {law}"
        raise InputError(f"--kind {kind}: {who} does not know it")
    offered = on_offer(campaign, kind, of)
    log.info(f"# {number} of {len(offered)} designs are chosen one after the other")
    numbers, _ = numbers_of([segment for _, segment in offered])
    top, share = (campaign.table[key] for key in ("top_pressure", "limit_share"))
    rows = most_telling(known[kind], numbers, number, top, share, touching)
    return sorted(offered[row][0] for row in rows)
