"""The sheet as one HTML page, and as a PDF by matplotlib."""

import textwrap
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from pneunet.base.files.atomic import atomic_path, write_text
from pneunet.base.pictures.rendering import figure
from pneunet.design.report.drawing import drawing_figure
from pneunet.design.report.page import document, image, table
from pneunet.design.workshop.sheet import Block, Picture, SheetTable, Steps
from pneunet.geometry.designfile import DesignFile

Sections = Sequence[tuple[str, list[Block]]]
#: inches of the PDF's pages, and of a line
PAGE, MARGIN, LINE = (8.27, 11.69), 0.7, 0.175
#: characters in a line of text; of a table, in a fixed pitch
TEXT, CELLS = 100, 108


def write_html(path: Path, name: str, sections: Sections) -> None:
    """Write the page; its pictures are read from its folder and go into it."""
    body = f"<h1>{escape(name)}: workshop sheet</h1>"
    for title, blocks in sections:
        body += f"<section><h2>{escape(title)}</h2>{''.join(_html(b, path.parent) for b in blocks)}</section>"
    style = " td { white-space: normal; }"
    write_text(path, document(f"{name}: workshop sheet", body, "Lengths in mm.", style))


def _html(block, folder):
    if isinstance(block, SheetTable):
        return table(block.header, block.rows)
    if isinstance(block, Steps):
        return f"<ol>{''.join(f'<li>{escape(text)}</li>' for text in block.texts)}</ol>"
    if isinstance(block, Picture):
        return image(folder, block.file, block.caption)
    return f"<p>{escape(block)}</p>"


def write_pdf(path: Path, design: DesignFile, sections: Sections) -> None:
    """Write the drawing on a page of its own size, then the rest on pages of A4."""
    from matplotlib.backends.backend_pdf import PdfPages

    pages = _Pages(f"{design.name}: workshop sheet")
    for title, blocks in sections:
        blocks = [b for b in blocks if not (isinstance(b, Picture) and b.file == "drawing.png")]
        if blocks:
            pages.heading(title)
        for block in blocks:
            pages.block(block, path.parent)
    with atomic_path(path) as temporary, PdfPages(temporary) as file:
        for figure in (*pages.figures, drawing_figure(design)):
            file.savefig(figure)


class _Pages:
    """Figures of A4, filled from the top down."""

    def __init__(self, title: str):
        self.figures: list[Any] = []
        self.left = 0.0
        self.turn()
        self.line(title, 15, "bold")

    def turn(self) -> None:
        """To a new page."""
        self.figures.append(figure(*PAGE))
        self.left = PAGE[1] - MARGIN

    def line(self, text: str, size: float = 9.5, weight: str = "normal", family: str = "sans-serif") -> None:
        height = LINE * max(size / 9.5, 1)
        if self.left - height < MARGIN:
            self.turn()
        self.left -= height
        at = MARGIN / PAGE[0], self.left / PAGE[1]
        self.figures[-1].text(*at, text, fontsize=size, weight=weight, family=family, parse_math=False)

    def heading(self, title: str) -> None:
        if self.left < MARGIN + 8 * LINE:
            self.turn()
        self.left -= LINE
        self.line(title, 12, "bold")
        self.left -= LINE / 3

    def block(self, block: Block, folder: Path) -> None:
        if isinstance(block, SheetTable):
            self.table(block)
        elif isinstance(block, Steps):
            for number, text in enumerate(block.texts, start=1):
                for i, line in enumerate(textwrap.wrap(text, TEXT - 4)):
                    self.line(f"{number}.  {line}" if i == 0 else f"      {line}")
        elif isinstance(block, Picture):
            self.picture(folder / block.file)
        else:
            for line in textwrap.wrap(block, TEXT):
                self.line(line)
        self.left -= LINE / 2

    def table(self, table: SheetTable) -> None:
        widths = [max(map(len, column)) for column in zip(table.header, *table.rows)]
        widths[-1] = max(min(widths[-1], CELLS - sum(widths[:-1]) - 2 * len(widths)), 12)
        for number, row in enumerate((table.header, *table.rows)):
            last = textwrap.wrap(row[-1], widths[-1]) or [""]
            for i, text in enumerate(last):
                cells = [*(row[:-1] if i == 0 else [""] * (len(row) - 1)), text]
                told = "  ".join(c.ljust(w) for c, w in zip(cells, widths))
                self.line(told, 7.5, "bold" if number == 0 else "normal", "monospace")

    def picture(self, path: Path) -> None:
        from matplotlib.image import imread

        image = imread(path)
        width = PAGE[0] - 2 * MARGIN
        height = min(width * image.shape[0] / image.shape[1], PAGE[1] - 4 * MARGIN)
        if self.left - height < MARGIN:
            self.turn()
        self.left -= height
        box = (MARGIN / PAGE[0], self.left / PAGE[1], width / PAGE[0], height / PAGE[1])
        ax = self.figures[-1].add_axes(box)
        ax.imshow(image)
        ax.axis("off")
