"""Text and tables of numbers as machines, trackers and spreadsheets write them.

Encoding, dialect, header and units are found by structure. What is no text or no number is refused in one
line that names file, row and fix.
"""

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pneunet.base.errors import InputError
from pneunet.base.files.reading import LARGEST_TEXT, read_bytes
from pneunet.base.quantities import LARGEST_NUMBER

#: a longer cell is text behind a quote that was never closed
LONGEST_CELL = 10_000
MOST_ROWS = 200_000
#: so much of a file is looked at to find its dialect, characters
SAMPLE = 200_000
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_BARE: tuple[tuple, tuple] = ((), ())  # neither header nor units
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
_UNIT = re.compile(
    r"[(\[].*[)\]]|%|-|[kMG]?Pa|k?N|[cm]?m|s|sec|min|psi|ksi|m?bar|°C|(N|kgf|mm|m)/([cm]?m|in)\^?[²2]?"
)


def read_text(path: str | Path) -> str:
    """The text of a file in UTF-8 (with or without mark), UTF-16 (with its mark) or Windows' Latin-1.

    InputError for what is no regular file, larger than LARGEST_TEXT, in another encoding or no text at all.
    """
    data = read_bytes(path, LARGEST_TEXT)
    if data.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise InputError(f"{path}: is a spreadsheet or an archive, not text: save the sheet as CSV")
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "cp1252"):
        try:
            text = data.decode(encoding).removesuffix("\x1a")  # how DOS ends a file
            break
        except UnicodeDecodeError:
            continue
    else:
        raise InputError(f"{path}: is text in no encoding known here: save it as UTF-8")
    found = _CONTROL.search(text)
    if found:
        what = "NUL bytes" if found[0] == "\0" else f"the control character 0x{ord(found[0]):02x}"
        row = text.count("\n", 0, found.start()) + 1
        raise InputError(f"{path} row {row}: holds {what}, so it is no text: save it as UTF-8 text")
    return text


@dataclass(eq=False)
class Table:
    """Rows of numbers under one header, as cells with single blanks between words.

    header: names of the columns, () where there are none; units: from a row of their own, "" without; rows:
    cells up to the last one that is filled; lines: the row in the file of every one of them, counted from 1.
    """

    path: str | Path
    header: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    @property
    def first_row(self) -> int:
        """The row in the file where the numbers start, counted from 1."""
        return self.lines[0]

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.header) or max(map(len, self.rows))

    def index(self, name: str) -> int:
        """The place of the one column of this name; InputError when it is missing or there twice."""
        if self.header.count(name) != 1:
            problem = "there twice: rename one" if name in self.header else "missing"
            raise InputError(f"{self.path}: column '{name}' is {problem}")
        return self.header.index(name)

    def numbers(self, column: int, gaps: bool = False) -> np.ndarray:
        """(n,) finite numbers of a column; empty cells are nan with `gaps`. InputError for any other cell."""
        name = self.header[column] if self.header else f"column {column + 1}"
        out = np.full(len(self.rows), np.nan)
        for k, row in enumerate(self.rows):
            cell = row[column] if column < len(row) else ""
            if cell or not gaps:
                value = float(cell.replace(",", ".")) if _NUMBER.fullmatch(cell) else np.nan
                if not abs(value) <= LARGEST_NUMBER:
                    said = f"'{cell[:40]}' is not a finite number" if cell else "is empty"
                    fix = "correct the cell or delete the row"
                    raise InputError(f"{self.path} row {self.lines[k]}: {said} under '{name[:80]}': {fix}")
                out[k] = value
        return out


def read_numbers_table(path: str | Path) -> Table:
    """The Table of a text file that holds most numbers: rows under the same header are one table.

    A header is a row without numbers that numbers follow. Between them a row of units may stand, above it
    anything. InputError for a file without rows of numbers, or with rows that do not fit the header.
    """
    text = read_text(path)
    delimiter = max(",;\t", key=lambda one: _consistency(text[:SAMPLE], one))
    if not _consistency(text[:SAMPLE], delimiter)[
        0
    ]:  # columns between blanks, as CAD and plotters write them
        single = "\n".join(" ".join(line.split()) for line in text.splitlines())
        if _consistency(single[:SAMPLE], " ")[0]:
            text, delimiter = single, " "
    table = _largest_table(path, _rows(path, text, delimiter))
    width = table.width
    for row, line in zip(table.rows, table.lines):
        if len(row) > width:
            hint = ": with decimal commas, save it with semicolons between the columns" * (delimiter == ",")
            raise InputError(f"{path} row {line}: {len(row)} cells in {width} columns{hint}")
    _refuse_two_decimal_signs(table)
    return table


