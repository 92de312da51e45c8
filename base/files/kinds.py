"""What a file of the user's is, by what stands in it: a file of another kind is refused with the command for
it."""

from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.files.toml import read_toml

DESIGN, TARGET, CELL, STUDY, CAMPAIGN = "a design", "a target", "a unit cell", "a study", "a campaign"
COMMANDS = {
    DESIGN: "pneunet shape, mesh or solve",
    TARGET: "pneunet design",
    CELL: "pneunet cell",
    STUDY: "pneunet study",
    CAMPAIGN: "pneunet campaign",
}
_OF_CAMPAIGNS = {"designs", "edge_designs", "mesh", "ranges", "edge_ranges", "further"}
_OF_TARGETS = {"points", "points_mm", "piece", "vary", "wrap", "shape", "tip_points", "casting"}


def read_tables(path: str | Path, wanted: str) -> dict:
    """The tables of a TOML file that should be of the kind `wanted`; InputError for a missing or broken file,
    or one of another kind."""
    suffix = Path(path).suffix.lower()
    if suffix in (".csv", ".tsv", ".txt") and Path(path).exists():
        what = f"is a table, perhaps {TARGET}: run {COMMANDS[TARGET]} {path} first"
        raise InputError(f"{path}: {what}" if wanted == DESIGN else f"{path}: is a table, not {wanted}")
    if suffix == ".npz" and Path(path).exists():
        raise InputError(f"{path}: holds arrays, a law, a data set or a mesh: it is not {wanted}")
    tables = read_toml(path)
    found = _kind(tables)
    if found not in (None, wanted):
        first = " first" if (found, wanted) == (TARGET, DESIGN) else ""
        raise InputError(f"{path}: is {found}, not {wanted}: run {COMMANDS[found]}{first}")
    return tables


def _kind(tables):
    """The kind that only these keys can be of, None where that is not clear."""
    segment = tables.get("segment")
    if "kind" in tables and "base" in tables:
        return STUDY
    if isinstance(segment, list):
        return DESIGN
    if _OF_TARGETS & set(tables) or isinstance(tables.get("target"), str):
        return TARGET
    if isinstance(segment, dict) and "kind" in segment and "chambers" not in segment:
        return CELL
    return CAMPAIGN if _OF_CAMPAIGNS & set(tables) else None
