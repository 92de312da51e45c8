"""`python -m examples.paper [3 4 9_wraps ...] [-o FOLDER] [--docs]`: the paper's figures, and what agrees
with its statements.

--docs writes docs/paper-figures.md and its pictures.
"""

import argparse
import textwrap
from importlib import import_module
from pathlib import Path

from pneunet.base.files.atomic import write_text
from pneunet.base.pictures.rendering import save

ROOT = Path(__file__).resolve().parents[2]
#: 7 and 9_wraps search for designs
FIGURES = ("3", "4", "5", "6", "7", "8", "9", "9_wraps")
#: dots an inch of pictures in docs/, which keeps each under 300 kB
DOCS_DPI = 75
ABOUT = """Made by `python -m examples.paper --docs` (examples/paper); do not edit.

Jiang et al., Appl. Phys. Rev. 8, 041416 (2021), "the paper". Each figure says what agrees with its statements
and what does not. The paper's dimensions stood in its supplement, which is lost, so the bodies are ours
(`examples/paper/common.py`), and magnitudes cannot be compared. Its two analytic models stand beside finite
elements in [paper-models.md](paper-models.md)."""


def section(name, module, found):
    """Lines of a figure's section of the page."""
    title, _, rest = module.__doc__.partition(":")
    lines = [f"## {title.strip()}", ""]
    text = " ".join(rest.split())
    lines += textwrap.wrap(text[0].upper() + text[1:], 110, break_on_hyphens=False)
    lines += ["", "| the paper | here | |", "|---|---|---|"]
    for each in module.statements(found):
        lines.append(f"| {each.says} | {each.here} | {each.verdict} |".replace("|P_t|", "\\|P_t\\|"))
    return [*lines, "", f"![Figure {name}](paper-fig{name}.png)", ""]


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m examples.paper", description=__doc__.splitlines()[0])
    parser.add_argument("figures", nargs="*", metavar="FIGURE", help=", ".join(FIGURES))
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "out" / "paper")
    parser.add_argument("--docs", action="store_true")
    given = parser.parse_args(arguments)
    for name in given.figures:
        if name not in FIGURES:
            parser.error(f"figure {name} is not known: known are {', '.join(FIGURES)}")
    folder = ROOT / "docs" if given.docs else given.output
    page = ["# The paper's figures", "", ABOUT, ""]
    for name in given.figures or FIGURES:
        print(f"Fig. {name}", flush=True)
        module = import_module(f"examples.paper.fig{name}")
        found = module.compute()
        for each in module.statements(found):
            print(f"  {each.verdict}: {each.says}\n    here: {each.here}")
        save(module.draw(found), folder / f"paper-fig{name}.png", DOCS_DPI if given.docs else 120)
        page += section(name, module, found)
    if given.docs:
        write_text(folder / "paper-figures.md", "\n".join(page).rstrip() + "\n")


if __name__ == "__main__":
    main()
