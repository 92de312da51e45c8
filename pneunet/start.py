"""`pneunet init`: files with comments to start from."""

import logging
from importlib.resources import files
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.files.atomic import write_text

#: kind of a file -> the command that runs it
KINDS = {
    "target": "design",
    "design": "shape",
    "cell": "cell",
    "study": "study",
    "campaign": "campaign",
}
log = logging.getLogger(__name__)


def write_start(kind: str, path: str | Path | None = None) -> Path:
    """Write a file to start from, by default KIND.toml in the working directory; its path.

    kind: one of KINDS. InputError where something is there already, or for another kind.
    """
    if kind not in KINDS:
        raise InputError(f"'{kind}' is not known: write one of {', '.join(KINDS)}")
    out = Path(path or f"{kind}.toml")
    if out.exists() or out.is_symlink():
        raise InputError(f"{out}: is there already, and is not overwritten: give another name")
    write_text(out, start_text(kind))
    log.info(f"{out}: edit it, then: pneunet {KINDS[kind]} {out}")
    return out


def start_text(kind: str) -> str:
    """The file of a kind, one of KINDS."""
    return (files("pneunet") / "starts" / f"{kind}.toml").read_text(encoding="utf-8")
