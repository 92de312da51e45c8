"""Pieces of a page: of a report, of a workshop sheet."""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from pneunet.base.files.record import revision

STYLE = """
:root { color-scheme: light; }
body {
  font: 16px/1.5 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; color: #1b1f24; background: #fff;
  margin: 0 auto; max-width: 1080px; padding: 1rem;
}
h1 { font-size: 1.7rem; margin: .5rem 0; }
h2 { font-size: 1.2rem; border-bottom: 2px solid #dee2e6; margin-top: 2.2rem; padding-bottom: .2rem; }
.verdict { font-size: 1.1rem; border-left: 5px solid #1f6fb2; background: #eef5fb; padding: .7rem 1rem; }
.alarm {
  border-left: 5px solid #c92a2a; background: #fff0f0; color: #861c1c; padding: .7rem 1rem; font-weight: 600;
}
.note { border-left: 5px solid #f08c00; background: #fff8eb; padding: .5rem 1rem; margin: .6rem 0; }
summary { cursor: pointer; padding: .3rem 0; }
.missing { color: #6b747d; font-style: italic; }
.table { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #e4e8ec; white-space: nowrap; }
th { background: #f1f3f5; }
th:first-child, td:first-child { text-align: left; }
tr.head td { font-weight: 600; background: #f8f9fa; }
td.long { white-space: normal; text-align: left; word-break: break-word; }
.grid { display: grid; grid-template-columns: repeat(auto-fill, minmax(290px, 1fr)); gap: .8rem; }
figure { margin: .8rem 0; }
.grid figure { margin: 0; }
img { width: 100%; height: auto; border: 1px solid #e4e8ec; }
.turn { width: 100%; height: 820px; border: 1px solid #e4e8ec; }
figcaption { font-size: .85rem; color: #4b545c; }
footer { margin-top: 2rem; font-size: .85rem; color: #6b747d; }
@media print {
  .turn, .turn + p { display: none; }
  body { max-width: none; font-size: 11pt; padding: 0; }
  figure, tr, .verdict, .alarm { break-inside: avoid; }
  h2 { break-after: avoid; }
  .grid { grid-template-columns: repeat(3, 1fr); }
  .table { overflow: visible; }
}
"""


def document(title: str, body: str, units: str, style: str = "") -> str:
    """A page with this title, body and remark on its units; style: CSS after STYLE."""
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}{style}</style></head><body>{body}"
        f"<footer>pneunet, revision {escape(revision())}. {units}</footer></body></html>\n"
    )


def image(folder: Path, name: str, caption: str) -> str:
    """A picture of the folder, within the page."""
    data = base64.b64encode((Path(folder) / name).read_bytes()).decode()
    told = escape(caption)
    return (
        f'<figure><img alt="{told}"'
        f' src="data:image/png;base64,{data}"><figcaption>{told}</figcaption></figure>'
    )


def grid(folder: Path, pictures: Iterable[tuple[str, str]]) -> str:
    """Pictures, (name, caption) each, side by side."""
    return f'<div class="grid">{"".join(image(folder, *p) for p in pictures)}</div>'


def table(header: Sequence[str], rows: Iterable) -> str:
    """HTML table; a row that is a string becomes a heading inside the table."""
    lines = "".join(f"<th>{escape(h)}</th>" for h in header)
    out = f"<tr>{lines}</tr>"
    for row in rows:
        if isinstance(row, str):
            out += f'<tr class="head"><td colspan="{len(header)}">{escape(row)}</td></tr>'
        else:
            out += (
                "<tr>"
                + "".join(
                    f"<td{' class=long' if len(str(c)) > 40 else ''}>{escape(str(c))}</td>" for c in row
                )
                + "</tr>"
            )
    return f'<div class="table"><table>{out}</table></div>'


def missing(text: str) -> str:
    """A remark on what is not there."""
    return f'<p class="missing">{escape(text)}</p>'


def folded(title: str, content: str) -> str:
    """Content that a click on its title shows."""
    return f"<details><summary>{escape(title)}</summary>{content}</details>"
