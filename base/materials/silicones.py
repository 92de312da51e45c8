"""Commercial silicones: laws fitted to open tensile tests, from a table that `make silicones` makes."""

from functools import cache
from pathlib import Path

from pneunet.base.errors import InputError
from pneunet.base.files.toml import read_toml

TABLE = Path(__file__).parent / "data" / "silicones.toml"


@cache
def measured_silicones() -> dict[str, dict]:
    """name -> [material] table of every silicone; each `source` names the file of the test."""
    return read_toml(TABLE)


def measured_silicone(name: str) -> dict:
    """File keys of a silicone's material, `law` among them; InputError for one that is not in the table."""
    known = measured_silicones()
    if name not in tuple(known):
        raise InputError(f"silicone = '{name}' is not in the table: known are {', '.join(known)}")
    return dict(known[name])
