"""`pneunet train`: the rod law from the data set of cells, and how well it does on designs that it has not
seen.

Nothing of the held-out designs is used before the last table. Where they are few, laws trained on parts of
the training designs are judged on the other ones too (reduced.training.states.splits).
"""

import hashlib
import logging
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_text
from pneunet.base.files.dataset import CellData, read_dataset
from pneunet.base.files.folder import output_folder
from pneunet.base.progress import Pace
from pneunet.reduced.trained.file import read_law, write_law
from pneunet.reduced.trained.kind_law import KindLaw
from pneunet.reduced.trained.law import TrainedLaw
from pneunet.reduced.training.comparing import compare_laws, curve_table, law_table, learning_curve
from pneunet.reduced.training.fit import FOLDS, fit_kind
from pneunet.reduced.training.judging import Figures, Misses, figures, misses
from pneunet.reduced.training.states import Sample, sample_of, splits

log = logging.getLogger(__name__)

#: as the built-in one
Map = Callable[[Callable, Iterable], Iterable]
#: kind -> (training Sample, held-out Sample)
Samples = dict[str, tuple[Sample, Sample]]


def samples_of(data: CellData) -> Samples:
    """{kind: (training Sample, held-out Sample)} of the kinds of which there are enough; InputError where
    there is none."""
    out, text = {}, "it holds none"
    for kind in data.about["kinds"]:
        training, held_out = (sample_of(data, kind, held) for held in (False, True))
        designs, held = len(training.designs), len(held_out.designs)
        text = f"{kind}: {designs} designs to train on, {held} held out"
        if designs < 2 * FOLDS or not held or not len(training.forces):
            log.info(f"{text}: too few, or no prescribed states: the law will not know this kind")
            continue
        log.info(text)
        out[kind] = training, held_out
    if not out:
        raise InputError(f"too few accepted designs of any kind to train on ({text})")
    return out


def digest(path: str | Path) -> str:
    """What a law knows its data set again by."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def run_training(
    path: Path, out: Path, compare: bool = True, mapping: Map = map, like: Path | None = None
) -> TrainedLaw:
    """Train on the data set at `path`; `out` (.npz) gets the law, the same name with .md its tables.

    mapping: a `map`, over processes for instance; what it computes side by side does not depend on how many
    there are. like: file of a law whose metrics and noises are taken as they are.
    """
    with output_folder(Path(out).parent):
        return _train(path, out, compare, mapping, like)


def _train(path, out, compare, mapping, like):
    """The law of `run_training`."""
    data, started = read_dataset(path), time.perf_counter()
    known, about = (read_law(like).kinds, {"like_sha256": digest(like)}) if like else ({}, {})
    try:
        samples = samples_of(data)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    jobs: list[tuple[Callable, tuple]] = [
        (fit_kind, (training, known.get(kind), False)) for kind, (training, _) in samples.items()
    ]
    if compare:
        jobs += [(job, pair) for pair in samples.values() for job in (compare_laws, learning_curve)]
    done = list(_shown(mapping(_do, jobs), len(jobs), "trained"))
    laws, tables = dict(zip(samples, done)), iter(done[len(samples) :])
    judged = judge(laws, samples, mapping)
    lines, compared = [f"# The trained law of {Path(path).name}"], {}
    for kind, pair in samples.items():
        lines += ["", f"## {kind}", "", judged_on(*pair), "", "| figure | value |", "|---|---|"]
        lines += [f"| {name} | {value:.4f} |" for name, value in judged[kind].items()]
        if compare:
            compared[kind] = {"laws": next(tables), "learning curve": next(tables)}
            lines += [*law_table(compared[kind]["laws"]), *curve_table(compared[kind]["learning curve"])]
    about |= {"data": Path(path).name, "data_sha256": digest(path), "revisions": data.about["revisions"]}
    found = {"figures": judged, "held_out": held_out_figures(laws, samples), "compared": compared}
    law = TrainedLaw(laws, about | found, str(out))
    write_law(out, law)
    write_text(Path(out).with_suffix(".md"), "\n".join(lines) + "\n")
    for line in lines:
        log.info(line)
    log.info(f"law in {out}, tables in {Path(out).with_suffix('.md')}; {time.perf_counter() - started:.0f} s")
    return law


def _do(job):
    function, arguments = job
    return function(*arguments)


def held_out_figures(laws: dict[str, KindLaw], samples: Samples) -> dict[str, Figures]:
    """{kind: {figure: number}} of KindLaws on the held-out designs alone."""
    return {kind: figures([misses(law, samples[kind][1])]) for kind, law in laws.items()}


def _shown(results: Iterable, count: int, what: str) -> Iterator:
    """The results as they come, each told."""
    pace = Pace()
    for number, result in enumerate(results, start=1):
        log.info(f"{number}/{count} {what}{pace.left(number / count)}")
        yield result


def judge(laws: dict[str, KindLaw], samples: Samples, mapping: Map = map) -> dict[str, Figures]:
    """{kind: {figure: number}} of KindLaws on the designs that neither they nor, where those are few, laws of
    parts have seen."""
    jobs = []
    for kind, law in laws.items():
        (_, held_out), *parts = splits(*samples[kind])
        jobs += [(misses, (law, held_out)), *[(judge_again, (law, *part)) for part in parts]]
    done = iter(list(_shown(mapping(_do, jobs), len(jobs), "judged")))
    out = {}
    for kind, law in laws.items():
        found = figures([next(done) for _ in splits(*samples[kind])])
        out[kind] = found | {"law_mesh_uncertainty_rel": law.mesh.uncertainty}
    return out


def judge_again(law: KindLaw, learned: Sample, judged: Sample) -> Misses:
    """`misses` on a Sample of the law that another Sample gives, a part of what this one was learned from."""
    return misses(fit_kind(learned, law, again=False, part=True), judged)


def judged_on(training: Sample, held_out: Sample) -> str:
    """A sentence on which designs the figures are about."""
    designs, held = len(training.designs), len(held_out.designs)
    text = f"{designs} designs to train on, {held} held out."
    parts = splits(training, held_out)[1:]
    if parts:
        judged = held + sum(len(part.designs) for _, part in parts)
        text += f" The figures are of {judged} that were drawn alike: of the held-out ones by the law,"
        text += f" of the others by cross-validation by design in {len(parts)} parts."
    return text
