"""What the command line does with bad inputs (benchmarks.bad_inputs): one line, exit code 2, no file, soon
and in little memory.

Commands run in process, in workers that are used again: a worker that hangs or dies is one unclean input.
"""

import importlib
import io
import multiprocessing
import os
import resource
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmarks.bad_inputs import BadInput, Content, bad_inputs, good_files

NUMBER, SEED, WORKERS = 1500, 1, 2
SECONDS, MEMORY_MB = 10.0, 1000.0
#: what a command's first run waits for
LIBRARIES = ("front", "geometry.cad.mesh", "hifi.runs.cell", "hifi.runs.study.study")
LIBRARIES += ("hifi.runs.campaign.campaign",)
#: after which a worker counts as hanging; and MB beyond which the system stops it
PATIENCE, LIMIT_MB = 30.0, 3000


@dataclass(frozen=True)
class Answer:
    """What became of one bad input. code: None where it hung or died; peak_MB: of the worker."""

    code: int | None
    error: str
    files_left: tuple[str, ...]
    seconds: float
    peak_MB: float

    @property
    def fault(self) -> str:
        """Why it is not clean; "" where it is."""
        told = self.error.splitlines()
        if self.code != 2:
            return f"exit code {self.code}: {told[-1] if told else ''}"
        if len(told) != 1 or not told[0].startswith("pneunet: ") or not told[0].isprintable():
            return f"{len(told)} lines: {self.error[:300]!r}"
        if self.files_left:
            return f"left {', '.join(self.files_left)}"
        if self.seconds > SECONDS or self.peak_MB > MEMORY_MB:
            return f"{self.seconds:.1f} s, {self.peak_MB:.0f} MB"
        return ""


def put(path: Path, content: Content) -> None:
    """Make what the content says."""
    path.unlink(missing_ok=True)
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content[0] == "pipe":
        os.mkfifo(path)
    elif content[0] == "folder":
        path.mkdir()
    elif content[0] == "link":
        path.symlink_to(path.name if content[1] == "LINK" else content[1])
    elif content[0] == "size":
        with open(path, "wb") as stream:
            stream.truncate(content[1])


def _listing(folder: Path) -> dict[str, tuple]:
    return {
        p.relative_to(folder).as_posix(): (p.lstat().st_mode, p.lstat().st_size, p.lstat().st_mtime_ns)
        for p in folder.rglob("*")
    }


def _peak_MB() -> float:
    """Largest resident memory of this process since `_forget_peak`."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def answer(bad: BadInput) -> Answer:
    """What `pneunet` says to a bad input, run in this process in a folder of its own."""
    from pneunet.cli import main

    with tempfile.TemporaryDirectory(prefix="door-") as name:
        folder = Path(name)
        (folder / "folder").mkdir()
        files = good_files() | ({"data.npz": b""} if bad.arguments[0] == "train" else {}) | bad.files
        for path, content in files.items():
            put(folder / path, content)
        os.chdir(folder)
        before, started = _listing(folder), time.perf_counter()
        _forget_peak()
        with _captured() as told:
            try:
                code: Any = main(list(bad.arguments))
            except SystemExit as error:
                code = f"SystemExit {error.code}"
            except BaseException as error:
                code = f"{type(error).__name__}: {error}"[:300]
        seconds, after = time.perf_counter() - started, _listing(folder)
        left = tuple(sorted(p for p in before.keys() | after.keys() if before.get(p) != after.get(p)))
        os.chdir("/")
        return Answer(code, told.text, left, seconds, _peak_MB())


class _captured:
    """Standard error of the block, of libraries in C too; what goes to standard output is thrown away."""

    def __enter__(self) -> "_captured":
        self.text, self._kept = "", [os.dup(1), os.dup(2)]
        self._stream = tempfile.TemporaryFile()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)
        os.dup2(self._stream.fileno(), 2)
        self._python = io.StringIO()
        self._redirections = [redirect_stderr(self._python), redirect_stdout(io.StringIO())]
        for each in self._redirections:
            each.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        for each in self._redirections:
            each.__exit__(None, None, None)
        for number, kept in enumerate(self._kept, start=1):
            os.dup2(kept, number)
            os.close(kept)
        self._stream.seek(0)
        self.text = self._python.getvalue() + self._stream.read().decode(errors="replace")
        self._stream.close()


def _work(pipe: Connection) -> None:
    """Answers to what comes through the pipe, within limits."""
    resource.setrlimit(resource.RLIMIT_DATA, (LIMIT_MB << 20,) * 2)
    for name in LIBRARIES:
        importlib.import_module(f"pneunet.{name}")
    while (bad := pipe.recv()) is not None:
        pipe.send(answer(bad))


class _Worker:
    def __init__(self) -> None:
        self.start()

    def start(self) -> None:
        spawn = multiprocessing.get_context("spawn")
        self.pipe, theirs = spawn.Pipe()
        self.process = spawn.Process(target=_work, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()

    def take(self, bad: BadInput) -> None:
        self.bad, self.since = bad, time.monotonic()
        self.pipe.send(bad)

    def result(self) -> Answer | None:
        """The answer once it is there; of one that hung or died, too, and a new process in its place."""
        late = time.monotonic() - self.since > PATIENCE
        if self.pipe.poll(0):
            try:
                return self.pipe.recv()
            except EOFError:
                late = True
        if not late:
            return None
        self.process.kill()
        self.process.join()
        ended = self.process.exitcode
        self.start()
        how = "hung" if ended == -signal.SIGKILL else f"died by {ended}"
        return Answer(None, how, (), time.monotonic() - self.since, 0.0)


def answers(inputs: Iterable[BadInput], workers: int = WORKERS) -> list[tuple[BadInput, Answer]]:
    """[(input, its Answer)] in the order in which they came."""
    found, todo = [], iter(inputs)
    crew = [_Worker() for _ in range(workers)]
    busy: list[_Worker] = []
    for worker in crew:
        bad = next(todo, None)
        if bad is not None:
            worker.take(bad)
            busy.append(worker)
    while busy:
        for worker in list(busy):
            got = worker.result()
            if got is None:
                continue
            found.append((worker.bad, got))
            bad = next(todo, None)
            if bad is None:
                busy.remove(worker)
            else:
                worker.take(bad)
        time.sleep(0.002)
    for worker in crew:
        worker.pipe.send(None)
        worker.process.join()
    return found


def door() -> tuple[dict[str, float], dict[str, Any]]:
    """The part `door`."""
    found = answers(bad_inputs(NUMBER, SEED))
    faults = [(bad, got.fault) for bad, got in found if got.fault]
    for bad, fault in faults:
        print(f"  {' '.join(bad.arguments)[:80]} ({bad.what}): {fault}", flush=True)
    figures = {
        "bad_inputs_tried": len(found),
        "bad_inputs_clean": len(found) - len(faults),
        "door_seconds_max": max(got.seconds for _, got in found),
    }
    return figures, {"seed": SEED, "doors": dict(Counter(bad.door for bad, _ in found))}
