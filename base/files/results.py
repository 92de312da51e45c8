"""What a run left in its folder, read back whatever kind of run it was."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.record import read_record
from pneunet.base.files.schemas import read_table

if TYPE_CHECKING:
    from pandas import DataFrame

#: folders in which a run keeps results below its own
PARTS = ("shape", "solve", "cell")


@dataclass(frozen=True, eq=False)
class Results:
    """record: what run.json says. tables: {name: structured array (rows,)}, units in the names of the fields;
    a table of a folder below has the folder's name too: 'solve/steps'."""

    directory: Path
    record: dict
    tables: dict[str, np.ndarray]

    def __repr__(self) -> str:
        shown = ", ".join(f"{name} ({len(table)} rows)" for name, table in self.tables.items())
        return f"<Results of {self.directory}: {shown or 'no tables'}>"

    def __getitem__(self, name: str) -> np.ndarray:
        """The table called so; the folder's name may be left out where only one fits.

        InputError where none or several fit.
        """
        found = [name] if name in self.tables else [key for key in self.tables if key.endswith(f"/{name}")]
        if len(found) != 1:
            told = f"stands there {len(found)} times" if found else "is not there"
            known = ", ".join(found or self.tables) or "none"
            raise InputError(f"{self.directory}: table '{name}' {told}: tables are {known}")
        return self.tables[found[0]]

    def frame(self, name: str) -> "DataFrame":
        """The table as a pandas DataFrame; InputError where pandas is not installed."""
        try:
            from pandas import DataFrame
        except ImportError:
            raise InputError("pandas is missing: install it with: pip install pandas") from None
        table = self[name]
        return DataFrame({column: table[column] for column in table.dtype.names})


def read_run(directory: str | Path) -> Results:
    """The tables and run.json of a run's folder: of a design, shape, solve, cell, study or campaign.

    InputError where there is neither, or one cannot be read.
    """
    directory = Path(directory)
    record = read_record(directory / "run.json")
    record |= {part: told for part in PARTS if (told := read_record(directory / part / "run.json"))}
    paths = [path for part in ("", *PARTS) for path in sorted((directory / part).glob("*.csv"))]
    tables = {path.relative_to(directory).with_suffix("").as_posix(): read_table(path) for path in paths}
    if not tables and not record:
        raise InputError(f"{directory}: holds no tables (.csv) and no run.json: give the folder of a run")
    return Results(directory, record, tables)
