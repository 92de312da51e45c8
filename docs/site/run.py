"""`python -m docs.site.run [PAGE ...]`: runs the blocks of pages, in their order, in a sandbox a page.

A sandbox looks like the repository, with an `out` of its own: blocks find what earlier ones of their page
have left, and a page that begins with <!-- after: other.md --> what that page has left in `out`. A block with
a title is a file there. Blocks of Python share their names. A block that ends otherwise than it says, or does
not say what it is said to, fails the page with its file and line. `out/pages/commands.json` counts what was
run.
"""

import argparse
import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from docs.site.blocks import ROOT, Block, blocks, pages
from docs.site.check import faults
from pneunet.base.files.atomic import write_text

OUT = ROOT / "out" / "pages"
#: a page's links to what its own commands have made, below its sandbox
MADE = "made/"
#: what a sandbox has of its own
OWN = {"out", ".git"}
AFTER = re.compile(r"<!-- after: (\S+\.md) -->\n")
#: seconds after which a block is taken to hang, on a machine that others use, too
PATIENCE = 3600


class WrongBlock(Exception):
    """A block that did not do what its page says."""


def sandbox(folder: Path, before: Path | None = None) -> Path:
    """A fresh folder with links to all that the repository has at its top, and with the results of another
    sandbox that was before."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for entry in ROOT.iterdir():
        if entry.name not in OWN:
            (folder / entry.name).symlink_to(entry)
    if before:
        shutil.copytree(before / "out", folder / "out")
    return folder


def before(page: Path) -> Path | None:
    """The page whose results this one goes on from."""
    found = AFTER.match(page.read_text())
    return page.with_name(found[1]) if found else None


def run_page(text: str, folder: Path) -> dict[str, int]:
    """Runs the blocks of a page's text in the folder; counts of commands, Python blocks and files, and of
    the commands that are long and were not run. WrongBlock that names the line."""
    counts = {"commands": 0, "python": 0, "files": 0, "long": 0}
    names: dict[str, object] = {"__name__": "__main__"}
    every = blocks(text)
    for block, following in zip(every, [*every[1:], None]):
        if block.title:
            (folder / block.title).parent.mkdir(parents=True, exist_ok=True)
            (folder / block.title).write_text(block.text)
            counts["files"] += 1
            continue
        if block.language not in ("sh", "python"):
            continue
        size = len(block.commands) if block.language == "sh" else 1
        if block.long:
            counts["long"] += size
            continue
        said, code = _shell(block, folder) if block.language == "sh" else _python(block, folder, names)
        if code != block.code:
            raise WrongBlock(f"line {block.line}: exit code {code}, not {block.code}\n{block.text}\n{said}")
        if following and following.language == "text" and _between(text, block, following):
            _compare(following, said)
        counts["commands" if block.language == "sh" else "python"] += size
    return counts


def _between(text: str, block: Block, following: Block) -> bool:
    """Whether nothing but blank lines stands between two blocks."""
    end = block.line + block.text.count("\n") + 2
    return not "".join(text.splitlines()[end - 1 : following.line - 1]).strip()


def _compare(wanted: Block, said: str) -> None:
    said = " ".join(said.split())
    for line in filter(None, (" ".join(line.split()) for line in wanted.text.splitlines())):
        if not re.search(re.escape(line).replace(r"\.\.\.", ".*?"), said):
            raise WrongBlock(f"line {wanted.line}: '{line}' is not said, but\n{said}")


def _environment() -> dict[str, str]:
    """As after `. .venv/bin/activate`; one thread a process."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return {**os.environ, "PATH": path, "OMP_NUM_THREADS": "1", "PYTHONPATH": ""}


def _shell(block: Block, folder: Path) -> tuple[str, int]:
    line = ["timeout", str(PATIENCE), "bash", "-euo", "pipefail", "-c", block.text]
    done = subprocess.run(
        line,
        cwd=folder,
        env=_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    return done.stdout, done.returncode


def _python(block: Block, folder: Path, names: dict[str, object]) -> tuple[str, int]:
    said = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            exec(compile(block.text, f"line {block.line}", "exec"), names)
        except Exception:
            return said.getvalue() + traceback.format_exc(), 1
    return said.getvalue(), 0


def _one(page: Path) -> None:
    """Runs a page here; its counts and seconds to counts.json in its sandbox."""
    start = time.monotonic()
    text = page.read_text()
    wrong = faults(text)
    if wrong:
        raise WrongBlock("\n".join(wrong))
    earlier = before(page)
    folder = sandbox(OUT / page.stem, earlier and OUT / earlier.stem)
    counts = run_page(text, folder)
    write_text(folder / "counts.json", json.dumps(counts | {"seconds": time.monotonic() - start}))


def _apart(page: Path) -> bool:
    """Runs a page in a process of its own; whether it did what it says."""
    line = [sys.executable, "-m", "docs.site.run", "--here", str(page)]
    done = subprocess.run(line, cwd=ROOT, env=_environment(), capture_output=True, text=True)
    if done.returncode:
        print(f"WRONG {page.relative_to(ROOT)}: {done.stdout}{done.stderr}", flush=True)
    else:
        print(page.relative_to(ROOT), (OUT / page.stem / "counts.json").read_text(), flush=True)
    return done.returncode == 0


def run(wanted: list[Path], workers: int) -> int:
    """Runs pages side by side and counts; the exit code."""
    wanted = [page for page in wanted if re.search("^```", page.read_text(), re.M)]
    right: list[bool] = []
    for later in (False, True):
        turn = [page for page in wanted if bool(before(page)) == later]
        with ThreadPoolExecutor(workers) as pool:
            right += pool.map(_apart, turn)
    found = {p.stem: OUT / p.stem / "counts.json" for p in pages()}
    table = {name: json.loads(path.read_text()) for name, path in found.items() if path.is_file()}
    keys = ("commands", "python", "files", "long", "seconds")
    total = {key: sum(row[key] for row in table.values()) for key in keys}
    write_text(OUT / "commands.json", json.dumps({"total": total, "pages": table}, indent=1))
    print("all pages", json.dumps(total))
    return not all(right)


def main() -> int:
    parser = argparse.ArgumentParser(prog="docs.site.run", description="run the commands of pages")
    parser.add_argument("pages", nargs="*", type=Path, help="default: all")
    parser.add_argument("-j", "--workers", type=int, default=2, help="pages side by side; default: 2")
    parser.add_argument("--here", action="store_true", help="one page, in this process")
    a = parser.parse_args()
    wanted = [page.resolve() for page in a.pages] or pages()
    if not a.here:
        return run(wanted, a.workers)
    try:
        _one(wanted[0])
    except WrongBlock as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