def _consistency(text, delimiter):
    """How well a delimiter splits: numbers less other cells in rows of mostly numbers and of the commonest
    width, then the number of rows of the commonest width."""
    rows = []
    try:
        for row in csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True):
            rows.append([cell.strip() for cell in row])
    except csv.Error:
        pass  # said when the file is read with the delimiter that is chosen
    good = [(len(row), 2 * n - filled) for row in rows for n, filled in [_count(row)] if 2 * n > filled]
    usual = Counter(width for width, _ in good if width > 1).most_common(1)
    points = sum(more for width, more in good if usual and width == usual[0][0])
    return points, max(Counter(len(row) for row in rows if len(row) > 1).values(), default=0)


def _rows(path, text, delimiter) -> Iterator[tuple[int, list[str]]]:
    """(row in the file, cells up to the last one that is filled) of every row; one empty cell for a row of
    delimiters alone."""
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=delimiter, strict=True, skipinitialspace=True
    )
    start = 1
    try:
        for row in reader:
            if start > MOST_ROWS:
                raise InputError(f"{path}: has over {MOST_ROWS} rows: thin it out")
            if max(map(len, row), default=0) > LONGEST_CELL:
                raise csv.Error
            cells = [" ".join(cell.split()) for cell in row]
            while len(cells) > 1 and not cells[-1]:
                cells.pop()
            yield start, cells
            start = reader.line_num + 1
    except csv.Error:
        raise InputError(
            f"{path} row {start}: a quotation mark is missing, or a cell has over {LONGEST_CELL} characters"
        ) from None


def _count(row):
    """(numbers, filled cells) of a row."""
    return sum(_NUMBER.fullmatch(cell) is not None for cell in row), sum(map(bool, row))


def _largest_table(path, rows):
    """The Table with most numbers in rows of mostly numbers. A row of empty cells belongs to a table unless
    another header follows."""
    tables: dict[tuple, Table] = {}
    sizes: Counter = Counter()
    table, last = Table(path), 0
    above: list[list[str]] = []
    empty: list[tuple[int, list[str]]] = []
    for line, row in rows:
        numbers, filled = _count(row)
        if filled and not numbers and (len(row) != last or tuple(row) == table.header):
            above, empty, last = [*above, row], [], 0
        elif filled:
            key = _header(above, row)
            # a title alone starts no table
            if not table.rows or key != _BARE or above and len(row) != len(table.header or table.rows[-1]):
                table = tables.setdefault(key, Table(path, *key))
            for number, cells in [*empty, (line, row)]:
                table.lines.append(number)
                table.rows.append(cells)
            sizes[table.header, table.units] += 1000 * numbers if 2 * numbers > filled else numbers
            above, empty, last = [], [], len(row)
        else:
            last = 0
            if row:
                empty.append((line, row))
    if not sizes:
        raise InputError(f"{path}: holds no rows of numbers")
    largest = tables[max(sizes, key=sizes.__getitem__)]
    if largest is table:  # to the file's end
        for number, cells in empty:
            table.lines.append(number)
            table.rows.append(cells)
    return largest


def _header(above, first):
    """(header, units) from the rows of words above the first row of numbers."""
    if not above or len(above[-1]) == 1 < len(first):
        return _BARE
    units = above[-1] if len(above) > 1 and all(_UNIT.fullmatch(c) for c in above[-1] if c) else []
    header = _uncommented(above[-2] if units else above[-1], len(first))
    width = max(len(header), len(units))
    return tuple([*header, *[""] * width][:width]), tuple([*units, *[""] * width][:width])


def _uncommented(header, width):
    """A header's cells without the mark of a comment before them."""
    if header[0] in ("#", "%", "//") and len(header) > width:
        return header[1:]
    return [header[0].removeprefix("#").removeprefix("//").lstrip(), *header[1:]]


def _refuse_two_decimal_signs(table):
    if not any("," in cell for row in table.rows for cell in row):
        return
    found: dict[str, int] = {}
    for row, line in zip(table.rows, table.lines):
        for cell in row:
            if ("," in cell or "." in cell) and _NUMBER.fullmatch(cell):
                found.setdefault("," if "," in cell else ".", line)
    if len(found) == 2:
        raise InputError(
            f"{table.path}: decimal commas (row {found[',']}) and decimal points (row {found['.']}): write"
            " one of them, and no separators of thousands"
        )
