"""`--help` as a manual page, and completion with the tab key in the shells themselves."""

import os
import pty
import re
import select
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pneunet.arguments import SHELLS, parser
from pneunet.cli import COMMANDS, main
from pneunet.manual import PAGES, TOP

ROOT = Path(__file__).resolve().parents[2]
PNEUNET = Path(sys.executable).with_name("pneunet")


def test_every_command_has_a_page_with_examples_that_parse():
    assert set(PAGES) == set(COMMANDS)
    grammar = parser(COMMANDS)
    for name, page in (*PAGES.items(), ("", TOP)):
        for line, text in page.examples:
            words = shlex.split(re.sub(r"^eval \"\$\((.*)\)\"$", r"\1", line.partition(" > ")[0]))
            assert words[0] == "pneunet" and text, line
            assert grammar.parse_args(words[1:]).command in COMMANDS
        assert not name or any(re.search(rf"pneunet (run .*)?{name}\b", line) for line, _ in page.examples)
        pages = re.findall(r"docs/[\w-]+\.md", page.more)
        assert pages and all((ROOT / each).is_file() for each in pages), page.more


@pytest.mark.parametrize("command", ["", *PAGES])
def test_help_is_a_page_for_a_terminal_where_every_option_is_explained(command, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit, match="0"):
        main([*([command] if command else []), "--help"])
    page = capsys.readouterr().out
    assert "\nexamples:\n  # " in page and "\nmore: docs/" in page
    assert max(map(len, page.splitlines())) <= 90
    of_all = parser(COMMANDS)._subparsers._group_actions[0].choices
    for action in of_all[command]._actions if command else ():
        assert action.help, action.dest


def typed(shell, first, lines, folder, seconds=60.0):
    """What an interactive shell shows after a first line and the tab key behind each of those that are begun,
    {begun: what is waited for}; each is wiped out again, not run."""
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(folder)
        os.execvpe(shell[0], shell, {**os.environ, "TERM": "dumb", "PS1": "> ", "COLUMNS": "200"})
    seen, deadline = "", time.monotonic() + seconds
    try:
        os.write(terminal, f"{first}\n".encode())
        for begun, whole in lines.items():
            os.write(terminal, f"{begun}\t".encode())
            while whole not in seen and time.monotonic() < deadline:
                if select.select([terminal], [], [], 0.2)[0]:
                    seen += os.read(terminal, 65536).decode(errors="replace")
            os.write(terminal, b"\x15")
    finally:
        os.kill(process, 9)
        os.waitpid(process, 0)
        os.close(terminal)
    return seen


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    pytest.importorskip("shtab")
    folder = tmp_path_factory.mktemp("scripts")
    for shell in SHELLS:
        line = [PNEUNET, "completion", shell]
        (folder / shell).write_text(subprocess.run(line, capture_output=True, text=True, check=True).stdout)
    return folder


def test_bash_completes_at_the_tab_key(scripts, tmp_path):
    """Commands, options, choices and files, as a user types them."""
    (tmp_path / "quite_a_curve.csv").touch()
    bash = [shutil.which("bash"), "--norc", "--noprofile", "-i"]
    lines = {
        "pneunet fit": "pneunet fit-material ",
        "pneunet solve --mesh": "pneunet solve --mesh-size-mm ",
        "pneunet view --film g": "pneunet view --film gif ",
        "pneunet init camp": "pneunet init campaign ",
        "pneunet design quite": "pneunet design quite_a_curve.csv ",
    }
    seen = typed(bash, f"source {scripts}/bash", lines, tmp_path)
    assert [whole for whole in lines.values() if whole not in seen] == [], seen


def test_fish_and_zsh_take_their_scripts(scripts, tmp_path):
    shells = [shell for shell in ("fish", "zsh") if shutil.which(shell)]
    if not shells:
        pytest.skip("neither fish nor zsh is here: apt-get install fish zsh")
    if "fish" in shells:
        ask = f"source {scripts}/fish; complete -C 'pneunet fit'; complete -C 'pneunet view --film '"
        done = subprocess.run(["fish", "-c", ask], capture_output=True, text=True, env=_at_home(tmp_path))
        assert {line.split("\t")[0] for line in done.stdout.splitlines()} >= {"fit-material", "gif", "mp4"}
    if "zsh" in shells:
        (tmp_path / "functions").mkdir()
        shutil.copy(scripts / "zsh", tmp_path / "functions" / "_pneunet")
        first = "fpath=($PWD/functions $fpath); autoload -Uz compinit; compinit -u"
        seen = typed(["zsh", "-f", "-i"], first, {"pneunet fit": "pneunet fit-material"}, tmp_path)
        assert "pneunet fit-material" in seen, seen


def _at_home(folder):
    return {**os.environ, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
