"""Whether the commands of a page could be run: their programs, sub-commands and options exist.

Nothing is computed. This is what holds for long blocks, and for commands that sentences name.
"""

import re
import shlex
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from docs.site.blocks import ROOT, Block, blocks, spoken
from pneunet.arguments import parser
from pneunet.base.errors import InputError
from pneunet.cli import COMMANDS

#: programs that long blocks may name beside this project's; they are not asked about their options
OTHERS = set(". apt-get cat cd cp export git jupyter paraview pip pre-commit sbatch".split())
#: what a block may be of: shown as it is written, and nothing that could pass for a command
SHOWN = {"csv", "ini", "json", "text", "toml"}
LAUNCHERS = {"mpirun", "srun"}
#: which start a program by `run` or `exec` and do else what is their own
CONTAINERS = {"apptainer", "docker", "podman"}


def faults(text: str) -> list[str]:
    """What is wrong with the commands of a page, a line each."""
    found = [f"`{command}`: {fault}" for command in spoken(text) if (fault := _spoken_fault(command))]
    try:
        every = blocks(text)
    except ValueError as error:
        return [*found, str(error)]
    for block in every:
        found += [f"line {block.line}: {fault}" for fault in _faults(block)]
    if text.count("```") % 2 or len(every) != len(re.findall("^```", text, re.M)) / 2:
        found.append("a fence is not closed, or not written as docs/site/blocks.py reads it")
    if re.search(r"^ {4}(?:pneunet|make|python|mpirun) ", text, re.M):
        found.append("an indented command: write a block ```sh, which is run")
    return found


def _faults(block: Block) -> list[str]:
    if block.language == "sh" and block.code == 0:  # one that must fail is run
        known_here = block.long or block.title  # it is not run
        every = [(shlex.join(c), command_fault(c, bool(known_here))) for c in block.commands]
        return [f"{command}: {fault}" for command, fault in every if fault]
    if block.language == "python":
        return []  # run, or parsed by tests/test_docs.py
    wrong = block.language not in SHOWN | {"sh"}
    return [f"a block of '{block.language}': say sh, python, {', '.join(sorted(SHOWN))}"] if wrong else []


def command_fault(words: list[str], alone: bool = True) -> str:
    """What is wrong with a command, or "". alone: it is not run, so that its program must be known here."""
    while words and re.fullmatch(r"\w+=.*", words[0]):
        words = words[1:]  # settings in front
    program = (Path(words[0]).name or words[0]) if words else ""
    if not words or program in OTHERS:
        return ""
    if program == "pneunet":
        return _pneunet_fault(words[1:])
    if program == "make":
        return _make_fault(words[1:])
    if program.startswith("python") and words[1:2] == ["-m"]:
        return _module_fault(words[2], words[3:])
    if program.startswith("python"):
        script = next((word for word in words[1:] if not word.startswith("-")), None)
        return "" if script and (ROOT / script).is_file() else f"there is no {script}"
    if program in CONTAINERS and words[1] not in ("run", "exec"):
        return ""
    if program in LAUNCHERS | CONTAINERS:
        n = next((n for n, word in enumerate(words) if n and Path(word).name in ("pneunet", "python")), 0)
        return command_fault(words[n:]) if n else f"nothing of pneunet's is started by {program}"
    return f"nobody here knows {program}" if alone else ""


def _pneunet_fault(arguments: list[str]) -> str:
    if {"--help", "-h", "--version"} & set(arguments):
        return ""
    try:
        a = parser(COMMANDS).parse_args(arguments)
    except InputError as error:
        return str(error)
    if a.command != "run":
        return ""
    return command_fault(a.rest[1:] if a.rest[:1] == ["--"] else ["pneunet", *a.rest])


def _make_fault(words: list[str]) -> str:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)
    wrong = [word for word in words if "=" not in word and word not in targets]
    return f"the Makefile has no {wrong[0]}" if wrong else ""


@cache
def _help(module: str) -> str:
    """What a module says of itself, by --help or else by its first lines."""
    if module == "pytest":
        return ""
    spec = find_spec(module)
    if spec and spec.submodule_search_locations:
        spec = find_spec(f"{module}.__main__")
    if not spec or not spec.origin:
        raise InputError(f"there is no program {module}")
    text = Path(spec.origin).read_text()
    if "argparse" not in text:
        return text
    done = subprocess.run([sys.executable, "-m", module, "--help"], cwd=ROOT, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else text


def _module_fault(module: str, arguments: list[str]) -> str:
    if module in ("pytest", "pip", "jupyter"):
        return ""
    try:
        known = _help(module)
    except InputError as error:
        return str(error)
    wrong = [word for word in arguments if word.startswith("-") and word.split("=")[0] not in known]
    return f"{module} knows no {wrong[0]}" if wrong else ""


def _spoken_fault(command: str) -> str:
    """Of a command in a sentence, which may leave out arguments: its sub-command and options."""
    program, *words = command.replace("...", "").split()
    if program != "pneunet":
        return command_fault([program, *words])
    if words[:1] == ["run"]:  # run -n N COMMAND
        words = words[3:]
    top = parser(COMMANDS)
    known = next(action.choices for action in top._actions if isinstance(action.choices, dict))
    if words and not words[0].startswith("-"):
        if words[0] not in known:
            return f"pneunet has no command {words[0]}"
        top = known[words[0]]
    wrong = [w for w in words if w.startswith("--") and w.split("=")[0] not in top._option_string_actions]
    return f"{top.prog} knows no {wrong[0]}" if wrong else ""
