"""`pneunet study`: cells, segments or manipulators over a list or grid of anything in them; one table and one
picture."""

import logging
import time
from collections import Counter
from pathlib import Path
from typing import Any

from mpi4py import MPI

from pneunet.base.files.atomic import read_csv, room_in, write_csv
from pneunet.base.files.record import write_record
from pneunet.base.files.schemas import CASE, ENDING, MARKS
from pneunet.hifi.contact.touch import marked
from pneunet.hifi.fem.agreement import folder_of_all, on_rank_0
from pneunet.hifi.runs.case_process import REFUSED
from pneunet.hifi.runs.cases import Case, run_cases
from pneunet.hifi.runs.study.file import Study, StudyCase, read_study, value_of

log = logging.getLogger(__name__)

#: a case's rows, written by hifi.runs.study.cases
LEVELS = "levels.csv"


def run_study(
    path: str | Path, directory: str | Path, comm: MPI.Comm = MPI.COMM_WORLD, retry: bool = False
) -> tuple[Study, "StudyTable"]:
    """Compute the cases of STUDY.toml that are not finished in `directory`; collective. Returns the Study and
    the StudyTable.

    directory gets study.csv (a row a case and pressure level, rewritten after every case), study.png,
    run.json and cases/NAME. retry: see hifi.runs.cases.run_cases. InputError on bad input before anything is
    computed.
    """
    directory, started = Path(directory), time.perf_counter()
    study = on_rank_0(comm, lambda: read_study(path))
    with folder_of_all(comm, directory):
        for text in _announcement(study, comm.size):
            log.info(text)
        table = StudyTable(study, directory)
        cases = [c.case for c in study.cases if c.case]
        records = run_cases(cases, directory / "cases", study.limits, comm, table.add, retry)
        seconds = time.perf_counter() - started
        on_rank_0(comm, lambda: _finish(study, table, records, directory, comm.size, seconds))
    return study, table


def _announcement(study, ranks):
    total, refused = len(study.cases), [c for c in study.cases if c.case is None]
    distinct = len({c.case.name for c in study.cases if c.case})
    same = f", {distinct} different ones" if distinct < total - len(refused) else ""
    at_once = "one after the other" if ranks == 1 else f"{ranks - 1} at once: rank 0 hands them out"
    yield f"study: {total} {study.kind} cases{same} over {', '.join(study.variables)}; {at_once}"
    if refused:
        yield f"{len(refused)} of them are no valid body, the first: {refused[0].refusal}"


def _finish(study, table, records, directory, ranks, seconds):
    from pneunet.hifi.runs.study.picture import draw

    table.write()
    counts = Counter(record["status"] for record in records)
    counts[REFUSED] += sum(case.case is None for case in study.cases)
    counts = {status: number for status, number in counts.items() if number}
    overlapping = table.overlapping()
    facts = {"variables": study.variables, "cases": counts, "overlapping_cases": overlapping}
    write_record(directory, kind=study.kind, **facts, ranks=ranks, wall_seconds=seconds)
    picture = draw(study, table, directory / "study.png")
    summary = ", ".join(f"{number} {status}" for status, number in counts.items())
    if overlapping:
        summary += (
            f"; {overlapping} OVERLAP, without a contact model, at their higher pressures (columns"
            f" {', '.join(MARKS)})"
        )
    drawn = f", picture {directory / 'study.png'}" if picture else ""
    log.info(f"{summary}; table in {directory / 'study.csv'}{drawn}")


class StudyTable:
    """study.csv: for each case that is known one row a pressure level, or one without levels. In order of the
    study."""

    def __init__(self, study: Study, directory: str | Path) -> None:
        self.study, self.directory = study, Path(directory)
        self._known = {}  # case name -> (record, [{column: text} of a level])

    def add(self, case: Case, record: dict[str, Any]) -> None:
        """Take a record with what levels.csv of the case says; rewrites study.csv. InputError when that
        cannot be written."""
        path = self.directory / "cases" / case.name / LEVELS
        header, rows = read_csv(path) if path.exists() else ([], [])
        self._known[case.name] = (record, [dict(zip(header, row)) for row in rows])
        self.write()

    def of(self, study_case: StudyCase) -> tuple[dict[str, Any], list[dict[str, str]]] | None:
        """(record, levels) of a StudyCase; a refused one has a record too. None while it is not known."""
        if study_case.case is None:
            return {"status": REFUSED, "reason": study_case.refusal, "seconds": "", "peak_memory_MB": ""}, []
        return self._known.get(study_case.case.name)

    def overlapping(self) -> int:
        """Number of the study's cases in which something overlaps at some level."""
        known = [self.of(case) for case in self.study.cases]
        return sum(any(marked(level) for level in levels) for _, levels in filter(None, known))

    def write(self) -> None:
        """Write study.csv of what is known; InputError when that cannot be written."""
        study = self.study
        columns = list(
            dict.fromkeys(name for _, levels in self._known.values() for level in levels for name in level)
        )
        rows = []
        for case in study.cases:
            known = self.of(case)
            if known is None:
                continue
            record, levels = known
            varied = [value_of(name, case) for name in study.variables]
            ending = [record["status"], record["reason"], record["seconds"], record["peak_memory_MB"]]
            name = case.case.name if case.case else ""
            rows += [
                [name, *varied, *(level.get(c, "") for c in columns), *ending] for level in levels or [{}]
            ]
        # a varied pressure is the case's top pressure; the level's has the plain name
        named = [f"top_{name}" if name in columns else name for name in study.variables]
        header = [*CASE, *named, *columns, *ENDING]
        with room_in(self.directory, " and start the study again"):
            write_csv(self.directory / "study.csv", header, rows)
