"""What stands on a page of Markdown: its fenced blocks, and the commands in its sentences.

A remark in front of a block says what a reader of the finished page need not see:

    <!-- long: why -->      not run when the pages are; its options are checked all the same
    <!-- exits 2 -->        ends with this exit code

A block ```text after a command has what the command says, `...` for anything. A title makes a block a file
of its page's sandbox: ```toml title="mine.toml".
"""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: pages of the repository's front beside those in docs/
FRONT = ("README.md", "CONTRIBUTING.md")
FENCE = re.compile(
    r"(?:<!-- (?P<remark>[^>]*) -->\n)?"
    r'^```(?P<language>[\w-]*)(?: title="(?P<title>[^"]+)")?\n'
    r"(?P<text>.*?)^```$",
    re.S | re.M,
)
REMARK = re.compile(r"long: (?P<long>.+)|exits (?P<code>\d+)")
#: what begins a command in a sentence's `code`
SPOKEN = re.compile(r"(?<!`)`((?:pneunet|make|python -m) [^`\n]+)`(?!`)")


@dataclass(frozen=True)
class Block:
    """A fenced block; long: why it is not run, or ""; code: the exit code that is wanted."""

    language: str
    text: str
    title: str
    long: str
    code: int
    line: int

    @property
    def commands(self) -> list[list[str]]:
        """The words of each command of a block of shell, pipes and lists taken apart, without comments and
        redirections."""
        found: list[list[str]] = []
        for line in self.text.replace("\\\n", " ").splitlines():
            words = shlex.shlex(line, posix=True, punctuation_chars=True)
            words.whitespace_split = True
            found.append([])
            for word in words:
                if set(word) <= set("&|;()"):
                    found.append([])
                elif set(word) <= set("<>"):
                    next(words)  # where a redirection goes
                else:
                    found[-1].append(word)
        return [words for words in found if words]


def pages() -> list[Path]:
    """All pages, those of the front first."""
    return [*(ROOT / name for name in FRONT), *sorted((ROOT / "docs").glob("*.md"))]


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a page's text, in their order; ValueError for a remark that says nothing known."""
    found = []
    for match in FENCE.finditer(text):
        remark = REMARK.fullmatch(match["remark"] or "exits 0")
        line = text.count("\n", 0, match.start("language")) + 1
        if not remark:
            raise ValueError(f"line {line}: a remark is 'long: why' or 'exits N', not '{match['remark']}'")
        code = int(remark["code"] or 0)
        given = (match["language"], match["text"], match["title"] or "", remark["long"] or "")
        found.append(Block(*given, code, line))
    return found


def spoken(text: str) -> list[str]:
    """Commands that sentences and tables name, outside of blocks."""
    return SPOKEN.findall(FENCE.sub("", text))
