"""Hooks of MkDocs: what the site has beyond the pages of docs/.

README, CONTRIBUTING and CHANGELOG are pages too. What a page links to in the repository (a notebook, an
example) and the pictures that a page's own commands have made (`made/...`, from its sandbox) come along.
Formulas become MathML, which browsers draw themselves: no script, no fonts, no network.
"""

import html
import logging
import os
import posixpath
import re
import sys
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files

log = logging.getLogger("mkdocs.hooks")  # whose warnings are errors
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # MkDocs is started from its own folder

from docs.site.run import MADE, OUT  # noqa: E402
from tests.typecheck import as_installed  # noqa: E402

#: page of the repository's front -> its name in the site
FRONT = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
#: a link that is called by its page's file, as it is read in the repository
NAMED = re.compile(r"\[([\w-]+\.md)\]\(")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\s*\\[(\[](.*?)\\[)\]]\s*</\1>', re.S)


def on_startup(command, dirty):
    # where mkdocstrings reads docstrings, nothing is imported: it looks for the folder before any on_config
    as_installed()


def on_files(files: Files, config):
    for name, page in FRONT.items():
        text = _links((ROOT / name).read_text(), "", page)
        files.append(File.generated(config, page, content=text))
    for file in list(files.documentation_pages()):
        text = (ROOT / "docs" / file.src_uri) if file.src_uri not in FRONT.values() else None
        text = text.read_text() if text else file.content_string
        for target in {match[1] for match in LINK.findall(text)}:
            _bring(files, config, file.src_uri, target)
    return files


def on_page_markdown(markdown, page, config, files):
    titles = dict(_titles(config.nav))
    name = page.file.src_uri
    markdown = markdown if name in FRONT.values() else _links(markdown, "docs", name)
    return NAMED.sub(lambda match: f"[{titles.get(match[1], match[1])}](", markdown)


def on_page_content(content, page, config, files):
    return FORMULA.sub(_mathml, content)


def _titles(entries):
    """(page, title) of the navigation."""
    for entry in entries:
        for title, inside in entry.items():
            yield from [(inside, title)] if isinstance(inside, str) else _titles(inside)


def _links(text: str, folder: str, page: str) -> str:
    """Links of a page in a folder of the repository, as the site has their targets: pages side by side,
    other files under their path, what a page has made under its name."""

    def there(match):
        target = match[2]
        if "://" in target:
            return match[0]
        if target.startswith(MADE):
            return match[1] + _made(page, target) + match[3]
        path = posixpath.normpath(posixpath.join(folder, target))
        return match[1] + FRONT.get(path, path.removeprefix("docs/")) + match[3]

    return LINK.sub(there, text)


def _made(page: str, target: str) -> str:
    return posixpath.join(MADE, Path(page).stem, target.removeprefix(MADE))


def _bring(files: Files, config, page: str, target: str) -> None:
    """A linked file that is not in docs/: from the page's sandbox, or from the repository."""
    if "://" in target or target.endswith(".md"):
        return
    if target.startswith(MADE):
        source = OUT / Path(page).stem / target.removeprefix(MADE)
        target = _made(page, target)
        if not source.is_file():
            why = f"{source.name} is not made: python -m docs.site.run docs/{page}"
            log.warning(f"{page}: {why}")
    else:
        target = posixpath.normpath(posixpath.join("docs", target)) if target.startswith("../") else target
        source = ROOT / target
    if source.is_file() and not files.get_file_from_path(target):
        files.append(File.generated(config, target, abs_src_path=os.fspath(source)))


def _mathml(match) -> str:
    display = "block" if match[1] == "div" else "inline"
    return convert(html.unescape(match[2]).strip(), display=display)
